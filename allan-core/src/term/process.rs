//! The interface of a process, the power laws of IEEE Std 952, and the sinusoid.

use crate::math::{abs, ln, sin};
use core::f64::consts::{LN_2, PI};

/// A random or deterministic process with a coefficient of 1, sampled every `sample_period` seconds.
pub trait Process {
    /// `V(m)`, the variance of the sum of `m` samples for a coefficient of 1, without terms to which second differences
    /// are blind.
    ///
    /// The Allan variance is `[4V(n) − V(2n)]/(2n²)`.
    fn sum_variance(&self, m: f64, sample_period: f64) -> f64;

    /// Two-sided power spectral density at `frequency` in Hz, aliases included, in unit²/Hz; 0 for deterministic terms.
    fn density(&self, frequency: f64, sample_period: f64) -> f64;

    /// Allan variance at averaging factor `n`, in units of the coefficient squared.
    fn avar(&self, n: u64, sample_period: f64) -> f64 {
        let n = n as f64;
        (4.0 * self.sum_variance(n, sample_period) - self.sum_variance(2.0 * n, sample_period)) / (2.0 * n * n)
    }

    /// Sets `table` to [`sum_variance`](Self::sum_variance) at 0, 1, 2 … strides, up to a common factor.
    fn sum_variances(&self, stride: f64, sample_period: f64, table: &mut [f64]) {
        for (k, entry) in table.iter_mut().enumerate() {
            *entry = self.sum_variance(k as f64 * stride, sample_period);
        }
    }

    /// Sum of the squared halved covariances of second differences at lags `2n + stride, 2n + 2·stride …`; 0 if none.
    fn squared_covariance_tail(&self, _n: u64, _stride: f64, _sample_period: f64) -> f64 {
        0.0
    }

    /// Relative variance over all phases of the mean square of `count` second differences; 0 without a phase.
    fn phase_variance(&self, _count: u64, _stride: f64, _sample_period: f64) -> f64 {
        0.0
    }
}

/// Quantization of the angle: `σ² = 3Q²/τ²` (IEEE 952), exact at every `n`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Quantization;

/// White rate noise: `σ² = N²/τ` (IEEE 952), exact at every `n`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct AngleRandomWalk;

/// Flicker rate noise, averaged over each sampling interval: `σ² = (2 ln 2/π)·B²` (IEEE 952), exact at every `n`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct BiasInstability;

/// A random walk of the rate, sampled every `dt` seconds: `σ² = K²·dt·(2n² + 1)/(6n)`, the `K²τ/3` of IEEE 952 at large
/// `n`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct RateRandomWalk;

/// A linear trend of the rate: `σ² = R²τ²/2` (IEEE 952), exact at every `n`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct RateRamp;

impl Process for Quantization {
    fn sum_variance(&self, m: f64, sample_period: f64) -> f64 {
        if m == 0.0 { 0.0 } else { 2.0 / (sample_period * sample_period) }
    }

    fn density(&self, frequency: f64, sample_period: f64) -> f64 {
        let sine = sin(PI * frequency * sample_period);
        4.0 * sine * sine / sample_period
    }
}

impl Process for AngleRandomWalk {
    fn sum_variance(&self, m: f64, sample_period: f64) -> f64 {
        m / sample_period
    }

    fn density(&self, _frequency: f64, _sample_period: f64) -> f64 {
        1.0
    }

    fn avar(&self, n: u64, sample_period: f64) -> f64 {
        1.0 / (n as f64 * sample_period)
    }
}

impl Process for BiasInstability {
    fn sum_variance(&self, m: f64, _sample_period: f64) -> f64 {
        if m == 0.0 { 0.0 } else { -m * m * ln(m) / PI }
    }

    /// `B²/(2π|f|)` after the averaging over the sampling interval, with its aliases.
    fn density(&self, frequency: f64, sample_period: f64) -> f64 {
        let f = frequency * sample_period;
        let sine = sin(PI * f);
        let cube = |x: f64| x * x * x;
        let aliases: f64 = (1..=20).map(f64::from).map(|k| 1.0 / cube(k + f) + 1.0 / cube(k - f)).sum();
        // The remaining aliases: the integral of 2/k³.
        let rest = 1.0 / (20.5 * 20.5);
        sample_period * sine * sine / (2.0 * PI * PI * PI) * (1.0 / cube(abs(f)) + aliases + rest)
    }

    fn avar(&self, _n: u64, _sample_period: f64) -> f64 {
        2.0 * LN_2 / PI
    }
}

impl Process for RateRandomWalk {
    fn sum_variance(&self, m: f64, sample_period: f64) -> f64 {
        -(m * m * m - m) * sample_period / 6.0
    }

    fn density(&self, frequency: f64, sample_period: f64) -> f64 {
        let sine = sin(PI * frequency * sample_period);
        sample_period * sample_period / (4.0 * sine * sine)
    }

    fn avar(&self, n: u64, sample_period: f64) -> f64 {
        let n = n as f64;
        sample_period * (2.0 * n * n + 1.0) / (6.0 * n)
    }
}

impl Process for RateRamp {
    fn sum_variance(&self, m: f64, sample_period: f64) -> f64 {
        -(m * m * m * m) * sample_period * sample_period / 12.0
    }

    fn density(&self, _frequency: f64, _sample_period: f64) -> f64 {
        0.0
    }

    fn avar(&self, n: u64, sample_period: f64) -> f64 {
        let tau = n as f64 * sample_period;
        tau * tau / 2.0
    }
}

/// A sinusoid of amplitude 1, sampled every `dt` seconds: `σ² = sin⁴(πf·n·dt)/(n²·sin²(πf·dt))` (IEEE 952:
/// `[sin²(πfτ)/(πfτ)]²` for continuous time).
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Sinusoid {
    /// f: frequency, Hz, above 0.
    #[cfg_attr(feature = "serde", serde(deserialize_with = "crate::serialized::positive"))]
    pub frequency: f64,
}

impl Process for Sinusoid {
    fn sum_variance(&self, m: f64, sample_period: f64) -> f64 {
        let half = PI * self.frequency * sample_period;
        let ratio = sin(half * m) / sin(half);
        ratio * ratio / 2.0
    }

    fn density(&self, _frequency: f64, _sample_period: f64) -> f64 {
        0.0
    }

    fn avar(&self, n: u64, sample_period: f64) -> f64 {
        let half = PI * self.frequency * sample_period;
        let ratio = sin(half * n as f64);
        let ratio = ratio * ratio / (n as f64 * sin(half));
        ratio * ratio
    }

    /// The mean of the cosines `cos(2φ + 2jθ)` over `count` strides is Dirichlet's kernel `sin(count·θ)/(count·sin θ)`.
    fn phase_variance(&self, count: u64, stride: f64, sample_period: f64) -> f64 {
        let step = 2.0 * PI * self.frequency * sample_period * stride;
        let (single, count) = (sin(step), count as f64);
        // A stride of whole half periods always meets the same phase.
        let kernel = if abs(single) * count < 1e-6 { 1.0 } else { sin(count * step) / (count * single) };
        kernel * kernel / 2.0
    }
}
