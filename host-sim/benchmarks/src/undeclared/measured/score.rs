//! Score of an effect in measured noise.

use super::hidden_kind::HiddenKind;
use super::hide::{HiddenEffect, hide};
use super::stretch::Stretch;
use crate::undeclared::score::{ParameterScore, UNEXPLAINED, score_effect, score_parameters};
use adis16405_driver::Channel;
use noise_analysis::analysis::analyze;
use noise_analysis::report::{ChannelEffect, ChannelReport, Effect, ModelReport, Parameter, Report};
use serde::Serialize;
use std::collections::BTreeSet;

/// Deviances per point on the unseen half, in the effect's first channel; absent if there are too few samples.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct MeasuredErrors {
    pub before: Option<f64>,
    pub after: Option<f64>,
    /// Deviance with added terms in the untouched stretch.
    pub untouched_after: Option<f64>,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct MeasuredScore {
    pub recording: String,
    /// Start of the stretch, s from the recording's first sample.
    pub from_s: f64,
    pub kind: HiddenKind,
    pub channels: Vec<&'static str>,
    /// Size over detection limit.
    pub strength: f64,
    /// True if the effect is named; outside the vocabulary also if it is reported as `unexplained`.
    pub named: bool,
    /// Findings on the effect's channels, as `channel: kind`.
    pub found: Vec<String>,
    /// Wrong names that the untouched stretch does not have, as `channel: kind`.
    pub wrong_names: Vec<String>,
    pub estimates: Vec<ParameterScore>,
    pub errors: MeasuredErrors,
}

pub(super) fn hidden(stretch: &Stretch<'_>, kind: HiddenKind, effect: &HiddenEffect, strength: f64) -> MeasuredScore {
    let report = analyze(&hide(&stretch.samples, effect, stretch.seed));
    let is_in = |channel: &Channel| {
        let output = simulation::output_register(*channel);
        stretch.noise.channels.contains(&output) && effect.shows_in(output)
    };
    let own: Vec<Channel> = Channel::INERTIAL.into_iter().filter(is_in).collect();
    let (named, right, estimates) = answer(kind, effect, strength, &own, &report, &stretch.report);
    let errors = own.first().map(|first| errors(*first, &report, &stretch.report)).unwrap_or_default();
    MeasuredScore {
        recording: stretch.recording.to_owned(),
        from_s: stretch.from_s,
        kind,
        channels: own.iter().map(|channel| channel.name()).collect(),
        strength,
        named,
        found: named_as(&names(&report, &own, |_| true)),
        wrong_names: wrong_names(&own, &right, effect, (&report, &stretch.report)),
        estimates,
        errors,
    }
}

fn channel_report(report: &Report, channel: Channel) -> Option<&ChannelReport> {
    report.channels.iter().find(|of| of.name == channel.name())
}

/// True if the effect was named, then the right names, and the parameters.
fn answer(
    kind: HiddenKind,
    effect: &HiddenEffect,
    strength: f64,
    own: &[Channel],
    report: &Report,
    untouched: &Report,
) -> (bool, Vec<&'static str>, Vec<ParameterScore>) {
    let only_new = |channel: &Channel| {
        let mut of = channel_report(report, *channel)?.clone();
        let before = channel_report(untouched, *channel);
        of.effects.retain(|shown| before.is_none_or(|before| is_new(&shown.effect, &before.effects)));
        Some((*channel, of))
    };
    let shown: Vec<(Channel, ChannelReport)> = own.iter().filter_map(only_new).collect();
    let scored: Vec<(Channel, &ChannelReport)> = shown.iter().map(|(channel, report)| (*channel, report)).collect();
    match effect {
        HiddenEffect::Known(kind, effect) => {
            let affected: Vec<&ChannelReport> = scored.iter().map(|(_, report)| *report).collect();
            let named = score_effect(*kind, strength, &affected).named;
            let estimates = if named { score_parameters(*kind, effect, &scored, 0.0) } else { Vec::new() };
            (named, vec![kind.name(), UNEXPLAINED], estimates)
        }
        HiddenEffect::Outside(_) => {
            let HiddenKind::Outside(kind) = kind else { return (false, Vec::new(), Vec::new()) };
            let right: Vec<&'static str> = kind.right_names().iter().copied().chain([UNEXPLAINED]).collect();
            let mut found = scored.iter().flat_map(|(_, report)| &report.effects);
            (found.any(|found| right.contains(&found.effect.name())), right, Vec::new())
        }
    }
}

/// True if none of `others` has the same kind and parameters, that is one estimate within the other's interval.
fn is_new(effect: &Effect, others: &[ChannelEffect]) -> bool {
    let parameters = effect.parameters();
    let is_same = |other: &ChannelEffect| {
        let of_other = other.effect.parameters();
        let is_in = |one: &Parameter, another: &Parameter| (another.low..=another.high).contains(&one.value);
        let agrees = |(name, parameter): (&&str, &Parameter)| {
            of_other.get(name).is_none_or(|of| is_in(of, parameter) || is_in(parameter, of))
        };
        other.effect.name() == effect.name() && parameters.iter().all(agrees)
    };
    !others.iter().any(is_same)
}

/// New names of the first report that are neither `right` in `own` channels nor of a part of the effect.
fn wrong_names(
    own: &[Channel],
    right: &[&str],
    effect: &HiddenEffect,
    (report, untouched): (&Report, &Report),
) -> Vec<String> {
    let known = names(untouched, &Channel::INERTIAL, |_| true);
    let is_right = |(channel, kind): &(Channel, &str)| own.contains(channel) && right.contains(kind);
    let is_no_part = |found: &Effect| !matches!(effect, HiddenEffect::Outside(effect) if effect.has_part(found));
    let mut new = names(report, &Channel::INERTIAL, is_no_part);
    new.retain(|name| !known.contains(name) && !is_right(name));
    named_as(&new)
}

fn names(report: &Report, channels: &[Channel], counts: impl Fn(&Effect) -> bool) -> BTreeSet<(Channel, &'static str)> {
    let of_channel = |channel: &Channel| {
        let effects = channel_report(report, *channel).map(|of| of.effects.as_slice()).unwrap_or_default();
        let counted = effects.iter().filter(|shown| counts(&shown.effect));
        counted.map(|shown| (*channel, shown.effect.name())).collect::<Vec<_>>()
    };
    channels.iter().flat_map(of_channel).collect()
}

fn named_as(names: &BTreeSet<(Channel, &'static str)>) -> Vec<String> {
    names.iter().map(|(channel, kind)| format!("{}: {kind}", channel.name())).collect()
}

fn errors(channel: Channel, report: &Report, untouched: &Report) -> MeasuredErrors {
    let (Some(report), Some(untouched)) = (channel_report(report, channel), channel_report(untouched, channel)) else {
        return MeasuredErrors::default();
    };
    let raw = |model: &ModelReport| model.unseen.deviance_per_point;
    MeasuredErrors { before: raw(&report.before), after: raw(&report.after), untouched_after: raw(&untouched.after) }
}
