//! Learning: each inertial channel's model is fitted to one epoch and validated on the next.

use crate::epoch::{EpochChannel, FinishedEpoch, Regressor, Regressors};
use crate::report_messages::{model_error, reported_coefficient};
use crate::scale::ReportScale;
use crate::statistics::{CHANNELS, ChannelMeans, FIRST_CROSS_OCTAVE, INERTIAL};
use adis16405_driver::Config;
use allan_core::fit::fit;
use allan_core::model::{FittedTerm, MAX_TERMS};
use allan_core::term::MovingAverageFilter;
use allan_core::trace::{AddedTerm, LineCandidates, MAX_ADDED, Trace, trace_while};
use allan_core::{Model, NoiseTerm};
use heapless::Vec;
use link::{
    LearnedMessage, MAX_COVARIATES, MAX_DEVIATIONS, ReportedAddedTerm, ReportedDeviations, ReportedModelError,
    ReportedParameter, ReportedRegressor, ValidationMessage,
};
use serde::{Deserialize, Serialize};

/// p-value of the residual above which no further term is searched: a dozen octaves then have a deviance below 14.
const P_VALUE_SUFFICIENT: f64 = 0.2;

const _: () = assert!(MAX_ADDED == link::MAX_ADDED_TERMS);
/// Largest number of findings of a model beyond N, B and K.
pub(crate) const MAX_FINDINGS: usize = MAX_COVARIATES + MAX_ADDED;

/// Coefficients of one channel; the device stores six of these models.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct EpochModel {
    /// The fitted N, B and K; `None` before the first fit.
    baseline: Option<BaselineCoefficients>,
    full: Vec<(NoiseTerm, f64), MAX_TERMS>,
    pub(crate) regressors: Regressors,
}

type BaselineCoefficients = [f64; NoiseTerm::BASELINE.len()];

impl EpochModel {
    pub(crate) const EMPTY: Self = Self { baseline: None, full: Vec::new(), regressors: Vec::new() };

    /// The model of N, B and K; `None` before the first fit.
    pub(crate) fn baseline(&self, scale: ReportScale) -> Option<Model> {
        Some(model(NoiseTerm::BASELINE.into_iter().zip(self.baseline?), scale))
    }

    /// The terms beyond N, B and K, with their coefficients.
    pub(crate) fn added_terms(&self) -> impl Iterator<Item = (NoiseTerm, f64)> {
        self.full.iter().copied().filter(|(term, _)| !NoiseTerm::BASELINE.contains(term))
    }

    /// The model with all terms; `None` before the first fit.
    fn full(&self, scale: ReportScale) -> Option<Model> {
        (!self.full.is_empty()).then(|| model(self.full.iter().copied(), scale))
    }
}

fn model(terms: impl Iterator<Item = (NoiseTerm, f64)>, scale: ReportScale) -> Model {
    Model::new(scale.period_s(), terms.map(|(kind, value)| FittedTerm::exact(kind, value)))
}

fn baseline_coefficients(model: &Model) -> Option<BaselineCoefficients> {
    let mut values = model.terms().iter().map(|term| term.value);
    Some([values.next()?, values.next()?, values.next()?])
}

/// Low-pass filters of the ADIS16405 that the trace tries: Bartlett windows of 2 to 64 taps per stage (SENS_AVG).
pub const FILTERS: [MovingAverageFilter; 10] = [
    MovingAverageFilter::bartlett(2),
    MovingAverageFilter::bartlett(4),
    MovingAverageFilter::bartlett(8),
    MovingAverageFilter::bartlett(16),
    MovingAverageFilter::bartlett(32),
    MovingAverageFilter::bartlett(64),
    MovingAverageFilter { stages: 2, taps: 8, decimation: 6.1 },
    MovingAverageFilter { stages: 2, taps: 8, decimation: 8.1 },
    MovingAverageFilter { stages: 2, taps: 8, decimation: 10.1 },
    MovingAverageFilter { stages: 2, taps: 8, decimation: 12.1 },
];

/// The fit of one channel's model to an epoch.
#[derive(Debug, Clone, PartialEq)]
pub struct EpochFit {
    baseline: Option<BaselineCoefficients>,
    regressors: Regressors,
    trace: Trace,
}

impl EpochFit {
    /// A fit with these [regressors](EpochChannel::estimate_regressors), before its [run](Self::run).
    pub fn new(regressors: Regressors) -> Self {
        Self { baseline: None, regressors, trace: Trace::empty() }
    }

    /// Fits the model of a channel to an epoch, for some seconds. False if `keep_on`, which is called at every step,
    /// returned false.
    #[must_use]
    pub fn run(&mut self, channel: EpochChannel<'_>, keep_on: &mut dyn FnMut() -> bool) -> bool {
        let done = self.search(channel, keep_on);
        self.baseline = if self.regressors.is_empty() {
            baseline_coefficients(&self.trace.before)
        } else {
            baseline_coefficients(&fit(&channel.curve(), &NoiseTerm::BASELINE))
        };
        done
    }

    /// Traces further terms; false if cancelled.
    fn search(&mut self, channel: EpochChannel<'_>, keep_on: &mut dyn FnMut() -> bool) -> bool {
        let mut curve = channel.curve();
        // Without covariances the curve is that of the stream itself.
        let _ = channel.compensate(&mut curve, &self.regressors);
        self.trace.fit_baseline(&curve);
        let sufficient = self.trace.before_goodness.p_value > P_VALUE_SUFFICIENT;
        sufficient || trace_while(&mut self.trace, &curve, LineCandidates::Curve, &FILTERS, keep_on)
    }

    /// The model that was fitted.
    pub fn model(&self) -> EpochModel {
        let full = self.trace.after.terms().iter().map(|term| (term.kind, term.value)).collect();
        EpochModel { baseline: self.baseline, full, regressors: self.regressors.clone() }
    }

    /// The message about the fit of [`CHANNELS`]`[index]` to the epoch with the number `epoch`.
    pub fn message(&self, index: usize, epoch: u32) -> LearnedMessage {
        let Self { regressors, trace, .. } = self;
        LearnedMessage {
            channel: CHANNELS[index] as u8,
            epoch,
            regressors: regressors.iter().map(reported_regressor).collect(),
            added_terms: trace.added.iter().map(|found| reported_added_term(found, &trace.after)).collect(),
            p_before: trace.before_goodness.p_value,
            p_after: trace.after_goodness.p_value,
        }
    }
}

/// Validates the model of a channel on an epoch; `means` are those of the epoch before. `None` before the first fit, or
/// without covariances.
pub fn validate(
    model: &EpochModel,
    means: Option<&ChannelMeans>,
    channel: EpochChannel<'_>,
) -> Option<ValidationMessage> {
    let mut message = ValidationMessage {
        channel: CHANNELS[channel.index] as u8,
        epoch: channel.epoch.number,
        before: model_error(&model.baseline(channel.scale)?, &channel.curve()),
        after: None,
        shift: means.and_then(|means| channel.mean_shift(&model.regressors, means)),
        drift: Vec::new(),
    };
    fill_compensated(model, channel, &mut message)?;
    Some(message)
}

/// Sets the error of the full model, and the Allan deviations of both streams.
fn fill_compensated(model: &EpochModel, channel: EpochChannel<'_>, message: &mut ValidationMessage) -> Option<()> {
    let mut curve = channel.curve();
    let slow = curve.points().iter().filter(|point| point.n >= 1 << FIRST_CROSS_OCTAVE).take(MAX_DEVIATIONS);
    message.drift.extend(slow.map(|raw| ReportedDeviations { n: raw.n, raw: libm::sqrt(raw.avar), compensated: 0.0 }));
    channel.compensate(&mut curve, &model.regressors)?;
    let slow = curve.points().iter().filter(|point| point.n >= 1 << FIRST_CROSS_OCTAVE);
    message.drift.iter_mut().zip(slow).for_each(|(drift, point)| drift.compensated = libm::sqrt(point.avar));
    message.after = model_error(&model.full(channel.scale)?, &curve);
    Some(())
}

fn reported_regressor(regressor: &Regressor) -> ReportedRegressor {
    let (low, high) = regressor.bounds();
    let Regressor { covariate, value, reference, .. } = *regressor;
    ReportedRegressor { covariate: CHANNELS[covariate] as u8, value, low, high, reference }
}

fn reported_added_term(found: &AddedTerm, model: &Model) -> ReportedAddedTerm {
    let term = &model.terms()[found.term];
    ReportedAddedTerm {
        coefficient: reported_coefficient(term),
        shape: term.shape_parameters().map(|(_, value, (low, high))| ReportedParameter { value, low, high }).collect(),
        score: found.score,
        n: found.residual.n,
        excess: found.residual.excess,
        sigmas: found.residual.sigmas,
    }
}

pub(crate) struct Learner {
    /// The finished epoch; `None` during a fit.
    pub(crate) finished: Option<&'static mut FinishedEpoch>,
    pub(crate) models: [EpochModel; INERTIAL],
    means: Option<ChannelMeans>,
    /// Deviances per point on the finished epoch: of N, B and K on the stream, and of the full model on the compensated
    /// stream.
    pub(crate) errors: [Option<(f64, f64)>; INERTIAL],
}

impl Learner {
    /// A learner without models; `finished` is the memory for epochs.
    pub(crate) fn new(finished: &'static mut FinishedEpoch) -> Self {
        Self {
            finished: Some(finished),
            models: [const { EpochModel::EMPTY }; INERTIAL],
            means: None,
            errors: [None; INERTIAL],
        }
    }

    pub(crate) fn reset(&mut self) {
        self.models = [const { EpochModel::EMPTY }; INERTIAL];
        self.errors = [None; INERTIAL];
        self.means = None;
    }

    pub(crate) fn validate(&mut self, index: usize, config: Config) -> Option<ValidationMessage> {
        let epoch = self.finished.as_deref()?;
        let channel = EpochChannel { epoch, index, scale: epoch.scale(config) };
        let message = validate(&self.models[index], self.means.as_ref(), channel);
        let deviance = |error: Option<ReportedModelError>| Some(error?.deviance_per_point);
        self.errors[index] =
            message.as_ref().and_then(|message| Some((deviance(message.before)?, deviance(message.after)?)));
        message
    }

    pub(crate) fn learn(&mut self, fit: &EpochFit, epoch: &FinishedEpoch, index: usize) {
        if index + 1 == INERTIAL {
            self.means = epoch.covariances().map(|covariances| covariances.means);
        }
        self.models[index] = fit.model();
    }
}
