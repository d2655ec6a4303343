//! Each finding in words, a sentence of physics and one of advice (`docs/findings.md`).

mod amounts;
mod channel_names;
mod departure;
mod sentences;
mod shown_effect;

use crate::formatting::capital;
use crate::rounding::significant;
pub(crate) use amounts::Label;
pub use channel_names::channel_list;
pub(crate) use channel_names::{ALL_CHANNELS, SENSED, channel_name};
pub(crate) use departure::{departure, excess_percent};
use noise_analysis::report::{Finding, Validation};
use sentences::DETAIL;
pub(crate) use sentences::Sentences;
pub use shown_effect::{ShownEffect, shown_effects};
use std::collections::BTreeMap;

/// Begin an advice: nothing is left to do; numbers are subtracted, if the second half confirms them.
const DONE: &str = "(done) ";
const COMPENSATE: &str = "(compensate) ";

#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct FindingText {
    /// The channels that show it, such as `gyro z` or `accel x y`.
    pub channels: String,
    pub channel_count: usize,
    /// The cause, with the size in each channel.
    pub physics: String,
    /// For one line of a narrow screen, without intervals and details.
    pub brief: String,
    /// Remedy, or what to look for.
    pub advice: String,
    /// First step of the advice; `None` if nothing is left to do.
    pub step: Option<String>,
    /// Share of the variance, and confirmation by the second half; empty if unknown.
    pub weight: String,
}

impl FindingText {
    pub(crate) fn sentences(&self) -> String {
        let weight = if self.weight.is_empty() { String::new() } else { format!(" {}.", capital(&self.weight)) };
        format!("{}{weight}", self.physics)
    }
}

/// `shown` has each channel's numbers; without it, those of the clearest channel are used.
pub fn describe(finding: &Finding, shown: &[ShownEffect]) -> FindingText {
    let clearest = finding.channels.get(finding.clearest).map_or("", String::as_str);
    let alone = [ShownEffect { channel: clearest, effect: &finding.effect }];
    let shown = if shown.is_empty() { &alone } else { shown };
    let label = Label::new(&finding.channels);
    let [full, brief] = [false, true].map(|is_brief| {
        let numbers = Sentences::new(&finding.effect, shown, label, is_brief);
        numbers.with("several", finding.channels.len() > 1).with("off", gain(finding))
    });
    let [physics, advice, ..] = &full.lines()[..] else { return FindingText::default() };
    let is_refuted = advice.starts_with(COMPENSATE) && finding.validated == Validation::No;
    let advice = if is_refuted { "{@again}" } else { advice.as_str() };
    let is_done = advice.starts_with(DONE);
    let advice = full.filled(advice.trim_start_matches(DONE).trim_start_matches(COMPENSATE));
    let first = advice.split(DETAIL).next().unwrap_or_default();
    FindingText {
        channels: channel_list(&finding.channels),
        channel_count: finding.channels.len(),
        physics: full.filled(physics).replace(DETAIL, ""),
        brief: brief.filled(physics).split(DETAIL).step_by(2).collect(),
        step: (!is_done).then(|| format!("{first}.")),
        advice: advice.replace(DETAIL, ""),
        weight: weight(finding),
    }
}

/// The largest of a finding's shares by channel, percent; 0 without one.
pub(crate) fn largest(shares: &BTreeMap<String, f64>) -> f64 {
    shares.values().copied().fold(0.0, f64::max)
}

/// Largest share of the variance, that around a minute, and the second half's confirmation; empty if unknown.
fn weight(finding: &Finding) -> String {
    let percent = |share: f64| (share >= 0.5).then(|| significant(share, 2));
    let [minute, share] = [&finding.minute_percent, &finding.share_percent].map(|shares| percent(largest(shares)));
    let share = share.map(|share| match minute {
        None => format!("up to {share} % of σ²"),
        Some(minute) if minute == share => format!("{share} % of σ² around τ = 1 min"),
        Some(minute) => format!("up to {share} % of σ², {minute} % around τ = 1 min"),
    });
    let held = match finding.validated {
        Validation::Yes => Some("the second half confirms it".to_owned()),
        Validation::No => Some("the second half does not confirm it".to_owned()),
        Validation::Untestable => None,
    };
    share.into_iter().chain(held).collect::<Vec<_>>().join("; ")
}

/// Reduction of σ in the channel with the largest share; empty if unknown.
fn gain(finding: &Finding) -> String {
    let share = largest(&finding.share_percent) / 100.0;
    let percent = significant(100.0 * (1.0 - (1.0 - share).sqrt()), 2);
    let is_known = share > 0.0 && share < 1.0;
    if is_known { format!(" It would take {percent} % off σ where it is largest.") } else { String::new() }
}

#[cfg(test)]
mod tests;
