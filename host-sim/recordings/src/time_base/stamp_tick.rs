//! The tick of a clock: the step that all of its time stamps are multiples of.

/// Intervals that are examined; a tick is seen in far fewer.
const EXAMINED: usize = 20_000;
/// Largest deviation of an interval from a multiple of the tick, in mean intervals: the rounding of stamps in a text with
/// few digits.
const TOLERANCE: f64 = 1e-3;
/// Smallest tick that is of use, in mean intervals.
const MIN_TICK: f64 = 0.05;

/// The greatest common divisor of the intervals of `times`, s; `None` where there is none of a twentieth of the mean interval
/// or more.
///
/// It is Euclid's, with intervals that are equal to within a thousandth of their mean taken for equal.
pub(crate) fn tick(times: &[f64]) -> Option<f64> {
    let examined = &times[..times.len().min(EXAMINED)];
    let mean = (examined.last()? - examined.first()?) / (examined.len() - 1).max(1) as f64;
    let tolerance = TOLERANCE * mean;
    if !(mean.is_finite() && mean > 0.0) {
        return None;
    }
    let mut tick = 0.0f64;
    for pair in examined.windows(2) {
        let (mut large, mut small) = (tick, pair[1] - pair[0]);
        // After an interval of a million ticks the rest says nothing.
        if small > 1e6 * mean {
            continue;
        }
        while small > tolerance {
            // The remainder nearest to 0: a multiple may be a little less than whole.
            let rest = large - (large / small).round() * small;
            (large, small) = (small, rest.abs());
        }
        tick = large;
        if tick > 0.0 && tick < MIN_TICK * mean {
            return None;
        }
    }
    (tick > 0.0).then_some(tick)
}
