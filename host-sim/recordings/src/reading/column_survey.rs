//! Numbers of a column before they become counts.

use crate::batch_source::{ProfiledColumn, channel};
use crate::recording::Verdict;
use adis16405_driver::{Channel, Faults};
use measurement::ChannelProfile;
use readers::ColumnQuantizer;
use std::collections::BTreeMap;

/// Factor on a data sheet's range of plausible values.
const MAX_RANGES: f64 = 2.0;

/// For unknown ranges: above any sensor in deg/s, g or gauss, and the largest 32-bit count.
const LARGEST_VALUE: f64 = 4.3e9;

/// Largest relative variance by rounding without a note: a twentieth of a percent of N.
const NOTED_COST: f64 = 1e-3;

const RUN: usize = 64;
const MOST_KEPT: usize = 1 << 17;

pub(crate) fn refusal(column: &ProfiledColumn, value: f64, verdict: Option<&Verdict>) -> Option<&'static str> {
    if value.is_nan() {
        return Some("missing");
    }
    match verdict.filter(|_| column.register.is_some()) {
        Some(verdict) if verdict.refused.is_empty() => None,
        Some(verdict) => refusal_of_register(channel(column.register)?, value, *verdict),
        None if value.is_infinite() => Some("not_finite"),
        None if (value * column.factor).abs() > largest_value(&column.channel) => Some("out_of_range"),
        None => None,
    }
}

fn refusal_of_register(channel: Channel, count: f64, verdict: Verdict) -> Option<&'static str> {
    if !verdict.refused.contains(channel) {
        return None;
    }
    let is_impossible = count.abs() > f64::from(Faults::LARGEST_RATE.unsigned_abs());
    let fault = match channel {
        Channel::GyroX | Channel::GyroY | Channel::GyroZ if is_impossible => Faults::IMPOSSIBLE_RATE,
        Channel::GyroX if verdict.faults.contains(Faults::X_SIGN) => Faults::X_SIGN,
        _ => Faults::NO_NEW_DATA,
    };
    fault.cause()
}

/// In the channel's unit.
fn largest_value(profile: &ChannelProfile) -> f64 {
    profile.range.map_or(LARGEST_VALUE, |range| MAX_RANGES * range)
}

/// Evenly spread runs of a column's numbers, NaN between; all up to 2¹⁷.
#[derive(Debug, Clone, Default)]
pub(crate) struct ColumnSurvey {
    values: Vec<f64>,
    /// Numbers, and times that every other run was dropped.
    seen: usize,
    thinned: u32,
    is_usable: bool,
    has_other_than_zero: bool,
    /// Numbers that are refused, by cause.
    pub(crate) refused: BTreeMap<&'static str, u64>,
}

impl ColumnSurvey {
    /// Sets refused numbers to NaN.
    pub(crate) fn add(&mut self, column: &ProfiledColumn, values: &mut [f64], verdicts: &[Verdict]) {
        for (row, value) in values.iter_mut().enumerate() {
            if let Some(cause) = refusal(column, *value, verdicts.get(row)) {
                *self.refused.entry(cause).or_insert(0) += 1;
                *value = f64::NAN;
                continue;
            }
            self.is_usable = true;
            self.has_other_than_zero |= *value != 0.0;
        }
        let mut rest = &*values;
        while !rest.is_empty() {
            let (run, after) = rest.split_at(rest.len().min(RUN - self.seen % RUN));
            if self.is_kept() && self.values.len() == MOST_KEPT {
                self.values = self.values.chunks(RUN).step_by(2).flatten().copied().collect();
                self.thinned += 1;
            }
            if self.is_kept() {
                self.values.extend_from_slice(run);
            }
            self.seen += run.len();
            rest = after;
        }
    }

    pub(crate) fn rows(&self) -> usize {
        self.seen
    }

    pub(crate) fn is_zero(&self) -> bool {
        self.is_usable && !self.has_other_than_zero
    }

    fn is_kept(&self) -> bool {
        (self.seen / RUN).is_multiple_of(1 << self.thinned)
    }

    fn values(&self) -> Vec<f64> {
        if self.thinned == 0 {
            return self.values.clone();
        }
        let run = |run: &[f64]| run.iter().copied().chain([f64::NAN]).collect::<Vec<f64>>();
        self.values.chunks(RUN).flat_map(run).collect()
    }

    pub(crate) fn quantizer(&self, column: &ProfiledColumn) -> Option<ColumnQuantizer> {
        let of_values =
            || if column.register.is_some() { ColumnQuantizer::COUNTS } else { ColumnQuantizer::new(&self.values()) };
        self.is_usable.then(of_values)
    }

    pub(crate) fn quantizer_without_step(&self) -> ColumnQuantizer {
        ColumnQuantizer::without_step(&self.values())
    }
}

/// A note on channels whose rounding costs precision; `None` if negligible.
pub(crate) fn rounding_note<'a>(
    channels: impl Iterator<Item = (&'a ChannelProfile, &'a ColumnQuantizer)>,
) -> Option<String> {
    let cost = |(profile, quantizer): (&ChannelProfile, &ColumnQuantizer)| {
        let cost = quantizer.cost.filter(|cost| *cost > NOTED_COST)?;
        Some(format!("{} {cost:.1e}", profile.name))
    };
    let costs: Vec<String> = channels.filter_map(cost).collect();
    let of = "rounding to counts adds to the variance of the noise, as a part of it:";
    (!costs.is_empty()).then(|| format!("{of} {}", costs.join(", ")))
}
