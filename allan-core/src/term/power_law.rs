//! The classical terms, each a power of the averaging time.

use super::Process;
use crate::math::{ln, sin};
use core::f64::consts::{LN_2, PI};

/// Quantization of the angle: `σ² = 3Q²/τ²` (IEEE 952), exact at every `n`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Quantization;

/// White rate noise: `σ² = N²/τ` (IEEE 952), exact at every `n`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct AngleRandomWalk;

/// Flicker rate noise, averaged over each sampling interval: `σ² = (2 ln 2/π)·B²` (IEEE 952).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct BiasInstability;

/// A random walk of the rate, sampled: `σ² = K²·dt·(2n² + 1)/(6n)`, which tends to IEEE 952's `K²τ/3` and is half as
/// large again at `n = 1`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RateRandomWalk;

/// A trend of the rate: `σ² = R²τ²/2` (IEEE 952).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RateRamp;

impl Process for Quantization {
    fn structure(&self, m: f64, sample_period: f64) -> f64 {
        if m == 0.0 { 0.0 } else { 2.0 / (sample_period * sample_period) }
    }

    fn density(&self, frequency: f64, sample_period: f64) -> f64 {
        let sine = sin(PI * frequency * sample_period);
        4.0 * sine * sine / sample_period
    }

    fn record_needed(&self, sample_period: f64) -> f64 {
        100.0 * sample_period
    }
}

impl Process for AngleRandomWalk {
    fn structure(&self, m: f64, sample_period: f64) -> f64 {
        m / sample_period
    }

    fn density(&self, _frequency: f64, _sample_period: f64) -> f64 {
        1.0
    }

    fn record_needed(&self, sample_period: f64) -> f64 {
        100.0 * sample_period
    }

    fn avar(&self, n: u64, sample_period: f64) -> f64 {
        1.0 / (n as f64 * sample_period)
    }
}

impl Process for BiasInstability {
    fn structure(&self, m: f64, _sample_period: f64) -> f64 {
        if m == 0.0 { 0.0 } else { -m * m * ln(m) / PI }
    }

    /// `B²/(2π|f|)`, with the aliases of what the averaging leaves.
    fn density(&self, frequency: f64, sample_period: f64) -> f64 {
        let f = frequency * sample_period;
        let sine = sin(PI * f);
        let cube = |x: f64| x * x * x;
        let aliases: f64 = (1..=20).map(f64::from).map(|k| 1.0 / cube(k + f) + 1.0 / cube(k - f)).sum();
        // The rest of the sum, by the integral of 2/k³.
        let rest = 1.0 / (20.5 * 20.5);
        sample_period * sine * sine / (2.0 * PI * PI * PI) * (1.0 / cube(crate::math::abs(f)) + aliases + rest)
    }

    fn record_needed(&self, sample_period: f64) -> f64 {
        10_000.0 * sample_period
    }

    fn avar(&self, _n: u64, _sample_period: f64) -> f64 {
        2.0 * LN_2 / PI
    }
}

impl Process for RateRandomWalk {
    fn structure(&self, m: f64, sample_period: f64) -> f64 {
        -(m * m * m - m) * sample_period / 6.0
    }

    fn density(&self, frequency: f64, sample_period: f64) -> f64 {
        let sine = sin(PI * frequency * sample_period);
        sample_period * sample_period / (4.0 * sine * sine)
    }

    fn record_needed(&self, sample_period: f64) -> f64 {
        100.0 * sample_period
    }

    fn avar(&self, n: u64, sample_period: f64) -> f64 {
        let n = n as f64;
        sample_period * (2.0 * n * n + 1.0) / (6.0 * n)
    }
}

impl Process for RateRamp {
    fn structure(&self, m: f64, sample_period: f64) -> f64 {
        -(m * m * m * m) * sample_period * sample_period / 12.0
    }

    fn density(&self, _frequency: f64, _sample_period: f64) -> f64 {
        0.0
    }

    fn record_needed(&self, sample_period: f64) -> f64 {
        1_000.0 * sample_period
    }

    fn avar(&self, n: u64, sample_period: f64) -> f64 {
        let tau = n as f64 * sample_period;
        tau * tau / 2.0
    }
}
