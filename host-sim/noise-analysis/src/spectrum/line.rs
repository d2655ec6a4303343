//! Lines in a spectrum: sinusoids, and resonances that are wider than the record's resolution.
//!
//! A sinusoid is tested by the likelihood ratio of its least-squares fit in the locally white background; the p-value counts
//! all the frequencies that were looked at (R. Baluev, "Assessing the statistical significance of periodogram peaks", 2008)
//! and that the background is an estimate itself. A resonance is sought in averages over 4, 16, 64 … ordinates. Which of
//! the two a peak is, the larger likelihood says.

use super::background::{Background, Level, median};
use super::lorentz::Lorentz;
use super::periodogram::{PADDING, Periodogram};
use super::sine::Sine;
use crate::grid::Grid;
use statrs::function::beta::beta_reg;
use std::f64::consts::PI;

/// Chance that a record of a channel without any line shows one sinusoid or more; as much again for a resonance.
pub const FALSE_ALARM: f64 = 2e-4;

/// Lines below this many periods in the record are not told from its drift.
pub const FEWEST_PERIODS: usize = 8;

/// Lines that are sought in a record.
const MOST: usize = 6;
/// A resonance is broader than this many resolutions …
const NARROWEST: f64 = 1.5;
/// … and likelier than a sinusoid by this −2 log-likelihood ratio.
const PREFERENCE: f64 = 10.0;
/// Excess over its surroundings below which a broad hump may be the background's own shape.
const LEAST_EXCESS: f64 = 0.1;
/// Averages on either side that a hump is compared with.
const NEIGHBOURS: usize = 16;
/// Rounds in which resonances and background are fitted again.
const POLISHING: usize = 1;
/// Resonances up to which they are fitted again whenever one comes.
const POLISHED: usize = 2;
/// Within so many widths of a resonance, a line with less than this share of its statistic belongs to it.
const SKIRTS: f64 = 20.0;
const BLEMISH: f64 = 0.02;

/// A value with its standard deviation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Estimate {
    /// Likeliest value.
    pub value: f64,
    /// Standard deviation by the likelihood's curvature.
    pub error: f64,
}

/// A line that stands out of the background.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Line {
    /// Hz.
    pub frequency: Estimate,
    /// Standard deviation of the line's signal, in the unit of the grid; a sinusoid's amplitude is √2 of it.
    pub deviation: Estimate,
    /// Full width at half maximum in Hz; `None` for a sinusoid: no wider than the record resolves.
    pub width: Option<Estimate>,
    /// −2 log-likelihood ratio of the background alone against background and line.
    pub statistic: f64,
    /// Chance that a record without a line shows such a peak anywhere.
    pub p_value: f64,
}

impl Line {
    /// Of the sinusoid; for a resonance, of the sinusoid with as much power.
    #[must_use]
    pub fn amplitude(&self) -> Estimate {
        let root = 2f64.sqrt();
        Estimate { value: root * self.deviation.value, error: root * self.deviation.error }
    }
}

/// The lines of a grid with a chance below [`FALSE_ALARM`], the strongest first.
///
/// Frequencies from [`FEWEST_PERIODS`] in the record up to half the sample rate, or less where the quantization is coarser
/// than the noise ([`Grid::dithered`]). A record of fewer than some hundred samples
/// has too few ordinates to tell a line.
#[must_use]
pub fn lines(grid: &Grid) -> Vec<Line> {
    lines_over(grid, |_| 1.0)
}

/// As [`lines`], where the background is white, flicker and walking noise times a density that is `known` at every
/// frequency in Hz.
#[must_use]
pub fn lines_over(grid: &Grid, known: impl Fn(f64) -> f64) -> Vec<Line> {
    let known: &dyn Fn(f64) -> f64 = &known;
    let mut rest = grid.clone().dithered().detrended();
    let mut sines = Vec::new();
    let mut resonances: Vec<Resonance> = Vec::new();
    while sines.len() + resonances.len() < MOST
        && let Some(spectrum) = Spectrum::of(&rest, known, &resonances, None)
    {
        match spectrum.most_significant(&rest) {
            Some(Found::Sine(line, sine)) => {
                rest = sine.taken_from(&rest);
                sines.push(line);
            }
            Some(Found::Resonance(resonance)) => {
                resonances.push(resonance);
                // Every round transforms the whole record for every resonance.
                if resonances.len() <= POLISHED {
                    polish(&rest, known, &mut resonances);
                }
            }
            None => break,
        }
    }
    let mut found: Vec<Line> = sines.into_iter().chain(resonances.iter().map(|resonance| resonance.line)).collect();
    found.sort_by(|a, b| b.statistic.total_cmp(&a.statistic));
    let all = found.clone();
    found.retain(|line| !all.iter().any(|strong| is_blemish(line, strong)));
    found
}

/// Fits each resonance again over the background that is left when all are gone: a strong one bends the first estimate.
fn polish(rest: &Grid, known: &dyn Fn(f64) -> f64, resonances: &mut [Resonance]) {
    for _ in 0..POLISHING {
        for index in 0..resonances.len() {
            let Some(spectrum) = Spectrum::of(rest, known, resonances, Some(index)) else { return };
            let Resonance { line, lorentz } = resonances[index];
            if let Some(better) = spectrum.resonance(lorentz.centre, [lorentz.width]) {
                resonances[index] = Resonance { line: spectrum.line_of(&better, line.p_value), lorentz: better };
            }
        }
    }
}

/// Whether `line` is what the form of a far stronger resonance leaves on its skirts.
fn is_blemish(line: &Line, strong: &Line) -> bool {
    strong.width.is_some_and(|width| {
        let distance = (line.frequency.value - strong.frequency.value).abs();
        distance > 0.0 && distance < SKIRTS * width.value && line.statistic < BLEMISH * strong.statistic
    })
}

/// A line, with what takes it out of the record.
enum Found {
    Sine(Line, Sine),
    Resonance(Resonance),
}

#[derive(Clone, Copy)]
struct Resonance {
    line: Line,
    lorentz: Lorentz,
}

/// A record's spectrum over its background.
struct Spectrum<'a> {
    resolution: f64,
    background: Background<'a>,
    /// Ordinates at the multiples of the resolution over the background's shape.
    whitened: Vec<f64>,
    /// Ordinates at the multiples of `1/PADDING` of it.
    padded: Vec<f64>,
    /// What each of these was multiplied with to take resonances away.
    deflation: Vec<f64>,
}

impl<'a> Spectrum<'a> {
    /// Without the `resonances`, except the one that is to be `kept`.
    fn of(grid: &Grid, known: &'a dyn Fn(f64) -> f64, resonances: &[Resonance], kept: Option<usize>) -> Option<Self> {
        let periodogram = Periodogram::of(grid)?;
        let deflation = |bin: f64, but: Option<usize>| {
            let others = resonances.iter().enumerate().filter(|(index, _)| Some(*index) != but);
            others.map(|(_, resonance)| resonance.lorentz.deflation(bin)).product::<f64>()
        };
        let mut density = periodogram.independent();
        for (bin, ordinate) in density.iter_mut().enumerate() {
            *ordinate *= deflation(bin as f64, None);
        }
        let background = Background::of(&density, known, periodogram.resolution(), grid.sample_period())?;
        let bin = |at: usize| at as f64 / PADDING as f64;
        let deflation: Vec<f64> = (0..periodogram.padded().len()).map(|at| deflation(bin(at), kept)).collect();
        let over_shape = |(at, (ordinate, deflation)): (usize, (&f64, &f64))| match at {
            0 => 0.0,
            at => ordinate * deflation / background.shape_at(bin(at)),
        };
        let padded: Vec<f64> = periodogram.padded().iter().zip(&deflation).enumerate().map(over_shape).collect();
        let whitened = padded.iter().copied().step_by(PADDING).collect();
        Some(Self { resolution: periodogram.resolution(), background, whitened, padded, deflation })
    }

    /// The most significant line, if one is significant.
    fn most_significant(&self, grid: &Grid) -> Option<Found> {
        let sine = self.sine(grid).filter(|(line, _)| line.p_value < FALSE_ALARM);
        if let Some((line, sine)) = sine {
            let bin = line.frequency.value / self.resolution;
            let widths =
                (0..).map(|power| 2f64.powi(2 * power)).take_while(|width| *width < self.whitened.len() as f64 / 32.0);
            let resonance = self.resonance(bin, widths);
            return Some(match resonance {
                Some(lorentz) if lorentz.statistic > line.statistic + PREFERENCE => {
                    Found::Resonance(Resonance { line: self.line_of(&lorentz, line.p_value), lorentz })
                }
                _ => Found::Sine(line, sine),
            });
        }
        let (bin, width, p_value) = self.hump()?;
        let lorentz = self.resonance(bin, [width / 2.0, width, 2.0 * width])?;
        Some(Found::Resonance(Resonance { line: self.line_of(&lorentz, p_value), lorentz }))
    }

    /// The sinusoid that stands out most.
    fn sine(&self, grid: &Grid) -> Option<(Line, Sine)> {
        let mut peaks: Vec<(f64, usize)> = self.peaks();
        peaks.sort_by(|a, b| b.0.total_cmp(&a.0));
        peaks.truncate(3);
        let candidates = peaks.into_iter().map(|(_, at)| {
            let spacing = self.resolution / PADDING as f64;
            let sine = Sine::near(grid, at as f64 * spacing, spacing);
            let bin = sine.frequency / self.resolution;
            let level = self.background.level(&self.whitened, at / PADDING);
            let ratio = sine.density(grid) * self.deflation[at] / (level.value * self.background.shape_at(bin));
            (ratio, level, sine)
        });
        let (ratio, level, sine) = candidates.max_by(|a, b| a.0.total_cmp(&b.0))?;
        let amplitude = sine.amplitude();
        let line = Line {
            // Cramér-Rao bound of a sine in white noise.
            frequency: Estimate { value: sine.frequency, error: 1.5f64.sqrt() / (PI * grid.duration() * ratio.sqrt()) },
            deviation: Estimate { value: amplitude / 2f64.sqrt(), error: amplitude / (2.0 * ratio.sqrt()) },
            width: None,
            statistic: 2.0 * ratio,
            p_value: self.chance_of_sine(ratio, level),
        };
        Some((line, sine))
    }

    /// Summits among the padded ordinates, over the local level.
    fn peaks(&self) -> Vec<(f64, usize)> {
        let mut level = 1.0;
        let mut until = 0;
        let mut peaks = Vec::new();
        for at in PADDING * FEWEST_PERIODS..self.padded.len().saturating_sub(2 * PADDING) {
            let bin = at / PADDING;
            if bin >= until {
                // The level changes little over a fraction of its window.
                level = self.background.level(&self.whitened, bin).value;
                until = bin + (bin / 16).clamp(1, 32);
            }
            let [left, here, right] = [self.padded[at - 1], self.padded[at], self.padded[at + 1]];
            if here >= left && here > right && here > 4.0 * level {
                peaks.push((here / level, at));
            }
        }
        peaks
    }

    /// Chance of a peak of `ratio` times the background anywhere: Baluev's bound, over a background that is the mean of
    /// some ordinates instead of exact.
    fn chance_of_sine(&self, ratio: f64, level: Level) -> f64 {
        let one = (1.0 + ratio / level.ordinates).powf(-level.ordinates);
        let frequencies = self.whitened.len() as f64 * (PI / 3.0).sqrt();
        (one * (1.0 + frequencies * ratio.sqrt())).min(1.0)
    }

    /// The most significant hump: its place and width in resolutions and its p-value.
    fn hump(&self) -> Option<(f64, f64, f64)> {
        let ordinates = self.whitened.len();
        let sizes = || (1..).map(|power| 4_usize.pow(power)).take_while(move |size| *size <= ordinates / 64);
        let trials: f64 = sizes().map(|size| 2.0 * ordinates as f64 / size as f64).sum();
        let humps = sizes().flat_map(|size| {
            let first = FEWEST_PERIODS.max(size);
            let averages: Vec<f64> = self.whitened[first..ordinates - 1]
                .chunks_exact(size)
                .map(|chunk| chunk.iter().sum::<f64>() / size as f64)
                .collect();
            let shifted = self.whitened[first + size / 2..ordinates - 1].chunks_exact(size);
            let shifted: Vec<f64> = shifted.map(|chunk| chunk.iter().sum::<f64>() / size as f64).collect();
            let mut humps = Vec::new();
            for (offset, values) in [(0, &averages), (size / 2, &shifted)] {
                for (at, &value) in values.iter().enumerate() {
                    let level = neighbourhood(&averages, at, size);
                    let excess = value / level.value;
                    if excess > 1.0 + LEAST_EXCESS {
                        let p_value = trials * upper_tail(excess, size as f64, level.ordinates);
                        let centre = (first + offset + at * size) as f64 + size as f64 / 2.0;
                        humps.push((centre, size as f64, p_value));
                    }
                }
            }
            humps
        });
        humps.min_by(|a, b| a.2.total_cmp(&b.2)).filter(|hump| hump.2 < FALSE_ALARM)
    }

    /// The likeliest resonance near `bin` among several starting widths, in resolutions.
    fn resonance(&self, bin: f64, widths: impl IntoIterator<Item = f64>) -> Option<Lorentz> {
        let fits = widths.into_iter().filter_map(|width| Lorentz::fit(&self.whitened, FEWEST_PERIODS, bin, width));
        fits.filter(|fit| fit.width > NARROWEST).max_by(|a, b| a.statistic.total_cmp(&b.statistic))
    }

    fn line_of(&self, lorentz: &Lorentz, p_value: f64) -> Line {
        let height = lorentz.height * lorentz.level * self.background.shape_at(lorentz.centre);
        let width = lorentz.width * self.resolution;
        // Area of a Lorentz curve.
        let deviation = (height * width * PI / 2.0).sqrt();
        let [_, centre, relative_width] = lorentz.errors;
        Line {
            frequency: Estimate { value: lorentz.centre * self.resolution, error: centre * self.resolution },
            deviation: Estimate { value: deviation, error: deviation * lorentz.area_error() / 2.0 },
            width: Some(Estimate { value: width, error: width * relative_width }),
            statistic: lorentz.statistic,
            p_value,
        }
    }
}

/// Median of the averages around one of them.
fn neighbourhood(averages: &[f64], at: usize, size: usize) -> Level {
    let low = at.saturating_sub(NEIGHBOURS);
    let high = (at + NEIGHBOURS).min(averages.len() - 1);
    let mut window = averages[low..=high].to_vec();
    // The median of a gamma variable of shape g is about 1 − 1/(3g) of its mean, and varies as 2/π of the mean does.
    let value = median(&mut window) / (1.0 - 1.0 / (3.0 * size as f64));
    Level { value, ordinates: (window.len() * size) as f64 * 2.0 / PI }
}

/// Chance that the mean of `above` exponential variables exceeds `ratio` times the mean of `below` others.
fn upper_tail(ratio: f64, above: f64, below: f64) -> f64 {
    beta_reg(below, above, below / (below + above * ratio))
}
