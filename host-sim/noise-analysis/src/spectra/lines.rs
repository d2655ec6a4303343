//! Lines in a spectrum: sinusoids, and resonances wider than the record resolves.
//!
//! A sinusoid is tested by the likelihood ratio against a locally white background, over all frequencies (R. Baluev,
//! MNRAS 385, 2008). A resonance is sought in averages over 4, 16, 64 … ordinates; the likelier model is taken. Half
//! the sample rate has a [test of its own](super::alternation).

use super::alternation::Alternation;
use super::found_sine::FoundSine;
use super::found_sines::{FoundSines, is_on_skirts};
use super::line_models::Sine;
use super::periodogram::{PADDING, Periodogram};
use super::spectral_line::{Resonance, SpectralLine};
use super::transforms::gain_of_mean;
use super::whitened_spectrum::{Candidate, FEWEST_PERIODS, Spectrum, WhitenedSpectrum, refit};
use crate::effects::findings::SIGNIFICANCE;
use crate::samples::uniform_series::UniformSeries;
use std::f64::consts::LN_2;

pub(super) const MOST: usize = 6;
/// Most resonances refitted when one is added: each fits the background again.
const REFITTED: usize = 2;
/// Least statistic over that of a resonance on whose skirts a line lies; less is a residue.
const RESIDUE: f64 = 0.02;

/// Fewest periods of a sinusoid that is all of the slow variation.
const FEWEST_SLOW_PERIODS: usize = 2;
/// Least slow variation of such a sinusoid over the rest; a walk has it with a probability below 10⁻⁶.
const SLOW_GAIN: f64 = 1000.0;
/// Largest part of the slow variation after the first fit; the straight line takes 0.15 of two periods.
const SLOW_LEFT: f64 = 0.5;
/// Most such sinusoids, and rounds of a joint fit with the straight line.
const MOST_SLOW: usize = 2;
/// Fewest blocks of the means in which they are sought.
const SLOW_BLOCKS: usize = 4096;
/// Fewest blocks of the first, coarse fit; they lose 10⁻⁴ of a slow sinusoid.
const COARSE_BLOCKS: usize = 1024;
const SLOW_ROUNDS: usize = 6;
/// Ordinates per side whose median is the noise.
const NEARBY: usize = 32;

/// The lines of a series with a p-value below 2·10⁻⁵, the strongest first; at most 6 and one at half the sample rate.
///
/// Searches from 8 periods per record to half the rate at which rounding acts as noise, and at half the sample rate. A
/// record of fewer than some hundred samples has too few ordinates and yields none.
#[must_use]
pub fn find_lines(series: &UniformSeries) -> Vec<SpectralLine> {
    find_lines_over(series, |_| 1.0)
}

/// [`find_lines`] over white, flicker and random-walk noise times `known`, by frequency in Hz.
#[must_use]
pub(crate) fn find_lines_over(series: &UniformSeries, known: impl Fn(f64) -> f64) -> Vec<SpectralLine> {
    let known: &dyn Fn(f64) -> f64 = &known;
    let (rest, slow) = without_slow_sines(series.clone().averaged_until_dithered());
    let mut sines = FoundSines::default();
    let mut rest = Transformed::new(rest.detrended());
    let mut resonances: Vec<Resonance> = Vec::new();
    while slow.len() + sines.len() + resonances.len() < MOST
        && let Some(transformed) = &rest
        && let Some(spectrum) = WhitenedSpectrum::new(&transformed.spectrum, known, &resonances, None)
    {
        match spectrum.most_significant(&transformed.series) {
            Some(Candidate::Sine(found)) => rest = Transformed::new(sines.take(found, &transformed.series)),
            Some(Candidate::Resonance(resonance)) => match sines.take_sidebands(&resonance.line, &transformed.series) {
                Some(left) => rest = Transformed::new(left),
                None => {
                    resonances.push(resonance);
                    if resonances.len() <= REFITTED {
                        refit(&transformed.spectrum, known, &mut resonances);
                    }
                }
            },
            None => break,
        }
    }
    let sines = match &rest {
        Some(rest) => sines.into_lines(&rest.series, &resonances),
        None => Vec::new(),
    };
    let at_half_the_rate = Alternation::of(series).line(series.duration(), series.sample_period(), series.rounding());
    let others = resonances.iter().map(|resonance| resonance.line).chain(at_half_the_rate);
    let mut found: Vec<SpectralLine> = slow.into_iter().chain(sines).chain(others).collect();
    found.sort_by(|a, b| b.statistic.total_cmp(&a.statistic));
    let all = found.clone();
    found.retain(|line| {
        !all.iter().any(|strong| is_residue(line, strong) || strong.has_sideband(line, series.duration()))
    });
    found
}

/// Removes sinusoids of fewer periods than are searched, each nearly all of the slow variation beside a straight line;
/// returns them too. They would leak into lines, and look like ramps and steps. Block means lose at most 6·10⁻⁶ of
/// them.
pub(crate) fn without_slow_sines(mut series: UniformSeries) -> (UniformSeries, Vec<SpectralLine>) {
    let block = |blocks: usize| (series.values().len() / blocks).max(1);
    let (coarse, size) = (block(COARSE_BLOCKS), block(SLOW_BLOCKS));
    if coarse > size && SlowSine::first_fit(&series.averaged(coarse)).is_none() {
        return (series, Vec::new());
    }
    let found = slow_sines(series.averaged(size));
    // A block's mean belongs to its middle.
    let delay = 0.5 * (size as f64 - 1.0) * series.sample_period();
    for (sine, _) in &found {
        series = sine.delayed(delay).subtracted_from(&series);
    }
    (series, found.into_iter().map(|(_, line)| line).collect())
}

/// A series without the sinusoids near these frequencies, Hz.
pub(crate) fn without_sines_at(series: &UniformSeries, frequencies: impl Iterator<Item = f64>) -> UniformSeries {
    let resolution = 0.5 / series.duration();
    let without = |series: UniformSeries, at: f64| Sine::fit_near(&series, at, resolution).subtracted_from(&series);
    frequencies.filter(|frequency| *frequency > resolution).fold(series.clone(), without)
}

/// Removes the sinusoids that stand out of means of at least [`SLOW_BLOCKS`] blocks.
pub(crate) fn without_sines(mut series: UniformSeries) -> UniformSeries {
    let size = (series.values().len() / SLOW_BLOCKS).max(1);
    let width = size as f64 * series.sample_period();
    let delay = 0.5 * (size as f64 - 1.0) * series.sample_period();
    let mut means = series.averaged(size).detrended();
    for _ in 0..MOST {
        let Some(sine) = sine_that_stands_out(&means) else { break };
        means = sine.subtracted_from(&means);
        let gain = gain_of_mean(sine.frequency, width, size as u64);
        series = sine.scaled(1.0 / gain).delayed(delay).subtracted_from(&series);
    }
    series
}

/// The sinusoid with the largest ordinate over constant or 1/f² noise around, if significant by [`SIGNIFICANCE`].
fn sine_that_stands_out(series: &UniformSeries) -> Option<Sine> {
    let spectrum = Periodogram::new(series)?;
    let ordinates: Vec<f64> = spectrum.independent().collect();
    let rising: Vec<f64> = ordinates.iter().enumerate().map(|(at, of)| of * (at as f64).powi(2)).collect();
    // Means hold little above half of their rate.
    let searched = FEWEST_PERIODS..ordinates.len() / 2;
    if searched.len() <= 2 * NEARBY {
        return None;
    }
    let limit = (searched.len() as f64 / SIGNIFICANCE).ln();
    let large = searched.filter(|at| exceeds_others(&ordinates, *at, limit) && exceeds_others(&rising, *at, limit));
    let ratios = large.map(|at| (at, over_others(&ordinates, at).min(over_others(&rising, at))));
    let (largest, ratio) = ratios.max_by(|a, b| a.1.total_cmp(&b.1))?;
    let at = (PADDING * largest - 1..=PADDING * largest + 1)
        .max_by(|&a, &b| spectrum.padded()[a].total_cmp(&spectrum.padded()[b]))?;
    let spacing = spectrum.resolution() / PADDING as f64;
    (ratio > limit).then(|| Sine::fit_near(series, at as f64 * spacing, spacing))
}

fn others(ordinates: &[f64], at: usize) -> impl Iterator<Item = &f64> {
    let around = at.saturating_sub(NEARBY).max(FEWEST_PERIODS)..(at + NEARBY + 1).min(ordinates.len());
    ordinates[around.start..around.start.max(at - 1)].iter().chain(&ordinates[at + 2..around.end])
}

/// An ordinate over the mean of the others, by their median over ln 2.
fn over_others(ordinates: &[f64], at: usize) -> f64 {
    let mut others: Vec<f64> = others(ordinates, at).copied().collect();
    let middle = others.len() / 2;
    ordinates[at] * LN_2 / *others.select_nth_unstable_by(middle, f64::total_cmp).1
}

/// True if an ordinate may be `limit` times the mean of the others, by a fast count.
fn exceeds_others(ordinates: &[f64], at: usize, limit: f64) -> bool {
    let low = ordinates[at] * LN_2 / limit;
    let (below, all) = others(ordinates, at).fold((0, 0), |(below, all), of| (below + usize::from(*of < low), all + 1));
    below > all / 2
}

/// The sinusoids of [`without_slow_sines`], time from the first sample.
fn slow_sines(mut series: UniformSeries) -> Vec<(Sine, SpectralLine)> {
    let mut found = Vec::new();
    while found.len() < MOST_SLOW {
        let Some(SlowSine { slow, spacing, mut sine }) = SlowSine::first_fit(&series) else { break };
        for _ in 0..SLOW_ROUNDS {
            let without = sine.subtracted_from(&series);
            let lines =
                without.values().iter().zip(without.detrended().values()).map(|(a, b)| a - b).collect::<Vec<_>>();
            let lineless = series.values().iter().zip(lines).map(|(value, line)| value - line).collect();
            sine = Sine::fit_near(&series.with_values(lineless), sine.frequency, 0.3 * spacing);
        }
        let Some(part) = part_left(&series, &sine, slow).filter(|part| part * SLOW_GAIN <= 1.0) else { break };
        let left = part * slow / FEWEST_PERIODS as f64;
        let density = left.max(series.rounding().density(sine.frequency));
        // Two degrees of freedom per ordinate, less sinusoid and line.
        let p_value = part.powi(FEWEST_PERIODS as i32 - 2);
        found.push((sine, FoundSine { sine, density, p_value }.line(&series)));
        series = sine.subtracted_from(&series);
    }
    found
}

/// A candidate for nearly all of the slow variation.
struct SlowSine {
    slow: f64,
    /// For padded ordinates, Hz.
    spacing: f64,
    sine: Sine,
}

impl SlowSine {
    /// Fit to the series without its straight line; `None` if too much is left.
    fn first_fit(series: &UniformSeries) -> Option<Self> {
        let level = series.detrended();
        let spectrum = Periodogram::new(&level).filter(|of| of.padded().len() > 2 * PADDING * FEWEST_PERIODS)?;
        let searched = PADDING * FEWEST_SLOW_PERIODS..=PADDING * FEWEST_PERIODS;
        let at = searched.max_by(|&a, &b| spectrum.padded()[a].total_cmp(&spectrum.padded()[b]))?;
        let spacing = spectrum.resolution() / PADDING as f64;
        let sine = Sine::fit_near(&level, at as f64 * spacing, spacing);
        let slow = slow_variation(&spectrum);
        let part = part_left(series, &sine, slow).filter(|part| *part <= SLOW_LEFT);
        part.map(|_| Self { slow, spacing, sine })
    }
}

/// Sum of the ordinates from one period up to those searched for lines.
fn slow_variation(spectrum: &Periodogram) -> f64 {
    spectrum.independent().skip(1).take(FEWEST_PERIODS).sum()
}

/// Part of the slow variation left by a sinusoid and a straight line.
fn part_left(series: &UniformSeries, sine: &Sine, slow: f64) -> Option<f64> {
    Some(slow_variation(&Periodogram::new(&sine.subtracted_from(series).detrended())?) / slow)
}

/// True if `line` is a residue on the skirts of a far stronger resonance.
fn is_residue(line: &SpectralLine, strong: &SpectralLine) -> bool {
    let (own, other) = (line.frequency.value, strong.frequency.value);
    own != other && is_on_skirts(own, strong) && line.statistic < RESIDUE * strong.statistic
}

struct Transformed {
    series: UniformSeries,
    spectrum: Spectrum,
}

impl Transformed {
    fn new(series: UniformSeries) -> Option<Self> {
        Some(Self { spectrum: Spectrum::new(&series)?, series })
    }
}
