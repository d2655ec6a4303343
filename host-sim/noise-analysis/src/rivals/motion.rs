//! Motion of the platform, and the stretches of a recording in which it was at rest.
//!
//! Over a second noise is averaged, and the bias of a channel at rest moves by less than the biases of two parts differ. A
//! channel whose means of a second leave their median by three times that is moved: an accelerometer of 50 mg (1 σ over
//! parts) by a turn of 9° or more, a gyroscope of 3 deg/s by 9 deg/s.
//!
//! Drift of a bias may go as far, given time. So each motion says whether it is sudden: faster than a Gaussian process with the changes of
//! the rest of the record.
//!
//! Without a data sheet the distance is compared with the scatter of the channel's own means, of which chance has one as far in fewer
//! than 2·10⁻⁴ of Gaussian records. A drift may go as far, and a disturbance may be in one channel: such a motion is sudden, in two
//! channels in the same seconds, and longer than the three seconds within which it begins.

use crate::bounds::BoundedEstimate;
use crate::distributions::{ROUNDING, quantile};
use crate::effects::findings::SIGNIFICANCE;
use crate::effects::{MotionInterval, MotionScale};
use crate::report::Stretch;
use crate::robust::{deviation_from_zero, median_and_deviation};
use crate::samples::series::Series;
use measurement::{ChannelId, ChannelProfile, PerChannel, Quantity};
use std::ops::Range;

const BLOCK_S: f64 = 1.0;
/// Distance from the median from which a channel is moved, in initial bias errors.
const BIAS_ERRORS: f64 = 3.0;
/// Means on either side of one that is moved that belong to the motion: its beginning and its end.
const AROUND: usize = 2;
/// Seconds within which a sudden motion begins.
const BEGINS_WITHIN: usize = AROUND + 1;

#[derive(Debug, Clone, PartialEq)]
pub(crate) struct PlatformMotion {
    quantity: Quantity,
    /// Numbers of the seconds in which the channel is moved, in ascending order.
    seconds: Vec<Range<usize>>,
    /// True if the channel changes faster than a Gaussian process would.
    pub is_sudden: bool,
    pub effect: MotionInterval,
}

pub(crate) fn find(series: &Series, channel: &ChannelProfile) -> Option<PlatformMotion> {
    let width = (BLOCK_S / series.period_s).round().max(1.0) as u64;
    let sums = series.sums_of_blocks(0, width).into_iter();
    let means: Vec<Option<f64>> = sums.map(|(sum, count)| (count > 0).then(|| sum / count as f64)).collect();
    let known: Vec<f64> = means.iter().copied().flatten().collect();
    if known.is_empty() {
        return None;
    }
    let (median, deviation) = median_and_deviation(&known);
    let (scale, limit, error) = match channel.initial_bias_error {
        Some(bias_error) => (MotionScale::BiasError(bias_error), BIAS_ERRORS * bias_error, bias_error),
        None => {
            // Means of values that seldom change scatter by less than their rounding.
            let scatter = deviation.max(ROUNDING.sqrt() * series.resolution);
            (MotionScale::Scatter(scatter), quantile(0.5 * SIGNIFICANCE / known.len() as f64) * scatter, scatter)
        }
    };
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
    // A knock is over sooner.
    let is_longer = |range: &Range<usize>| range.len() >= 2 * AROUND + BEGINS_WITHIN;
    seconds.retain(|range| matches!(scale, MotionScale::BiasError(_)) || is_longer(range));
    let (from, to) = (seconds.first()?.start as f64 * BLOCK_S, seconds.last()?.end as f64 * BLOCK_S);
    let moved: usize = seconds.iter().map(Range::len).sum();
    let exact = |value: f64, error: f64| BoundedEstimate::new(value, value - error, value + error);
    let effect = MotionInterval {
        from_s: exact(from, BLOCK_S),
        to_s: exact(to, BLOCK_S),
        size: exact(largest, error).in_unit(channel.unit),
        scale,
        stretches: seconds.len(),
        moved_s: moved,
    };
    Some(PlatformMotion { quantity: channel.quantity, seconds, is_sudden: is_sudden(&means), effect })
}

/// True if one of the changes within three seconds is larger than chance has one in a Gaussian process of their median size.
fn is_sudden(means: &[Option<f64>]) -> bool {
    let pairs = means.iter().zip(means.iter().skip(BEGINS_WITHIN));
    let changes: Vec<f64> =
        pairs.filter_map(|(before, after)| Some((after.as_ref()? - before.as_ref()?).abs())).collect();
    let Some(largest) = changes.iter().copied().max_by(f64::total_cmp) else { return false };
    largest > quantile(0.5 * SIGNIFICANCE / changes.len() as f64) * deviation_from_zero(changes.iter().copied())
}

/// The `motions` of all channels, without those by the scatter of the means that are not sudden in two channels in the same seconds.
pub(crate) fn told_by_two(motions: PerChannel<Option<PlatformMotion>>) -> PerChannel<Option<PlatformMotion>> {
    let is_told = |(channel, motion): (ChannelId, &PlatformMotion)| {
        let others = motions.with_ids().filter(|(other, _)| *other != channel).filter_map(|(_, other)| other.as_ref());
        let is_by_two =
            || motion.is_sudden && others.filter(|other| other.is_sudden).any(|other| motion.overlaps(other));
        matches!(motion.effect.scale, MotionScale::BiasError(_)) || is_by_two()
    };
    let kept = |(channel, motion): (ChannelId, &Option<PlatformMotion>)| {
        motion.as_ref().filter(|motion| is_told((channel, motion))).cloned()
    };
    motions.with_ids().map(kept).collect()
}

impl PlatformMotion {
    /// True if both are of one quantity, and moved in the same seconds.
    pub(crate) fn is_shared_with(&self, other: &Self) -> bool {
        self.quantity == other.quantity && self.overlaps(other)
    }

    fn overlaps(&self, other: &Self) -> bool {
        let is_in = |range: &Range<usize>| other.seconds.iter().any(|of| of.start < range.end && range.start < of.end);
        self.seconds.iter().any(is_in)
    }
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
    use super::{at_rest, find, told_by_two};
    use crate::report::Stretch;
    use crate::samples::series::Series;
    use measurement::PerChannel;
    use measurement::adis16405::profile;
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::StandardNormal;

    /// An accelerometer at 10 Hz that is turned by `size` g from 40.0 s to 50.0 s.
    fn series(size: f64) -> Series {
        accelerometer(1000, |slot| if (400..500).contains(&slot) { 1.0 + size } else { 1.0 })
    }

    fn accelerometer(samples: u64, value: impl FnMut(u64) -> f64) -> Series {
        let slots = 0..samples;
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
    fn a_drift_that_goes_far_is_not_sudden_and_a_turn_is() {
        let x = profile(0.05).channel("accl_x").unwrap();
        for seed in 0..10 {
            let mut random = ChaCha8Rng::seed_from_u64(seed);
            // A process of deviation 0.1 g with a time constant of 10 s over 1000 s leaves its median by 0.15 g many times.
            let kept = (-0.1f64 / 10.0).exp();
            let mut state = 0.0;
            let drift = accelerometer(10_000, |_| {
                state = kept * state + 0.1 * (1.0 - kept * kept).sqrt() * random.sample::<f64, _>(StandardNormal);
                state
            });
            let found = find(&drift, &x).expect("goes far");
            assert!(!found.is_sudden && found.is_shared_with(&found), "{seed}");
        }
        assert!(find(&series(-0.7), &x).unwrap().is_sudden);
    }

    /// Two channels of a sensor without a data sheet, turned for ten seconds, one of them by less than three initial bias errors of any
    /// part; noise alone, a drift of one of them, and a turn in one channel alone are no motion. In 20 records of noise chance has a
    /// motion of both with a probability far below 20 times 2·10⁻⁴.
    #[test]
    fn a_motion_is_told_from_the_record_itself() {
        let unknown = measurement::ChannelProfile::generic("accl_x", measurement::Quantity::SpecificForce);
        let noisy = |seed: u64, size: f64, drift: f64| {
            let mut random = ChaCha8Rng::seed_from_u64(seed);
            accelerometer(1000, |slot| {
                let turned = if (400..500).contains(&slot) { size } else { 0.0 };
                turned + drift * (slot as f64 / 1000.0).powi(2) + 0.01 * random.sample::<f64, _>(StandardNormal)
            })
        };
        let moved = |channels: [Series; 2]| {
            let found = channels.map(|series| find(&series, &unknown));
            told_by_two(PerChannel::from(found.to_vec())).into_vec().into_iter().flatten().count()
        };
        for seed in 0..20 {
            assert_eq!(moved([noisy(seed, 0.0, 0.0), noisy(100 + seed, 0.0, 0.5)]), 0, "{seed}");
            assert_eq!(moved([noisy(seed, 0.1, 0.0), noisy(100 + seed, 0.0, 0.0)]), 0, "{seed}");
            assert_eq!(moved([noisy(seed, 0.1, 0.0), noisy(100 + seed, -0.05, 0.0)]), 2, "{seed}");
        }
    }

    #[test]
    fn a_swing_is_a_motion_and_the_rest_is_at_rest() {
        let channel = profile(0.05).channel("accl_x").unwrap();
        // The data sheet: ±50 mg of initial bias error, 1 σ.
        assert_eq!(find(&series(0.14), &channel), None);
        let motion = find(&series(-0.7), &channel).unwrap();
        assert!((motion.effect.size.value + 0.7).abs() < 1e-12);
        assert_eq!((motion.effect.from_s.value, motion.effect.to_s.value), (38.0, 52.0), "two seconds around");
        let rest = [Stretch { from_s: 0.0, to_s: 38.0 }, Stretch { from_s: 52.0, to_s: 100.0 }];
        assert_eq!(at_rest([&motion].into_iter(), 100.0), rest);
        assert_eq!(at_rest([].into_iter(), 100.0), [Stretch { from_s: 0.0, to_s: 100.0 }]);
    }
}
