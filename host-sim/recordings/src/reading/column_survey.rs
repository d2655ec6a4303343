//! Survey of the numbers of a column before they become counts.

use crate::batch_source::channel;
use crate::recording::Verdict;
use adis16405_driver::{Channel, Faults};
use measurement::ChannelProfile;
use readers::{ColumnQuantizer, ValueColumn};
use std::collections::BTreeMap;

/// How often a range of the data sheet a value may be before it is no measurement.
const MAX_RANGES: f64 = 2.0;

/// The same in the unit of a channel whose range is not known: far above what any sensor measures in deg/s, g or gauss, and the largest
/// count of 32 bits.
const LARGEST_VALUE: f64 = 4.3e9;

/// Largest part of the variance of the noise that rounding adds without a note: ten times what it adds where there is room for it, and
/// a twentieth of a percent of N.
const NOTED_COST: f64 = 1e-3;

/// Consecutive rows of a column of which all are kept or none.
const RUN: usize = 64;
/// Numbers of a column that are kept at most.
const MOST_KEPT: usize = 1 << 17;

/// Why a number of a row is no measurement, if so.
pub(crate) fn refusal(column: &ValueColumn, value: f64, verdict: Option<&Verdict>) -> Option<&'static str> {
    if value.is_nan() {
        return Some("missing");
    }
    match verdict.filter(|_| column.register.is_some()) {
        Some(verdict) if verdict.refused.is_empty() => None,
        Some(verdict) => refusal_of_register(channel(column)?, value, *verdict),
        None if value.is_infinite() => Some("not_finite"),
        None if (value * column.factor).abs() > largest_value(&column.profile) => Some("out_of_range"),
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

/// The largest value of a channel that is a measurement, in its unit.
fn largest_value(profile: &ChannelProfile) -> f64 {
    profile.range.map_or(LARGEST_VALUE, |range| MAX_RANGES * range)
}

/// Numbers of a column, evenly spread in runs of neighbours with NaN between the runs: all numbers of a column up to 2¹⁷.
#[derive(Debug, Clone)]
pub(crate) struct ColumnSurvey {
    values: Vec<f64>,
    /// Numbers seen, and how many runs there are for one that is kept.
    seen: usize,
    stride: usize,
    /// True if a number can be used, and whether one is not zero.
    is_usable: bool,
    has_other_than_zero: bool,
    /// Numbers that are refused, by cause.
    pub(crate) refused: BTreeMap<&'static str, u64>,
}

impl ColumnSurvey {
    pub(crate) fn new() -> Self {
        Self {
            values: Vec::new(),
            seen: 0,
            stride: 1,
            is_usable: false,
            has_other_than_zero: false,
            refused: BTreeMap::new(),
        }
    }

    /// Adds the numbers of rows that arrived, and makes those that are refused NaN.
    pub(crate) fn add(&mut self, column: &ValueColumn, values: &mut [f64], verdicts: &[Verdict]) {
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
                self.thin();
                self.stride *= 2;
            }
            if self.is_kept() {
                self.values.extend_from_slice(run);
            }
            self.seen += run.len();
            rest = after;
        }
    }

    /// Numbers that were added.
    pub(crate) fn rows(&self) -> usize {
        self.seen
    }

    /// True if all numbers that can be used are zero.
    pub(crate) fn is_zero(&self) -> bool {
        self.is_usable && !self.has_other_than_zero
    }

    /// True if the next number is in a run that is kept. The stride is a power of two.
    fn is_kept(&self) -> bool {
        (self.seen / RUN) & (self.stride - 1) == 0
    }

    /// Drops every second run.
    fn thin(&mut self) {
        let kept = self.values.chunks(RUN).step_by(2).flatten().copied().collect();
        self.values = kept;
    }

    /// The numbers that are kept.
    fn values(&self) -> Vec<f64> {
        if self.stride == 1 {
            return self.values.clone();
        }
        let run = |run: &[f64]| run.iter().copied().chain([f64::NAN]).collect::<Vec<f64>>();
        self.values.chunks(RUN).flat_map(run).collect()
    }

    /// How the numbers become counts; `None` where none can be used.
    pub(crate) fn quantizer(&self, column: &ValueColumn) -> Option<ColumnQuantizer> {
        let of_values =
            || if column.register.is_some() { ColumnQuantizer::COUNTS } else { ColumnQuantizer::new(&self.values()) };
        self.is_usable.then(of_values)
    }

    /// The same for numbers that are no multiples of the step of those that were kept.
    pub(crate) fn quantizer_without_step(&self) -> ColumnQuantizer {
        ColumnQuantizer::without_step(&self.values())
    }
}

/// Note on the counts that stand for the numbers of some channels; `None` where rounding to them costs nothing that
/// counts.
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
