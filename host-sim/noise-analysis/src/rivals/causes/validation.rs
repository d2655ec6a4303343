//! Test of the first half's findings on the second half of a record.
//!
//! The first half is analysed by itself, as if there were nothing else. If an effect holds throughout, its parameters in the first half and
//! in the whole record are two estimates of the same numbers, the second of which uses all the samples of the first. For such a pair of
//! efficient estimates the variance of the difference is the difference of the variances (J. Hausman, "Specification tests in
//! econometrics", Econometrica 46, 1978); with two halves of equal information it is half the variance of the first. So the test needs no
//! threshold of detection in the second half: an effect that is missing there moves the estimate of the whole record.

use crate::bounds::BoundedEstimate;
use crate::distributions::{NORMAL_975, upper_tail};
use crate::effects::Effect;
use crate::effects::findings::Validation;

/// Probability that an effect which holds throughout is said to fail, over all its channels and parameters.
const LEVEL: f64 = 0.01;
/// Farthest that the lines of two halves may be apart, as a part of their frequency, to be taken for the same line.
const FARTHEST_LINE: f64 = 0.1;

pub(super) fn is_same(whole: &Effect, half: &Effect) -> bool {
    match (whole.is_line(), half.is_line()) {
        (true, true) => distance(whole, half) < FARTHEST_LINE,
        _ => whole.is_of_kind(half),
    }
}

/// Distance of the frequencies of two effects, as a part of the first; 0 for effects without a frequency.
pub(super) fn distance(whole: &Effect, half: &Effect) -> f64 {
    match (whole.frequency_hz(), half.frequency_hz()) {
        (Some(whole), Some(half)) if whole.value > 0.0 => (half.value / whole.value - 1.0).abs(),
        _ => 0.0,
    }
}

/// Compares effects of the whole record with those of the first half, of one cause in several channels.
pub(super) fn compare(pairs: &[(&Effect, &Effect)]) -> Validation {
    let deviations: Vec<f64> = pairs
        .iter()
        .flat_map(|(whole, half)| {
            let whole = whole.lasting();
            half.lasting().into_iter().filter_map(move |(name, half)| deviation(whole.get(name)?, &half))
        })
        .collect();
    let Some(largest) = deviations.iter().copied().reduce(f64::max) else { return Validation::Untestable };
    // The largest of this many deviations, as if they were independent (Šidák).
    let p_value = 1.0 - (1.0 - 2.0 * upper_tail(largest)).powi(i32::try_from(deviations.len()).unwrap_or(i32::MAX));
    if p_value < LEVEL { Validation::No } else { Validation::Yes }
}

/// Distance of an estimate by the whole record from that by the first half, in standard deviations; `None` without intervals.
fn deviation(whole: &BoundedEstimate, half: &BoundedEstimate) -> Option<f64> {
    // An interval that ends at 0 because the parameter cannot be negative says nothing on that side.
    let error = |of: &BoundedEstimate| {
        let side = if of.low > 0.0 || of.value < 0.0 { of.high - of.low } else { 2.0 * (of.high - of.value) };
        side / (2.0 * NORMAL_975)
    };
    let (whole_error, half_error) = (error(whole), error(half));
    let variance = (half_error.powi(2) - whole_error.powi(2)).max(0.5 * half_error.powi(2));
    (variance > 0.0 && variance.is_finite()).then(|| (whole.value - half.value).abs() / variance.sqrt())
}
