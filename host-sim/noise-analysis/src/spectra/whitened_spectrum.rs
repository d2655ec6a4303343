//! A spectrum over its background, and its peaks.

use super::found_sine::FoundSine;
use super::line_envelope::Modulation;
use super::line_models::{Lorentz, Sine};
use super::periodogram::{PADDING, Periodogram, taper_response};
use super::smooth_shape::{Background, Filters, LocalLevel, WINDOW};
use super::spectral_line::{Resonance, SpectralLine};
use crate::bounds::MeasuredValue;
use crate::distributions::mean_ratio_tail;
use crate::effects::findings::{REFUTED, SIGNIFICANCE};
use crate::minimum::summit;
use crate::samples::rounding::Rounding;
use crate::samples::uniform_series::UniformSeries;
use std::cell::OnceCell;
use std::f64::consts::PI;
use std::ops::Range;

/// Lowest frequency, periods per record; below is drift.
pub(super) const FEWEST_PERIODS: usize = 8;
/// Highest peaks to which a sinusoid is fitted.
const FITTED_PEAKS: usize = 3;
/// Largest ratio of a sinusoid's ordinate to the nearest padded one: 1.23 by padding, and the change of the level.
const LARGEST_RISE: f64 = 1.5;
/// Least width of a resonance, resolutions.
pub(super) const NARROWEST: f64 = 1.5;
/// Least −2 log-likelihood ratio for a resonance over a sinusoid.
const PREFERENCE: f64 = 10.0;
/// Least −2 log-likelihood ratio for a changing sinusoid over a resonance: 2·ln 256 + 2·ln 100.
const COST_OF_A_CHANGE: f64 = 20.0;
/// Least relative excess of a broad peak over its surroundings.
const LEAST_EXCESS: f64 = 0.1;
/// Standard deviations over the level of a peak, one in a thousand.
const EXAMINED: f64 = 3.0;
/// Averages per side that a broad peak is compared with.
const NEIGHBOURS: usize = 16;
/// Standard deviations of a sinusoid's ordinates over the background, and largest distance, padded ordinates.
const EXCEEDS: f64 = 3.0;
const MOST_REACHED: usize = 32 * PADDING;
/// Frequency error by three padded ordinates, resolutions.
const INTERPOLATION: f64 = 0.01;
const REFITS: usize = 6;
/// Samples per noise level; each squared level is known to 15 %.
const LEVEL_BLOCK: usize = 128;

#[derive(Clone)]
pub(super) struct Spectrum {
    pub periodogram: Periodogram,
    pub sample_period: f64,
    /// Filters its noise may be behind.
    filters: Filters,
    /// Independent exponential variables whose mean varies as an ordinate.
    pub independent: f64,
    /// Least density of the background: the rounding to counts.
    pub(super) floor: Rounding,
}

impl Spectrum {
    /// Removes the straight line; `None` for a record that is too short.
    pub(super) fn new(series: &UniformSeries) -> Option<Self> {
        Some(Self {
            periodogram: Periodogram::new(series)?,
            sample_period: series.sample_period(),
            filters: Filters::ReadEvery(series.read_every()),
            independent: independent_part(series),
            floor: series.rounding().clone(),
        })
    }

    pub(super) fn average_with(&mut self, next: &Self) {
        self.periodogram.average_with(&next.periodogram);
        self.independent += next.independent;
    }
}

pub(super) enum Candidate {
    Sine(FoundSine),
    Resonance(Resonance),
}

/// A spectrum over its background.
pub(super) struct WhitenedSpectrum<'a> {
    periodogram: &'a Periodogram,
    resolution: f64,
    background: Background<'a>,
    /// At multiples of the resolution, without removed resonances.
    ordinates: Vec<f64>,
    /// Over the background's shape; a refit needs few of them.
    whitened: OnceCell<Vec<f64>>,
    /// At multiples of `1/PADDING` of the resolution; not needed for resonances.
    padded: OnceCell<Vec<f64>>,
    removed: Vec<Lorentz>,
    independent: f64,
    floor: &'a Rounding,
    looks: f64,
}

impl<'a> WhitenedSpectrum<'a> {
    /// Removes the `resonances` except number `kept`.
    pub(super) fn new(
        spectrum: &'a Spectrum,
        known: &'a dyn Fn(f64) -> f64,
        resonances: &[Resonance],
        kept: Option<usize>,
    ) -> Option<Self> {
        Self::behind(spectrum, known, resonances, kept, spectrum.filters)
    }

    /// For noise behind these `filters`.
    fn behind(
        spectrum: &'a Spectrum,
        known: &'a dyn Fn(f64) -> f64,
        resonances: &[Resonance],
        kept: Option<usize>,
        filters: Filters,
    ) -> Option<Self> {
        let &Spectrum { ref periodogram, sample_period, independent, ref floor, .. } = spectrum;
        let (looks, resolution) = (periodogram.looks(), periodogram.resolution());
        let others = resonances.iter().enumerate().filter(|(index, _)| Some(*index) != kept);
        let removed: Vec<Lorentz> = others.map(|(_, other)| other.lorentz).collect();
        let deflated = |(bin, ordinate)| ordinate * deflation(&removed, bin as f64);
        let ordinates: Vec<f64> = periodogram.independent().enumerate().map(deflated).collect();
        let kept = kept.and_then(|kept| resonances.get(kept));
        let density = kept.map(|kept| {
            ordinates.iter().enumerate().map(|(bin, ordinate)| ordinate * kept.lorentz.deflation(bin as f64)).collect()
        });
        let density: &Vec<f64> = density.as_ref().unwrap_or(&ordinates);
        let background = Background::fit(density, looks, known, resolution, (sample_period, filters))?;
        let (whitened, padded) = (OnceCell::new(), OnceCell::new());
        Some(Self {
            periodogram,
            resolution,
            background,
            ordinates,
            whitened,
            padded,
            removed,
            independent,
            floor,
            looks,
        })
    }

    fn whitened(&self) -> &[f64] {
        self.whitened.get_or_init(|| std::iter::once(0.0).chain(self.over_shape(1..self.ordinates.len())).collect())
    }

    fn over_shape(&self, bins: Range<usize>) -> impl Iterator<Item = f64> {
        bins.map(|bin| self.ordinates[bin] / self.background.shape_at(bin as f64))
    }

    fn padded(&self) -> &[f64] {
        self.padded.get_or_init(|| {
            let over_shape = |(at, ordinate): (usize, &f64)| {
                let bin = at as f64 / PADDING as f64;
                match at % PADDING {
                    0 => self.whitened()[at / PADDING],
                    _ => ordinate * deflation(&self.removed, bin) / self.background.shape_at(bin),
                }
            };
            self.periodogram.padded().iter().enumerate().map(over_shape).collect()
        })
    }

    /// Factor of the removed resonances on a [`padded`](Self::padded) ordinate.
    fn deflation_at(&self, at: usize) -> f64 {
        deflation(&self.removed, at as f64 / PADDING as f64)
    }

    fn floor_at(&self, bin: f64) -> f64 {
        self.floor.density(bin * self.resolution)
    }

    pub(super) fn most_significant(&self, series: &UniformSeries) -> Option<Candidate> {
        if let Some(found) = self.strongest_sine(series).filter(|found| found.p_value < SIGNIFICANCE) {
            let bin = found.sine.frequency / self.resolution;
            let widths =
                (0..).map(|power| 2f64.powi(2 * power)).take_while(|width| *width < self.ordinates.len() as f64 / 32.0);
            // A modulated sinusoid is a band of a few lines.
            let change =
                || Modulation::find(&found.sine, &found.sine.subtracted_from(series), found.density, |_| false);
            let is_likelier = |lorentz: &Lorentz| {
                let over_sine = lorentz.statistic - 2.0 * found.over_noise(series);
                over_sine > PREFERENCE
                    && change().is_none_or(|change| over_sine > change.with_multiples - COST_OF_A_CHANGE)
            };
            return Some(match self.resonance(bin, widths).filter(is_likelier) {
                Some(lorentz) => {
                    Candidate::Resonance(Resonance { line: self.resonance_line(&lorentz, found.p_value), lorentz })
                }
                None => Candidate::Sine(found),
            });
        }
        let (bin, width, p_value) = self.broad_peak(1)?;
        let lorentz = self.resonance(bin, [width / 2.0, width, 2.0 * width])?;
        Some(Candidate::Resonance(Resonance { line: self.resonance_line(&lorentz, p_value), lorentz }))
    }

    /// The sinusoid with the largest likelihood ratio.
    fn strongest_sine(&self, series: &UniformSeries) -> Option<FoundSine> {
        let mut peaks: Vec<(f64, usize)> = self.peaks();
        let highest_first = |a: &(f64, usize), b: &(f64, usize)| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1));
        if peaks.len() > FITTED_PEAKS {
            peaks.select_nth_unstable_by(FITTED_PEAKS, highest_first);
            peaks.truncate(FITTED_PEAKS);
        }
        peaks.retain(|(ratio, at)| {
            let level = self.background.level(self.whitened(), at / PADDING);
            self.sine_p_value(LARGEST_RISE * ratio, level) < SIGNIFICANCE
        });
        peaks.sort_by(highest_first);
        let candidates = peaks.into_iter().map(|(_, at)| {
            let spacing = self.resolution / PADDING as f64;
            let sine = Sine::fit_near(series, at as f64 * spacing, spacing);
            let bin = sine.frequency / self.resolution;
            let level = self.background.level(self.whitened(), at / PADDING);
            let background = (level.value * self.background.shape_at(bin)).max(self.floor_at(bin));
            let density = background / self.deflation_at(at);
            FoundSine { sine, density, p_value: self.sine_p_value(sine.density(series) / density, level) }
        });
        candidates.max_by(|a, b| a.over_noise(series).total_cmp(&b.over_noise(series)))
    }

    /// Maxima of the padded ordinates above four times the local level, over it, with positions.
    fn peaks(&self) -> Vec<(f64, usize)> {
        let mut level = 1.0;
        let mut until = 0;
        let mut peaks = Vec::new();
        let padded = self.padded();
        for at in PADDING * FEWEST_PERIODS..padded.len().saturating_sub(2 * PADDING) {
            let bin = at / PADDING;
            if bin >= until {
                // The level changes little over a fraction of its window.
                level = self.background.level(self.whitened(), bin).value;
                until = bin + (bin / 16).clamp(1, WINDOW / 8);
            }
            let [left, here, right] = [padded[at - 1], padded[at], padded[at + 1]];
            let is_peak = here >= left && here > right && here > 4.0 * level;
            let bin = at as f64 / PADDING as f64;
            if is_peak && here * self.background.shape_at(bin) > 4.0 * self.floor_at(bin) {
                peaks.push((here / level, at));
            }
        }
        peaks
    }

    /// p-value of a peak of `ratio` at any frequency: Baluev's bound, with the error of the level.
    fn sine_p_value(&self, ratio: f64, level: LocalLevel) -> f64 {
        let ordinates = self.independent * level.ordinates;
        let one = (1.0 + ratio / ordinates).powf(-ordinates);
        let frequencies = self.ordinates.len() as f64 * (PI / 3.0).sqrt();
        (one * (1.0 + frequencies * ratio.sqrt())).min(1.0)
    }

    /// Most significant peak in averages of at least `4^least_log4` ordinates: position and width, resolutions,
    /// p-value.
    pub(super) fn broad_peak(&self, least_log4: u32) -> Option<(f64, f64, f64)> {
        let ordinates = self.ordinates.len();
        let sizes = || (least_log4..).map(|power| 4_usize.pow(power)).take_while(move |size| *size <= ordinates / 64);
        let whitened = self.whitened();
        let trials: f64 = sizes().map(|size| 2.0 * ordinates as f64 / size as f64).sum();
        let peaks = sizes().flat_map(|size| {
            let first = FEWEST_PERIODS.max(size);
            let averages: Vec<f64> = whitened[first..ordinates - 1]
                .chunks_exact(size)
                .map(|chunk| chunk.iter().sum::<f64>() / size as f64)
                .collect();
            let shifted = whitened[first + size / 2..ordinates - 1].chunks_exact(size);
            let shifted: Vec<f64> = shifted.map(|chunk| chunk.iter().sum::<f64>() / size as f64).collect();
            let levels = neighbourhoods(&averages, size, self.looks);
            let mut peaks = Vec::new();
            // An average of one ordinate cannot shift by half.
            for (offset, values) in [(0, &averages), (size / 2, &shifted)].into_iter().take(size) {
                for (at, (&value, level)) in values.iter().zip(&levels).enumerate() {
                    let [own, others] = [size as f64, level.ordinates].map(|count| self.independent * count);
                    let most = 1.0 + LEAST_EXCESS.max(EXAMINED * (1.0 / own + 1.0 / others).sqrt());
                    // The floor is computed only if needed.
                    if value / level.value <= most {
                        continue;
                    }
                    let centre = (first + offset + at * size) as f64 + size as f64 / 2.0;
                    let excess = value / level.value.max(self.floor_at(centre) / self.background.shape_at(centre));
                    if excess > most {
                        let p_value = trials * mean_ratio_tail(excess, own, others);
                        peaks.push((centre, size as f64, p_value));
                    }
                }
            }
            peaks
        });
        peaks.min_by(|a, b| a.2.total_cmp(&b.2)).filter(|peak| peak.2 < SIGNIFICANCE)
    }

    /// The likeliest resonance near `bin` from each of `widths`, resolutions.
    pub(super) fn resonance(&self, bin: f64, widths: impl IntoIterator<Item = f64>) -> Option<Lorentz> {
        let fits = self.lorentz_fits(bin, widths);
        fits.filter(|fit| fit.width > NARROWEST).max_by(|a, b| a.statistic.total_cmp(&b.statistic))
    }

    /// May be as narrow as a sinusoid.
    pub(super) fn likeliest_lorentz(&self, bin: f64, widths: impl IntoIterator<Item = f64>) -> Option<Lorentz> {
        self.lorentz_fits(bin, widths).max_by(|a, b| a.statistic.total_cmp(&b.statistic))
    }

    fn lorentz_fits(&self, bin: f64, widths: impl IntoIterator<Item = f64>) -> impl Iterator<Item = Lorentz> {
        let spectrum = move |bins: Range<usize>| match self.whitened.get() {
            Some(whitened) => whitened[bins].to_vec(),
            None => self.over_shape(bins).collect(),
        };
        let bins = FEWEST_PERIODS..self.ordinates.len();
        let fit = move |width| Lorentz::fit(&spectrum, bins.clone(), self.looks, bin, width);
        widths.into_iter().filter_map(fit)
    }

    /// The sinusoid nearest to `bin` within `width`, resolutions, and its padded ordinates with their densities.
    pub(super) fn sinusoid_near(&self, bin: f64, width: f64, p_value: f64) -> (SpectralLine, Vec<(usize, f64)>) {
        let padded = self.padded();
        let last = padded.len() - PADDING - 1;
        let position = |bin: f64| (bin * PADDING as f64).clamp(1.0, last as f64 - 1.0) as usize;
        let level = self.background.level(self.whitened(), bin as usize).value;
        let exceeds = |at: &usize| padded[*at] > level * (1.0 + EXCEEDS / self.independent.sqrt());
        // The skirts of a strong line are found before its peak.
        let (low, high) = (position(bin - width), position(bin + width));
        let low = (1..low).rev().take(MOST_REACHED).take_while(exceeds).last().unwrap_or(low);
        let high = (high + 1..last).take(MOST_REACHED).take_while(exceeds).last().unwrap_or(high);
        let highest = (low..=high).max_by(|&a, &b| padded[a].total_cmp(&padded[b])).unwrap_or(1);
        // ln of a taper's main lobe is nearly a parabola.
        let shift = summit([highest - 1, highest, highest + 1].map(|at| padded[at].ln())).clamp(-0.5, 0.5);
        let centre = (highest as f64 + shift) / PADDING as f64;
        let below = (1..highest).rev().take(MOST_REACHED).take_while(exceeds).count().max(PADDING).min(highest - 1);
        let above = (highest + 1..last).take(MOST_REACHED).take_while(exceeds).count().max(PADDING);
        let reached = highest - below..=(highest + above).min(last);
        let without = |at: usize| level * self.background.shape_at(at as f64 / PADDING as f64);
        let over: f64 = reached
            .clone()
            .filter(|at| at.is_multiple_of(PADDING))
            .map(|at| padded[at] * self.background.shape_at((at / PADDING) as f64) - without(at))
            .sum();
        let ordinates = (below + above) as f64 / PADDING as f64;
        // Energy over the noise density, in all stretches.
        let ratio = self.independent * over.max(0.0) / without(highest);
        let relative = 0.5 * (self.independent * ordinates + 2.0 * ratio).sqrt() / ratio;
        let deviation = (over.max(0.0) * self.resolution).sqrt();
        let by_noise = relative * 3f64.sqrt() / PI;
        let peak = (padded[highest] / level).max(1.0);
        let line = SpectralLine {
            // Cramér-Rao bound in white noise, with a phase per stretch.
            frequency: MeasuredValue {
                value: centre * self.resolution,
                error: self.resolution * by_noise.hypot(INTERPOLATION),
            },
            deviation: MeasuredValue { value: deviation, error: relative * deviation },
            width: None,
            statistic: 2.0 * self.independent * (peak - 1.0 - peak.ln()),
            p_value,
            shape_p_value: 1.0,
            modulation: None,
        };
        // The skirts of a strong line would be a band.
        let height = (peak - 1.0) / taper_response(shift / PADDING as f64);
        let skirt = |at: usize| 1.0 + height * taper_response(at as f64 / PADDING as f64 - centre);
        let replaced = |at: usize| match reached.contains(&at) {
            true => without(at) / self.deflation_at(at),
            false => self.periodogram.padded()[at] / skirt(at),
        };
        let near = highest.saturating_sub(MOST_REACHED).max(1)..=(highest + MOST_REACHED).min(last);
        let replaced = near.map(|at| (at, replaced(at))).collect();
        (line, replaced)
    }

    pub(super) fn resonance_line(&self, lorentz: &Lorentz, p_value: f64) -> SpectralLine {
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

fn deflation(removed: &[Lorentz], bin: f64) -> f64 {
    removed.iter().fold(1.0, |factor, lorentz| factor * lorentz.deflation(bin))
}

/// Medians of the averages over `size` ordinates around each.
fn neighbourhoods(averages: &[f64], size: usize, looks: f64) -> Vec<LocalLevel> {
    let mut window: Vec<f64> = Vec::with_capacity(2 * NEIGHBOURS + 2);
    let place = |window: &[f64], value: &f64| window.partition_point(|other| other.total_cmp(value).is_lt());
    let mut next = averages.iter();
    let mut take = |window: &mut Vec<f64>| {
        if let Some(value) = next.next() {
            window.insert(place(window, value), *value);
        }
    };
    (0..NEIGHBOURS).for_each(|_| take(&mut window));
    let mut level = |at: usize| {
        take(&mut window);
        if let Some(passed) = at.checked_sub(NEIGHBOURS + 1) {
            window.remove(place(&window, &averages[passed]));
        }
        let middle = window.len() / 2;
        let median =
            if window.len().is_multiple_of(2) { (window[middle - 1] + window[middle]) / 2.0 } else { window[middle] };
        // Gamma median of shape g: 1 − 1/(3g) of the mean, worth 2/π of the values.
        let value = median / (1.0 - 1.0 / (3.0 * size as f64 * looks));
        LocalLevel { value, ordinates: (window.len() * size) as f64 * 2.0 / PI }
    };
    (0..averages.len()).map(&mut level).collect()
}

/// Part of the ordinates that count as independent: `(Σv)²/Σv²` with the variance v of each sample, 0 if missing.
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
    // Half the mean square of first differences is the estimation error alone.
    let scatter = levels.windows(2).map(|pair| 0.5 * (pair[1] - pair[0]).powi(2)).sum::<f64>() / (count - 1.0);
    present / (1.0 + (variance - scatter).max(0.0) / (mean * mean))
}

/// Refits each resonance over the background without any, until the changes are below its errors.
pub(super) fn refit(spectrum: &Spectrum, known: &dyn Fn(f64) -> f64, resonances: &mut [Resonance]) {
    let mut first = resonances.to_vec();
    refit_behind(spectrum, known, resonances, spectrum.filters);
    if let ([refitted], [other]) = (resonances, &mut first[..])
        && refitted.lorentz.shape_p_value < REFUTED
    {
        refit_behind(spectrum, known, std::slice::from_mut(other), Filters::Without);
        if other.lorentz.shape_p_value >= REFUTED {
            *refitted = *other;
        }
    }
}

fn refit_behind(spectrum: &Spectrum, known: &dyn Fn(f64) -> f64, resonances: &mut [Resonance], filters: Filters) {
    for _ in 0..REFITS {
        let mut moved = false;
        for index in 0..resonances.len() {
            let whitened = WhitenedSpectrum::behind(spectrum, known, resonances, Some(index), filters);
            let Some(whitened) = whitened else { return };
            let Resonance { line, lorentz } = resonances[index];
            if let Some(better) = whitened.resonance(lorentz.centre, [lorentz.width]) {
                moved |= better.differs_from(&lorentz);
                resonances[index] = Resonance { line: whitened.resonance_line(&better, line.p_value), lorentz: better };
            }
        }
        if !moved {
            return;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::parallel::in_parallel;
    use crate::spectra::find_lines;
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::StandardNormal;
    use std::f64::consts::TAU;

    /// 450 s of white noise and a resonance at 5.9 Hz, whose skirts look like a filter of 8 taps.
    fn resonant(seed: u64) -> UniformSeries {
        let (rate, width) = (204.8, 0.9);
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let kept = (-PI * width / rate).exp();
        let drive = 3.5 * (1.0 - kept * kept).sqrt();
        let (sine, cosine) = (TAU * 5.9 / rate).sin_cos();
        let (mut a, mut b) = (0.0, 0.0);
        let value = |_| {
            let [one, other, noise]: [f64; 3] = [(); 3].map(|()| random.sample(StandardNormal));
            (a, b) = (kept * (a * cosine - b * sine) + drive * one, kept * (a * sine + b * cosine) + drive * other);
            a + 2.3 * noise
        };
        UniformSeries::new(1.0 / rate, (0..92_160).map(value).collect())
    }

    /// Chance refutes one in 5,000: two of 20 in 60,000 cases.
    #[test]
    fn a_wide_resonance_has_its_form_and_no_filter() {
        let found = in_parallel(&(0..20).collect::<Vec<u64>>(), |seed| find_lines(&resonant(*seed)));
        let is_refuted = |lines: &&Vec<SpectralLine>| lines[0].shape_p_value < REFUTED;
        assert!(found.iter().filter(is_refuted).count() <= 1, "{found:?}");
        for lines in &found {
            let SpectralLine { frequency, width: Some(width), .. } = lines[0] else { panic!("{lines:?}") };
            // Four deviations are exceeded once in 800 cases.
            assert!((frequency.value - 5.9).abs() < 4.0 * frequency.error, "{frequency:?}");
            assert!((width.value - 0.9).abs() < 4.0 * width.error, "{width:?}");
        }
    }
}
