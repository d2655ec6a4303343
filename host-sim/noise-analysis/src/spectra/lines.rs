//! Lines in a spectrum: sinusoids, and resonances that are wider than the record's resolution.
//!
//! A sinusoid is tested by the likelihood ratio of its least-squares fit against a locally white background. The p-value
//! accounts for all the frequencies that were searched (R. Baluev, "Assessing the statistical significance of periodogram
//! peaks", MNRAS 385, 2008) and for the uncertainty of the background. A resonance is sought in averages over 4, 16, 64 …
//! ordinates. A peak is taken for the model with the larger likelihood.

use super::line_envelope::{MOST_PERIODS, Modulation};
use super::line_models::{Lorentz, Sine};
use super::periodogram::{PADDING, Periodogram};
use super::smooth_shape::{Background, LocalLevel, WINDOW, median};
use crate::distributions::mean_ratio_tail;
use crate::findings::MeasuredValue;
use crate::uniform_series::UniformSeries;
use std::f64::consts::PI;

/// Probability that a record without lines yields one sinusoid or more, and the same again for a resonance.
const FALSE_ALARM: f64 = 2e-4;

/// Lowest frequency that is searched, in periods per record: below, lines cannot be distinguished from drift.
const FEWEST_PERIODS: usize = 8;

/// Peaks of the periodogram that a sinusoid is fitted to, the highest over the local level.
const FITTED_PEAKS: usize = 3;
/// Largest number of lines that are returned.
const MOST: usize = 6;
/// Least width of a resonance, in resolutions.
const NARROWEST: f64 = 1.5;
/// Least −2 log-likelihood ratio of a sinusoid against a resonance for the latter to be taken.
const PREFERENCE: f64 = 10.0;
/// Least relative excess of a broad peak over the density around it; a smaller one may be an error of the background's shape.
const LEAST_EXCESS: f64 = 0.1;
/// Averages on either side that a broad peak is compared with.
const NEIGHBOURS: usize = 16;
/// Largest number of resonances that are refitted when one is added: each refit fits the background of the whole spectrum.
const REFITTED: usize = 2;
/// Most rounds of refits.
const REFITS: usize = 6;
/// A line within this many widths of a resonance, and with less than this fraction of its statistic, is a residue of it.
const SKIRTS: f64 = 20.0;
const RESIDUE: f64 = 0.02;

/// Neighbouring samples over which the level of the noise is estimated, to see whether it changes. The square of such a level
/// has a relative error of 15 %, and a disturbance of a second or more is several of them.
const LEVEL_BLOCK: usize = 128;
/// Fewest periods of a sinusoid in a record, where it is all of the slow variation.
const FEWEST_SLOW_PERIODS: usize = 2;
/// Least part of the slow variation, over what it leaves, of such a sinusoid. A random walk has most of its variation in the
/// lowest ordinates: that one of two periods or more holds all but a thousandth has a probability below 10⁻⁶.
const SLOW_GAIN: f64 = 1000.0;
/// Most such sinusoids, and rounds in which each is fitted together with the straight line of the record; a round takes at
/// least nine tenths off what the line has of a sinusoid of two periods.
const MOST_SLOW: usize = 2;
/// Blocks of the record in whose means they are sought, at least.
const SLOW_BLOCKS: usize = 4096;
const SLOW_ROUNDS: usize = 6;

/// A line that stands out of the background.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SpectralLine {
    /// Hz.
    pub frequency: MeasuredValue,
    /// Standard deviation of the line's signal, in the unit of the series: 1/√2 of a sinusoid's amplitude.
    pub deviation: MeasuredValue,
    /// Full width at half maximum in Hz; `None` for a sinusoid, which is no wider than the record resolves.
    pub width: Option<MeasuredValue>,
    /// −2 log-likelihood ratio of the background alone against background and line.
    pub statistic: f64,
    /// Probability that a record without lines shows such a peak at any frequency.
    pub p_value: f64,
    /// Probability that a line with the spectrum of a resonance deviates as far from it; 1 of a sinusoid.
    pub shape_p_value: f64,
    /// How the amplitude or the phase of a line without a width changes over the record; `None` where it may be constant.
    pub modulation: Option<Modulation>,
}

impl SpectralLine {
    /// Amplitude of the sinusoid; for a resonance, of a sinusoid of the same power.
    #[must_use]
    pub fn amplitude(&self) -> MeasuredValue {
        let root = 2f64.sqrt();
        MeasuredValue { value: root * self.deviation.value, error: root * self.deviation.error }
    }
}

/// The lines of a series with a p-value below 2·10⁻⁴, the strongest first; at most 6.
///
/// Searches from 8 periods per record up to half the sample rate, or to half the rate at which rounding acts as noise
/// where that is lower. A record of fewer than some hundred samples has too few ordinates and yields none.
#[must_use]
pub fn find_lines(series: &UniformSeries) -> Vec<SpectralLine> {
    find_lines_over(series, |_| 1.0)
}

/// As [`find_lines`], over a background of white, flicker and random-walk noise times `known`, a function of the frequency
/// in Hz.
#[must_use]
pub(crate) fn find_lines_over(series: &UniformSeries, known: impl Fn(f64) -> f64) -> Vec<SpectralLine> {
    let known: &dyn Fn(f64) -> f64 = &known;
    let (rest, slow) = without_slow_sines(series.clone().averaged_until_dithered());
    let mut sines: Vec<FoundSine> = Vec::new();
    let mut rest = Transformed::new(rest.detrended());
    let mut resonances: Vec<Resonance> = Vec::new();
    while slow.len() + sines.len() + resonances.len() < MOST
        && let Some(transformed) = &rest
        && let Some(spectrum) = WhitenedSpectrum::new(transformed, known, &resonances, None)
    {
        match spectrum.most_significant(&transformed.series) {
            Some(Candidate::Sine(line, sine)) => {
                let density = 2.0 * sine.density(&transformed.series) / line.statistic;
                sines.push(FoundSine { line, sine, density });
                rest = Transformed::new(sine.subtracted_from(&transformed.series));
            }
            Some(Candidate::Resonance(resonance)) => {
                resonances.push(resonance);
                if resonances.len() <= REFITTED {
                    refit(transformed, known, &mut resonances);
                }
            }
            None => break,
        }
    }
    if let Some(rest) = &rest {
        find_modulations(&mut sines, &rest.series, &resonances);
    }
    let sines = sines.into_iter().map(|found| found.line);
    let mut found: Vec<SpectralLine> =
        slow.into_iter().chain(sines).chain(resonances.iter().map(|resonance| resonance.line)).collect();
    found.sort_by(|a, b| b.statistic.total_cmp(&a.statistic));
    let all = found.clone();
    found.retain(|line| !all.iter().any(|strong| is_residue(line, strong)));
    found
}

/// The series without sinusoids of fewer periods than are searched, each of which is nearly all of the slow variation beside a
/// straight line; and these sinusoids. Their leakage would be taken for lines, and they themselves for ramps and steps.
///
/// They are sought in block means, which such a sinusoid passes with a loss of `(π·8/4096)²/6`, 6·10⁻⁶, or less.
pub(crate) fn without_slow_sines(mut series: UniformSeries) -> (UniformSeries, Vec<SpectralLine>) {
    let size = (series.values().len() / SLOW_BLOCKS).max(1);
    let found = slow_sines(series.averaged(size));
    // A block's mean belongs to its middle.
    let delay = 0.5 * (size as f64 - 1.0) * series.sample_period();
    for (sine, _) in &found {
        series = sine.delayed(delay).subtracted_from(&series);
    }
    (series, found.into_iter().map(|(_, line)| line).collect())
}

/// The sinusoids of [`without_slow_sines`], with time counted from the first sample of `series`.
fn slow_sines(mut series: UniformSeries) -> Vec<(Sine, SpectralLine)> {
    let mut found = Vec::new();
    let slow = |spectrum: &Periodogram| spectrum.independent()[1..=FEWEST_PERIODS].iter().sum::<f64>();
    while found.len() < MOST_SLOW {
        let level = series.detrended();
        let Some(spectrum) = Periodogram::new(&level).filter(|of| of.padded().len() > 2 * PADDING * FEWEST_PERIODS)
        else {
            break;
        };
        let searched = PADDING * FEWEST_SLOW_PERIODS..=PADDING * FEWEST_PERIODS;
        let Some(at) = searched.max_by(|&a, &b| spectrum.padded()[a].total_cmp(&spectrum.padded()[b])) else { break };
        let spacing = spectrum.resolution() / PADDING as f64;
        let mut sine = Sine::fit_near(&level, at as f64 * spacing, spacing);
        for _ in 0..SLOW_ROUNDS {
            let without = sine.subtracted_from(&series);
            let lines =
                without.values().iter().zip(without.detrended().values()).map(|(a, b)| a - b).collect::<Vec<_>>();
            let lineless = series.values().iter().zip(lines).map(|(value, line)| value - line).collect();
            sine = Sine::fit_near(&series.with_values(lineless), sine.frequency, 0.3 * spacing);
        }
        let without = sine.subtracted_from(&series);
        let Some(left) = Periodogram::new(&without.detrended()).map(|spectrum| slow(&spectrum)) else { break };
        let part = left / slow(&spectrum);
        if part.is_nan() || part * SLOW_GAIN > 1.0 {
            break;
        }
        let ratio = sine.density(&level) / (left / FEWEST_PERIODS as f64).max(series.rounding_density());
        // What is left has two degrees of freedom an ordinate, less the sinusoid's and the line's.
        let p_value = part.powi(FEWEST_PERIODS as i32 - 2);
        found.push((sine, sine_line(&sine, series.duration(), ratio, p_value)));
        series = without;
    }
    found
}

/// A sinusoid whose ordinate is `ratio` times the background, in a record of `duration` s.
fn sine_line(sine: &Sine, duration: f64, ratio: f64, p_value: f64) -> SpectralLine {
    let amplitude = sine.amplitude();
    SpectralLine {
        // Cramér-Rao bound for a sinusoid in white noise.
        frequency: MeasuredValue { value: sine.frequency, error: 1.5f64.sqrt() / (PI * duration * ratio.sqrt()) },
        deviation: MeasuredValue { value: amplitude / 2f64.sqrt(), error: amplitude / (2.0 * ratio.sqrt()) },
        width: None,
        statistic: 2.0 * ratio,
        p_value,
        shape_p_value: 1.0,
        modulation: None,
    }
}

/// The part of the ordinates of a spectrum that are as good as independent. Where samples are missing, or where the level of
/// the noise changes, neighbouring ordinates are correlated: the mean of many varies as that of `(Σv)²/Σv²` of them, `v` being
/// the variance of each sample and 0 of a missing one.
fn independent_part(series: &UniformSeries) -> f64 {
    let present = series.present() as f64 / series.values().len().max(1) as f64;
    let level = |block: &[f64]| {
        let squares = block.windows(2).map(|pair| (pair[1] - pair[0]).powi(2)).filter(|square| square.is_finite());
        let (sum, count) = squares.fold((0.0, 0), |(sum, count), square| (sum + square, count + 1));
        (2 * count > LEVEL_BLOCK).then(|| sum / count as f64)
    };
    let levels: Vec<f64> = series.values().chunks_exact(LEVEL_BLOCK).filter_map(level).collect();
    let count = levels.len() as f64;
    let mean = levels.iter().sum::<f64>() / count;
    if levels.len() < 2 || mean <= 0.0 {
        return present;
    }
    let variance = levels.iter().map(|level| (level - mean).powi(2)).sum::<f64>() / count;
    // Neighbouring levels differ by the scatter of their estimates, in whatever way the noise is correlated.
    let scatter = levels.windows(2).map(|pair| 0.5 * (pair[1] - pair[0]).powi(2)).sum::<f64>() / (count - 1.0);
    present / (1.0 + (variance - scatter).max(0.0) / (mean * mean))
}

/// Refits each resonance over the background without any of them, until that moves it by less than its errors: a strong one biases the
/// first estimates of it, and those the background.
fn refit(rest: &Transformed, known: &dyn Fn(f64) -> f64, resonances: &mut [Resonance]) {
    for _ in 0..REFITS {
        let mut moved = false;
        for index in 0..resonances.len() {
            let Some(spectrum) = WhitenedSpectrum::new(rest, known, resonances, Some(index)) else { return };
            let Resonance { line, lorentz } = resonances[index];
            if let Some(better) = spectrum.resonance(lorentz.centre, [lorentz.width]) {
                moved |= better.differs_from(&lorentz);
                resonances[index] = Resonance { line: spectrum.resonance_line(&better, line.p_value), lorentz: better };
            }
        }
        if !moved {
            return;
        }
    }
}

/// Whether `line` is what the fit of a far stronger resonance has left on its skirts.
fn is_residue(line: &SpectralLine, strong: &SpectralLine) -> bool {
    strong.width.is_some_and(|width| {
        let distance = (line.frequency.value - strong.frequency.value).abs();
        distance > 0.0 && distance < SKIRTS * width.value && line.statistic < RESIDUE * strong.statistic
    })
}

/// A line with the model by which it is removed from the record.
enum Candidate {
    Sine(SpectralLine, Sine),
    Resonance(Resonance),
}

/// A sinusoid that was removed from the record.
struct FoundSine {
    line: SpectralLine,
    sine: Sine,
    /// Of the noise around it, unit²/Hz.
    density: f64,
}

/// Sets how each of the sinusoids changes over the record of which `rest` is left, and removes those that are sidebands of another.
fn find_modulations(sines: &mut Vec<FoundSine>, rest: &UniformSeries, resonances: &[Resonance]) {
    let duration = rest.duration();
    let mut at = 0;
    while let Some(found) = sines.get(at) {
        let frequency = found.sine.frequency;
        let distance = |other: &FoundSine| other.sine.frequency - frequency;
        let is_near =
            |other: &&FoundSine| (1.0..=MOST_PERIODS as f64 + 1.0).contains(&(distance(other).abs() * duration));
        let near: Vec<&FoundSine> = sines.iter().filter(is_near).filter(|other| other.is_weaker_than(found)).collect();
        let with_near = near.iter().fold(rest.clone(), |rest, other| other.sine.negative().subtracted_from(&rest));
        let distances: Vec<f64> = near.iter().map(|other| distance(other)).collect();
        // On the skirts of a resonance the noise is not white.
        let is_skirt = |resonance: &Resonance| {
            let line = &resonance.line;
            let distance = (line.frequency.value - frequency).abs();
            line.width.is_some_and(|width| distance < SKIRTS * width.value)
        };
        let is_examined = !resonances.iter().any(is_skirt);
        let modulation = Modulation::find(&found.sine, &with_near, found.density, &distances).filter(|_| is_examined);
        sines[at].line.modulation = modulation;
        if let Some(modulation) = modulation {
            let power = sines[at].line.deviation.value;
            let is_sideband = |other: &FoundSine| {
                other.line.deviation.value < power && modulation.is_sideband(other.sine.frequency - frequency, duration)
            };
            let before = sines[..at].iter().filter(|other| is_sideband(other)).count();
            sines.retain(|other| !is_sideband(other));
            at -= before;
        }
        at += 1;
    }
}

impl FoundSine {
    fn is_weaker_than(&self, other: &Self) -> bool {
        self.line.deviation.value < other.line.deviation.value
    }
}

#[derive(Clone, Copy)]
struct Resonance {
    line: SpectralLine,
    lorentz: Lorentz,
}

/// A record with its transform.
struct Transformed {
    series: UniformSeries,
    periodogram: Periodogram,
    /// Part of the ordinates that are independent of each other.
    independent: f64,
}

impl Transformed {
    fn new(series: UniformSeries) -> Option<Self> {
        Some(Self { periodogram: Periodogram::new(&series)?, independent: independent_part(&series), series })
    }
}

/// A record's spectrum divided by its background.
struct WhitenedSpectrum<'a> {
    resolution: f64,
    background: Background<'a>,
    /// Ordinates at the multiples of the resolution, over the background's shape.
    whitened: Vec<f64>,
    /// Ordinates at the multiples of `1/PADDING` of the resolution.
    padded: Vec<f64>,
    /// Factor by which resonances were removed from each of the `padded` ordinates.
    deflation: Vec<f64>,
    /// Part of the ordinates that are independent of each other.
    independent: f64,
    /// Least density of the background: that of the rounding to counts, below which a spectrum shows the rounding itself.
    floor: f64,
}

impl<'a> WhitenedSpectrum<'a> {
    /// Removes the `resonances`, except the one with the index `kept`, from the spectrum of the record.
    fn new(
        record: &Transformed,
        known: &'a dyn Fn(f64) -> f64,
        resonances: &[Resonance],
        kept: Option<usize>,
    ) -> Option<Self> {
        let Transformed { series, periodogram, independent } = record;
        let deflation = |bin: f64, except: Option<usize>| {
            let others = resonances.iter().enumerate().filter(|(index, _)| Some(*index) != except);
            others.map(|(_, resonance)| resonance.lorentz.deflation(bin)).product::<f64>()
        };
        let mut density = periodogram.independent();
        for (bin, ordinate) in density.iter_mut().enumerate() {
            *ordinate *= deflation(bin as f64, None);
        }
        let background = Background::fit(&density, known, periodogram.resolution(), series.sample_period())?;
        let bin = |at: usize| at as f64 / PADDING as f64;
        let deflation: Vec<f64> = (0..periodogram.padded().len()).map(|at| deflation(bin(at), kept)).collect();
        let over_shape = |(at, (ordinate, deflation)): (usize, (&f64, &f64))| match at {
            0 => 0.0,
            at => ordinate * deflation / background.shape_at(bin(at)),
        };
        let padded: Vec<f64> = periodogram.padded().iter().zip(&deflation).enumerate().map(over_shape).collect();
        let whitened = padded.iter().copied().step_by(PADDING).collect();
        let resolution = periodogram.resolution();
        let floor = series.rounding_density();
        Some(Self { resolution, background, whitened, padded, deflation, independent: *independent, floor })
    }

    /// The most significant line, if one is significant.
    fn most_significant(&self, series: &UniformSeries) -> Option<Candidate> {
        let sine = self.strongest_sine(series).filter(|(line, _)| line.p_value < FALSE_ALARM);
        if let Some((line, sine)) = sine {
            let bin = line.frequency.value / self.resolution;
            let widths =
                (0..).map(|power| 2f64.powi(2 * power)).take_while(|width| *width < self.whitened.len() as f64 / 32.0);
            let resonance = self.resonance(bin, widths);
            return Some(match resonance {
                Some(lorentz) if lorentz.statistic > line.statistic + PREFERENCE => {
                    Candidate::Resonance(Resonance { line: self.resonance_line(&lorentz, line.p_value), lorentz })
                }
                _ => Candidate::Sine(line, sine),
            });
        }
        let (bin, width, p_value) = self.broad_peak()?;
        let lorentz = self.resonance(bin, [width / 2.0, width, 2.0 * width])?;
        Some(Candidate::Resonance(Resonance { line: self.resonance_line(&lorentz, p_value), lorentz }))
    }

    /// The sinusoid with the largest likelihood ratio.
    fn strongest_sine(&self, series: &UniformSeries) -> Option<(SpectralLine, Sine)> {
        let mut peaks: Vec<(f64, usize)> = self.peaks();
        let highest_first = |a: &(f64, usize), b: &(f64, usize)| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1));
        if peaks.len() > FITTED_PEAKS {
            peaks.select_nth_unstable_by(FITTED_PEAKS, highest_first);
            peaks.truncate(FITTED_PEAKS);
        }
        peaks.sort_by(highest_first);
        let candidates = peaks.into_iter().map(|(_, at)| {
            let spacing = self.resolution / PADDING as f64;
            let sine = Sine::fit_near(series, at as f64 * spacing, spacing);
            let bin = sine.frequency / self.resolution;
            let level = self.background.level(&self.whitened, at / PADDING);
            let background = (level.value * self.background.shape_at(bin)).max(self.floor);
            let ratio = sine.density(series) * self.deflation[at] / background;
            (ratio, level, sine)
        });
        let (ratio, level, sine) = candidates.max_by(|a, b| a.0.total_cmp(&b.0))?;
        Some((sine_line(&sine, series.duration(), ratio, self.sine_p_value(ratio, level)), sine))
    }

    /// Local maxima of the padded ordinates above four times the local level, over that level, with their positions.
    fn peaks(&self) -> Vec<(f64, usize)> {
        let mut level = 1.0;
        let mut until = 0;
        let mut peaks = Vec::new();
        for at in PADDING * FEWEST_PERIODS..self.padded.len().saturating_sub(2 * PADDING) {
            let bin = at / PADDING;
            if bin >= until {
                // The level is computed at every few ordinates: it changes little over a fraction of its window.
                level = self.background.level(&self.whitened, bin).value;
                until = bin + (bin / 16).clamp(1, WINDOW / 8);
            }
            let [left, here, right] = [self.padded[at - 1], self.padded[at], self.padded[at + 1]];
            let is_peak = here >= left && here > right && here > 4.0 * level;
            if is_peak && here * self.background.shape_at(at as f64 / PADDING as f64) > 4.0 * self.floor {
                peaks.push((here / level, at));
            }
        }
        peaks
    }

    /// Probability of a peak of `ratio` times the background at any frequency: Baluev's bound, for a background that is
    /// estimated from `level.ordinates` ordinates, of which a part is independent.
    fn sine_p_value(&self, ratio: f64, level: LocalLevel) -> f64 {
        let ordinates = self.independent * level.ordinates;
        let one = (1.0 + ratio / ordinates).powf(-ordinates);
        let frequencies = self.whitened.len() as f64 * (PI / 3.0).sqrt();
        (one * (1.0 + frequencies * ratio.sqrt())).min(1.0)
    }

    /// The most significant broad peak: its position and width in resolutions and its p-value.
    fn broad_peak(&self) -> Option<(f64, f64, f64)> {
        let ordinates = self.whitened.len();
        let sizes = || (1..).map(|power| 4_usize.pow(power)).take_while(move |size| *size <= ordinates / 64);
        let trials: f64 = sizes().map(|size| 2.0 * ordinates as f64 / size as f64).sum();
        let peaks = sizes().flat_map(|size| {
            let first = FEWEST_PERIODS.max(size);
            let averages: Vec<f64> = self.whitened[first..ordinates - 1]
                .chunks_exact(size)
                .map(|chunk| chunk.iter().sum::<f64>() / size as f64)
                .collect();
            let shifted = self.whitened[first + size / 2..ordinates - 1].chunks_exact(size);
            let shifted: Vec<f64> = shifted.map(|chunk| chunk.iter().sum::<f64>() / size as f64).collect();
            let mut peaks = Vec::new();
            for (offset, values) in [(0, &averages), (size / 2, &shifted)] {
                for (at, &value) in values.iter().enumerate() {
                    let level = neighbourhood(&averages, at, size);
                    let centre = (first + offset + at * size) as f64 + size as f64 / 2.0;
                    let excess = value / level.value.max(self.floor / self.background.shape_at(centre));
                    if excess > 1.0 + LEAST_EXCESS {
                        let [own, others] = [size as f64, level.ordinates].map(|count| self.independent * count);
                        let p_value = trials * mean_ratio_tail(excess, own, others);
                        peaks.push((centre, size as f64, p_value));
                    }
                }
            }
            peaks
        });
        peaks.min_by(|a, b| a.2.total_cmp(&b.2)).filter(|peak| peak.2 < FALSE_ALARM)
    }

    /// The likeliest resonance near `bin`, by fits that begin with each of `widths`; all in resolutions.
    fn resonance(&self, bin: f64, widths: impl IntoIterator<Item = f64>) -> Option<Lorentz> {
        let fits = widths.into_iter().filter_map(|width| Lorentz::fit(&self.whitened, FEWEST_PERIODS, bin, width));
        fits.filter(|fit| fit.width > NARROWEST).max_by(|a, b| a.statistic.total_cmp(&b.statistic))
    }

    fn resonance_line(&self, lorentz: &Lorentz, p_value: f64) -> SpectralLine {
        let height = lorentz.height * lorentz.level * self.background.shape_at(lorentz.centre);
        let width = lorentz.width * self.resolution;
        // The area of a Lorentz curve is π/2 of height times width.
        let deviation = (height * width * PI / 2.0).sqrt();
        let [_, centre, relative_width] = lorentz.errors;
        SpectralLine {
            frequency: MeasuredValue { value: lorentz.centre * self.resolution, error: centre * self.resolution },
            deviation: MeasuredValue { value: deviation, error: deviation * lorentz.area_error() / 2.0 },
            width: Some(MeasuredValue { value: width, error: width * relative_width }),
            statistic: lorentz.statistic,
            p_value,
            shape_p_value: lorentz.shape_p_value,
            modulation: None,
        }
    }
}

/// Median of the averages around one of them, each over `size` ordinates.
fn neighbourhood(averages: &[f64], at: usize, size: usize) -> LocalLevel {
    let low = at.saturating_sub(NEIGHBOURS);
    let high = (at + NEIGHBOURS).min(averages.len() - 1);
    let mut window = averages[low..=high].to_vec();
    // The median of a gamma variable of shape g is about 1 − 1/(3g) of its mean. The median of many is worth the mean of
    // 2/π of them.
    let value = median(&mut window) / (1.0 - 1.0 / (3.0 * size as f64));
    LocalLevel { value, ordinates: (window.len() * size) as f64 * 2.0 / PI }
}
