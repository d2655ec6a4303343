//! White noise behind an analog low-pass filter of the second order, sampled.

use super::exponential::Complex;
use super::process::Process;
use crate::math::{cos, expm1, sin, sqrt};
use core::f64::consts::PI;

/// White noise of density 1 after a low-pass filter of the second order, `H(s) = ω₀²/(s² + 2ζω₀s + ω₀²)`, `ω₀ = 2πf₀`,
/// which is not averaged before it is sampled.
///
/// Its autocovariance is `ω₀/(4ζ)·exp(−ζω₀|t|)·(cos ω_d t + ζω₀/ω_d·sin ω_d|t|)`, `ω_d = ω₀·√(1 − ζ²)` (A. Papoulis,
/// "Probability, Random Variables, and Stochastic Processes"). The Allan variance is exact where `f₀` is above a
/// thousandth of the sample rate.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct LowPass {
    /// f₀: natural frequency, Hz, above 0.
    #[cfg_attr(feature = "serde", serde(deserialize_with = "crate::serialized::positive"))]
    pub frequency: f64,
    /// ζ: damping, above 0 and below 1.
    #[cfg_attr(feature = "serde", serde(deserialize_with = "crate::serialized::damping"))]
    pub damping: f64,
}

impl LowPass {
    /// A Butterworth filter of the second order, of which half of the power is left at `frequency`, Hz.
    #[must_use]
    pub const fn butterworth(frequency: f64) -> Self {
        Self { frequency, damping: core::f64::consts::FRAC_1_SQRT_2 }
    }

    /// Two equal stages of the first order with the corner `frequency`, Hz, each, to a thousandth of their damping.
    #[must_use]
    pub const fn two_stages(frequency: f64) -> Self {
        Self { frequency, damping: 0.999 }
    }

    /// Frequency at which half of the power is left, Hz: `f₀·√(1 − 2ζ² + √((1 − 2ζ²)² + 1))`.
    #[must_use]
    pub fn bandwidth(&self) -> f64 {
        let excess = 1.0 - 2.0 * self.damping * self.damping;
        self.frequency * sqrt(excess + sqrt(excess * excess + 1.0))
    }

    /// λ, the decay and angle (radians) per sample, and c of the autocovariance `Re c·exp(−λ·|j|)` in units of the variance.
    fn rate(&self, sample_period: f64) -> (Complex, Complex) {
        let turn = 2.0 * PI * self.frequency * sample_period;
        let damped = sqrt(1.0 - self.damping * self.damping);
        (Complex { re: self.damping * turn, im: damped * turn }, Complex { re: 1.0, im: self.damping / damped })
    }

    fn variance(&self) -> f64 {
        PI * self.frequency / (2.0 * self.damping)
    }
}

/// `(1+z)/(1−z)` and `2z/(1−z)²`, each times the factor of the autocovariance.
fn line_and_bend(rate: Complex, factor: Complex) -> (f64, Complex) {
    let inverse = rate.one_minus_exp().inverse();
    let line = factor * inverse * 2.0 - factor;
    (line.re, factor * (inverse * inverse - inverse) * 2.0)
}

impl Process for LowPass {
    fn sum_variance(&self, m: f64, sample_period: f64) -> f64 {
        let (rate, factor) = self.rate(sample_period);
        let (line, bend) = line_and_bend(rate, factor);
        self.variance() * (line * m - (bend * (rate * m).one_minus_exp()).re)
    }

    fn density(&self, frequency: f64, sample_period: f64) -> f64 {
        let (rate, factor) = self.rate(sample_period);
        let angle = 2.0 * PI * frequency * sample_period;
        // 1 + Re c·(2z·cos θ − 2z²)/(1 − 2z·cos θ + z²).
        let shrink = expm1(-rate.re) + 1.0;
        let z = Complex { re: shrink * cos(rate.im), im: -shrink * sin(rate.im) };
        let one = Complex { re: 1.0, im: 0.0 };
        let turned = z * (2.0 * cos(angle));
        let ratio = (turned - z * z * 2.0) * (one - turned + z * z).inverse();
        self.variance() * sample_period * (1.0 + (factor * ratio).re)
    }

    fn squared_covariance_tail(&self, n: u64, stride: f64, sample_period: f64) -> f64 {
        let (rate, factor) = self.rate(sample_period);
        let (_, bend) = line_and_bend(rate, factor);
        let n = n as f64;
        let one_minus_power = (rate * n).one_minus_exp();
        let square = one_minus_power * one_minus_power;
        let at_2n = bend * square * square * (-self.variance() / (4.0 * n * n));
        super::exponential::squared_tail(at_2n, rate * stride)
    }
}
