//! The digital filter's response, against plain sums over its weights.

use std::f64::consts::PI;

use adis16405_driver::{Config, Filter, GyroRange, SamplePeriod};

/// Two boxcars of `n` convolved, and their discrete-time Fourier transform at `frequency` cycles per sample.
fn weights(n: usize) -> Vec<f64> {
    let mut weights = vec![0.0; 2 * n - 1];
    for first in 0..n {
        for second in 0..n {
            weights[first + second] += 1.0 / (n * n) as f64;
        }
    }
    weights
}

fn response(weights: &[f64], frequency: f64) -> f64 {
    let at = |k: usize| 2.0 * PI * frequency * k as f64;
    let real: f64 = weights.iter().enumerate().map(|(k, w)| w * at(k).cos()).sum();
    let imaginary: f64 = weights.iter().enumerate().map(|(k, w)| w * at(k).sin()).sum();
    real.hypot(imaginary)
}

#[test]
fn the_response_is_that_of_two_cascaded_averages() {
    for taps_log2 in 0..=6 {
        let filter = Filter::new(taps_log2);
        let weights = weights(1 << taps_log2);
        assert_eq!(filter.length() as usize, weights.len());
        for (age, weight) in weights.iter().enumerate() {
            assert!((filter.weight(age as u32) - weight).abs() < 1e-15);
        }
        assert_eq!(filter.weight(filter.length()), 0.0);
        let power: f64 = weights.iter().map(|w| w * w).sum();
        assert!((filter.white_noise_gain() - power).abs() < 1e-15);
        let delay: f64 = weights.iter().enumerate().map(|(k, w)| k as f64 * w).sum();
        assert!((f64::from(filter.group_delay()) - delay).abs() < 1e-9, "a symmetric filter delays by its centroid");
        for step in -300..=300 {
            let frequency = f64::from(step) * 0.01;
            let difference = filter.gain(frequency) - response(&weights, frequency);
            assert!(difference.abs() < 1e-12, "M = {taps_log2}, {frequency}: {difference:e}");
        }
    }
}

/// Divisors of the sample rate in Linux's driver of this part (drivers/iio/imu/adis16400.c).
#[test]
fn the_cutoff_is_that_of_linux() {
    assert_eq!(Filter::new(0).cutoff(), None);
    for (taps_log2, divisor) in [(1, 6.0), (2, 12.0), (3, 25.0), (4, 50.0), (5, 100.0), (6, 200.0)] {
        let filter = Filter::new(taps_log2);
        let cutoff = filter.cutoff().unwrap();
        assert!((filter.gain(cutoff).powi(2) - 0.5).abs() < 1e-12);
        assert!((1.0 / cutoff - divisor).abs() <= 0.75, "M = {taps_log2}: fs/{}", 1.0 / cutoff);
    }
}

#[test]
fn a_configuration_knows_its_filter() {
    let config = Config::new(GyroRange::Dps75, 5, SamplePeriod::RESET).unwrap();
    assert_eq!(config.filter().taps(), 32);
    assert_eq!(Filter::new(200).taps(), 64, "the part has six");
}
