//! Motion of the platform, and the stretches of a recording in which it was at rest.
//!
//! Over a second noise is averaged, and the bias of a channel at rest moves by less than the biases of two parts differ. A
//! channel whose means of a second leave their median by three times that is moved: an accelerometer of 50 mg (1 σ over
//! parts) by a turn of 9° or more, a gyroscope of 3 deg/s by 9 deg/s.

use crate::findings::{Effect, Parameter};
use crate::report::Stretch;
use crate::series::Series;
use measurement::ChannelProfile;
use std::ops::Range;

/// Length of a mean, s.
const BLOCK_S: f64 = 1.0;
/// Distance from the median from which a channel is moved, in initial bias errors.
const BIAS_ERRORS: f64 = 3.0;
/// Means on either side of one that is moved that belong to the motion: its beginning and its end.
const AROUND: usize = 2;

/// The motion of one channel.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct PlatformMotion {
    /// Numbers of the seconds in which the channel is moved, in ascending order.
    seconds: Vec<Range<usize>>,
    /// As reported.
    pub effect: Effect,
}

/// The motion that a channel shows, if any.
pub(crate) fn find(series: &Series, channel: &ChannelProfile) -> Option<PlatformMotion> {
    let limit = BIAS_ERRORS * channel.initial_bias_error?;
    let width = (BLOCK_S / series.period_s).round().max(1.0) as u64;
    let mut sums: Vec<(f64, u64)> = Vec::new();
    for (&slot, value) in series.slots.iter().zip(series.values.iter()) {
        let number = (slot / width) as usize;
        if sums.len() <= number {
            sums.resize(number + 1, (0.0, 0));
        }
        sums[number].0 += value;
        sums[number].1 += 1;
    }
    let means: Vec<Option<f64>> = sums.iter().map(|(sum, count)| (*count > 0).then(|| sum / *count as f64)).collect();
    let mut sorted: Vec<f64> = means.iter().copied().flatten().collect();
    sorted.sort_by(f64::total_cmp);
    let median = *sorted.get(sorted.len() / 2)?;
    let mut seconds: Vec<Range<usize>> = Vec::new();
    let mut largest = 0.0_f64;
    for (number, mean) in means.iter().enumerate() {
        let Some(distance) = mean.map(|mean| mean - median).filter(|distance| distance.abs() > limit) else { continue };
        if distance.abs() > largest.abs() {
            largest = distance;
        }
        let moved = number.saturating_sub(AROUND)..(number + AROUND + 1).min(means.len());
        match seconds.last_mut() {
            Some(last) if last.end >= moved.start => last.end = moved.end,
            _ => seconds.push(moved),
        }
    }
    let (from, to) = (seconds.first()?.start as f64 * BLOCK_S, seconds.last()?.end as f64 * BLOCK_S);
    let moved: usize = seconds.iter().map(Range::len).sum();
    let evidence = format!(
        "the mean of a second leaves the median by up to {largest:.3} {unit}, more than three times the {:.3} {unit} by which \
         the biases of parts differ, in {} stretches of together {moved} s: the platform was moved",
        limit / BIAS_ERRORS,
        seconds.len(),
        unit = channel.unit,
    );
    let exact = |value: f64, error: f64, unit: &str| Parameter::new(value, value - error, value + error, unit);
    let parameters = [
        ("from", exact(from, BLOCK_S, "s")),
        ("to", exact(to, BLOCK_S, "s")),
        ("size", exact(largest, channel.initial_bias_error?, channel.unit)),
    ];
    Some(PlatformMotion { seconds, effect: Effect::new("motion", parameters, evidence) })
}

/// The stretches of a recording of `duration_s` seconds in which no channel was moved.
pub(crate) fn at_rest<'a>(motions: impl Iterator<Item = &'a PlatformMotion>, duration_s: f64) -> Vec<Stretch> {
    let mut moved: Vec<&Range<usize>> = motions.flat_map(|motion| &motion.seconds).collect();
    moved.sort_by_key(|range| range.start);
    let mut stretches = Vec::new();
    let mut from_s = 0.0;
    for range in moved {
        let start = range.start as f64 * BLOCK_S;
        if start > from_s {
            stretches.push(Stretch { from_s, to_s: start });
        }
        from_s = f64::max(from_s, range.end as f64 * BLOCK_S);
    }
    if from_s < duration_s {
        stretches.push(Stretch { from_s, to_s: duration_s });
    }
    stretches
}

#[cfg(test)]
mod tests {
    use super::{at_rest, find};
    use crate::report::Stretch;
    use crate::series::Series;
    use measurement::adis16405::profile;

    /// An accelerometer at 10 Hz that is turned by `size` g from 40.0 s to 50.0 s.
    fn series(size: f64) -> Series {
        let slots = 0..1000_u64;
        let value = |slot: u64| if (400..500).contains(&slot) { 1.0 + size } else { 1.0 };
        Series {
            values: slots.clone().map(value).collect(),
            span: slots.clone(),
            slots: slots.collect(),
            period_s: 0.1,
            resolution: 3.33e-3,
            unit: "g",
        }
    }

    #[test]
    fn a_swing_is_a_motion_and_the_rest_is_at_rest() {
        let channel = profile(0.05).channel("accl_x").unwrap();
        // The data sheet: ±50 mg of initial bias error, 1 σ.
        assert_eq!(find(&series(0.14), &channel), None);
        let motion = find(&series(-0.7), &channel).unwrap();
        let value = |name: &str| motion.effect.parameters[name].value;
        assert!((value("size") + 0.7).abs() < 1e-12);
        assert_eq!((value("from"), value("to")), (38.0, 52.0), "two seconds around");
        let rest = [Stretch { from_s: 0.0, to_s: 38.0 }, Stretch { from_s: 52.0, to_s: 100.0 }];
        assert_eq!(at_rest([&motion].into_iter(), 100.0), rest);
        assert_eq!(at_rest([].into_iter(), 100.0), [Stretch { from_s: 0.0, to_s: 100.0 }]);
    }
}
