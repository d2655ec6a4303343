//! What the noise does to a vehicle: the error of an angle (or a velocity) that is integrated without help.
//!
//! The vehicle stands still for [`CALIBRATION_S`], takes the mean as its bias, and then integrates for a while. With
//! `V(m)` the variance of the sum of `m` samples, the sums over the bias's `c` samples and the `t` samples after them
//! differ by `S_t − (t/c)·S_c`, whose variance is `r(1 + r)·V(c) + (1 + r)·V(t) − r·V(c + t)` with `r = t/c`; for `t = c`
//! that is `2t²` Allan variances. Constants and what second differences do not see cancel, so that it exists for a
//! random walk too.

use crate::uniform_series::UniformSeries;
use allan_core::Model;
use statrs::distribution::{ChiSquared, ContinuousCDF};

/// Time over which the vehicle learns its bias, s.
pub const CALIBRATION_S: f64 = 60.0;
/// Times without help that are told, s.
pub const TIMES_S: [f64; 3] = [10.0, 60.0, 600.0];

/// Starts of an integration to the time that one takes: more would tell the same again.
const OVERLAP: usize = 8;
/// A window may lack this share of its samples; its mean stands for them.
const MOST_MISSING: f64 = 0.1;

/// The standard deviation of the integral after a time, in unit·s.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Drift {
    /// Time of integration, s.
    pub seconds: f64,
    /// As the model says.
    pub predicted: f64,
    /// As data shows; absent where they are too short.
    pub observed: Option<Observed>,
}

/// A root mean square over many starts, in unit·s.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Observed {
    /// Root mean square.
    pub value: f64,
    /// Lower 95 % bound, by χ².
    pub low: f64,
    /// Upper 95 % bound.
    pub high: f64,
    /// Equivalent degrees of freedom, if the model is true.
    pub edf: f64,
}

/// The drifts after [`TIMES_S`] that `model` predicts, beside those that `unseen` samples show.
#[must_use]
pub fn drifts(model: &Model, unseen: &UniformSeries) -> Vec<Drift> {
    let period = model.sample_period();
    let calibration = samples(CALIBRATION_S, period);
    let sums = Sums::of(unseen);
    TIMES_S
        .map(|seconds| {
            let contrast = Contrast { calibration, time: samples(seconds, period) };
            Drift {
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

/// `S_t − (t/c)·S_c`
#[derive(Debug, Clone, Copy)]
struct Contrast {
    calibration: usize,
    time: usize,
}

impl Contrast {
    /// Covariance of two of them whose starts are `lag` samples apart, in unit².
    fn covariance(&self, model: &Model, lag: usize) -> f64 {
        let ratio = self.time as f64 / self.calibration as f64;
        // Weights of the running sum at the contrast's three places: they and their first moment add up to 0.
        let (c, t) = (self.calibration as f64, self.time as f64);
        let places = [(-c, ratio), (0.0, -1.0 - ratio), (t, 1.0)];
        let of = |m: f64| -> f64 {
            let structure = |term: &allan_core::model::FittedTerm| {
                term.value * term.value * term.kind.process().sum_variance(m.abs(), model.sample_period())
            };
            model.terms().iter().filter(|term| term.value > 0.0).map(structure).sum()
        };
        let pairs = places.iter().flat_map(|a| places.iter().map(move |b| (a, b)));
        -0.5 * pairs.map(|((x, a), (y, b))| a * b * of(x - y + lag as f64)).sum::<f64>()
    }

    fn observed(&self, model: &Model, sums: &Sums) -> Option<Observed> {
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
        // Fails for a record without an error, or a model without noise.
        let chi_squared = ChiSquared::new(edf).ok()?;
        let bound = |probability: f64| (mean_square * edf / chi_squared.inverse_cdf(probability)).sqrt();
        Some(Observed { value: mean_square.sqrt(), low: bound(0.975), high: bound(0.025), edf })
    }
}

/// Running sums and counts of the samples that are there.
struct Sums {
    sums: Vec<(f64, usize)>,
}

impl Sums {
    fn of(grid: &UniformSeries) -> Self {
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
        (count >= (1.0 - MOST_MISSING) * (to - from) as f64).then(|| (end - start) / count)
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
    fn pure_noises_have_closed_forms() {
        let nothing = UniformSeries::new(0.1, vec![]);
        // White noise: N²·t for the time and N²·t²/c for the bias.
        for drift in drifts(&model([0.5, 0.0, 0.0]), &nothing) {
            let expected = 0.5 * (drift.seconds + drift.seconds * drift.seconds / 60.0).sqrt();
            assert!((drift.predicted / expected - 1.0).abs() < 1e-9, "{drift:?}");
            assert_eq!(drift.observed, None);
        }
        // A random walk: ∫∫ gives K²·t²(c + t)/3.
        for drift in drifts(&model([0.0, 0.0, 0.5]), &nothing) {
            let expected = 0.5 * drift.seconds * ((60.0 + drift.seconds) / 3.0).sqrt();
            assert!((drift.predicted / expected - 1.0).abs() < 1e-3, "{drift:?}");
        }
        // As long as the bias: √2·t Allan deviations, of flicker noise 0.664·B.
        let flicker = drifts(&model([0.0, 0.5, 0.0]), &nothing)[1];
        assert!((flicker.predicted / (2f64.sqrt() * 60.0 * 0.664 * 0.5) - 1.0).abs() < 1e-3, "{flicker:?}");
    }
}
