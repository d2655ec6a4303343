//! The unseen half foretold epoch by epoch, each from the states of those before it.
//!
//! The shape — which terms, how wide, how large — is that of the fitted half. Only what moved there is followed: the state
//! of epoch `k` is foretold before the epoch is looked at, and corrected by it afterwards. Over many epochs the mean of
//! states that lag by one is nearly the mean of the states, so the error of the pooled curve flatters; the error of the
//! single epochs, one step ahead, does not.

use super::moving::{Free, Moving, STATES, State};
use super::{SIGNIFICANCE, deviance_per_point};
use allan_core::{Curve, Model};

/// How a followed model does on the unseen half.
#[derive(Debug, Clone, PartialEq)]
pub struct Tracked {
    /// What was followed.
    pub free: Free,
    /// Deviance per point of the mean of all foretold curves against the curve of the unseen half.
    pub pooled: f64,
    /// Mean over the unseen epochs of the deviance per point of each against what was foretold of it.
    pub one_step: f64,
    /// The same of the model that is not followed.
    pub one_step_static: f64,
}

/// What moves in a model, by the epochs of the fitted half alone: the line only together with the level.
#[must_use]
pub fn what_moves<const POINTS: usize>(moving: &Moving, fitted: &[Curve<POINTS>]) -> Free {
    let level = moving.evidence(fitted, Free::Nothing, Free::Level);
    match moving.free() {
        Free::LevelAndLine => Free::LevelAndLine,
        _ if level.p_value < SIGNIFICANCE => Free::Level,
        _ => Free::Nothing,
    }
}

/// Follows `free` through the epochs of both halves and judges what was foretold of the unseen one.
#[must_use]
pub fn track<const POINTS: usize>(
    moving: &Moving,
    free: Free,
    [fitted, unseen]: [&[Curve<POINTS>]; 2],
    half: &Curve<POINTS>,
) -> Tracked {
    let estimates: Vec<_> = fitted.iter().chain(unseen).map(|epoch| moving.estimate(epoch, free)).collect();
    let mut states = [[0.0; STATES]].repeat(unseen.len());
    for index in 0..STATES {
        let measured: Vec<(f64, f64)> = estimates.iter().map(|e| (e.state[index], e.error[index])).collect();
        let foretold = one_step_ahead(&measured, fitted.len());
        for (state, foretold) in states.iter_mut().zip(&foretold[fitted.len()..]) {
            state[index] = *foretold;
        }
    }
    let models: Vec<Model> = states.iter().map(|state: &State| moving.at(*state)).collect();
    let mean = |n: u64| models.iter().map(|model| model.avar(n)).sum::<f64>() / models.len() as f64;
    let of_epoch = |(epoch, model): (&Curve<POINTS>, &Model)| deviance_per_point(epoch, |n| model.avar(n));
    let count = unseen.len() as f64;
    Tracked {
        free,
        pooled: deviance_per_point(half, mean),
        one_step: unseen.iter().zip(&models).map(of_epoch).sum::<f64>() / count,
        one_step_static: unseen.iter().map(|epoch| of_epoch((epoch, moving.model()))).sum::<f64>() / count,
    }
}

/// Variance of the step from one of the `(value, error)` to the next, the errors' own taken off.
pub fn step(measured: &[(f64, f64)]) -> f64 {
    let squares =
        measured.windows(2).map(|pair| (pair[1].0 - pair[0].0).powi(2) - pair[0].1.powi(2) - pair[1].1.powi(2));
    (squares.sum::<f64>() / (measured.len().max(2) - 1) as f64).max(0.0)
}

/// What is foretold of each of the `(value, error)` from those before it.
///
/// A random walk seen through noise (the local level model of structural time series): a Kalman filter with the errors as
/// they are, and a step whose variance the first `learnt` values show.
fn one_step_ahead(measured: &[(f64, f64)], learnt: usize) -> Vec<f64> {
    let step = step(&measured[..learnt]);
    let (mut level, mut variance) = measured.first().map_or((0.0, 0.0), |&(value, error)| (value, error * error));
    let mut foretold = Vec::with_capacity(measured.len());
    for (at, &(value, error)) in measured.iter().enumerate() {
        foretold.push(level);
        if at > 0 && variance + error * error > 0.0 {
            let gain = variance / (variance + error * error);
            level += gain * (value - level);
            variance *= 1.0 - gain;
        }
        variance += step;
    }
    foretold
}
