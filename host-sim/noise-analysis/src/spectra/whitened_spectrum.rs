//! A spectrum divided by its background, and the peaks that stand out of it.

use super::line_envelope::Modulation;
use super::line_models::{Lorentz, Sine};
use super::periodogram::{PADDING, Periodogram};
use super::smooth_shape::{Background, Filters, LocalLevel, WINDOW};
use crate::bounds::MeasuredValue;
use crate::distributions::mean_ratio_tail;
use crate::effects::findings::{REFUTED, SIGNIFICANCE};
use crate::samples::rounding::Rounding;
use crate::samples::uniform_series::UniformSeries;
use std::cell::OnceCell;
use std::f64::consts::PI;
use std::ops::Range;

/// Lowest frequency that is searched, in periods per record: below, lines cannot be distinguished from drift.
pub(super) const FEWEST_PERIODS: usize = 8;
/// Peaks of the periodogram that a sinusoid is fitted to, the highest over the local level.
const FITTED_PEAKS: usize = 3;
/// Ordinate of a sinusoid between two padded ordinates over the larger of these, at most, by which chance is judged before the fit: the
/// padding costs 0.9 dB, a factor of 1.23; the rest is for a level that changes over the few ordinates between two of its estimates.
const LARGEST_RISE: f64 = 1.5;
/// Least width of a resonance, in resolutions.
pub(super) const NARROWEST: f64 = 1.5;
/// Least −2 log-likelihood ratio of a sinusoid against a resonance for the latter to be taken.
const PREFERENCE: f64 = 10.0;
/// Least −2 log-likelihood ratio of a resonance against a sinusoid that changes for the latter to be taken: the frequency of the change was
/// chosen among 256, 2·ln 256, and its size and phase were fitted to some hundred ordinates, ln 100 for each.
const COST_OF_A_CHANGE: f64 = 20.0;
/// Least relative excess of a broad peak over the density around it; a smaller one may be an error of the background's shape.
const LEAST_EXCESS: f64 = 0.1;
/// An average is no peak within so many standard deviations of the level around it, which chance exceeds in one of a thousand.
const EXAMINED: f64 = 3.0;
/// Averages on either side that a broad peak is compared with.
const NEIGHBOURS: usize = 16;
/// An ordinate belongs to a sinusoid where it exceeds the background by so many standard deviations, at most so far from the
/// sinusoid, in padded ordinates.
const EXCEEDS: f64 = 3.0;
const MOST_REACHED: usize = 32 * PADDING;
/// Error of the frequency of a peak by three padded ordinates, in resolutions.
const INTERPOLATION: f64 = 0.01;
/// Most rounds of refits.
const REFITS: usize = 6;
/// Neighbouring samples over which the level of the noise is estimated, to see whether it changes. The square of such a level
/// has a relative error of 15 %, and a disturbance of a second or more is several of them.
const LEVEL_BLOCK: usize = 128;

/// A spectrum to be searched for lines.
#[derive(Clone)]
pub(super) struct Spectrum {
    pub periodogram: Periodogram,
    /// Of the samples, s.
    pub sample_period: f64,
    /// What its noise may be behind.
    filters: Filters,
    /// Independent exponential variables of mean 1 whose mean varies as an ordinate over its density does.
    pub independent: f64,
    /// What is the least density of the background: below it a spectrum shows the rounding to counts itself.
    pub(super) floor: Rounding,
}

impl Spectrum {
    /// Of a record whose straight line was removed; `None` if it is too short.
    pub(super) fn new(series: &UniformSeries) -> Option<Self> {
        Some(Self {
            periodogram: Periodogram::new(series)?,
            sample_period: series.sample_period(),
            filters: Filters::ReadEvery(series.read_every()),
            independent: independent_part(series),
            floor: series.rounding().clone(),
        })
    }

    /// Makes this the mean of the spectra that it is made of and of the `next` record of the same length.
    pub(super) fn average_with(&mut self, next: &Self) {
        self.periodogram.average_with(&next.periodogram);
        self.independent += next.independent;
    }
}

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

/// A line with the model by which it is removed from the record.
pub(super) enum Candidate {
    Sine(SpectralLine, Sine),
    Resonance(Resonance),
}

#[derive(Clone, Copy)]
pub(super) struct Resonance {
    pub line: SpectralLine,
    pub lorentz: Lorentz,
}

/// A record's spectrum divided by its background.
pub(super) struct WhitenedSpectrum<'a> {
    periodogram: &'a Periodogram,
    resolution: f64,
    background: Background<'a>,
    /// Ordinates at the multiples of the resolution, without the resonances that were removed.
    ordinates: Vec<f64>,
    /// The same over the background's shape; a resonance that is fitted once more needs a few of them.
    whitened: OnceCell<Vec<f64>>,
    /// Ordinates at the multiples of `1/PADDING` of the resolution, which a resonance does not need.
    padded: OnceCell<Vec<f64>>,
    /// The resonances that were removed.
    removed: Vec<Lorentz>,
    /// As those of the [`Spectrum`].
    independent: f64,
    floor: &'a Rounding,
    looks: f64,
}

impl<'a> WhitenedSpectrum<'a> {
    /// Removes the `resonances`, except the one with the index `kept`, from the spectrum.
    pub(super) fn new(
        spectrum: &'a Spectrum,
        known: &'a dyn Fn(f64) -> f64,
        resonances: &[Resonance],
        kept: Option<usize>,
    ) -> Option<Self> {
        Self::behind(spectrum, known, resonances, kept, spectrum.filters)
    }

    /// The same of noise that may be behind these `filters`.
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

    /// Ordinates at the multiples of the resolution, over the background's shape.
    fn whitened(&self) -> &[f64] {
        self.whitened.get_or_init(|| std::iter::once(0.0).chain(self.over_shape(1..self.ordinates.len())).collect())
    }

    /// Some of these, but for the first of all.
    fn over_shape(&self, bins: Range<usize>) -> impl Iterator<Item = f64> {
        bins.map(|bin| self.ordinates[bin] / self.background.shape_at(bin as f64))
    }

    /// Ordinates at the multiples of `1/PADDING` of the resolution, over the background's shape.
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

    /// Factor by which resonances were removed from an ordinate of [`padded`](Self::padded).
    fn deflation_at(&self, at: usize) -> f64 {
        deflation(&self.removed, at as f64 / PADDING as f64)
    }

    /// Least density of the background at a bin.
    fn floor_at(&self, bin: f64) -> f64 {
        self.floor.density(bin * self.resolution)
    }

    /// The most significant line, if one is significant.
    pub(super) fn most_significant(&self, series: &UniformSeries) -> Option<Candidate> {
        let sine = self.strongest_sine(series).filter(|(line, _)| line.p_value < SIGNIFICANCE);
        if let Some((line, sine)) = sine {
            let bin = line.frequency.value / self.resolution;
            let widths =
                (0..).map(|power| 2f64.powi(2 * power)).take_while(|width| *width < self.ordinates.len() as f64 / 32.0);
            // A sinusoid that is switched, or swells and fades, is a band of a few lines.
            let change = || {
                let density = 2.0 * sine.density(series) / line.statistic;
                Modulation::find(&sine, &sine.subtracted_from(series), density, |_| false)
            };
            let is_likelier = |lorentz: &Lorentz| {
                let over_sine = lorentz.statistic - line.statistic;
                over_sine > PREFERENCE
                    && change().is_none_or(|change| over_sine > change.with_multiples - COST_OF_A_CHANGE)
            };
            return Some(match self.resonance(bin, widths).filter(is_likelier) {
                Some(lorentz) => {
                    Candidate::Resonance(Resonance { line: self.resonance_line(&lorentz, line.p_value), lorentz })
                }
                None => Candidate::Sine(line, sine),
            });
        }
        let (bin, width, p_value) = self.broad_peak(1)?;
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
            let ratio = sine.density(series) * self.deflation_at(at) / background;
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
        let padded = self.padded();
        for at in PADDING * FEWEST_PERIODS..padded.len().saturating_sub(2 * PADDING) {
            let bin = at / PADDING;
            if bin >= until {
                // The level is computed at every few ordinates: it changes little over a fraction of its window.
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

    /// Probability of a peak of `ratio` times the background at any frequency: Baluev's bound, for a background that is
    /// estimated from `level.ordinates` ordinates, of which a part is independent.
    fn sine_p_value(&self, ratio: f64, level: LocalLevel) -> f64 {
        let ordinates = self.independent * level.ordinates;
        let one = (1.0 + ratio / ordinates).powf(-ordinates);
        let frequencies = self.ordinates.len() as f64 * (PI / 3.0).sqrt();
        (one * (1.0 + frequencies * ratio.sqrt())).min(1.0)
    }

    /// The most significant peak in averages of `4^least_log4` ordinates or more: its position and width in resolutions and its p-value.
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
            // An average over one ordinate cannot be shifted by half of it.
            for (offset, values) in [(0, &averages), (size / 2, &shifted)].into_iter().take(size) {
                for (at, (&value, level)) in values.iter().zip(&levels).enumerate() {
                    let [own, others] = [size as f64, level.ordinates].map(|count| self.independent * count);
                    let most = 1.0 + LEAST_EXCESS.max(EXAMINED * (1.0 / own + 1.0 / others).sqrt());
                    // The floor is not needed where the level alone is too near.
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

    /// The likeliest resonance near `bin`, by fits that begin with each of `widths`; all in resolutions.
    pub(super) fn resonance(&self, bin: f64, widths: impl IntoIterator<Item = f64>) -> Option<Lorentz> {
        let fits = self.lorentz_fits(bin, widths);
        fits.filter(|fit| fit.width > NARROWEST).max_by(|a, b| a.statistic.total_cmp(&b.statistic))
    }

    /// The likeliest of such curves, which may be as narrow as a sinusoid.
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

    /// The sinusoid whose peak is nearest to `bin`, within `width`, both in resolutions; and the padded ordinates that it reaches, with the
    /// densities that they would have without it.
    pub(super) fn sinusoid_near(&self, bin: f64, width: f64, p_value: f64) -> (SpectralLine, Vec<(usize, f64)>) {
        let padded = self.padded();
        let last = padded.len() - PADDING - 1;
        let position = |bin: f64| (bin * PADDING as f64).clamp(1.0, last as f64 - 1.0) as usize;
        let near = position(bin - width)..=position(bin + width);
        let highest = near.max_by(|&a, &b| padded[a].total_cmp(&padded[b])).unwrap_or(1);
        let level = self.background.level(self.whitened(), highest / PADDING).value;
        // The logarithm of the main lobe of a taper is a parabola but for a hundredth of the resolution.
        let [left, here, right] = [highest - 1, highest, highest + 1].map(|at| padded[at].ln());
        let curvature = 2.0 * here - left - right;
        let shift = if curvature > 0.0 { (0.5 * (right - left) / curvature).clamp(-0.5, 0.5) } else { 0.0 };
        let centre = (highest as f64 + shift) / PADDING as f64;
        let exceeds = |at: &usize| padded[*at] > level * (1.0 + EXCEEDS / self.independent.sqrt());
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
        // Energy of the sinusoid over the density of the noise, in all stretches together, and the scatter of both.
        let ratio = self.independent * over.max(0.0) / without(highest);
        let relative = 0.5 * (self.independent * ordinates + 2.0 * ratio).sqrt() / ratio;
        let deviation = (over.max(0.0) * self.resolution).sqrt();
        let by_noise = relative * 3f64.sqrt() / PI;
        let peak = (padded[highest] / level).max(1.0);
        let line = SpectralLine {
            // Cramér-Rao bound for a sinusoid in white noise, whose phase is another one in each stretch.
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
        let replaced = reached.map(|at| (at, without(at) / self.deflation_at(at))).collect();
        (line, replaced)
    }

    /// The line of which `lorentz` is the curve.
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

/// Factor on the ordinate at `bin` resolutions that removes resonances.
fn deflation(removed: &[Lorentz], bin: f64) -> f64 {
    removed.iter().fold(1.0, |factor, lorentz| factor * lorentz.deflation(bin))
}

/// Medians of the averages around each of them, each over `size` ordinates.
fn neighbourhoods(averages: &[f64], size: usize, looks: f64) -> Vec<LocalLevel> {
    // In ascending order.
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
        // The median of a gamma variable of shape g is about 1 − 1/(3g) of its mean. The median of many is worth the mean of
        // 2/π of them.
        let value = median / (1.0 - 1.0 / (3.0 * size as f64 * looks));
        LocalLevel { value, ordinates: (window.len() * size) as f64 * 2.0 / PI }
    };
    (0..averages.len()).map(&mut level).collect()
}

/// A sinusoid whose ordinate is `ratio` times the background, in a record of `duration` s.
pub(super) fn sine_line(sine: &Sine, duration: f64, ratio: f64, p_value: f64) -> SpectralLine {
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
/// first estimates of it, and those the background. The skirts of the first one, which is the strongest, may be taken for noise behind a
/// filter, so that neither has its form; it is then refitted to noise that is behind none, and kept if it has its form there.
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

    /// 450 s of white noise of deviation 2.3 at 204.8 Hz, with a resonance of deviation 3.5 at 5.9 Hz, 0.9 Hz wide: its skirts are as high as
    /// the noise at 2 and at 12 Hz, and are those of noise behind a filter of 8 taps.
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

    /// Chance refutes the form of one in 5,000: of 20, two in 60,000 cases.
    #[test]
    fn a_wide_resonance_has_its_form_and_no_filter() {
        let found = in_parallel(&(0..20).collect::<Vec<u64>>(), |seed| find_lines(&resonant(*seed)));
        let is_refuted = |lines: &&Vec<SpectralLine>| lines[0].shape_p_value < REFUTED;
        assert!(found.iter().filter(is_refuted).count() <= 1, "{found:?}");
        for lines in &found {
            let SpectralLine { frequency, width: Some(width), .. } = lines[0] else { panic!("{lines:?}") };
            // Of 95 %, and of 20 independent records: four deviations are exceeded in one of 800 cases.
            assert!((frequency.value - 5.9).abs() < 4.0 * frequency.error, "{frequency:?}");
            assert!((width.value - 0.9).abs() < 4.0 * width.error, "{width:?}");
        }
    }
}
