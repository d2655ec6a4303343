//! The best linear prediction of a sample from those before it, which shows a spike in front of a filter.
//!
//! A filter spreads a spike as it does the noise, so interpolation keeps only 0.27 (mean of two values) to 0.5 (of
//! eight) of the spike. The prediction error is the innovation and keeps 0.96 and 0.84 of it.

use super::noise_levels::clipped_deviation;
use crate::samples::interpolation::{Autocovariance, LEAST_WHITE, REACH};
use crate::samples::series::Series;
use nalgebra::{SMatrix, SVector};

const ORDER: usize = 2 * REACH;
/// A response ends where less than this part of its maximum follows.
const LEFT: f64 = 0.25;

pub(super) struct Prediction {
    weights: [f64; ORDER],
    /// Response of the samples, from its own on, to an error of 1.
    response: Vec<f64>,
    pub deviation: f64,
}

impl Prediction {
    /// `None` if the response is longer than the prediction (drift, a line) or a single sample (white noise).
    pub(super) fn fit(series: &Series, covariance: &Autocovariance, mean: f64) -> Option<Self> {
        let white = |a: usize, b: usize| if a == b { LEAST_WHITE * covariance[0] } else { 0.0 };
        let entry = |a: usize, b: usize| covariance[a.abs_diff(b)] + white(a, b);
        let with_sample = SVector::<f64, ORDER>::from_fn(|at, _| covariance[at + 1]);
        let weights: [f64; ORDER] = SMatrix::<f64, ORDER, ORDER>::from_fn(entry).cholesky()?.solve(&with_sample).into();
        let mut response = vec![1.0];
        for at in 1..2 * ORDER {
            response.push((0..at.min(ORDER)).map(|before| weights[before] * response[at - 1 - before]).sum());
        }
        let largest = response.iter().map(|of: &f64| of.abs()).fold(0.0, f64::max);
        let length = response.iter().rposition(|of| of.abs() >= LEFT * largest)? + 1;
        response.truncate(length);
        if !(2..=ORDER).contains(&length) {
            return None;
        }
        let mut prediction = Self { weights, response, deviation: 0.0 };
        let error = |at| prediction.error(series, &series.values, mean, at);
        let errors: Vec<f64> = (0..series.values.len()).map(error).collect();
        prediction.deviation = clipped_deviation(&errors).max(0.5 * series.resolution);
        Some(prediction)
    }

    pub(super) fn length(&self) -> usize {
        self.response.len()
    }

    /// Positions that a spike changes from one on, up to the next gap.
    pub(super) fn changed(&self, series: &Series, position: usize) -> impl Iterator<Item = usize> {
        let end = (position + self.length()).min(series.values.len());
        (position..end).take_while(move |&at| series.is_gapless(position, at))
    }

    /// The largest remainder of a spike of error 1 after an interpolation with `weights`.
    pub(super) fn interpolated(&self, weights: &[f64; REACH]) -> f64 {
        let sample = |at: i64| usize::try_from(at).ok().and_then(|at| self.response.get(at)).copied().unwrap_or(0.0);
        let left = |at: i64| {
            let beside = |(distance, weight): (i64, &f64)| weight * (sample(at - distance) + sample(at + distance));
            (sample(at) - (1..).zip(weights).map(beside).sum::<f64>()).abs()
        };
        let reach = REACH as i64;
        (-reach..self.length() as i64 + reach).map(left).fold(0.0, f64::max)
    }

    /// Prediction error at `position`; 0 if a sample before it is missing.
    pub(super) fn error(&self, series: &Series, values: &[f64], mean: f64, position: usize) -> f64 {
        if position < ORDER || !series.is_gapless(position - ORDER, position) {
            return 0.0;
        }
        let before = self.weights.iter().zip(values[..position].iter().rev());
        values[position] - mean - before.map(|(weight, value)| weight * (value - mean)).sum::<f64>()
    }

    /// True if one innovation explains the error at `position`: a spike in front of the filter.
    pub(super) fn is_in_front(&self, series: &Series, values: &[f64], mean: f64, position: usize) -> bool {
        let behind: Vec<f64> = std::iter::once(1.0).chain(self.weights.map(|weight| -weight)).collect();
        let sums = behind.iter().scan(0.0, |sum, of| {
            *sum += of;
            Some(*sum)
        });
        let jumps = [sums.collect(), vec![1.0; ORDER + 1]];
        let errors: Vec<f64> = (position - ORDER..(position + ORDER + 1).min(values.len()))
            .map(|at| self.error(series, values, mean, at))
            .collect();
        let own = errors[ORDER].powi(2);
        let is_less = |shape: &Vec<f64>| {
            let squares = shape.iter().map(|of| of * of).sum::<f64>();
            let product = |errors: &[f64]| errors.iter().zip(shape).map(|(error, of)| error * of).sum::<f64>();
            (0..=ORDER).all(|from| product(&errors[from..]).powi(2) / squares < own)
        };
        is_less(&behind) && jumps.iter().all(is_less)
    }

    pub(super) fn subtract(&self, series: &Series, values: &mut [f64], position: usize, error: f64) {
        for (at, response) in self.changed(series, position).zip(&self.response) {
            values[at] -= error * response;
        }
    }
}
