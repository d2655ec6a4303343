//! Changes of a channel's bias over the record.
//!
//! Each candidate is tested on block means against every mixture of white, flicker and random-walk noise. The best one
//! is accepted, then the best of the rest beside it, and so on.

use super::bias_response::BiasResponse;
use super::bias_step::{self, BiasStep, StepPosition};
use super::block_means::{BLOCKS, BlockMeans};
use super::gls_regression::{GlsRegression, RegressionEstimate};
use super::noise_grid::NoiseGrid;
use super::thermal_response::{self, TemperatureCourse};
use super::time_constant::TimeConstant;
use super::turn_on::Transient;
use super::vibration_rectification::{Acceleration, Vibration};
use crate::bounds::BoundedEstimate;
use crate::distributions::NORMAL_975;
use crate::effects::findings::{Detection, REFUTED, SIGNIFICANCE};
use crate::effects::{LinearDrift, LinearDriftEvidence};
use crate::samples::series::Series;
use nalgebra::DVector;

/// Least fraction of a channel's samples at whose time a regressor has one too.
const LEAST_COMMON: f64 = 0.9;
/// Most candidates that are accepted.
const MOST: usize = 4;

#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct BiasSensitivity {
    /// In the channel's unit over the regressor's.
    pub sensitivity: f64,
    /// Standard deviation of the sensitivity.
    pub error: f64,
    pub degrees_of_freedom: f64,
    /// Time constant, s, over which the regressor was smoothed; 0 if it is as measured.
    pub smoothed_over_s: f64,
}

#[derive(Debug, Default, Clone, PartialEq)]
pub(crate) struct BiasChanges {
    pub step: Option<Detection>,
    pub ramp: Option<Detection>,
    /// Index of each regressor that the bias depends on, and the sensitivity to it.
    pub sensitivities: Vec<(usize, BiasSensitivity)>,
    /// Transient after the start; responses to lagged or squared temperature and to vibration.
    pub responses: Vec<BiasResponse>,
}

struct Covariates<'a> {
    regressors: Vec<(usize, DVector<f64>)>,
    temperature: Option<(usize, TemperatureCourse)>,
    vibrations: Vec<Vibration<'a>>,
}

enum Candidate {
    Ramp,
    Regressor { index: usize, smoothed_over_s: f64 },
    Step(StepPosition),
    Transient(Transient),
    Lagged(TimeConstant),
    Squared,
    Vibration(usize),
}

struct Accepted {
    candidate: Candidate,
    regressor: DVector<f64>,
    p_value: f64,
}

/// Looks for what changes the bias of `series`. `regressors` are other channels that may influence it. Samples that one of them lacks are
/// not used; a regressor that lacks more than a tenth of the samples of `series` is left out. `accelerations` may shake the channel. Of
/// slow changes rounding makes steps smaller than `least_step`, in the channel's unit, which is asked for where there is a step.
pub(crate) fn find(
    series: &Series,
    regressors: &[&Series],
    accelerations: &[Acceleration],
    least_step: &dyn Fn() -> f64,
) -> BiasChanges {
    let regressors: Vec<(usize, &Series)> =
        regressors.iter().copied().enumerate().filter(|(_, regressor)| covers(regressor, series)).collect();
    if regressors.iter().any(|(_, regressor)| regressor.slots != series.slots) {
        let others: Vec<&Series> = regressors.iter().map(|(_, regressor)| *regressor).collect();
        let series = series.clone().in_common(&others);
        let regressors: Vec<(usize, Series)> =
            regressors.iter().map(|&(index, regressor)| (index, regressor.clone().in_common(&[&series]))).collect();
        let regressors: Vec<(usize, &Series)> =
            regressors.iter().map(|(index, regressor)| (*index, regressor)).collect();
        return find_on_common_samples(&series, &regressors, accelerations, least_step);
    }
    find_on_common_samples(series, &regressors, accelerations, least_step)
}

fn covers(regressor: &Series, series: &Series) -> bool {
    regressor.slots == series.slots || series.count_common(regressor) as f64 >= LEAST_COMMON * series.slots.len() as f64
}

fn find_on_common_samples(
    series: &Series,
    regressors: &[(usize, &Series)],
    accelerations: &[Acceleration],
    least_step: &dyn Fn() -> f64,
) -> BiasChanges {
    // Squares of small changes beside a large bias would lose digits.
    let (first, bias) = series.slots.first().copied().zip(series.values.first().copied()).unwrap_or_default();
    let series = &series.clone().lowered_from(first, bias);
    let Some(blocks) = BlockMeans::from_series(series) else { return BiasChanges::default() };
    let grid = NoiseGrid::from_blocks(&blocks);
    let series_of = |index: usize| regressors.iter().find(|(of, _)| *of == index).map(|(_, series)| *series);
    let regressors: Vec<(usize, DVector<f64>)> = regressors
        .iter()
        .filter_map(|&(index, regressor)| {
            let means = BlockMeans::from_series(regressor)?.means;
            varies(&means, regressor).then_some((index, means))
        })
        .collect();
    let temperature = regressors
        .iter()
        .find_map(|(index, _)| Some((*index, TemperatureCourse::new(series_of(*index)?, blocks.width)?)));
    let vibrations = accelerations.iter().filter_map(|of| Vibration::new(*of, &blocks)).collect();
    let covariates = Covariates { regressors, temperature, vibrations };
    let mut accepted: Vec<Accepted> = Vec::new();
    while accepted.len() < MOST
        && let Some(next) = best_candidate(series, &blocks, &grid, &covariates, &accepted, least_step)
    {
        accepted.push(next);
    }
    drop_explained_by_others(&blocks, &grid, &mut accepted);
    accepted.extend(linear_part(&blocks, &grid, &covariates, &accepted));
    let mut changes = BiasChanges::default();
    let (mut linear, mut lagged, mut squared) = (None, None, None);
    for (at, Accepted { candidate, regressor, p_value }) in accepted.iter().enumerate() {
        let others = accepted.iter().enumerate().filter(|(other, _)| *other != at);
        let others: Vec<DVector<f64>> = others.map(|(_, other)| other.regressor.clone()).collect();
        let Some(estimate) = GlsRegression::new(&blocks, &grid, &others).estimate(regressor) else { continue };
        match candidate {
            Candidate::Ramp => changes.ramp = Some(ramp_detection(series, &blocks, &estimate, *p_value)),
            Candidate::Step(position) => {
                changes.step = Some(bias_step::detection(series, position, &estimate, *p_value));
            }
            &Candidate::Regressor { index, smoothed_over_s } => {
                let RegressionEstimate { size: sensitivity, error, .. } = estimate;
                let degrees_of_freedom = BLOCKS as f64;
                let of = BiasSensitivity { sensitivity, error, degrees_of_freedom, smoothed_over_s };
                changes.sensitivities.push((index, of));
                if covariates.temperature.as_ref().is_some_and(|(of, _)| *of == index) {
                    linear = Some(estimate);
                }
            }
            Candidate::Transient(transient) => {
                changes.responses.push(transient.response(&blocks, series.period_s, &estimate, series.unit));
            }
            Candidate::Lagged(lag) => lagged = Some((lag, estimate)),
            Candidate::Squared => squared = Some(estimate),
            Candidate::Vibration(at) => {
                changes.responses.push(covariates.vibrations[*at].response(&estimate, series.unit));
            }
        }
    }
    if let Some((_, course)) = &covariates.temperature {
        let curved = squared.map(|estimate| course.squared_response(linear.as_ref(), &estimate, series.unit));
        let behind_lag = lagged.map(|(lag, estimate)| course.lag_response(lag, &estimate, series.unit));
        changes.responses.extend(behind_lag.or(curved));
    }
    changes
}

/// Drops, the weakest first, each accepted candidate whose p-value beside the others is [`REFUTED`] or more.
fn drop_explained_by_others(blocks: &BlockMeans, grid: &NoiseGrid, accepted: &mut Vec<Accepted>) {
    while accepted.len() > 1 {
        let p_value = |at: usize| {
            let others = accepted.iter().enumerate().filter(|(other, _)| *other != at);
            let others: Vec<DVector<f64>> = others.map(|(_, other)| other.regressor.clone()).collect();
            let estimate = GlsRegression::new(blocks, grid, &others).estimate(&accepted[at].regressor);
            (at, estimate.map_or(1.0, |of| of.p_value))
        };
        let weakest = (0..accepted.len()).map(p_value).max_by(|a, b| a.1.total_cmp(&b.1));
        let Some((at, _)) = weakest.filter(|(_, p_value)| *p_value >= REFUTED) else { return };
        accepted.remove(at);
    }
}

/// The linear response at the mean temperature beside an accepted curvature, significant or not.
fn linear_part(
    blocks: &BlockMeans,
    grid: &NoiseGrid,
    covariates: &Covariates,
    accepted: &[Accepted],
) -> Option<Accepted> {
    let (temperature, _) = covariates.temperature.as_ref()?;
    let is_curved = accepted.iter().any(|of| matches!(of.candidate, Candidate::Squared));
    let is_known = |of: &Accepted| matches!(of.candidate, Candidate::Regressor { index, .. } if index == *temperature);
    if !is_curved || accepted.iter().any(is_known) {
        return None;
    }
    let (index, regressor) = covariates.regressors.iter().find(|(index, _)| index == temperature)?;
    let known: Vec<DVector<f64>> = accepted.iter().map(|accepted| accepted.regressor.clone()).collect();
    let RegressionEstimate { p_value, .. } = GlsRegression::new(blocks, grid, &known).estimate(regressor)?;
    let candidate = Candidate::Regressor { index: *index, smoothed_over_s: 0.0 };
    Some(Accepted { candidate, regressor: regressor.clone(), p_value })
}

/// True if the block means of a regressor span at least one count; smaller changes are rounding.
fn varies(means: &DVector<f64>, regressor: &Series) -> bool {
    means.max() - means.min() >= regressor.resolution
}

/// The likeliest candidate beside those accepted, if its p-value is significant for its kind.
fn best_candidate(
    series: &Series,
    blocks: &BlockMeans,
    grid: &NoiseGrid,
    covariates: &Covariates,
    accepted: &[Accepted],
    least_step: &dyn Fn() -> f64,
) -> Option<Accepted> {
    let Covariates { regressors, temperature, vibrations } = covariates;
    let known: Vec<DVector<f64>> = accepted.iter().map(|accepted| accepted.regressor.clone()).collect();
    let regression = GlsRegression::new(blocks, grid, &known);
    let ramp = blocks.ramp();
    // −2 ln likelihood, by which they are compared.
    let mut rivals: Vec<(f64, Accepted)> = Vec::new();
    let single =
        || std::iter::once((None, &ramp)).chain(regressors.iter().map(|(index, regressor)| (Some(*index), regressor)));
    // A lag of a slow temperature resembles the temperature, but less than its name requires.
    let mut resembles_temperature = false;
    let estimates =
        regression.estimates_below(REFUTED, &single().map(|(_, regressor)| regressor.clone()).collect::<Vec<_>>());
    for ((index, regressor), estimate) in single().zip(estimates) {
        let candidate = index.map_or(Candidate::Ramp, |index| Candidate::Regressor { index, smoothed_over_s: 0.0 });
        let Some(RegressionEstimate { p_value, deviance, .. }) = estimate else { continue };
        let is_temperature = |(of, _): &(usize, _)| index == Some(*of);
        resembles_temperature |= temperature.as_ref().is_some_and(is_temperature);
        if p_value < SIGNIFICANCE {
            rivals.push((deviance, Accepted { candidate, regressor: regressor.clone(), p_value }));
        }
    }
    let is_thermal = |of: &Accepted| matches!(of.candidate, Candidate::Lagged(_) | Candidate::Squared);
    if let Some((index, course)) = temperature
        && !accepted.iter().any(is_thermal)
    {
        let regressor = course.squared_regressor(blocks);
        if let Some(RegressionEstimate { p_value, deviance, .. }) =
            regression.estimate_below(bias_step::SIGNIFICANCE, &regressor)
        {
            let accepted = Accepted { candidate: Candidate::Squared, regressor, p_value };
            rivals.push((deviance + thermal_response::ADVANTAGE, accepted));
        }
        if resembles_temperature
            && let Some(lag) = course.likeliest_lag(blocks, &regression)
            && let smoothed = course.smoothed_regressor(lag.value, blocks)
            && let Some(without_lag) = regression.estimate(&smoothed)
        {
            // Smoothed by the lag, the temperature has less rounding error: an advantage that is no lag.
            let is_late = lag.estimate.deviance + thermal_response::ADVANTAGE < without_lag.deviance;
            let (RegressionEstimate { p_value, deviance, .. }, candidate, regressor) = if is_late {
                let regressor = course.lagged_regressor(lag.value, blocks);
                (lag.estimate, Candidate::Lagged(lag), regressor)
            } else {
                (without_lag, Candidate::Regressor { index: *index, smoothed_over_s: lag.value }, smoothed)
            };
            if p_value < SIGNIFICANCE {
                rivals.push((deviance + thermal_response::ADVANTAGE, Accepted { candidate, regressor, p_value }));
            }
        }
    }
    let has_transient = accepted.iter().any(|accepted| matches!(accepted.candidate, Candidate::Transient(_)));
    let transient = if has_transient { None } else { Transient::likeliest(blocks, &regression) };
    if let Some(transient) = transient {
        let RegressionEstimate { p_value, deviance, .. } = transient.estimate();
        let regressor = transient.regressor(blocks);
        // One more parameter, as a lag has.
        let accepted = Accepted { candidate: Candidate::Transient(transient), regressor, p_value };
        rivals.push((deviance + thermal_response::ADVANTAGE, accepted));
    }
    let is_shaken = accepted.iter().any(|accepted| matches!(accepted.candidate, Candidate::Vibration(_)));
    let vibrations: &[Vibration] = if is_shaken { &[] } else { vibrations };
    let shaken: Vec<DVector<f64>> = vibrations.iter().map(|vibration| vibration.regressor(blocks)).collect();
    let estimates = regression.estimates_below(SIGNIFICANCE, &shaken);
    for (at, ((vibration, regressor), estimate)) in vibrations.iter().zip(shaken).zip(estimates).enumerate() {
        if let Some(RegressionEstimate { size, p_value, deviance, .. }) = estimate
            && vibration.is_possible(size)
        {
            rivals.push((deviance, Accepted { candidate: Candidate::Vibration(at), regressor, p_value }));
        }
    }
    let has_step = accepted.iter().any(|accepted| matches!(accepted.candidate, Candidate::Step(_)));
    let step = if has_step { None } else { bias_step::find(series, blocks, grid, &known, &regression) };
    let is_large =
        |step: &BiasStep| regression.estimate(&step.regressor).is_some_and(|of| of.size.abs() >= least_step());
    if let Some(step) = step.filter(is_large) {
        let accepted =
            Accepted { candidate: Candidate::Step(step.position), regressor: step.regressor, p_value: step.p_value };
        rivals.push((step.deviance + bias_step::ADVANTAGE, accepted));
    }
    rivals.into_iter().min_by(|(a, _), (b, _)| a.total_cmp(b)).map(|(_, best)| best)
}

/// The ramp with the slope of `estimate`, per block. The samples keep it: the noise model has a term for it.
fn ramp_detection(series: &Series, blocks: &BlockMeans, estimate: &RegressionEstimate, p_value: f64) -> Detection {
    let block_s = blocks.width as f64 * series.period_s;
    let (slope, half) = (estimate.size / block_s, NORMAL_975 * estimate.error / block_s);
    let drift = LinearDrift {
        slope: BoundedEstimate::new(slope, slope - half, slope + half).in_unit(series.unit),
        evidence: LinearDriftEvidence::Regression { p_value },
    };
    Detection { effect: drift.into(), correction: None }
}
