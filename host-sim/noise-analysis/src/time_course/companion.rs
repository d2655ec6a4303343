//! A line that moves, seen in another channel too, at a ratio of small whole numbers.
//!
//! A mechanical or electrical source shows in several channels and at multiples of its frequency. Where the fitted half
//! shows such a companion, its frequency in the unseen half foretells that of the line: like temperature, it is measured
//! beside the channel that is judged.

use super::moving::{Moving, least};
use super::parts::Parts;
use super::{SIGNIFICANCE, deviance_per_point};
use crate::OCTAVES;
use crate::series::Series;
use crate::spectra::Welch;
use crate::uniform_series::UniformSeries;
use allan_core::Curve;
use statrs::distribution::{ContinuousCDF, StudentsT};
use std::ops::Range;

/// Companion's frequency over the line's.
const RATIOS: [(u8, u8); 5] = [(1, 3), (1, 2), (1, 1), (2, 1), (3, 1)];
/// How far a line is sought from where it is on average, as a part of its frequency.
const BAND: f64 = 0.18;
/// Half width of what is taken for the line, as a part of its frequency.
const LINE: f64 = 0.05;
/// Resolution of the spectra, as a part of the frequency.
const RESOLUTION: f64 = 0.005;
/// Highest frequency that is sought, as a part of the sample rate: beyond, a band would fold.
const HIGHEST: f64 = 0.4;
/// Rounds of the fit along the path, one parameter after the other, and its first step.
const ROUNDS: usize = 12;
const FIRST_STEP: f64 = 0.02;

/// Another channel that shows where the line is.
#[derive(Debug, Clone, PartialEq)]
pub struct Companion {
    /// Position of the channel among those that were searched.
    pub channel: usize,
    /// Its frequency over the line's, as a fraction.
    pub ratio: (u8, u8),
    /// Correlation of the two frequencies' changes from epoch to epoch, fitted half.
    pub correlation: f64,
    /// Chance of as much in any channel at any ratio.
    pub p_value: f64,
    /// Mean and standard deviation of the line's frequency over the companion's, epoch by epoch, fitted half.
    pub measured_ratio: (f64, f64),
    /// Frequency of the line, Hz, in the epochs of the fitted half.
    pub line: Vec<f64>,
    /// Frequency of the companion, Hz, in the epochs of the fitted and of the unseen half.
    pub companion: [Vec<f64>; 2],
    /// Deviance per point on the unseen half of the model whose line is where the companion says.
    pub unseen: f64,
}

impl Companion {
    /// Looks for a companion of the line that moves in channel `of`; `None` if none moves or none goes with it.
    #[must_use]
    pub fn of(channels: &[Series], of: usize, moving: &Moving, parts: &Parts) -> Option<Self> {
        let near = moving.line_frequency()?;
        let (half, epoch) = (channels[of].values.len() / 2, parts.epoch);
        let fitted =
            |channel: usize, near: f64| track(&channels[channel], half % epoch, parts.fitted_epochs.len(), epoch, near);
        let unseen =
            |channel: usize, near: f64| track(&channels[channel], half, parts.unseen_epochs.len(), epoch, near);
        // Of the channel itself the fitted half alone.
        let mean = centroid(&channels[of], 0..half, near)?;
        let line = fitted(of, mean)?;
        let others = (0..channels.len()).filter(|&other| other != of);
        let candidates: Vec<(usize, (u8, u8))> = others.flat_map(|other| RATIOS.map(|ratio| (other, ratio))).collect();
        let tried = candidates.iter().filter_map(|&(channel, ratio)| {
            let near = mean * f64::from(ratio.0) / f64::from(ratio.1);
            let path = fitted(channel, near)?;
            let (correlation, chance) = correlation(&changes(&line), &changes(&path))?;
            let p_value = (chance * candidates.len() as f64).min(1.0);
            Some((channel, ratio, correlation, p_value, path, near))
        });
        let (channel, ratio, correlation, p_value, path, near) = tried.min_by(|a, b| a.3.total_cmp(&b.3))?;
        if p_value > SIGNIFICANCE || correlation < 0.0 {
            return None;
        }
        let companion = [path, unseen(channel, near)?];
        let ratios: Vec<f64> = line.iter().zip(&companion[0]).map(|(line, companion)| line / companion).collect();
        let unseen = foretell(moving, parts, &companion);
        Some(Self { channel, ratio, correlation, p_value, measured_ratio: moments(&ratios), line, companion, unseen })
    }
}

/// Frequencies of the line near `near` Hz in so many epochs from sample `start` on; `None` where one shows none.
fn track(series: &Series, start: usize, epochs: usize, epoch: usize, near: f64) -> Option<Vec<f64>> {
    (0..epochs).map(|k| start + k * epoch).map(|at| centroid(series, at..at + epoch, near)).collect()
}

/// Centre of what stands out of the spectrum around `near` Hz, Hz.
fn centroid(series: &Series, range: Range<usize>, near: f64) -> Option<f64> {
    let rate = 1.0 / series.period_s;
    if near > HIGHEST * rate {
        return None;
    }
    let length = ((rate / (RESOLUTION * near)) as usize).next_power_of_two();
    let stretch = Series {
        slots: series.slots.get(range.clone())?.to_vec(),
        values: series.values.get(range)?.to_vec(),
        period_s: series.period_s,
        resolution: series.resolution,
        unit: series.unit,
    };
    let welch = Welch::estimate(&UniformSeries::from_series(&stretch), length)?;
    let band: Vec<(f64, f64)> = welch.points().filter(|(f, _)| (f / near - 1.0).abs() < BAND).collect();
    let mut sorted: Vec<f64> = band.iter().map(|point| point.1).collect();
    sorted.sort_by(f64::total_cmp);
    let floor = *sorted.get(sorted.len() / 2)?;
    let above = |centre: f64| band.iter().filter(move |(f, _)| (f / centre - 1.0).abs() < LINE);
    let power = |centre: f64| above(centre).map(|(_, density)| density - floor).sum::<f64>();
    let peak = band.iter().map(|&(f, _)| (f, power(f))).max_by(|a, b| a.1.total_cmp(&b.1))?.0;
    let weight = |density: f64| (density - floor).max(0.0);
    let (moment, sum) =
        above(peak).fold((0.0, 0.0), |(moment, sum), &(f, d)| (moment + f * weight(d), sum + weight(d)));
    (sum > 0.0).then(|| moment / sum)
}

/// Steps of the logarithm: what two drifts have in common by chance is not in them.
fn changes(track: &[f64]) -> Vec<f64> {
    track.windows(2).map(|pair| (pair[1] / pair[0]).ln()).collect()
}

/// Mean and standard deviation.
fn moments(values: &[f64]) -> (f64, f64) {
    let count = values.len() as f64;
    let mean = values.iter().sum::<f64>() / count;
    (mean, (values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / (count - 1.0)).sqrt())
}

/// Pearson's correlation and the chance of as much either way between independent normal numbers.
fn correlation(a: &[f64], b: &[f64]) -> Option<(f64, f64)> {
    let ((mean_a, deviation_a), (mean_b, deviation_b)) = (moments(a), moments(b));
    let freedom = a.len() as f64 - 2.0;
    let products: f64 = a.iter().zip(b).map(|(a, b)| (a - mean_a) * (b - mean_b)).sum();
    let correlation = products / (deviation_a * deviation_b * (freedom + 1.0));
    let t = correlation * (freedom / (1.0 - correlation * correlation)).sqrt();
    let law = StudentsT::new(0.0, 1.0, freedom).ok()?;
    t.is_finite().then(|| (correlation, 2.0 * law.sf(t.abs())))
}

/// Deviance per point on the unseen half of the model whose line follows `companion`.
///
/// What the path does not tell — where the line is in units of the companion, how wide it is when it does not move, its
/// amplitude, and the white level — is fitted to the later quarter of the fitted half along the companion's path there.
fn foretell(moving: &Moving, parts: &Parts, [fitted, unseen]: &[Vec<f64>; 2]) -> f64 {
    let Some(near) = moving.line_frequency() else { return f64::NAN };
    let quarter = &parts.quarters[1];
    let recent = &fitted[fitted.len() / 2..];
    let start = (recent.len() as f64 * near / recent.iter().sum::<f64>()).ln();
    // Of level, frequency over the companion's, width and amplitude.
    let mut shape = [0.0, start, -0.5, 0.0];
    let model = |shape: [f64; 4], path: &[f64], n: u64| {
        let at = |&f: &f64| moving.along(shape[0], shape[1] + (f / near).ln(), shape[2], shape[3]).avar(n);
        path.iter().map(at).sum::<f64>() / path.len() as f64
    };
    let deviance =
        |shape: [f64; 4], path: &[f64], curve: &Curve<OCTAVES>| deviance_per_point(curve, |n| model(shape, path, n));
    for _ in 0..ROUNDS {
        for index in 0..shape.len() {
            let trial = |value: f64| {
                let mut shape = shape;
                shape[index] = value;
                deviance(shape, recent, quarter)
            };
            shape[index] = least(trial, shape[index], FIRST_STEP, f64::INFINITY);
        }
    }
    deviance(shape, unseen, &parts.unseen)
}
