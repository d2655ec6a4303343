//! Temperature, supply and force over time, and random processes.

use crate::spectral_noise::normal;
use rand::Rng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, Exp1};
use std::f64::consts::TAU;
use virtual_sensor::Environment;

pub(super) struct EnvironmentCourse {
    pub(super) temperature_c: Vec<f64>,
    pub(super) supply_v: Vec<f64>,
    pub(super) force_g: [Vec<f64>; 3],
}

impl EnvironmentCourse {
    /// The environment at `k·period_s` s for all samples `k`.
    pub(super) fn new(environment: &Environment, samples: usize, period_s: f64, random: &mut ChaCha8Rng) -> Self {
        let Environment { temperature, supply, motion } = *environment;
        let times = || (0..samples).map(|at| at as f64 * period_s);
        let cycle = |time_s: f64, cycle_s: f64| (TAU * time_s / cycle_s).sin();
        let warm = |time_s: f64| {
            let warm_up = temperature.rise_c * (1.0 - (-time_s / temperature.time_constant_s).exp());
            warm_up + temperature.cycle_c * cycle(time_s, temperature.period_s)
        };
        let load = two_levels(supply.load_time_s, samples, period_s, random);
        let volts = |(time_s, up): (f64, bool)| {
            (if up { 0.5 } else { -0.5 }) * supply.load_v + supply.cycle_v * cycle(time_s, supply.period_s)
        };
        let axis = |random: &mut ChaCha8Rng| {
            let unit = gauss_markov(motion.time_constant_s, samples, period_s, random);
            unit.into_iter().map(|value| motion.deviation_g * value).collect()
        };
        Self {
            temperature_c: times().map(warm).collect(),
            supply_v: times().zip(load).map(volts).collect(),
            force_g: [(); 3].map(|()| axis(random)),
        }
    }
}

pub(super) fn log_uniform(random: &mut ChaCha8Rng, low: f64, high: f64) -> f64 {
    low * (random.random::<f64>() * (high / low).ln()).exp()
}

/// Rate and length for which every drawn frequency and time constant is visible.
const USUAL_RATE_HZ: f64 = 100.0;
const USUAL_S: f64 = 120.0;

/// Factor on drawn frequencies: below 1 for rates below [`USUAL_RATE_HZ`], above 1 for records below [`USUAL_S`].
pub(super) fn frequency_factor(seconds: f64, period_s: f64) -> f64 {
    (USUAL_S / seconds).max(1.0).min(1.0 / (USUAL_RATE_HZ * period_s))
}

/// A signal that jumps between two levels, with the autocorrelation `exp(−t/time_constant)`.
pub(super) fn two_levels(time_constant_s: f64, samples: usize, period_s: f64, random: &mut ChaCha8Rng) -> Vec<bool> {
    let stay = |random: &mut ChaCha8Rng| {
        let unit: f64 = Exp1.sample(random);
        2.0 * time_constant_s * unit
    };
    let mut up = random.random_bool(0.5);
    let mut until_s = stay(random);
    let level = |at: usize| {
        while until_s <= at as f64 * period_s {
            until_s += stay(random);
            up = !up;
        }
        up
    };
    (0..samples).map(level).collect()
}

/// A Gauss-Markov process of variance 1 with the autocorrelation `exp(−t/time_constant)`.
pub(super) fn gauss_markov(time_constant_s: f64, samples: usize, period_s: f64, random: &mut ChaCha8Rng) -> Vec<f64> {
    let kept = (-period_s / time_constant_s).exp();
    let drive = (1.0 - kept * kept).sqrt();
    let mut value = normal(random);
    let next = |_| {
        let present = value;
        value = kept * value + drive * normal(random);
        present
    };
    (0..samples).map(next).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;

    #[test]
    fn frequencies_follow_the_rate_and_the_length_of_the_record() {
        for (seconds, rate_hz, expected) in
            [(120.0, 100.0, 1.0), (1800.0, 204.8, 1.0), (2400.0, 5.0, 0.05), (30.0, 400.0, 4.0), (30.0, 40.0, 0.4)]
        {
            let factor = frequency_factor(seconds, 1.0 / rate_hz);
            assert!((factor - expected).abs() < 1e-12, "{seconds} s at {rate_hz} Hz: {factor}");
        }
    }

    /// The tolerance is 1/√20,000 for 20,000 correlation times.
    #[test]
    fn both_processes_have_the_exponential_autocorrelation() {
        let mut random = ChaCha8Rng::seed_from_u64(1);
        let levels = two_levels(0.1, 200_000, 0.01, &mut random);
        let signs: Vec<f64> = levels.into_iter().map(|up| if up { 1.0 } else { -1.0 }).collect();
        for values in [signs, gauss_markov(0.1, 200_000, 0.01, &mut random)] {
            let product = |lag: usize| {
                let pairs = values.iter().zip(&values[lag..]);
                pairs.map(|(a, b)| a * b).sum::<f64>() / (values.len() - lag) as f64
            };
            for (lag, expected) in [(0, 1.0), (10, (-1f64).exp()), (30, (-3f64).exp())] {
                assert!((product(lag) - expected).abs() < 0.04, "{lag}: {}", product(lag));
            }
        }
    }
}
