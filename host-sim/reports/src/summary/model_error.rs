//! Errors of the models on the unseen half, in words.

use super::channels::{inertial, inertial_names};
use crate::finding_text::channel_name;
use crate::formatting::count;
use crate::rounding::{NONE, extremes, significant};
use noise_analysis::nonstationarity::FittedPart;
use noise_analysis::report::{ChannelReport, ModelReport, Report};

/// Deviance per point on the unseen half above which a model is marked; a true model has about 1.
pub(crate) const HIGH_DEVIANCE: f64 = 3.0;

/// Without and with the findings: twice the same one for a channel without a finding, even if its first half alone has shown an effect.
pub(crate) fn models(channel: &ChannelReport) -> [&ModelReport; 2] {
    [if channel.effects.is_empty() { &channel.after } else { &channel.before }, &channel.after]
}

pub(super) fn is_high(channel: &ChannelReport) -> bool {
    channel.after.unseen.deviance_per_point.is_some_and(|of| of > HIGH_DEVIANCE)
}

pub fn is_fitted_to_later_quarter(channel: &ChannelReport) -> bool {
    channel.nonstationarity.as_ref().is_some_and(|of| of.fitted_to == FittedPart::LaterQuarter)
}

/// Error of σ by the rms logarithm of its ratio: a factor of 2 is 100 %.
pub(crate) fn off_percent(rms_percent: f64) -> String {
    match 100.0 * (rms_percent / 100.0).exp_m1() {
        off if off > 1000.0 => "> 1,000".to_owned(),
        off => significant(off, if off < 100.0 { 2 } else { 3 }),
    }
}

pub(crate) fn deviance_per_point(of: f64) -> String {
    match of {
        of if of < 9.95 => format!("{of:.1}"),
        of if of <= 1000.0 => count(of.round() as u64),
        _ => "> 1,000".to_owned(),
    }
}

/// Error of σ before and after; empty without unseen data.
pub(super) fn error_change(rms_percent: [Option<f64>; 2]) -> String {
    let [before, after] = rms_percent.map(|of| of.map_or_else(|| NONE.to_owned(), off_percent));
    match (rms_percent, before == after) {
        ([None, None], _) => NONE.to_owned(),
        (_, true) => format!("{after} %"),
        _ => format!("{before} → {after} %"),
    }
}

/// Error of the first half's models on the second; `None` without unseen data.
pub(super) fn unseen_half(report: &Report) -> Option<String> {
    let range = |of: &dyn Fn(&ChannelReport) -> Option<f64>| {
        let each: Vec<f64> = inertial(report).filter_map(of).collect();
        let (low, high) = extremes(each.iter().copied());
        let [low, high] = [low, high].map(off_percent);
        let range = if low == high { high } else { format!("{low} to {high}") };
        (!each.is_empty()).then(|| format!("{range} %"))
    };
    let with = range(&|channel| channel.after.unseen.rms_percent)?;
    let halves = range(&|channel| channel.first_half_curve.rms_percent)
        .map_or_else(String::new, |halves| format!(" (the two halves differ by {halves})"));
    let is_changed = |channel: &ChannelReport| models(channel)[0].unseen != channel.after.unseen;
    let changed = inertial_names(report, is_changed);
    let without = range(&|channel| channel.before.unseen.rms_percent.filter(|_| is_changed(channel))).zip(changed);
    let without =
        without.map_or_else(String::new, |(range, names)| format!("; without what was found in {names}, by {range}"));
    Some(format!("On the second half, which the model had not seen, σ is off by {with}{halves}{without}."))
}

pub(super) fn recent_fit(report: &Report) -> Option<String> {
    let recent = inertial_names(report, is_fitted_to_later_quarter)?;
    Some(format!(
        "Because the noise changed, the model of {recent} was fitted to the last quarter before the second half alone."
    ))
}

/// `None` without spikes and knocks.
pub(super) fn without_events(report: &Report) -> Option<String> {
    let excluding = inertial(report).filter_map(|channel| {
        let [before, after] = models(channel).map(|model| model.unseen_excluding.as_ref());
        let change = error_change([before?, after?].map(|error| error.rms_percent));
        Some(format!("{} {change}", channel_name(channel)))
    });
    let excluding: Vec<String> = excluding.collect();
    (!excluding.is_empty()).then(|| format!("Without spikes and knocks σ is off by: {}.", excluding.join(", ")))
}

/// Reasons why models fail on the unseen half, with their channels.
pub(super) fn failures(report: &Report) -> Vec<String> {
    const EVENTS: &str = "spikes or knocks came oftener or larger than before";
    const CHANGE: &str = "the noise changed";
    const LACK: &str = "the model lacks something";
    const UNKNOWN: &str = "the model fails";
    let excluding = |channel: &ChannelReport| channel.after.unseen_excluding.as_ref()?.deviance_per_point;
    let reason = |channel: &ChannelReport| match channel.first_half_curve.deviance_per_point {
        _ if excluding(channel).is_some_and(|of| of <= HIGH_DEVIANCE) => EVENTS,
        Some(of) if of > HIGH_DEVIANCE => CHANGE,
        Some(_) => LACK,
        None => UNKNOWN,
    };
    let failing = |of: &str| inertial_names(report, |channel| is_high(channel) && reason(channel) == of);
    let told = [EVENTS, CHANGE, LACK, UNKNOWN].into_iter().filter_map(|of| Some(format!("{of} in {}", failing(of)?)));
    told.collect()
}
