//! Why the driver refused a burst is counted in what the device reports.

use adis16405_driver::{Burst, Config, Counts, OutputWord};
use firmware::{Arrival, Estimators, Statistics};
use link::Health;

/// 5.00 V in counts of 2.418 mV, and a sensor at rest.
const GOOD: [i16; 12] = [2068, 11, 12, 13, 4, 5, 6, 7, 8, 9, 10, 11];

fn good(gyro_x: i16) -> Burst {
    let mut counts = GOOD;
    counts[1] = gyro_x;
    Burst::from_counts(&Counts::new(counts))
}

/// One clock too many: every bit arrives one place to the left.
fn shifted(burst: &Burst) -> Burst {
    let next = |k: usize| burst.words.get(k + 1).map_or(0, |word| word.0 >> 15);
    Burst { words: core::array::from_fn(|k| OutputWord(burst.words[k].0 << 1 | next(k))) }
}

fn health_after(bursts: impl IntoIterator<Item = Burst>) -> Health {
    let mut statistics = Statistics::new();
    let mut estimators = Estimators::new(&mut statistics, Config::default());
    for (period, burst) in (0..).zip(bursts) {
        let at_us = (f64::from(period) * 1e6 / 819.2) as u64;
        estimators.take(Arrival { at_us, dropped: 0, burst: Some(burst) }, 0);
    }
    estimators.health()
}

#[test]
fn damaged_bursts_are_counted_by_cause() {
    // Beyond ±7000 counts of 0.05 deg/s the part cannot measure.
    let damaged = [good(1), good(7_001), good(2), good(-7_001), good(3), shifted(&good(4)), good(5)];
    let health = health_after(damaged);
    assert_eq!((health.bursts, health.used), (7, 4), "{health:?}");
    assert_eq!((health.impossible_rate, health.shifted, health.frozen, health.x_sign), (2, 1, 0, 0), "{health:?}");
}

/// The 513th of equal bursts is the first that has 512 before it.
#[test]
fn a_frozen_sensor_is_counted() {
    let health = health_after(core::iter::repeat_n(good(1), 600));
    assert_eq!((health.bursts, health.frozen, health.used), (600, 88, 512), "{health:?}");
}
