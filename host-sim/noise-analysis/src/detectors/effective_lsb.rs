//! Effective LSB: the number of counts that divides all differences of a channel's values. More than one means rounding
//! before the recording, white noise of variance step²/12.

use crate::bounds::BoundedEstimate;
use crate::effects::EffectiveLsb;
use crate::effects::findings::Detection;
use crate::samples::series::Series;

/// Fewest changes of the value; without such rounding about half of them are odd.
const FEWEST_CHANGES: usize = 50;

/// The largest number of counts that divides every difference of two values; 1 if the values change fewer than 50 times.
pub(crate) fn counts_per_step(series: &Series) -> u32 {
    let Some(&first) = series.values.first() else { return 1 };
    let count = |value: f64| ((value - first) / series.resolution).round().abs() as u64;
    let divisor = series.values.iter().map(|&value| count(value)).fold(0, greatest_common_divisor);
    let changes = series.values.windows(2).filter(|pair| pair[0] != pair[1]).take(FEWEST_CHANGES).count();
    if changes < FEWEST_CHANGES { 1 } else { u32::try_from(divisor).unwrap_or(1).max(1) }
}

pub(crate) fn find(series: &Series) -> Option<Detection> {
    let counts = counts_per_step(series);
    if counts == 1 {
        return None;
    }
    let step = f64::from(counts) * series.resolution;
    let found = EffectiveLsb {
        step: BoundedEstimate::exact(step).in_unit(series.unit),
        counts,
        values: series.values.len(),
        changes: series.values.windows(2).filter(|pair| pair[0] != pair[1]).count(),
    };
    Some(Detection { effect: found.into(), correction: None })
}

pub(crate) fn greatest_common_divisor(a: u64, b: u64) -> u64 {
    if b == 0 { a } else { greatest_common_divisor(b, a % b) }
}
