//! Faults of the sampling: lost samples, repeated samples, a wrong sample rate.

use crate::bounds::{BoundedEstimate, MeasuredValue};
use crate::distributions::{poisson_bounds, poisson_tail, upper_tail};
use crate::effects::findings::{Correction, Detection, SIGNIFICANCE};
use crate::effects::{ClockDeviation, DroppedSamples, RateChange, RepeatedSamples};
use measurement::{Measurement, SensorProfile, repeated_fraction};
use std::collections::BTreeMap;

/// Factor on the chance of equal neighbours, for dependent channels.
const DEPENDENCE: f64 = 3.0;
/// Largest relative deviation from a usual rate.
const MAX_RATE_DEVIATION: f64 = 0.04;
/// Usual rates of hosts: powers of ten times these powers of two, and powers of two, in Hz.
const DOUBLINGS: std::ops::RangeInclusive<i32> = -3..=3;
/// Segments whose rates give the standard deviation of the rate.
const SEGMENTS: usize = 8;
/// Most parts whose rates are compared, and the fewest samples of one.
const RATE_SEGMENTS: usize = 64;
const MIN_SEGMENT: usize = 100;
const SHORTEST_PART: usize = 4;
/// Standard deviations by which the scatter of steady rates may exceed that of neighbours.
const WANDERING: f64 = 4.0;
/// Shortest recording, samples, whose rate is compared.
const MIN_SAMPLES: usize = 100 * SEGMENTS;

/// Lost samples, repeated samples and a wrong sample rate, as far as they are found, in this order.
pub(crate) fn detect(measurement: &Measurement) -> Vec<Detection> {
    [lost_samples_of(measurement), repeated_samples(measurement), sample_clock(measurement)]
        .into_iter()
        .flatten()
        .collect()
}

pub(crate) fn lost_samples_of(measurement: &Measurement) -> Option<Detection> {
    lost_samples(measurement.len() as u64, &measurement.dropped, measurement.gaps())
}

/// Samples beside the `used` ones for which indices or time stamps have room. A single one is reported: only a loss leaves room.
pub(crate) fn lost_samples(used: u64, dropped: &BTreeMap<&'static str, u64>, gaps: usize) -> Option<Detection> {
    let missing = dropped.get("gap").copied().unwrap_or(0);
    if missing == 0 {
        return None;
    }
    let all = (used + dropped.values().sum::<u64>()) as f64;
    let missing = missing as f64;
    // The events are gaps of several samples each.
    let per_gap = missing / (gaps.max(1) as f64);
    let (low, high) = poisson_bounds(gaps.max(1) as f64);
    let fraction = |count: f64| (count / all).min(1.0);
    let lost = DroppedSamples {
        fraction: BoundedEstimate::new(fraction(missing), fraction(low * per_gap), fraction(high * per_gap)),
        missing,
        samples: all,
        gaps,
    };
    Some(Detection { effect: lost.into(), correction: None })
}

/// Samples that equal the sample before in all channels, if there are more of them than by chance.
pub(crate) fn repeated_samples(measurement: &Measurement) -> Option<Detection> {
    let channels = &measurement.channels;
    let mut equal = vec![0u64; channels.len()];
    let mut positions = Vec::new();
    for at in 1..measurement.len() {
        let mut all = true;
        for (channel, equal) in channels.iter().zip(&mut equal) {
            let same = channel.counts[at] == channel.counts[at - 1];
            *equal += u64::from(same);
            all &= same;
        }
        if all {
            positions.push(measurement.slots[at]);
        }
    }
    let refused = measurement.dropped.get("repeated").copied().unwrap_or(0);
    let (pairs, seen) = (measurement.len().saturating_sub(1) as f64, positions.len() as f64);
    let shares: Vec<f64> = equal.iter().map(|&equal| equal as f64 / pairs.max(1.0)).collect();
    let expected = DEPENDENCE * pairs * shares.iter().product::<f64>();
    let p_value = poisson_tail(positions.len() as u64 + refused, expected);
    if p_value > SIGNIFICANCE {
        return None;
    }
    let count = pairs * repeated_fraction(seen / pairs.max(1.0), &shares) + refused as f64;
    let (low, high) = poisson_bounds(count);
    let all = pairs + 1.0 + refused as f64;
    let repeated = RepeatedSamples {
        fraction: BoundedEstimate::new(count / all, low / all, high / all),
        equal: positions.len() as u64 + refused,
        samples: all,
        by_chance: expected,
        channels: channels.len(),
    };
    Some(Detection { effect: repeated.into(), correction: Some(Correction::Exclude(positions)) })
}

/// Compares the sample rate by the time stamps with the stated rate, or without one with the nearest rate that the sensor
/// can be set to or that hosts usually read at; and its parts with each other. A sensor without a data sheet has no rate of its own.
pub(crate) fn sample_clock(measurement: &Measurement) -> Option<Detection> {
    let MeasuredValue { value: measured, error } = rate_by_time_stamps(measurement)?;
    let nominal = measurement.stated_rate_hz.or_else(|| nearest_usual_rate(&measurement.profile, measured));
    let nominal = nominal.unwrap_or(measured);
    let off = measured / nominal - 1.0;
    let z = off.abs() * measured / error;
    let p_value = 2.0 * upper_tail(z);
    let unusual = measurement.stated_rate_hz.is_none() && off.abs() > MAX_RATE_DEVIATION;
    let change = rate_change(measurement);
    if (unusual || p_value > SIGNIFICANCE) && change.is_none() {
        return None;
    }
    let rate_hz = MeasuredValue { value: measured, error }.bounds();
    let clock = ClockDeviation { rate_hz, nominal_hz: nominal, sigmas: z, change };
    Some(Detection { effect: clock.into(), correction: None })
}

/// The sample rate by the time stamps, Hz: its standard deviation is that of the segments' rates and
/// [`SensorProfile::host_clock_error`]. `None` without time stamps or with fewer than [`MIN_SAMPLES`].
pub(crate) fn rate_by_time_stamps(measurement: &Measurement) -> Option<MeasuredValue> {
    let rates = segment_rates(measurement, SEGMENTS)?;
    let [measured] = segment_rates(measurement, 1)?[..] else { return None };
    let scatter = variance(&rates) / rates.len() as f64;
    let host = measurement.profile.host_clock_error * measured;
    Some(MeasuredValue { value: measured, error: scatter.sqrt().hypot(host) })
}

/// Rates of segments by their time stamps, Hz; `None` without increasing stamps or with fewer than [`MIN_SAMPLES`].
fn segment_rates(measurement: &Measurement, segments: usize) -> Option<Vec<f64>> {
    let (times, slots) = (measurement.times_s.as_ref()?, &measurement.slots);
    let of_segment = |segment: usize| {
        let range = slots.len() * segment / segments..slots.len() * (segment + 1) / segments;
        rate(&slots[range.clone()], &times[range])
    };
    (slots.len() >= MIN_SAMPLES).then(|| (0..segments).map(of_segment).collect())?
}

/// A rate that changes once, beyond chance and the host's clock.
///
/// The rest has to scatter as neighbours differ, unlike a clock that wanders. The ratio of both variances is 1 ± 1/√n
/// (J. von Neumann, Ann. Math. Statist. 12, 1941).
fn rate_change(measurement: &Measurement) -> Option<RateChange> {
    let segments = RATE_SEGMENTS.min(measurement.len() / MIN_SEGMENT);
    if segments < 4 * SHORTEST_PART {
        return None;
    }
    let rates = segment_rates(measurement, segments)?;
    let squares = |rates: &[f64]| variance(rates) * (rates.len() - 1) as f64;
    // The part with the change belongs to neither.
    let left = |at: usize| squares(&rates[..at]) + squares(&rates[at + 1..]);
    let at = (SHORTEST_PART..segments - SHORTEST_PART).min_by(|a, b| left(*a).total_cmp(&left(*b)))?;
    let (before, after) = (&rates[..at], &rates[at + 1..]);
    let pairs = |rates: &[f64]| rates.windows(2).map(|pair| 0.5 * (pair[1] - pair[0]).powi(2)).sum::<f64>();
    let count = (segments - 3) as f64;
    let (of_all, of_neighbours) = (left(at) / count, (pairs(before) + pairs(after)) / count);
    let host = measurement.profile.host_clock_error;
    let part = |rates: &[f64]| {
        let value = mean(rates);
        MeasuredValue { value, error: (of_all / rates.len() as f64).sqrt().hypot(host * value) }
    };
    let [earlier, later] = [before, after].map(part);
    let sigmas = (later.value - earlier.value).abs() / earlier.error.hypot(later.error);
    let places = (segments - 2 * SHORTEST_PART) as f64;
    // Both may wander by the error of the host's clock.
    let tolerated = of_neighbours.max((host * earlier.value).powi(2));
    let is_steady = of_all < (1.0 + WANDERING / count.sqrt()) * tolerated;
    let is_change = places * 2.0 * upper_tail(sigmas) < SIGNIFICANCE;
    let time_s = |at: usize| {
        let position = (measurement.len() * at / segments).min(measurement.len() - 1);
        measurement.slots[position] as f64 / measurement.sample_rate_hz
    };
    let [from_s, to_s] = [at, at + 1].map(time_s);
    // The part between has the mean of both rates, weighted by time.
    let of_part = ((rates[at] - later.value) / (earlier.value - later.value)).clamp(0.0, 1.0);
    (is_steady && is_change).then(|| RateChange {
        time_s: BoundedEstimate::new(from_s + of_part * (to_s - from_s), from_s, to_s),
        before_hz: earlier.bounds(),
        after_hz: later.bounds(),
        sigmas,
    })
}

/// The nearest usual rate, Hz, of the sensor or of hosts; `None` if its rates are unknown.
fn nearest_usual_rate(profile: &SensorProfile, measured: f64) -> Option<f64> {
    let native = profile.nearest_native_rate_hz(measured)?;
    let decade = |power: i32| DOUBLINGS.map(move |doublings| 10f64.powi(power) * 2f64.powi(doublings));
    let round = (-1..=3).flat_map(decade).chain((0..=10).map(|power| 2f64.powi(power)));
    let distance = |rate: &f64| (rate / measured - 1.0).abs();
    std::iter::once(native).chain(round).min_by(|a, b| distance(a).total_cmp(&distance(b)))
}

/// Sample rate, Hz: 1/slope of the least-squares line of the stamps over the sample periods.
fn rate(slots: &[u64], times: &[f64]) -> Option<f64> {
    let (&first, &start_s) = (slots.first()?, times.first()?);
    let points = || slots.iter().zip(times).map(|(slot, time)| ((slot - first) as f64, time - start_s));
    let count = slots.len() as f64;
    let (slot_sum, time_sum) = points().fold((0.0, 0.0), |(slots, times), (slot, time)| (slots + slot, times + time));
    let (mean_slot, mean_time) = (slot_sum / count, time_sum / count);
    let (squares, products) = points().fold((0.0, 0.0), |(squares, products), (slot, time)| {
        (squares + (slot - mean_slot).powi(2), products + (slot - mean_slot) * (time - mean_time))
    });
    let rate = squares / products;
    (rate.is_finite() && rate > 0.0).then_some(rate)
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

fn variance(values: &[f64]) -> f64 {
    let mean = mean(values);
    values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / (values.len() - 1) as f64
}

#[cfg(test)]
mod tests {
    use super::nearest_usual_rate;
    use measurement::SensorProfile;

    /// The ADIS16405 samples at 1638.4 Hz/n, n ≥ 2, and at 52.85 Hz/n (data sheet).
    #[test]
    fn the_nearest_usual_rate_is_one_of_the_sensor_or_a_round_one() {
        for (measured, usual) in [(816.43, 819.2), (204.1, 204.8), (100.02, 100.0), (101.9, 102.4), (199.5, 200.0)] {
            let nearest = nearest_usual_rate(&measurement::adis16405::profile(0.05), measured).expect("a part's rates");
            assert!((nearest / usual - 1.0).abs() < 1e-4, "{measured}: {nearest}");
        }
        // Parts without a profile run at any rate.
        for rate_hz in (10..5000).map(|tenths| f64::from(tenths) / 10.0) {
            assert_eq!(nearest_usual_rate(&SensorProfile::generic(), rate_hz), None, "{rate_hz}");
        }
    }
}
