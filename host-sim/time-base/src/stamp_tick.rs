//! The tick of a clock: the step that all of its time stamps are multiples of.

use crate::lateness_track::quantile;

/// Intervals that are examined; a tick is seen in far fewer.
const EXAMINED: usize = 20_000;
/// Largest deviation of an interval from a multiple of the tick, in mean intervals: the rounding of stamps in a text with
/// few digits.
const TOLERANCE: f64 = 1e-3;
/// Smallest tick that is of use, in mean intervals.
const MIN_TICK: f64 = 0.05;
/// An interval of so many median ones is an outage, and says nothing of the tick or of the mean.
const OUTAGE: f64 = 1e3;
/// Largest deviation of a stamp from a multiple of the tick since the last outage, in mean intervals: one at each end.
const TOLERANCE_OF_STAMPS: f64 = 4.0 * TOLERANCE;
/// Ticks between two stamps from which their distance tells the tick better than a shorter one.
const TELLING: f64 = 100.0;

/// The greatest common divisor of the intervals of `times`, s; `None` where there is none of a twentieth of the mean interval
/// or more.
///
/// It is Euclid's, with intervals that are equal to within a thousandth of their mean taken for equal. All stamps between two outages
/// have to be multiples of it, or it is none: the intervals of a clock that wanders equal their neighbours, and have no tick.
pub(crate) fn tick(times: &[f64]) -> Option<f64> {
    let examined = &times[..times.len().min(EXAMINED)];
    let intervals = || examined.windows(2).map(|pair| pair[1] - pair[0]);
    let mut positive: Vec<f64> = intervals().filter(|interval| *interval > 0.0).collect();
    if positive.is_empty() {
        return None;
    }
    let outage = OUTAGE * quantile(&mut positive, 1, 2);
    let is_usual = |interval: &f64| *interval <= outage;
    let (sum, count) =
        intervals().filter(is_usual).fold((0.0, 0.0), |(sum, count), interval| (sum + interval, count + 1.0));
    let mean: f64 = sum / count;
    let tolerance = TOLERANCE * mean;
    if !(mean.is_finite() && mean > 0.0) {
        return None;
    }
    let mut tick = 0.0f64;
    for interval in intervals().filter(is_usual) {
        let (mut large, mut small) = (tick, interval);
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
    (tick > 0.0).then(|| refined(tick, examined, outage, TOLERANCE_OF_STAMPS * mean)).flatten()
}

/// The tick near `tick` of which all `times` between two outages are multiples to within `tolerance`, improved at growing distances like
/// a vernier; `None` where there is none.
fn refined(mut tick: f64, times: &[f64], outage: f64, tolerance: f64) -> Option<f64> {
    let (mut origin, mut last) = (*times.first()?, *times.first()?);
    for &time in times {
        if time - last > outage {
            origin = time;
        }
        last = time;
        let ticks = ((time - origin) / tick).round();
        if (time - origin - ticks * tick).abs() > tolerance {
            return None;
        }
        if ticks >= TELLING {
            tick = (time - origin) / ticks;
        }
    }
    Some(tick)
}
