//! One recording: made, analysed without a word about it, and compared with the truth.

use super::draw::Case;
use super::kind::Kind;
use super::limit::unknown_noise;
use super::truth;
use adis16405_driver::Channel;
use noise_analysis::analysis::analyze;
use noise_analysis::report::{ChannelReport, Report};
use recordings::timeline::{TimelineError, measurement};
use serde::Serialize;
use simulation::SimulationError;
use virtual_sensor::InjectedEffect;

/// Channels that are recorded: those that are scored, and what may move them.
const RECORDED: [Channel; 8] = [
    Channel::Supply,
    Channel::GyroX,
    Channel::GyroY,
    Channel::GyroZ,
    Channel::AcclX,
    Channel::AcclY,
    Channel::AcclZ,
    Channel::Temp,
];

/// Why a recording could not be examined.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ExamineError {
    /// It could not be made.
    #[error("seed {seed}: {reason}")]
    Record {
        /// Of the recording.
        seed: u64,
        /// What went wrong.
        reason: SimulationError,
    },
    /// It has no timeline.
    #[error("seed {seed}: {reason}")]
    Timeline {
        /// Of the recording.
        seed: u64,
        /// What went wrong.
        reason: TimelineError,
    },
}

/// A parameter of an effect that was named.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Estimate {
    /// Of the effect.
    pub kind: Kind,
    /// As in the report.
    pub name: &'static str,
    /// What was drawn.
    pub truth: f64,
    /// What was estimated, with its 95 % bounds.
    pub value: f64,
    /// Lower bound.
    pub low: f64,
    /// Upper bound.
    pub high: f64,
    /// Error over the size of the parameter; of a sensitivity to three axes, over its length.
    pub relative_error: f64,
}

/// A hidden effect and whether it was named.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Answer {
    /// What was hidden.
    pub kind: Kind,
    /// Its size over the smallest that any test could see.
    pub strength: f64,
    /// Whether the report lists it where it is.
    pub named: bool,
    /// Whether a test that knows its channel and shape, but not the noise, sees it; absent in pairs, and where an effect
    /// is no course of the level.
    pub shape_known: Option<bool>,
    /// What the report lists in its channels, when it does not.
    pub instead: Option<String>,
}

/// `deviance_per_point` on data that the fit has not seen, in the first channel with an effect.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Unseen {
    /// Of the declared model.
    pub before: f64,
    /// Of the model with what was traced.
    pub after: f64,
    /// Of the true model.
    pub truth: f64,
    /// Of the true terms, fitted to the half that is seen: what is lost to the fit, not to the trace.
    pub refitted: f64,
}

/// What became of one recording.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Outcome {
    /// Of the recording.
    pub seed: u64,
    /// One an effect.
    pub answers: Vec<Answer>,
    /// Effects that are reported and are not there: `channel: kind`.
    pub false_alarms: Vec<String>,
    /// Of the effects that were named.
    pub estimates: Vec<Estimate>,
    /// Absent where nothing is hidden, or where an error is not finite.
    pub unseen: Option<Unseen>,
}

/// Makes the recording, has it analysed and compares.
///
/// # Errors
/// The recording cannot be made, or has no timeline.
pub fn examine(case: &Case) -> Result<Outcome, ExamineError> {
    let seed = case.seed;
    let failed = |reason| ExamineError::Record { seed, reason };
    let mut recording = case.simulation.run(|_| ()).map_err(failed)?;
    recording.channels.retain(|channel| RECORDED.contains(channel));
    let measurement = measurement(&recording, None).map_err(|reason| ExamineError::Timeline { seed, reason })?;
    let report = analyze(&measurement);
    let begin_s = recording.samples.first().and_then(|sample| sample.clock.time_s).unwrap_or(0.0);
    let mut outcome = score(case, &report, begin_s);
    let effects = &case.simulation.scenario.effects;
    if let ([answer], [effect]) = (&mut outcome.answers[..], &effects[..]) {
        answer.shape_known = unknown_noise::sees(effect, &measurement, begin_s);
    }
    if let Some(channel) = effects
        .first()
        .map(|effect| effect.channels().first().map_or(Channel::GyroX, |&output| simulation::channel(output)))
    {
        let truth = truth::unseen_error(case, channel).map_err(failed)?;
        let of = report.channels.iter().find(|report| report.name == channel.name());
        outcome.unseen = of.zip(truth).and_then(|(report, truth)| {
            let before = report.before.unseen.deviance_per_point?;
            Some(Unseen {
                before,
                after: report.after.unseen.deviance_per_point?,
                truth: truth.model,
                refitted: truth.fitted,
            })
        });
    }
    Ok(outcome)
}

/// Compares a report with the truth. `begin_s` is when the recording begins, counted from the part's start.
pub(super) fn score(case: &Case, report: &Report, begin_s: f64) -> Outcome {
    let moved = case.simulation.scenario.environment.motion.deviation_g > 0.0;
    // An accelerometer that is moved shows the motion, whatever that may look like.
    let is_scored = |channel: &Channel| Channel::INERTIAL[..if moved { 3 } else { 6 }].contains(channel);
    let scored: Vec<(Channel, &ChannelReport)> = Channel::INERTIAL
        .into_iter()
        .filter(is_scored)
        .filter_map(|channel| Some((channel, report.channels.iter().find(|of| of.name == channel.name())?)))
        .collect();
    let effects = &case.simulation.scenario.effects;
    let answers = case
        .kinds
        .iter()
        .zip(effects)
        .zip(&case.strengths)
        .map(|((&kind, effect), &strength)| answer(kind, effect, strength, &scored))
        .collect();
    let is_true =
        |channel: Channel, kind: &str| effects.iter().any(|effect| effect.name() == kind && shows_in(effect, channel));
    let false_alarms = scored
        .iter()
        .flat_map(|(channel, report)| report.effects.iter().map(move |effect| (*channel, effect)))
        .filter(|(channel, effect)| !is_true(*channel, &effect.kind))
        .map(|(channel, effect)| format!("{}: {}", channel.name(), effect.kind))
        .collect();
    let estimates =
        case.kinds.iter().zip(effects).flat_map(|(&kind, effect)| estimates(kind, effect, &scored, begin_s)).collect();
    Outcome { seed: case.seed, answers, false_alarms, estimates, unseen: None }
}

/// What concerns all samples alike shows in every channel.
fn shows_in(effect: &InjectedEffect, channel: Channel) -> bool {
    effect.channels().is_empty() || effect.channels().contains(&simulation::output_register(channel))
}

/// An effect is named when at least half of the channels that show it list it; what concerns the samples, not their
/// values, may be listed once.
fn answer(kind: Kind, effect: &InjectedEffect, strength: f64, scored: &[(Channel, &ChannelReport)]) -> Answer {
    let affected: Vec<&ChannelReport> =
        scored.iter().filter(|(channel, _)| shows_in(effect, *channel)).map(|(_, report)| *report).collect();
    let listing = affected.iter().filter(|report| report.effects.iter().any(|found| found.kind == kind.name())).count();
    let once = matches!(kind, Kind::DroppedSamples | Kind::RepeatedSamples | Kind::SampleClock);
    let named = listing >= if once { 1 } else { affected.len().div_ceil(2).max(1) };
    let other = affected.iter().flat_map(|report| &report.effects).find(|found| found.kind != kind.name());
    Answer {
        kind,
        strength,
        named,
        shape_known: None,
        instead: other.filter(|_| !named).map(|found| found.kind.clone()),
    }
}

/// The parameters of `effect` in the first channel that lists it.
fn estimates(kind: Kind, effect: &InjectedEffect, scored: &[(Channel, &ChannelReport)], begin_s: f64) -> Vec<Estimate> {
    let found = scored
        .iter()
        .filter(|(channel, _)| shows_in(effect, *channel))
        .find_map(|(_, report)| report.effects.iter().find(|found| found.kind == kind.name()));
    let Some(found) = found else { return Vec::new() };
    let parameters = truth::parameters(effect);
    let length = parameters.iter().map(|(_, value)| value * value).sum::<f64>().sqrt();
    let of = |&(name, truth): &(&'static str, f64)| {
        let estimate = found.parameters.get(name)?;
        let truth = if kind == Kind::BiasStep && name == "time" { truth - begin_s } else { truth };
        let scale = if kind == Kind::Acceleration { length } else { truth.abs() };
        let relative_error = (estimate.value - truth).abs() / scale;
        let (value, low, high) = (estimate.value, estimate.low, estimate.high);
        Some(Estimate { kind, name, truth, value, low, high, relative_error })
    };
    parameters.iter().filter_map(of).collect()
}
