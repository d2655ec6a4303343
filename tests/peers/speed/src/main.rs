//! Prints the time per sample and channel of this crate and two others on the same white noise, ns.
//!
//! Each time is the shortest of several runs, which other load on the machine affects least.

use allan::{Allan, DataType, Mode, Style};
use allan_core::Cascade;
use imu_calib::allan::{AllanConfig, AllanEstimator};
use std::hint::black_box;
use std::time::{Duration, Instant};

const SAMPLES: usize = 1_000_000;
const RATE_HZ: f64 = 100.0;

fn main() {
    let counts = counts();
    let values: Vec<f64> = counts.iter().map(|&count| f64::from(count)).collect();

    let mut cascade = Cascade::<24, 8>::new();
    print("allan-core push", least(40, || counts.iter().for_each(|&count| black_box(&mut cascade).push(count))), 1);
    print("allan-core push_slice", least(40, || black_box(&mut cascade).push_slice(&counts)), 1);
    print("allan 0.4.1", least(3, || drop(black_box(record(&values)))), 1);
    print("imu-calib 0.3.1", least(3, || drop(black_box(calibrate(&values)))), 6);
}

/// White noise with a standard deviation of about 20 counts.
fn counts() -> Vec<i32> {
    let mut state = 1_u64;
    let mut die = || {
        state = state * 16_807 % 2_147_483_647;
        (state % 41) as i32 - 20
    };
    (0..SAMPLES).map(|_| die() + die() + die()).collect()
}

/// Estimates at the averaging factors 1, 2, 4, 8, 10, 20 … up to a quarter of the record, about as many as there are
/// octaves.
fn record(values: &[f64]) -> Allan {
    let config = Allan::builder().mode(Mode::Cumulative).data_type(DataType::Frequency);
    let mut allan = config.style(Style::Decade1248).max_tau(SAMPLES / 4).build_allan();
    values.iter().for_each(|&value| allan.record(value));
    allan
}

/// Estimates six channels at the crate's default of 100 averaging factors.
fn calibrate(values: &[f64]) -> AllanEstimator {
    let mut estimator = AllanEstimator::with_rate(AllanConfig::default(), RATE_HZ).expect("a rate");
    for (k, &value) in values.iter().enumerate() {
        estimator.push(k as f64 / RATE_HZ, [value; 3], [value; 3]);
    }
    estimator
}

fn least(runs: usize, mut work: impl FnMut()) -> Duration {
    let timed = |_| {
        let start = Instant::now();
        work();
        start.elapsed()
    };
    (0..runs).map(timed).min().expect("at least one run")
}

fn print(name: &str, time: Duration, channels: u32) {
    println!("{name}\t{:.2}", time.as_nanos() as f64 / SAMPLES as f64 / f64::from(channels));
}
