//! Length, rest and losses of a record.

use super::channels::inertial;
use crate::finding_text::channel_list;
use crate::formatting::{count, of_each_cause};
use crate::rounding::{significant, span};
use noise_analysis::effects::Effect;
use noise_analysis::report::{ChannelReport, Finding, Report, Stretch};
use time_base::TimeRange;

/// Least part at rest for "throughout".
const THROUGHOUT: f64 = 0.999;

const REPEATED: &str = "repeated";

/// Cause of a sample without a value in one channel.
const MISSING: &str = "missing";

pub(super) fn periods(report: &Report) -> u64 {
    let missing = report.dropped.iter().filter(|(cause, _)| *cause != REPEATED);
    missing.fold(report.samples, |sum, (_, &of)| sum.saturating_add(of))
}

pub(super) fn report_length_s(report: &Report) -> f64 {
    let length = periods(report) as f64 / report.sample_rate_hz;
    if length.is_finite() { length } else { 0.0 }
}

/// The longest stretch at rest: of the whole file if it was examined, else of the record.
pub fn longest_at_rest(report: &Report) -> Option<Stretch> {
    let stretches = || inertial(report).flat_map(|channel| &channel.at_rest);
    let longest = || stretches().max_by(|a, b| (a.to_s - a.from_s).total_cmp(&(b.to_s - b.from_s))).copied();
    report.longest_at_rest.or_else(longest)
}

/// Options for a part of a recording, in tenths of a second inside of it.
pub fn time_options(from_s: f64, to_s: f64) -> String {
    let TimeRange { from_s, to_s } = TimeRange { from_s, to_s }.whole_tenths();
    format!("--from {from_s} --to {to_s}")
}

/// Least over the channels, s; `None` without any.
fn least_at_rest(report: &Report) -> Option<f64> {
    let still = |channel: &ChannelReport| channel.at_rest.iter().map(|of| of.to_s - of.from_s).sum::<f64>();
    let least = inertial(report).filter(|channel| !channel.at_rest.is_empty()).map(still).fold(f64::INFINITY, f64::min);
    least.is_finite().then_some(least)
}

pub(super) fn has_moved(report: &Report) -> bool {
    let is_motion = |of: &Finding| matches!(of.effect, Effect::MotionInterval(_));
    least_at_rest(report)
        .is_some_and(|least| report.findings.iter().any(is_motion) || least < THROUGHOUT * report_length_s(report))
}

pub(super) fn rest(report: &Report) -> String {
    let length = report_length_s(report);
    let Some(least) = least_at_rest(report) else { return String::new() };
    let is_knock = |of: &&Finding| matches!(of.effect, Effect::NoisyInterval(_));
    let knocks = report.findings.iter().filter(is_knock).count();
    if has_moved(report) {
        let longest = longest_at_rest(report).map_or_else(String::new, |of| {
            format!("; for the longest part at rest, add {}", time_options(of.from_s, of.to_s))
        });
        return format!("It moved for up to {}{longest}.", span((length - least).max(0.0)));
    }
    match knocks {
        0 => "At rest throughout.".to_owned(),
        1 => "At rest but for a knock.".to_owned(),
        knocks => format!("At rest but for {knocks} knocks."),
    }
}

pub(super) fn losses(report: &Report) -> String {
    let lost = report.dropped.get("gap").copied().unwrap_or(0);
    let percent = significant(100.0 * lost as f64 / periods(report).max(1) as f64, 2);
    if lost > 0 && report.dropped.get(REPEATED) == Some(&lost) {
        // Values read twice account for the missing ones.
        return format!("{} samples ({percent} %) are missing: the one before was read again instead.", count(lost));
    }
    let refused = of_each_cause(report.dropped.iter().filter(|(cause, _)| cause.as_str() != "gap"));
    let refused = if refused.is_empty() { refused } else { format!(", refused: {refused}") };
    let lost =
        if lost == 0 { "No sample lost".to_owned() } else { format!("{} samples lost ({percent} %)", count(lost)) };
    format!("{lost}{}{refused}.", missing_values(report))
}

fn missing_values(report: &Report) -> String {
    let missing = |channel: &ChannelReport| channel.missing.refused.get(MISSING).copied().unwrap_or(0);
    let with_missing: Vec<&ChannelReport> = report.channels.iter().filter(|channel| missing(channel) > 0).collect();
    let Some(most) = with_missing.iter().map(|channel| missing(channel)).max() else { return String::new() };
    let up_to = if with_missing.iter().all(|channel| missing(channel) == most) { "" } else { "up to " };
    let names = channel_list(with_missing.iter().map(|channel| &channel.name));
    format!(", {up_to}{} values missing in {names}", count(most))
}
