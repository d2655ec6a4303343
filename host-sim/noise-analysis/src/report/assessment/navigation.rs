//! The error of an angle or a velocity that is integrated without aiding.
//!
//! The vehicle stands still for [`CALIBRATION_S`], takes the mean of these `c` samples as the bias, and integrates the next
//! `t` samples. The error is `S_t − (t/c)·S_c` with the sums `S` of the samples. With `V(m)` the variance of the sum of `m`
//! samples and `r = t/c`, its variance is `r(1 + r)·V(c) + (1 + r)·V(t) − r·V(c + t)`; for `t = c` that is `2t²` Allan
//! variances. It is finite for a random walk too, because constants and ramps of the sums cancel.

use crate::distributions::chi_squared_quantile;
use crate::samples::uniform_series::UniformSeries;
use allan_core::Model;

/// Time over which the bias is estimated, s.
pub const CALIBRATION_S: f64 = 60.0;
/// Times of integration that are reported, s.
pub const TIMES_S: [f64; 3] = [10.0, 60.0, 600.0];

/// Integrations of the data start at so many times within the length of one; more would be redundant.
const OVERLAP: usize = 8;
/// Largest part of a window's samples that may be missing; they are replaced by its mean.
const MAX_MISSING: f64 = 0.1;

/// Standard deviation of the integral after a time, in the channel's unit times s.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct IntegratedError {
    pub seconds: f64,
    pub predicted: f64,
    /// Measured in the data; absent if the record is too short.
    pub observed: Option<ObservedError>,
}

/// Root mean square over many starts, in the channel's unit times s.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ObservedError {
    pub value: f64,
    /// Lower 95 % bound, by χ².
    pub low: f64,
    pub high: f64,
    /// Equivalent degrees of freedom by the model.
    pub edf: f64,
}

/// The errors after each of [`TIMES_S`], by `model` and in the samples of `unseen`.
#[must_use]
pub fn integrated_errors(model: &Model, unseen: &UniformSeries) -> Vec<IntegratedError> {
    let period = model.sample_period();
    let calibration = samples(CALIBRATION_S, period);
    let sums = RunningSums::new(unseen);
    TIMES_S
        .map(|seconds| {
            let contrast = Contrast { calibration, time: samples(seconds, period) };
            IntegratedError {
                seconds,
                predicted: period * contrast.covariance(model, 0).max(0.0).sqrt(),
                observed: contrast.observed(model, &sums),
            }
        })
        .into()
}

fn samples(seconds: f64, period: f64) -> usize {
    (seconds / period).round().max(1.0) as usize
}

/// The error `S_t − (t/c)·S_c`.
#[derive(Debug, Clone, Copy)]
struct Contrast {
    /// `c`, samples.
    calibration: usize,
    /// `t`, samples.
    time: usize,
}

impl Contrast {
    /// Covariance of two errors whose starts are `lag` samples apart, in the square of the channel's unit.
    fn covariance(&self, model: &Model, lag: usize) -> f64 {
        let ratio = self.time as f64 / self.calibration as f64;
        // Position and weight of the running sum at the start, the end of the calibration and the end: weights and first moments add to 0.
        let (c, t) = (self.calibration as f64, self.time as f64);
        let weights = [(-c, ratio), (0.0, -1.0 - ratio), (t, 1.0)];
        let sum_variance = |m: f64| -> f64 {
            let of_term = |term: &allan_core::model::FittedTerm| {
                term.value * term.value * term.kind.process().sum_variance(m.abs(), model.sample_period())
            };
            model.terms().iter().filter(|term| term.value > 0.0).map(of_term).sum()
        };
        let pairs = weights.iter().flat_map(|a| weights.iter().map(move |b| (a, b)));
        -0.5 * pairs.map(|((x, a), (y, b))| a * b * sum_variance(x - y + lag as f64)).sum::<f64>()
    }

    fn observed(&self, model: &Model, sums: &RunningSums) -> Option<ObservedError> {
        let length = self.calibration + self.time;
        let stride = (length / OVERLAP).max(1);
        let starts = (0..(sums.sums.len()).checked_sub(length)?).step_by(stride);
        let errors: Vec<f64> = starts
            .filter_map(|start| {
                let middle = start + self.calibration;
                let bias = sums.mean(start, middle)?;
                let mean = sums.mean(middle, middle + self.time)?;
                Some((mean - bias) * self.time as f64 * model.sample_period())
            })
            .collect();
        let count = errors.len() as f64;
        let variance = self.covariance(model, 0);
        let correlation = |step: usize| self.covariance(model, step * stride) / variance;
        let reach = (2 * OVERLAP).min(errors.len().saturating_sub(1));
        let sum: f64 = (1..=reach).map(|step| (1.0 - step as f64 / count) * correlation(step).powi(2)).sum();
        let edf = count / (1.0 + 2.0 * sum);
        let mean_square = errors.iter().map(|error| error * error).sum::<f64>() / count;
        // `edf` is not a number where no window has data or the model has no noise.
        let bound = |probability| (mean_square * edf / chi_squared_quantile(probability, edf)).sqrt();
        let [low, high] = [0.975, 0.025].map(bound);
        (edf > 0.0).then(|| ObservedError { value: mean_square.sqrt(), low, high, edf })
    }
}

/// Running sums and counts of the samples that are not missing.
struct RunningSums {
    sums: Vec<(f64, usize)>,
}

impl RunningSums {
    fn new(grid: &UniformSeries) -> Self {
        let mean = grid.mean();
        let running = grid.values().iter().scan((0.0, 0), |state, value| {
            if value.is_finite() {
                *state = (state.0 + value - mean, state.1 + 1);
            }
            Some(*state)
        });
        Self { sums: std::iter::once((0.0, 0)).chain(running).collect() }
    }

    fn mean(&self, from: usize, to: usize) -> Option<f64> {
        let ((start, before), (end, after)) = (self.sums[from], self.sums[to]);
        let count = (after - before) as f64;
        (count >= (1.0 - MAX_MISSING) * (to - from) as f64).then(|| (end - start) / count)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use allan_core::NoiseTerm;
    use allan_core::model::FittedTerm;

    fn model(terms: [f64; 3]) -> Model {
        Model::new(0.1, NoiseTerm::BASELINE.into_iter().zip(terms).map(|(kind, value)| FittedTerm::exact(kind, value)))
    }

    #[test]
    fn predictions_for_n_b_and_k_are_their_closed_forms() {
        let nothing = UniformSeries::new(0.1, vec![]);
        // White noise: N²·t for the time and N²·t²/c for the bias.
        for drift in integrated_errors(&model([0.5, 0.0, 0.0]), &nothing) {
            let expected = 0.5 * (drift.seconds + drift.seconds * drift.seconds / 60.0).sqrt();
            assert!((drift.predicted / expected - 1.0).abs() < 1e-9, "{drift:?}");
            assert_eq!(drift.observed, None);
        }
        // A random walk: ∫∫ gives K²·t²(c + t)/3.
        for drift in integrated_errors(&model([0.0, 0.0, 0.5]), &nothing) {
            let expected = 0.5 * drift.seconds * ((60.0 + drift.seconds) / 3.0).sqrt();
            assert!((drift.predicted / expected - 1.0).abs() < 1e-3, "{drift:?}");
        }
        // After 60 s, as long as the calibration: √2·t Allan deviations, which are 0.664·B for flicker noise.
        let flicker = integrated_errors(&model([0.0, 0.5, 0.0]), &nothing)[1];
        assert!((flicker.predicted / (2f64.sqrt() * 60.0 * 0.664 * 0.5) - 1.0).abs() < 1e-3, "{flicker:?}");
    }
}
