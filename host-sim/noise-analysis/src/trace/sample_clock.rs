//! A sample clock that does not run at the nominal rate.

use crate::distributions::{NORMAL_975, upper_tail};
use crate::findings::{Detection, Effect, Parameter, SIGNIFICANCE};
use measurement::{Measurement, SensorProfile};

/// Standard deviation of the clock of an ordinary host, which the rate is measured by: 20 parts in a million, as of a
/// crystal that nobody has trimmed.
pub const HOST_CLOCK: f64 = 20e-6;
/// Farther from every rate that is usual, the rate is none of them.
const FARTHEST: f64 = 0.04;
/// Round rates at which hosts read: a power of ten, halved or doubled up to three times, or a power of two.
const DOUBLINGS: std::ops::RangeInclusive<i32> = -3..=3;
/// Stretches whose rates tell how well the rate is known.
const STRETCHES: usize = 8;
/// Shortest record whose stretches tell it.
const FEWEST_SAMPLES: usize = 100 * STRETCHES;

/// Compares the rate that the time stamps show with the one that is stated, or else with the nearest at which the part
/// samples or a host reads.
#[must_use]
pub fn find(measurement: &Measurement) -> Option<Detection> {
    let times = measurement.times_s.as_ref()?;
    let slots: Vec<f64> = measurement.slots.iter().map(|&slot| slot as f64).collect();
    if slots.len() < FEWEST_SAMPLES {
        return None;
    }
    let rates: Option<Vec<f64>> = (0..STRETCHES)
        .map(|stretch| {
            let range = slots.len() * stretch / STRETCHES..slots.len() * (stretch + 1) / STRETCHES;
            rate(&slots[range.clone()], &times[range])
        })
        .collect();
    let rates = rates?;
    let measured = rate(&slots, times)?;
    let mean = rates.iter().sum::<f64>() / STRETCHES as f64;
    let scatter = rates.iter().map(|rate| (rate - mean).powi(2)).sum::<f64>() / (STRETCHES * (STRETCHES - 1)) as f64;
    let nominal = measurement.stated_rate_hz.unwrap_or_else(|| nearest_usual(&measurement.profile, measured));
    let error = (scatter / (measured * measured) + HOST_CLOCK * HOST_CLOCK).sqrt();
    let off = measured / nominal - 1.0;
    let z = off.abs() / error;
    let p_value = 2.0 * upper_tail(z);
    let other = measurement.stated_rate_hz.is_none() && off.abs() > FARTHEST;
    if other || p_value > SIGNIFICANCE {
        return None;
    }
    let half = NORMAL_975 * error * measured;
    let evidence = format!(
        "{measured:.4} Hz by the time stamps, {:+.1} ppm from the nominal {nominal:.4} Hz, {z:.1} σ of an ordinary host's \
         clock; the tolerance of the part's oscillator",
        1e6 * off,
    );
    Some(Detection {
        effect: Effect::new(
            "sample_clock",
            [("rate_hz", Parameter::new(measured, measured - half, measured + half, "Hz"))],
            evidence,
        ),
        correction: None,
    })
}

/// The nearest rate, in Hz, that the part can be set to or that is round.
fn nearest_usual(profile: &SensorProfile, measured: f64) -> f64 {
    let part = profile.nearest_native_rate_hz(measured);
    let decade = |power: i32| DOUBLINGS.map(move |doublings| 10f64.powi(power) * 2f64.powi(doublings));
    let round = (-1..=3).flat_map(decade).chain((0..=10).map(|power| 2f64.powi(power)));
    let distance = |rate: &f64| (rate / measured - 1.0).abs();
    part.into_iter().chain(round).min_by(|a, b| distance(a).total_cmp(&distance(b))).unwrap_or(measured)
}

/// Hz; one over the slope of the least-squares line of time over period.
fn rate(slots: &[f64], times: &[f64]) -> Option<f64> {
    let count = slots.len() as f64;
    let mean = |values: &[f64]| values.iter().sum::<f64>() / count;
    let (mean_slot, mean_time) = (mean(slots), mean(times));
    let (squares, products) = slots.iter().zip(times).fold((0.0, 0.0), |(squares, products), (slot, time)| {
        (squares + (slot - mean_slot).powi(2), products + (slot - mean_slot) * (time - mean_time))
    });
    let rate = squares / products;
    (rate.is_finite() && rate > 0.0).then_some(rate)
}

#[cfg(test)]
mod tests {
    use super::nearest_usual;

    /// The part's rates are 1638.4 Hz over whole numbers from 2 on, and 52.85 Hz over whole numbers (data sheet).
    #[test]
    fn a_rate_belongs_to_the_part_or_to_a_host() {
        for (measured, usual) in [(816.43, 819.2), (204.1, 204.8), (100.02, 100.0), (101.9, 102.4), (199.5, 200.0)] {
            let nearest = nearest_usual(&measurement::adis16405::profile(0.05), measured);
            assert!((nearest / usual - 1.0).abs() < 1e-4, "{measured}: {nearest}");
        }
    }
}
