//! The Allan deviation from a measured spectrum by equation (5) of the paper (IEEE Std 952).

use super::welch::Welch;
use crate::samples::uniform_series::UniformSeries;
use std::f64::consts::PI;

/// Shortest segment of a spectrum, samples.
const SHORTEST: usize = 1 << 10;
/// Each segment length over the one before.
const LENGTH_STEP: usize = 8;
/// Least segment length over the averaging time. A random walk loses 7.5·τ/T = 12 % of its variance below 2.5 cycles.
const SEGMENT_PER_TAU: u64 = 64;
/// [`SEGMENT_PER_TAU`] at the longest averaging times, with segments about as long as the record.
const LEAST_SEGMENT_PER_TAU: u64 = 16;

/// σ²(τ) = 4·∫ S(f)·sin⁴(πfτ)/(πfτ)² df of `series` at the averaging factors `factors`, with the measured two-sided
/// density S.
///
/// `None` for averaging times of more than a sixteenth of the record, which the spectrum does not resolve, and of a
/// record without a segment of 1,024 samples of which half are there.
#[must_use]
pub fn allan_deviations_by_spectrum(series: &UniformSeries, factors: &[u64]) -> Vec<Option<f64>> {
    let longest = series.values().len();
    let mut lengths: Vec<usize> = std::iter::successors(Some(SHORTEST), |length| Some(length * LENGTH_STEP))
        .take_while(|of| *of <= longest)
        .collect();
    if let Some(last) = longest.checked_ilog2().map(|log2| 1 << log2)
        && last >= SHORTEST
        && lengths.last() != Some(&last)
    {
        lengths.push(last);
    }
    let mut deviations = vec![None; factors.len()];
    for (position, &length) in lengths.iter().enumerate() {
        let is_last = position + 1 == lengths.len();
        let per_tau = if is_last { LEAST_SEGMENT_PER_TAU } else { SEGMENT_PER_TAU };
        let is_resolved = |n: u64| n.checked_mul(per_tau).is_some_and(|needed| needed <= length as u64);
        let wanted: Vec<usize> =
            (0..factors.len()).filter(|&at| deviations[at].is_none() && is_resolved(factors[at])).collect();
        if wanted.is_empty() {
            continue;
        }
        let Some(welch) = Welch::estimate(series, length) else { continue };
        for at in wanted {
            deviations[at] = Some(allan_variance(&welch, factors[at]).sqrt());
        }
    }
    deviations
}

/// The integral at the averaging factor `n`.
fn allan_variance(welch: &Welch, n: u64) -> f64 {
    let last = 0.5 / welch.sample_period();
    let term = |(frequency, density): (f64, f64)| {
        // The point at half the sample rate has half an interval.
        let part = if frequency < last * (1.0 - 1e-9) { 1.0 } else { 0.5 };
        part * weight(PI * frequency * welch.sample_period(), n) * density
    };
    welch.resolution() * welch.points().map(term).sum::<f64>()
}

/// Weight of the one-sided density at `phase` = πf·dt and the averaging factor `n`.
///
/// Twice for one-sided; sin(πfτ)/(n·sin(πf·dt)) is the mean of `n` samples, whose density includes aliases.
fn weight(phase: f64, n: u64) -> f64 {
    let n = n as f64;
    if phase == 0.0 { 0.0 } else { 2.0 * (n * phase).sin().powi(4) / (n * phase.sin()).powi(2) }
}
