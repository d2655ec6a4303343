//! From the rows of any sensor to the [`Measurement`] that is analysed: time base, counts, and what the channels show.

use crate::tables::channel_health::saturated;
use crate::tables::quantizer::Quantizer;
use crate::tables::sensor_table::{SensorTable, TableColumn};
use crate::time_base::EstimatedTimeBase;
use crate::time_base::sample_slots::{MAX_REPEATED_READ_INTERVAL, SampleSlots, usual_interval};
use crate::time_base::stamp_quality::StampQuality;
use crate::time_base::time_base_error::TimeBaseError;
use measurement::{ChannelProfile, MeasuredChannel, Measurement, SensorProfile, repeated_fraction};
use std::collections::{BTreeMap, BTreeSet};

/// Fewest channels whose equal rows are one sample that was read twice; fewer are equal by chance.
pub(crate) const MIN_CHANNELS_OF_REPEAT: usize = 3;

/// Least part of the rows that equal the one before that are more than by chance, for all of them to be left out.
const LEAST_READ_AGAIN: f64 = 0.5;

/// Largest part of the variance of the noise that rounding adds without a note: ten times what it adds where there is room for it, and
/// a twentieth of a percent of N.
const NOTED_COST: f64 = 1e-3;

/// How often a range of the data sheet a value may be before it is no measurement.
const MAX_RANGES: f64 = 2.0;

/// The same in the unit of a channel whose range is not known: far above what any sensor measures in deg/s, g or gauss, and the largest
/// count of 32 bits.
const LARGEST_VALUE: f64 = 4.3e9;

/// The rows of `table`, which `sensor` measured, on their time base; and what the user should know, one sentence each.
pub(crate) fn time_base(
    mut table: SensorTable,
    sensor: &SensorProfile,
    stated_hz: Option<f64>,
) -> Result<(EstimatedTimeBase, Vec<String>), TimeBaseError> {
    let stated_hz = stated_hz.or(table.rate_hz);
    let repeated = leave_out_repeated(&mut table, stated_hz);
    let SensorTable { times_s, indices, columns, mut dropped, mut notes, rate_hz: _ } = table;
    let rows = columns.first().map_or(0, |column| column.values.len());
    let base = SampleSlots::new(rows, times_s.as_deref(), indices.as_deref(), stated_hz)?;
    dropped.extend(Some(("repeated", repeated)).filter(|_| repeated > 0));
    // The rows that were left out are between the others and are missing there.
    let left_out = dropped.get("time_backwards").copied().unwrap_or(0);
    dropped.insert("gap", base.never_arrived.saturating_sub(left_out));
    let mut at_full_scale = BTreeSet::new();
    let mut channels = Vec::with_capacity(columns.len());
    let (mut rounded, mut unusable_values) = (Vec::new(), BTreeMap::new());
    for column in columns {
        let unusable = format!("{} ({}) has no usable value and is left out", column.profile.name, column.label);
        match channel(column, &mut at_full_scale, &mut notes, &mut rounded) {
            Ok(channel) => channels.push(channel),
            Err(refused) => {
                notes.push(unusable);
                for (cause, positions) in refused {
                    let count = unusable_values.entry(cause).or_insert(0);
                    *count = positions.len().max(*count as usize) as u64;
                }
            }
        }
    }
    notes.extend(rounding_note(rounded.iter().map(|(profile, quantizer)| (profile, quantizer))));
    if channels.is_empty() {
        dropped.extend(unusable_values);
        return Err(TimeBaseError::TooShort { used: 0, dropped });
    }
    let mut flagged = BTreeMap::new();
    flagged.extend(Some(("saturated", at_full_scale.len() as u64)).filter(|(_, count)| *count > 0));
    flagged.extend(base.stamps.iter().flat_map(StampQuality::warnings));
    let measurement = Measurement {
        profile: sensor.clone(),
        sample_rate_hz: base.sample_rate_hz,
        stated_rate_hz: stated_hz,
        slots: base.slots,
        times_s,
        channels,
        dropped,
        flagged,
    };
    Ok((EstimatedTimeBase { measurement, stamps: base.stamps }, notes))
}

/// Takes rows out that equal the one before in all of three channels or more and come sooner than 0.75 periods after it: one
/// sample that was read or published twice. Where no more rows do so than by chance, as in noise of about a count with stamps that are
/// coarser than the sample period, all stay.
fn leave_out_repeated(table: &mut SensorTable, stated_hz: Option<f64>) -> u64 {
    let Some(times) = table.times_s.as_ref().filter(|_| table.columns.len() >= MIN_CHANNELS_OF_REPEAT) else {
        return 0;
    };
    let Some(period_s) = stated_hz.map(f64::recip).or_else(|| usual_interval(times)) else { return 0 };
    let is_repeat = |row: usize| {
        row > 0
            && times[row] - times[row - 1] < MAX_REPEATED_READ_INTERVAL * period_s
            && table.columns.iter().all(|column| column.values[row] == column.values[row - 1])
    };
    let kept: Vec<bool> = (0..times.len()).map(|row| !is_repeat(row)).collect();
    let repeated = kept.iter().filter(|kept| !**kept).count();
    let pairs = times.len().saturating_sub(1).max(1) as f64;
    let equal = |column: &TableColumn| column.values.windows(2).filter(|pair| pair[0] == pair[1]).count();
    let shares: Vec<f64> = table.columns.iter().map(|column| equal(column) as f64 / pairs).collect();
    let all = repeated as f64 / pairs;
    if repeated_fraction(all, &shares) <= LEAST_READ_AGAIN * all {
        return 0;
    }
    table.retain(&kept);
    repeated as u64
}

/// Why a value of a channel is no measurement, if so: 1 in it is `factor` in the channel's unit, in which it is `limit` at most.
pub(crate) fn refusal(value: f64, factor: f64, limit: f64) -> Option<&'static str> {
    match value {
        value if value.is_nan() => Some("missing"),
        value if value.is_infinite() => Some("not_finite"),
        value if (value * factor).abs() > limit => Some("out_of_range"),
        _ => None,
    }
}

/// The largest value of a channel that is a measurement, in its unit.
pub(crate) fn largest_value(profile: &ChannelProfile) -> f64 {
    profile.range.map_or(LARGEST_VALUE, |range| MAX_RANGES * range)
}

/// What the user should know of the counts that stand for the numbers of some channels; `None` where rounding to them costs nothing that
/// counts.
pub(crate) fn rounding_note<'a>(channels: impl Iterator<Item = (&'a ChannelProfile, &'a Quantizer)>) -> Option<String> {
    let cost = |(profile, quantizer): (&ChannelProfile, &Quantizer)| {
        let cost = quantizer.cost.filter(|cost| *cost > NOTED_COST)?;
        Some(format!("{} {cost:.1e}", profile.name))
    };
    let costs: Vec<String> = channels.filter_map(cost).collect();
    let of = "rounding to counts adds to the variance of the noise, as a part of it:";
    (!costs.is_empty()).then(|| format!("{of} {}", costs.join(", ")))
}

/// One channel as counts; the positions of the values that are refused, by cause, where all are.
fn channel(
    column: TableColumn,
    at_full_scale: &mut BTreeSet<usize>,
    notes: &mut Vec<String>,
    rounded: &mut Vec<(ChannelProfile, Quantizer)>,
) -> Result<MeasuredChannel, BTreeMap<&'static str, Vec<usize>>> {
    let TableColumn { profile, factor, mut values, .. } = column;
    let limit = largest_value(&profile);
    let mut refused: BTreeMap<&'static str, Vec<usize>> = BTreeMap::new();
    for (position, value) in values.iter_mut().enumerate() {
        let Some(cause) = refusal(*value, factor, limit) else { continue };
        refused.entry(cause).or_default().push(position);
        *value = f64::NAN;
    }
    let quantizer = Quantizer::new(&values);
    let lsb = quantizer.lsb * factor;
    let counts: Vec<Option<i32>> = values.iter().map(|&value| quantizer.count(value)).collect();
    if counts.iter().all(Option::is_none) {
        return Err(refused);
    }
    let beyond = |position: &usize| counts[*position].is_none() && values[*position].is_finite();
    let beyond: Vec<usize> = (0..values.len()).filter(beyond).collect();
    if !beyond.is_empty() {
        refused.entry("out_of_range").or_default().extend(beyond);
        refused.values_mut().for_each(|positions| positions.sort_unstable());
    }
    rounded.push((profile, quantizer));
    let saturated = saturated(&counts, profile.range.map(|range| range / lsb));
    if let Some(first) = saturated.first() {
        let count = saturated.len();
        notes.push(format!("{}: {count} samples at full scale, the first of them row {}", profile.name, first + 1));
    }
    at_full_scale.extend(saturated);
    let counts = counts.into_iter().map(Option::unwrap_or_default).collect();
    Ok(MeasuredChannel { profile: ChannelProfile { lsb, ..profile }, counts, refused })
}
