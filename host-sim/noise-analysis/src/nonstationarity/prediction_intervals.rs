//! Prediction intervals of the noise of the next epoch, octave by octave.
//!
//! The logarithm of an octave's Allan variance is a random walk measured by each epoch (local level model; A. Harvey,
//! 1989). Predictions for all step variances are averaged by their posterior probabilities, equal at first.

use super::epochs::{EpochCurves, MIN_AVERAGES};
use allan_core::{AllanPoint, Curve, Model};
use serde::Serialize;
use statrs::distribution::{ContinuousCDF, Normal};

/// Step variances over the variance of an epoch's estimate: 0, and powers of 4.
const STEPS: [f64; 11] = [0.0, 1.0 / 64.0, 1.0 / 16.0, 0.25, 1.0, 4.0, 16.0, 64.0, 256.0, 1024.0, 4096.0];
/// Probability on either side of a prediction interval of 95 %.
const TAIL: f64 = 0.025;

/// Octaves of the second half's epochs within their 95 % prediction intervals.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct IntervalCoverage {
    /// Octaves that were predicted, in all epochs of the second half.
    pub octaves: usize,
    pub within: usize,
}

impl IntervalCoverage {
    /// Predicts each octave of each epoch of the second half; `model` gives the degrees of freedom.
    #[must_use]
    pub(crate) fn of_second_half(curves: &EpochCurves, model: &Model) -> Self {
        let (mut octaves, mut within) = (0, 0);
        let longest = curves.epoch / MIN_AVERAGES;
        for n in (0..=longest.ilog2()).map(|octave| 1_u64 << octave) {
            let measured = |epoch: &Curve<_>| {
                let is_at = |point: &&AllanPoint| point.n == n && point.avar > 0.0;
                epoch.points().iter().find(is_at).map(|point| (point.avar.ln(), log_variance(model.edf(point))))
            };
            let mut level = None;
            for epoch in &curves.fitted_epochs {
                update(&mut level, measured(epoch));
            }
            for epoch in &curves.unseen_epochs {
                if let (Some(level), Some((value, variance))) = (&level, measured(epoch)) {
                    octaves += 1;
                    within += usize::from((TAIL..1.0 - TAIL).contains(&level.probability_below(value, variance)));
                }
                update(&mut level, measured(epoch));
            }
        }
        Self { octaves, within }
    }
}

/// Variance of ln of a variance with `edf` degrees of freedom: trigamma of `edf/2` (Abramowitz and Stegun, 6.4.12).
fn log_variance(edf: f64) -> f64 {
    let x = edf / 2.0;
    1.0 / x + 0.5 / (x * x) + 1.0 / (6.0 * x * x * x)
}

fn update(level: &mut Option<LocalLevel>, measured: Option<(f64, f64)>) {
    let Some((value, variance)) = measured else { return };
    match level {
        Some(level) => level.update(value, variance),
        None => *level = Some(LocalLevel::new(value, variance)),
    }
}

/// A Kalman filter of a random walk.
struct LocalLevel {
    filters: Vec<StepFilter>,
}

struct StepFilter {
    step: f64,
    /// Predicted value, and its variance without that of the measurement.
    level: f64,
    variance: f64,
    log_likelihood: f64,
}

impl LocalLevel {
    fn new(value: f64, variance: f64) -> Self {
        let filter = |step: &f64| {
            let step = step * variance;
            StepFilter { step, level: value, variance: variance + step, log_likelihood: 0.0 }
        };
        Self { filters: STEPS.iter().map(filter).collect() }
    }

    /// Probability that the next value, of measurement variance `variance`, is below `value`.
    fn probability_below(&self, value: f64, variance: f64) -> f64 {
        let largest = self.filters.iter().map(|filter| filter.log_likelihood).fold(f64::NEG_INFINITY, f64::max);
        let (mut below, mut weights) = (0.0, 0.0);
        for filter in &self.filters {
            let weight = (filter.log_likelihood - largest).exp();
            let sigma = (filter.variance + variance).sqrt();
            below += weight * Normal::standard().cdf((value - filter.level) / sigma);
            weights += weight;
        }
        below / weights
    }

    fn update(&mut self, value: f64, variance: f64) {
        for filter in &mut self.filters {
            let (difference, expected) = (value - filter.level, filter.variance + variance);
            filter.log_likelihood -= 0.5 * (expected.ln() + difference * difference / expected);
            let gain = filter.variance / expected;
            filter.level += gain * difference;
            filter.variance = filter.variance * (1.0 - gain) + filter.step;
        }
    }
}
