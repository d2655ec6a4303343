//! Prediction of the second half with tracked parameters, epoch by epoch, and its baselines.
//!
//! Only parameters that changed in the first half are tracked, each epoch predicted from those before it. The pooled error is too small,
//! because the mean of lagging predictions is nearly that of the parameters; the one-step error is not.

use super::epochs::{ComparedCurve, EpochCurves, MIN_AVERAGES, SIGNIFICANCE};
use super::tracked_parameters::{MAX_LEVEL, PARAMETERS, ParameterVector, TrackedModel, TrackedSet, minimum};
use crate::OCTAVES;
use allan_core::{Curve, Model};
use serde::Serialize;

/// Rounds of the coordinate search in [`beyond_drift`], and its first step.
const ROUNDS: usize = 8;
const FIRST_STEP: f64 = 0.01;

/// Deviances per point on the second half of a model with tracked parameters.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TrackingErrors {
    /// The mean of all predicted curves against the curve of the second half.
    pub pooled: f64,
    /// Mean over the epochs, each against its own prediction.
    pub one_step: f64,
    /// [`one_step`](Self::one_step) for the model without tracking.
    pub one_step_static: f64,
}

/// The parameters to track, by the epochs of the first half alone. The line is tracked only together with the level.
pub(crate) fn select_tracked(model: &TrackedModel, fitted: &[Curve<OCTAVES>]) -> TrackedSet {
    let level = model.test_movement(fitted, TrackedSet::Nothing, TrackedSet::Level);
    match model.largest_set() {
        TrackedSet::LevelAndLine => TrackedSet::LevelAndLine,
        _ if level.p_value < SIGNIFICANCE => TrackedSet::Level,
        _ => TrackedSet::Nothing,
    }
}

/// Tracks the parameters `tracked` through the epochs of both halves; the errors are those on the second half `half`.
pub(crate) fn track(
    model: &TrackedModel,
    tracked: TrackedSet,
    [fitted, unseen]: [&[Curve<OCTAVES>]; 2],
    half: &Curve<OCTAVES>,
) -> TrackingErrors {
    let models = predictions(model, tracked, [fitted, unseen]);
    let compared: Vec<_> = unseen.iter().map(|epoch| ComparedCurve::new(epoch, model.model())).collect();
    let of_epoch = |(epoch, model): (&ComparedCurve, &Model)| epoch.deviance_per_point(|n| model.avar(n));
    let count = unseen.len() as f64;
    TrackingErrors {
        pooled: ComparedCurve::new(half, model.model()).deviance_per_point(|n| mean_avar(&models, n)),
        one_step: compared.iter().zip(&models).map(of_epoch).sum::<f64>() / count,
        one_step_static: compared.iter().map(|epoch| of_epoch((epoch, model.model()))).sum::<f64>() / count,
    }
}

/// The model of each epoch of the second half, with the parameters that the epochs before it predict.
fn predictions(model: &TrackedModel, tracked: TrackedSet, [fitted, unseen]: [&[Curve<OCTAVES>]; 2]) -> Vec<Model> {
    let estimates: Vec<_> = fitted.iter().chain(unseen).map(|epoch| model.estimate(epoch, tracked)).collect();
    let mut predicted = [[0.0; PARAMETERS]].repeat(unseen.len());
    for index in 0..PARAMETERS {
        let measured: Vec<(f64, f64)> = estimates.iter().map(|e| (e.parameters[index], e.error[index])).collect();
        let ahead = predict_one_step(&measured, fitted.len());
        for (parameters, value) in predicted.iter_mut().zip(&ahead[fitted.len()..]) {
            parameters[index] = *value;
        }
    }
    predicted.iter().map(|parameters: &ParameterVector| model.at(*parameters)).collect()
}

pub(crate) fn mean_avar(models: &[Model], n: u64) -> f64 {
    models.iter().map(|model| model.avar(n)).sum::<f64>() / models.len() as f64
}

/// Variance of the step between `(value, error)`s, less the variances of the errors.
fn step_variance(measured: &[(f64, f64)]) -> f64 {
    let squares =
        measured.windows(2).map(|pair| (pair[1].0 - pair[0].0).powi(2) - pair[0].1.powi(2) - pair[1].1.powi(2));
    (squares.sum::<f64>() / (measured.len().max(2) - 1) as f64).max(0.0)
}

/// Predicts each `(value, error)` by a Kalman filter of a random walk with the steps of the first `fitted` values.
fn predict_one_step(measured: &[(f64, f64)], fitted: usize) -> Vec<f64> {
    let step = step_variance(&measured[..fitted]);
    let (mut level, mut variance) = measured.first().map_or((0.0, 0.0), |&(value, error)| (value, error * error));
    let mut predicted = Vec::with_capacity(measured.len());
    for (at, &(value, error)) in measured.iter().enumerate() {
        predicted.push(level);
        if at > 0 && variance + error * error > 0.0 {
            let gain = variance / (variance + error * error);
            level += gain * (value - level);
            variance *= 1.0 - gain;
        }
        variance += step;
    }
    predicted
}

/// Standard deviation of the difference between each parameter's mean over `unseen` epochs and its mean over the last
/// `used` epochs of the first half, if the parameter goes on as a random walk with the steps of the first half.
///
/// With steps of variance `q`, the means over `L` epochs and over the `H` that follow differ by a variance of about `q·(L + H)/3`.
pub(crate) fn expected_drift(
    model: &TrackedModel,
    tracked: TrackedSet,
    fitted: &[Curve<OCTAVES>],
    used: usize,
    unseen: usize,
) -> ParameterVector {
    let estimates: Vec<_> = fitted.iter().map(|epoch| model.estimate(epoch, tracked)).collect();
    std::array::from_fn(|index| {
        let measured: Vec<(f64, f64)> = estimates.iter().map(|e| (e.parameters[index], e.error[index])).collect();
        (step_variance(&measured) * (used + unseen) as f64 / 3.0).sqrt()
    })
}

/// Deviance per point of a model on `half`, with parameters that may differ by `drift` (standard deviations): the minimum
/// over the parameters `x` of the model's deviance and their cost `(x/σ)²`. Without drift the plain deviance per point.
pub(crate) fn beyond_drift(model: &TrackedModel, drift: ParameterVector, half: &Curve<OCTAVES>) -> f64 {
    let half = ComparedCurve::new(half, model.model());
    let points = half.len() as f64;
    let cost = |parameters: ParameterVector| {
        let moved = parameters.iter().zip(drift).filter(|(_, sigma)| *sigma > 0.0);
        let prior: f64 = moved.map(|(x, sigma)| (x / sigma).powi(2)).sum();
        let model = model.at(parameters);
        half.deviance_per_point(|n| model.avar(n)) + prior / points
    };
    let mut parameters = [0.0; PARAMETERS];
    for _ in 0..ROUNDS {
        for index in (0..PARAMETERS).filter(|&index| drift[index] > 0.0) {
            let trial = |value: f64| {
                let mut trial = parameters;
                trial[index] = value;
                cost(trial)
            };
            parameters[index] = minimum(trial, parameters[index], FIRST_STEP, MAX_LEVEL);
        }
    }
    cost(parameters)
}

/// Deviances per point on the second half of two predictions without added terms.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Baselines {
    /// The baseline model with its white noise tracked: the gain of tracking alone.
    pub baseline_tracked: f64,
    /// The curve of the epoch before; the baseline model at averaging times too long for an epoch.
    pub persistence: f64,
}

impl Baselines {
    /// `baseline` is the baseline model, fitted to the first half; `model` gives the degrees of freedom.
    pub(crate) fn new(curves: &EpochCurves, baseline: &Model, model: &Model) -> Self {
        let half = ComparedCurve::new(&curves.unseen, model);
        let tracked = TrackedModel::without_line(baseline.clone());
        let epochs = [&curves.fitted_epochs[..], &curves.unseen_epochs[..]];
        let predicted = predictions(&tracked, TrackedSet::Level, epochs);
        let count = curves.unseen_epochs.len();
        let persistent = |n: u64| {
            if n * MIN_AVERAGES > curves.epoch {
                return baseline.avar(n);
            }
            let before = curves.fitted_epochs.last().into_iter().chain(&curves.unseen_epochs).take(count);
            let points = before.flat_map(|epoch| epoch.points().iter().filter(|point| point.n == n));
            points.map(|point| point.avar).sum::<f64>() / count as f64
        };
        Self {
            baseline_tracked: half.deviance_per_point(|n| mean_avar(&predicted, n)),
            persistence: half.deviance_per_point(persistent),
        }
    }
}
