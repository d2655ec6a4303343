//! Processes with an exponentially decaying autocovariance: the Gauss–Markov process, and the resonance, whose decay rate
//! is complex.
//!
//! With the autocovariance `r_j = Re z^j`, `z = exp(−λ)`, the variance of a sum of `m` samples is
//! `Re[m(1+z)/(1−z) − 2z(1−z^m)/(1−z)²]`, from which the Allan variance follows. For slow processes `z` is close to 1, so
//! the formulas are written in `1 − z`; where this cancels too, a power series in `λ` is used.

use super::process::Process;
use crate::math::{cos, exp, expm1, sin, sqrt};
use core::f64::consts::PI;
use core::ops::{Add, Div, Mul, Sub};

/// Exponentially correlated (first-order Gauss–Markov) noise of variance 1: `r(t) = exp(−|t|/T)` (IEEE 952).
///
/// Sampled, it is an AR(1) process, whose Allan variance this is exactly. Random telegraph noise has the same Allan variance.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Markov {
    /// T: correlation time, s, above 0.
    #[cfg_attr(feature = "serde", serde(deserialize_with = "crate::serialized::positive"))]
    pub time_constant: f64,
}

/// A damped oscillation of variance 1 driven by white noise: `r(t) = exp(−π·Δf·|t|)·cos(2πf·t)`.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Resonance {
    /// f: centre frequency, Hz.
    #[cfg_attr(feature = "serde", serde(deserialize_with = "crate::serialized::positive"))]
    pub frequency: f64,
    /// Δf: full width of the spectral line at half its height, Hz, above 0.
    #[cfg_attr(feature = "serde", serde(deserialize_with = "crate::serialized::positive"))]
    pub bandwidth: f64,
}

/// Magnitude of `λ·n` below which the power series is more accurate than the closed form.
const SLOW: f64 = 0.03;

/// A process with the autocovariance `Re exp(−λ·|j|)` at a lag of `j` samples.
trait ExponentialAutocovariance {
    /// λ: decay and angle (radians) per sample.
    fn rate(&self, sample_period: f64) -> Complex;
}

impl ExponentialAutocovariance for Markov {
    fn rate(&self, sample_period: f64) -> Complex {
        Complex { re: sample_period / self.time_constant, im: 0.0 }
    }
}

impl ExponentialAutocovariance for Resonance {
    fn rate(&self, sample_period: f64) -> Complex {
        Complex { re: PI * self.bandwidth * sample_period, im: 2.0 * PI * self.frequency * sample_period }
    }
}

impl<T: ExponentialAutocovariance> Process for T {
    fn sum_variance(&self, m: f64, sample_period: f64) -> f64 {
        sum_variance(self.rate(sample_period), m)
    }

    fn density(&self, frequency: f64, sample_period: f64) -> f64 {
        let Complex { re: decay, im: centre } = self.rate(sample_period);
        let angle = 2.0 * PI * frequency * sample_period;
        (lorentzian(decay, angle - centre) + lorentzian(decay, angle + centre)) * sample_period / 2.0
    }

    fn avar(&self, n: u64, sample_period: f64) -> f64 {
        avar(self.rate(sample_period), n as f64)
    }

    fn sum_variances(&self, stride: f64, sample_period: f64, table: &mut [f64]) {
        sum_variances(self.rate(sample_period), stride, table);
    }

    fn squared_covariance_tail(&self, n: u64, stride: f64, sample_period: f64) -> f64 {
        squared_covariance_tail(self.rate(sample_period), n as f64, stride)
    }
}

fn sum_variance(rate: Complex, m: f64) -> f64 {
    let one_minus_z = rate.one_minus_exp();
    let one_minus_power = (rate * m).one_minus_exp();
    let z = Complex::ONE - one_minus_z;
    let line = (Complex::ONE + z) / one_minus_z * m;
    (line - z * one_minus_power / (one_minus_z * one_minus_z) * 2.0).re
}

fn avar(rate: Complex, n: f64) -> f64 {
    if (rate * n).magnitude() < SLOW {
        return slow_avar(rate, n);
    }
    let one_minus_z = rate.one_minus_exp();
    let one_minus_power = (rate * n).one_minus_exp();
    let z = Complex::ONE - one_minus_z;
    let line = (Complex::ONE + z) / one_minus_z * n;
    // 3 − 4zⁿ + z²ⁿ without its cancellation.
    let bend = one_minus_power * 2.0 + one_minus_power * one_minus_power;
    (line - z * bend / (one_minus_z * one_minus_z)).re / (n * n)
}

/// Power series of the Allan variance in `λ` up to `λ⁴`; the next term is below 10⁻⁷ of the result.
fn slow_avar(rate: Complex, n: f64) -> f64 {
    let square = rate * rate;
    let (n2, n3) = (n * n, n * n * n);
    let sum = rate * ((2.0 * n2 + 1.0) / (3.0 * n)) - square * (n2 / 2.0)
        + square * rate * ((1.4 * n3 - n / 3.0 - 1.0 / (15.0 * n)) / 6.0)
        - square * square * ((2.0 * n2 * n2 - n2) / 24.0);
    sum.re
}

/// Sum variances at 0, 1, 2 … strides. `1 − z^m` advances from stride to stride by `1 − zᵃ⁺ᵇ = u + v − uv` with
/// `u = 1 − zᵃ`, `v = 1 − zᵇ`.
fn sum_variances(rate: Complex, stride: f64, table: &mut [f64]) {
    if (rate * stride).magnitude() * (table.len() as f64) < 1e-3 {
        // At these strides the process is a random walk, and the differences below would cancel.
        for (k, sum_variance) in table.iter_mut().enumerate() {
            let m = k as f64 * stride;
            *sum_variance = m - m * m * m;
        }
        return;
    }
    let one_minus_z = rate.one_minus_exp();
    let z = Complex::ONE - one_minus_z;
    let line = (Complex::ONE + z) / one_minus_z;
    let bend = z / (one_minus_z * one_minus_z) * 2.0;
    let step = (rate * stride).one_minus_exp();
    let mut one_minus_power = Complex { re: 0.0, im: 0.0 };
    for (k, sum_variance) in table.iter_mut().enumerate() {
        *sum_variance = (line * (k as f64 * stride) - bend * one_minus_power).re;
        one_minus_power = one_minus_power + step - one_minus_power * step;
    }
}

/// A complex number whose real part is the covariance of second differences at a lag of `2n`; at longer lags it is
/// multiplied by `z` per sample.
fn covariance_at_2n(rate: Complex, n: f64) -> Complex {
    let one_minus_z = rate.one_minus_exp();
    let square = (rate * n).one_minus_exp() * (rate * n).one_minus_exp();
    let z = Complex::ONE - one_minus_z;
    z * square * square / (one_minus_z * one_minus_z) * (-1.0 / (2.0 * n * n))
}

/// Sum of the squares of the covariances at the lags `2n + stride, 2n + 2·stride …`
fn squared_covariance_tail(rate: Complex, n: f64, stride: f64) -> f64 {
    let step = rate * stride;
    let first = covariance_at_2n(rate, n) * step.decay();
    let square = first * first;
    let steady = (first.re * first.re + first.im * first.im) / -expm1(-2.0 * step.re);
    (steady + (square / (step * 2.0).one_minus_exp()).re) / 2.0
}

/// Discrete spectrum of `exp(−decay·|j|)` at `angle` radians per sample.
fn lorentzian(decay: f64, angle: f64) -> f64 {
    let z = exp(-decay);
    (1.0 - z * z) / (1.0 - 2.0 * z * cos(angle) + z * z)
}

/// A complex number with the operations that the formulas above need.
#[derive(Debug, Clone, Copy)]
struct Complex {
    re: f64,
    im: f64,
}

impl Complex {
    const ONE: Self = Self { re: 1.0, im: 0.0 };

    /// `1 − exp(−self)`, without cancellation near 0.
    fn one_minus_exp(self) -> Self {
        let shrink = expm1(-self.re);
        let half = sin(self.im / 2.0);
        Self { re: 2.0 * half * half * (1.0 + shrink) - shrink, im: (1.0 + shrink) * sin(self.im) }
    }

    /// `exp(−self)`.
    fn decay(self) -> Self {
        let modulus = exp(-self.re);
        Self { re: modulus * cos(self.im), im: -modulus * sin(self.im) }
    }

    fn magnitude(self) -> f64 {
        sqrt(self.re * self.re + self.im * self.im)
    }
}

impl Add for Complex {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self { re: self.re + other.re, im: self.im + other.im }
    }
}

impl Sub for Complex {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        Self { re: self.re - other.re, im: self.im - other.im }
    }
}

impl Mul for Complex {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        Self { re: self.re * other.re - self.im * other.im, im: self.re * other.im + self.im * other.re }
    }
}

impl Mul<f64> for Complex {
    type Output = Self;
    fn mul(self, factor: f64) -> Self {
        Self { re: self.re * factor, im: self.im * factor }
    }
}

impl Div for Complex {
    type Output = Self;
    fn div(self, by: Self) -> Self {
        let square = by.re * by.re + by.im * by.im;
        Self { re: (self.re * by.re + self.im * by.im) / square, im: (self.im * by.re - self.re * by.im) / square }
    }
}
