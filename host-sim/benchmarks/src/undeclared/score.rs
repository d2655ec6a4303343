//! The score of one recording, which is simulated, analysed and compared with the truth.

use super::channel_under_test::ChannelUnderTest;
use super::draw::DrawnRecording;
use super::effect::{EffectKind, parameters};
use super::outside::{OutsideEffect, OutsideKind};
use super::sample_loss::lose_samples;
use super::truth::{detects_known_waveform, true_model_errors};
use adis16405_driver::Channel;
use noise_analysis::analysis::analyze;
use noise_analysis::report::{ChannelReport, Effect, ModelReport, Report};
use recordings::time_base::{TimeBaseError, measurement};
use serde::Serialize;
use virtual_sensor::InjectedEffect;

/// The scored channels, and the channels on which effects depend.
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

pub(super) const UNEXPLAINED: &str = "unexplained";

#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ScoreError {
    #[error("seed {seed}: {reason}")]
    Timeline { seed: u64, reason: TimeBaseError },
}

/// The error of a parameter of a named effect, in the report's unit.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ParameterScore {
    pub kind: EffectKind,
    pub name: &'static str,
    pub truth: f64,
    pub value: f64,
    pub low: f64,
    pub high: f64,
    /// Relative error; for a sensitivity to three axes it is relative to the vector's length.
    pub relative_error: f64,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct EffectScore {
    pub kind: EffectKind,
    /// Size over detection limit.
    pub strength: f64,
    pub named: bool,
    /// True if a test with known channel and waveform but unknown noise detects the effect; absent in pairs and for
    /// other effects.
    pub shape_known: Option<bool>,
    /// The first other effect in its channels, if it is not named.
    pub instead: Option<String>,
}

/// Deviances per point on the unseen half, in the first channel with an effect.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct UnseenErrors {
    pub before: f64,
    pub after: f64,
    pub truth: f64,
    /// Deviance with the true terms fitted to the other half: it shows the error of the fit.
    pub refitted: f64,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RecordingScore {
    pub seed: u64,
    pub answers: Vec<EffectScore>,
    /// Names without a hidden effect, as `channel: kind`.
    pub false_alarms: Vec<String>,
    pub estimates: Vec<ParameterScore>,
    /// Absent if no effect is hidden, or if an error is not finite.
    pub unseen: Option<UnseenErrors>,
    pub outside: Option<OutsideScore>,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct OutsideScore {
    pub kind: OutsideKind,
    /// Size over detection limit.
    pub strength: f64,
    /// True if its channel is reported as `unexplained`.
    pub unexplained: bool,
    pub named: bool,
}

/// Generates a recording, removes the fraction `loss` of samples, analyses it and compares the report with the truth.
///
/// # Errors
/// The recording has no time base.
pub fn score_recording(drawn: &DrawnRecording, loss: f64) -> Result<RecordingScore, ScoreError> {
    let seed = drawn.seed;
    let mut recording = drawn.simulation.record();
    recording.channels.retain(|channel| RECORDED.contains(channel));
    let mut measurement = measurement(&recording, None).map_err(|reason| ScoreError::Timeline { seed, reason })?;
    lose_samples(&mut measurement, loss, seed);
    let report = analyze(&measurement);
    let mut score = compare(drawn, &report, loss);
    let effects = &drawn.simulation.scenario.effects;
    if let ([answer], [effect]) = (&mut score.answers[..], &effects[..]) {
        answer.shape_known = detects_known_waveform(effect, &drawn.simulation, &recording);
    }
    if let Some(channel) = effects
        .first()
        .map(|effect| effect.channels().first().map_or(Channel::GyroX, |&output| simulation::channel(output)))
    {
        let truth = true_model_errors(drawn, channel);
        let of = report.channels.iter().find(|report| report.name == channel.name());
        score.unseen = of.zip(truth).and_then(|(report, truth)| {
            // The error excludes spikes by the rule of the first half, as for the true model.
            let error =
                |model: &ModelReport| model.unseen_excluding.as_ref().unwrap_or(&model.unseen).deviance_per_point;
            Some(UnseenErrors {
                before: error(&report.before)?,
                after: error(&report.after)?,
                truth: truth.model,
                refitted: truth.fitted,
            })
        });
    }
    Ok(score)
}

/// The score of a report; `loss` is the fraction of samples lost in addition to the effects.
pub(super) fn compare(drawn: &DrawnRecording, report: &Report, loss: f64) -> RecordingScore {
    let moved = drawn.simulation.scenario.environment.motion.deviation_g > 0.0;
    // In an accelerometer a motion can resemble any kind.
    let is_scored = |channel: &Channel| Channel::INERTIAL[..if moved { 3 } else { 6 }].contains(channel);
    let scored: Vec<(Channel, &ChannelReport)> = Channel::INERTIAL
        .into_iter()
        .filter(is_scored)
        .filter_map(|channel| Some((channel, report.channels.iter().find(|of| of.name == channel.name())?)))
        .collect();
    let effects = &drawn.simulation.scenario.effects;
    let is_below_a_count = |channel: Channel| {
        let output = simulation::output_register(channel);
        ChannelUnderTest::new(&drawn.simulation, output, effects).is_below_a_count()
    };
    let answers = drawn
        .kinds
        .iter()
        .zip(effects)
        .zip(&drawn.strengths)
        .map(|((&kind, effect), &strength)| {
            // Counts that seldom change cannot show a filter.
            let is_shown = |channel: Channel| kind != EffectKind::FilterBandwidth || !is_below_a_count(channel);
            let shown = scored.iter().filter(|(channel, _)| shows_in(effect, *channel) && is_shown(*channel));
            score_effect(kind, strength, &shown.map(|(_, report)| *report).collect::<Vec<_>>())
        })
        .collect();
    let outside = drawn.simulation.outside.first();
    let is_true = |channel: Channel, found: &Effect| {
        let kind = found.name();
        let is_lost = loss > 0.0 && kind == EffectKind::DroppedSamples.name();
        // `unexplained` for a part of an effect is not a wrong name.
        let output = simulation::output_register(channel);
        let is_outside = outside.is_some_and(|effect| {
            let describes =
                kind == UNEXPLAINED || effect.kind().right_names().contains(&kind) || effect.has_part(found);
            effect.shows_in(output) && describes
        });
        let is_unexplained = kind == UNEXPLAINED && effects.iter().any(|effect| shows_in(effect, channel));
        is_lost
            || is_outside
            || is_unexplained
            || (kind == "noise_below_count" && is_below_a_count(channel))
            || effects.iter().any(|effect| effect.name() == kind && shows_in(effect, channel))
    };
    let false_alarms = scored
        .iter()
        .flat_map(|(channel, report)| report.effects.iter().map(move |shown| (*channel, &shown.effect)))
        .filter(|(channel, found)| !is_true(*channel, found))
        .map(|(channel, found)| format!("{}: {}", channel.name(), found.name()))
        .collect();
    let estimates = drawn
        .kinds
        .iter()
        .zip(effects)
        .flat_map(|(&kind, effect)| score_parameters(kind, effect, &scored, loss))
        .collect();
    let strength = drawn.strengths.first().copied().unwrap_or(0.0);
    let outside = outside.map(|effect| score_outside(effect, strength, &scored));
    RecordingScore { seed: drawn.seed, answers, false_alarms, estimates, unseen: None, outside }
}

fn score_outside(effect: &OutsideEffect, strength: f64, scored: &[(Channel, &ChannelReport)]) -> OutsideScore {
    let own = scored.iter().filter(|(channel, _)| effect.shows_in(simulation::output_register(*channel)));
    let names: Vec<&str> = own.flat_map(|(_, report)| &report.effects).map(|found| found.effect.name()).collect();
    let named = names.iter().any(|name| effect.kind().right_names().contains(name));
    OutsideScore { kind: effect.kind(), strength, unexplained: names.contains(&UNEXPLAINED), named }
}

fn shows_in(effect: &InjectedEffect, channel: Channel) -> bool {
    effect.channels().is_empty() || effect.channels().contains(&simulation::output_register(channel))
}

/// An effect counts as named if half of its channels list it; one channel suffices for sample faults and clock.
pub(super) fn score_effect(kind: EffectKind, strength: f64, affected: &[&ChannelReport]) -> EffectScore {
    let listing =
        affected.iter().filter(|report| report.effects.iter().any(|found| found.effect.name() == kind.name())).count();
    let once = matches!(kind, EffectKind::DroppedSamples | EffectKind::RepeatedSamples | EffectKind::SampleClock);
    let named = listing >= if once { 1 } else { affected.len().div_ceil(2).max(1) };
    let other = affected.iter().flat_map(|report| &report.effects).find(|found| found.effect.name() != kind.name());
    EffectScore {
        kind,
        strength,
        named,
        shape_known: None,
        instead: other.filter(|_| !named).map(|found| found.effect.name().to_owned()),
    }
}

/// The parameters in the first channel that lists the effect.
pub(super) fn score_parameters(
    kind: EffectKind,
    effect: &InjectedEffect,
    scored: &[(Channel, &ChannelReport)],
    loss: f64,
) -> Vec<ParameterScore> {
    let found = scored
        .iter()
        .filter(|(channel, _)| shows_in(effect, *channel))
        .find_map(|(_, report)| report.effects.iter().find(|found| found.effect.name() == kind.name()));
    let Some(found) = found else { return Vec::new() };
    let (parameters, estimates) = (parameters(effect), found.effect.parameters());
    let length = parameters.iter().map(|(_, value)| value * value).sum::<f64>().sqrt();
    let score = |&(name, truth): &(&'static str, f64)| {
        let estimate = estimates.get(name)?;
        let truth = match kind {
            EffectKind::DroppedSamples => truth + (1.0 - truth) * loss,
            _ => truth,
        };
        let scale = if kind == EffectKind::Acceleration { length } else { truth.abs() };
        let relative_error = (estimate.value - truth).abs() / scale;
        let (value, low, high) = (estimate.value, estimate.low, estimate.high);
        Some(ParameterScore { kind, name, truth, value, low, high, relative_error })
    };
    parameters.iter().filter_map(score).collect()
}
