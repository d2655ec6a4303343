//! The tick: the common step of time stamps.

use crate::lateness_track::quantile;

const EXAMINED: usize = 20_000;
/// In mean intervals: rounding of few digits.
const TOLERANCE: f64 = 1e-3;
/// In mean intervals.
const MIN_TICK: f64 = 0.05;
/// In median intervals; an outage tells nothing.
const OUTAGE: f64 = 1e3;
/// In mean intervals, one at each end.
const TOLERANCE_OF_STAMPS: f64 = 4.0 * TOLERANCE;
const TELLING: f64 = 100.0;

/// Common divisor of the intervals of `times`, s, to a thousandth (Euclid); `None` below a twentieth of the mean.
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

/// Near `tick`, improved at growing distances; `None` if `times` are not multiples within `tolerance`.
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
