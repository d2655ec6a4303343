//! A line of another channel whose frequency moves with a channel's line, at a ratio of small whole numbers.
//!
//! Its frequency in the second half predicts that of the channel's own line there.

use super::epochs::{ComparedCurve, EpochCurves, SIGNIFICANCE};
use super::prediction::mean_avar;
use super::tracked_parameters::{TrackedModel, minimum};
use crate::distributions::student_tail;
use crate::record::sample_curves::SampleCurves;
use crate::samples::series::Series;
use crate::samples::uniform_series::UniformSeries;
use crate::spectra::Welch;
use allan_core::Model;
use serde::Serialize;
use std::ops::Range;

/// Ratios of the related line's frequency to the line's.
const RATIOS: [(u8, u8); 5] = [(1, 3), (1, 2), (1, 1), (2, 1), (3, 1)];
/// Half-width of the searched band, over the frequency.
const BAND: f64 = 0.18;
/// Half-width of the band with the line's power, over the frequency.
const LINE: f64 = 0.05;
/// Resolution of the spectra, over the frequency.
const RESOLUTION: f64 = 0.005;
/// Highest frequency searched, over the sample rate: the band stays below the Nyquist frequency.
const MAX_FREQUENCY: f64 = 0.4;
/// Rounds of the coordinate search, and its first step.
const ROUNDS: usize = 12;
const FIRST_STEP: f64 = 0.02;

pub(crate) struct LineSource<'a> {
    pub name: &'static str,
    pub series: &'a Series,
    /// Curves of the samples, if `series` has means.
    pub samples: &'a SampleCurves,
}

/// A line of another channel that moves with this channel's.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RelatedLine {
    pub channel: String,
    /// Frequency over the line's, as a fraction.
    pub ratio: (u8, u8),
    /// Correlation of both frequencies' changes between epochs of the first half.
    pub correlation: f64,
    /// Probability of as much between unrelated lines, in any channel at any ratio.
    pub p_value: f64,
    /// Mean over the epochs of the first half.
    pub measured_ratio: f64,
    pub measured_ratio_deviation: f64,
    /// Frequency of the line, Hz, in the epochs of the first half.
    pub line_hz: Vec<f64>,
    /// Frequency of the related line, Hz, in the epochs of the first half.
    pub related_fitted_hz: Vec<f64>,
    /// Frequency of the related line, Hz, in the epochs of the second half.
    pub related_unseen_hz: Vec<f64>,
    /// Deviance per point on the second half, with the line where the other channel's second half has the related line.
    pub unseen: f64,
}

impl RelatedLine {
    /// Searches the other channels for a line that moves with the tracked line of channel `of`.
    pub(crate) fn find(channels: &[LineSource], of: usize, model: &TrackedModel, curves: &EpochCurves) -> Option<Self> {
        let near = model.line_frequency()?;
        let frequencies = |channel: usize, near: f64, epochs: &[Range<u64>]| -> Option<Vec<f64>> {
            epochs.iter().map(|slots| centroid(&channels[channel], slots.clone(), near)).collect()
        };
        let [fitted, unseen] = &curves.ranges;
        // The second half of the channel itself is not used.
        let middle = unseen.first()?.start;
        let mean = centroid(&channels[of], channels[of].series.span.start..middle, near)?;
        let line = frequencies(of, mean, fitted)?;
        let others = (0..channels.len()).filter(|&other| other != of);
        let candidates: Vec<(usize, (u8, u8))> = others.flat_map(|other| RATIOS.map(|ratio| (other, ratio))).collect();
        let tried = candidates.iter().filter_map(|&(channel, ratio)| {
            let near = mean * f64::from(ratio.0) / f64::from(ratio.1);
            let related = frequencies(channel, near, fitted)?;
            // A line that moves the other way must not hide a related one.
            let (correlation, chance) =
                correlation(&changes(&line), &changes(&related)).filter(|(correlation, _)| *correlation >= 0.0)?;
            let p_value = (chance * candidates.len() as f64).min(1.0);
            Some((channel, ratio, correlation, p_value, related, near))
        });
        let (channel, ratio, correlation, p_value, related_fitted_hz, near) =
            tried.min_by(|a, b| a.3.total_cmp(&b.3))?;
        if p_value > SIGNIFICANCE {
            return None;
        }
        let related_unseen_hz = frequencies(channel, near, unseen)?;
        let ratios: Vec<f64> = line.iter().zip(&related_fitted_hz).map(|(line, related)| line / related).collect();
        let (measured_ratio, measured_ratio_deviation) = moments(&ratios);
        Some(Self {
            channel: channels[channel].name.to_owned(),
            ratio,
            correlation,
            p_value,
            measured_ratio,
            measured_ratio_deviation,
            unseen: predict(model, curves, [&related_fitted_hz, &related_unseen_hz]),
            line_hz: line,
            related_fitted_hz,
            related_unseen_hz,
        })
    }
}

/// Centroid, Hz, of the strongest line around `near` Hz in the sample periods `slots`, above the band's median.
fn centroid(channel: &LineSource, slots: Range<u64>, near: f64) -> Option<f64> {
    let welch = spectrum(channel, slots, near)?;
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

/// Spectrum of the sample periods `slots` that resolves a line near `near` Hz; `None` if the samples do not suffice.
fn spectrum(channel: &LineSource, slots: Range<u64>, near: f64) -> Option<Welch> {
    let LineSource { series, samples, .. } = channel;
    let rate = 1.0 / series.period_s;
    if near > MAX_FREQUENCY * rate {
        let of_samples = samples.spectrum_within(samples.slots_of(slots));
        return of_samples.filter(|spectrum| near <= MAX_FREQUENCY / spectrum.sample_period());
    }
    let length = ((rate / (RESOLUTION * near)) as usize).next_power_of_two();
    let position = |slot: u64| series.slots.partition_point(|&of| of < slot);
    let range = position(slots.start)..position(slots.end);
    let stretch = Series {
        span: slots,
        slots: series.slots[range.clone()].into(),
        values: series.values[range].into(),
        ..**series
    };
    Welch::estimate(&UniformSeries::from_series(&stretch), length)
}

/// Changes of ln f between epochs; unrelated drifts correlate, their changes do not.
fn changes(frequencies: &[f64]) -> Vec<f64> {
    frequencies.windows(2).map(|pair| (pair[1] / pair[0]).ln()).collect()
}

fn moments(values: &[f64]) -> (f64, f64) {
    let count = values.len() as f64;
    let mean = values.iter().sum::<f64>() / count;
    (mean, (values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / (count - 1.0)).sqrt())
}

/// Pearson's correlation and its two-sided p-value between independent normal numbers.
fn correlation(a: &[f64], b: &[f64]) -> Option<(f64, f64)> {
    let ((mean_a, deviation_a), (mean_b, deviation_b)) = (moments(a), moments(b));
    let degrees_of_freedom = a.len() as f64 - 2.0;
    let products: f64 = a.iter().zip(b).map(|(a, b)| (a - mean_a) * (b - mean_b)).sum();
    let correlation = products / (deviation_a * deviation_b * (degrees_of_freedom + 1.0));
    let t = correlation * (degrees_of_freedom / (1.0 - correlation * correlation)).sqrt();
    let is_known = t.is_finite() && degrees_of_freedom > 0.0;
    is_known.then(|| (correlation, 2.0 * student_tail(t.abs(), degrees_of_freedom)))
}

/// Deviance per point on the second half of the model whose line moves with the related one.
fn predict(tracked: &TrackedModel, curves: &EpochCurves, [fitted, unseen]: [&[f64]; 2]) -> f64 {
    let Some(near) = tracked.line_frequency() else { return f64::NAN };
    let quarter = ComparedCurve::new(&curves.quarters[1], tracked.model());
    let recent = &fitted[fitted.len() / 2..];
    let start = (recent.len() as f64 * near / recent.iter().sum::<f64>()).ln();
    // Logarithms of level, frequency ratio, width and amplitude.
    let mut shape = [0.0, start, -0.5, 0.0];
    let deviance = |shape: [f64; 4], frequencies: &[f64], curve: &ComparedCurve| {
        let model = |f: &f64| tracked.with_line_shape(shape[0], shape[1] + (f / near).ln(), shape[2], shape[3]);
        let models: Vec<Model> = frequencies.iter().map(model).collect();
        curve.deviance_per_point(|n| mean_avar(&models, n))
    };
    for _ in 0..ROUNDS {
        for index in 0..shape.len() {
            let trial = |value: f64| {
                let mut shape = shape;
                shape[index] = value;
                deviance(shape, recent, &quarter)
            };
            shape[index] = minimum(trial, shape[index], FIRST_STEP, f64::INFINITY);
        }
    }
    deviance(shape, unseen, &ComparedCurve::new(&curves.unseen, tracked.model()))
}
