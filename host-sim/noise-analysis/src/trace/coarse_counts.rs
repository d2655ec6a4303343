//! A channel whose values are whole multiples of more than one count: it was rounded before it came here.
//!
//! Where noise is larger than the step this adds no more than white noise of step²/12, which no curve and no spectrum
//! tells from any other; the values themselves do.

use crate::findings::{Effect, Finding, Parameter};
use crate::series::Series;

/// Changes of the value that must all be multiples of the step: of a smooth density every other one would be odd.
const FEWEST_CHANGES: usize = 50;

/// The largest number of counts that divides every difference of two values; 1 where too few differ to tell.
#[must_use]
pub fn step(series: &Series) -> u32 {
    let Some(&first) = series.values.first() else { return 1 };
    let count = |value: f64| ((value - first) / series.resolution).round().abs() as u64;
    let divisor = series.values.iter().map(|&value| count(value)).fold(0, greatest_common_divisor);
    let changes = series.values.windows(2).filter(|pair| pair[0] != pair[1]).take(FEWEST_CHANGES).count();
    if changes < FEWEST_CHANGES { 1 } else { u32::try_from(divisor).unwrap_or(1).max(1) }
}

/// Looks for a step of more than one count.
#[must_use]
pub fn find(series: &Series) -> Option<Finding> {
    let counts = step(series);
    if counts == 1 {
        return None;
    }
    let step = f64::from(counts) * series.resolution;
    let changes = series.values.windows(2).filter(|pair| pair[0] != pair[1]).count() as f64;
    let evidence = format!(
        "all {} values lie {counts} counts or a multiple of that apart, {changes} changes without an exception; \
         a converter of fewer bits, or rounding on the way",
        series.values.len(),
    );
    Some(Finding {
        effect: Effect::new("quantization", [("step", Parameter::new(step, step, step, series.unit))], evidence),
        repair: None,
    })
}

fn greatest_common_divisor(a: u64, b: u64) -> u64 {
    if b == 0 { a } else { greatest_common_divisor(b, a % b) }
}
