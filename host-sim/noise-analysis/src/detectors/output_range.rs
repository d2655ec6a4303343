//! What the output of a channel can express: whether its samples are cut off at the end of a range, and whether its noise
//! reaches from one count to the next.

use crate::distributions::poisson_bounds;
use crate::findings::{Detection, Effect, Parameter};
use crate::series::Series;
use crate::{OCTAVES, OVERLAP};
use allan_core::Cascade;
use std::collections::BTreeMap;

/// Samples at an end of the values from which on the channel is cut off there. Three times as many as at any other value, by
/// chance alone, have a probability of 4·10⁻⁵: that of 20 or more events where 7 are expected.
const FEWEST_AT_AN_END: u64 = 20;
/// How many times more often than any other value an end occurs. The arcsine distribution of a sinusoid, which has the
/// sharpest ends of all smooth signals, has 1/(√2 − 1) = 2.4 times as many samples in its last count as in the one before.
const PILED: u64 = 3;
/// Fewest other values: of a few values, such as those of a signal that repeats, none is an end of a range.
const FEWEST_VALUES: usize = 10;
/// Fewest samples whose noise is compared with a count.
const FEWEST_SAMPLES: usize = 100;
/// Octaves in which noise behind a filter can reach from one count to the next: the longest filters average 64 samples.
const NOISE_OCTAVES: usize = 7;

/// Samples that are cut off: at the ends of the channel's `range` (in its unit, where it is known), or at another level.
#[must_use]
pub(crate) fn find_saturation(series: &Series, range: Option<f64>) -> Option<Detection> {
    let mut counts: BTreeMap<i64, u64> = BTreeMap::new();
    for value in series.values.iter() {
        *counts.entry((value / series.resolution).round() as i64).or_insert(0) += 1;
    }
    let ends = [counts.first_key_value()?, counts.last_key_value()?].map(|(level, count)| (*level, *count));
    if counts.len() < FEWEST_VALUES + ends.len() {
        return None;
    }
    let most_of_others = counts.values().skip(1).take(counts.len() - 2).max().copied().unwrap_or(0);
    let is_end_of_range = |level: i64| {
        range.is_some_and(|range| level.unsigned_abs() as f64 * series.resolution > range - 0.5 * series.resolution)
    };
    let is_cut_off = |&(level, count): &(i64, u64)| {
        count >= FEWEST_AT_AN_END && (count > PILED * most_of_others || is_end_of_range(level))
    };
    let cut_off: Vec<(i64, u64)> = ends.into_iter().filter(is_cut_off).collect();
    let &(level, _) = cut_off.iter().max_by_key(|(_, count)| *count)?;
    let (samples, all) = (cut_off.iter().map(|(_, count)| count).sum::<u64>() as f64, series.values.len() as f64);
    let level = level as f64 * series.resolution;
    let (low, high) = poisson_bounds(samples);
    let at =
        if is_end_of_range((level / series.resolution).round() as i64) { "the end of the range" } else { "a limit" };
    let evidence = format!(
        "{samples} of {all} samples lie at {at}, {level:.4} {}, no other value occurs more than {most_of_others} times: what is \
         beyond is cut off, and N, B and K are lower limits",
        series.unit,
    );
    let share = Parameter::new(samples / all, low / all, (high / all).min(1.0), "");
    let level = Parameter::new(level, level, level, series.unit);
    let effect = Effect::new("saturated", [("share", share), ("level", level)], evidence);
    Some(Detection { effect, correction: None })
}

/// Noise that does not reach from one count to the next: its Allan variance at the shortest octaves is below
/// `dithered_avar_counts2` counts².
#[must_use]
pub(crate) fn find_noise_below_count(series: &Series, dithered_avar_counts2: f64) -> Option<Detection> {
    if series.values.len() < FEWEST_SAMPLES {
        return None;
    }
    let mut estimator = Cascade::<OCTAVES, OVERLAP>::new();
    let mut next = series.slots.first().copied().unwrap_or(0);
    for (&slot, value) in series.slots.iter().zip(series.values.iter()) {
        if slot > next {
            estimator.gap(u32::try_from(slot - next).unwrap_or(u32::MAX));
        }
        estimator.push((value / series.resolution).round() as i32);
        next = slot + 1;
    }
    let curve = estimator.curve(series.period_s);
    let largest = curve.points().iter().take(NOISE_OCTAVES).map(|point| point.avar).fold(0.0, f64::max);
    if largest > dithered_avar_counts2 {
        return None;
    }
    let deviation = largest.sqrt() * series.resolution;
    let evidence = if largest == 0.0 {
        "the value never changes; nothing is known of its noise but that it is below a count".to_owned()
    } else {
        format!(
            "the Allan deviation is at most {:.2} counts at the shortest averaging times, less than the {:.2} counts from which on \
             rounding adds white noise alone; N, B and K are those of the rounded values",
            largest.sqrt(),
            dithered_avar_counts2.sqrt(),
        )
    };
    // Before the rounding it may be anything up to the limit.
    let limit = dithered_avar_counts2.sqrt() * series.resolution;
    let parameter = Parameter::new(deviation, 0.0, limit, series.unit);
    Some(Detection { effect: Effect::new("noise_below_count", [("deviation", parameter)], evidence), correction: None })
}
