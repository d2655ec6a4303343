//! Processes with an exponentially decaying autocovariance: Gauss–Markov, and the resonance with its complex decay
//! rate.
//!
//! The variance of a sum of `m` samples is `Re[m(1+z)/(1−z) − 2z(1−z^m)/(1−z)²]` with the autocovariance
//! `r_j = Re z^j`, `z = exp(−λ)`. It is written in `1 − z`, or in powers of `λ` where that cancels.

use super::process::Process;
use crate::math::{cos, exp, expm1, sin};
use core::f64::consts::PI;
use core::ops::{Add, Mul, Sub};

/// Exponentially correlated (first-order Gauss–Markov) noise of variance 1: `r(t) = exp(−|t|/T)` (IEEE 952).
///
/// The Allan variance is exactly that of its samples, an AR(1) process, and also that of random telegraph noise.
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

impl Markov {
    /// The factors a and b of the variance of the sum of `m` samples, `a·m − b·(1 − exp(−m·dt/T))`.
    pub(super) fn line_and_bend(&self, sample_period: f64) -> (f64, f64) {
        let (line, bend) = line_and_bend(self.rate(sample_period));
        (line, bend.re)
    }
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

/// `Re (1+z)/(1−z)` and `2z/(1−z)²`: a sum of `m` samples has the variance `m` times the first less `Re` of the second
/// times `1 − z^m`.
#[inline(never)] // linked once
fn line_and_bend(rate: Complex) -> (f64, Complex) {
    let inverse = rate.one_minus_exp().inverse();
    (2.0 * inverse.re - 1.0, (inverse * inverse - inverse) * 2.0)
}

fn sum_variance(rate: Complex, m: f64) -> f64 {
    let (line, bend) = line_and_bend(rate);
    line * m - (bend * (rate * m).one_minus_exp()).re
}

fn avar(rate: Complex, n: f64) -> f64 {
    if (rate * n).square() < SLOW * SLOW {
        return slow_avar(rate, n);
    }
    let (line, bend) = line_and_bend(rate);
    let one_minus_power = (rate * n).one_minus_exp();
    // Half of 3 − 4zⁿ + z²ⁿ, without its cancellation.
    let powers = one_minus_power + one_minus_power * one_minus_power * 0.5;
    (line * n - (bend * powers).re) / (n * n)
}

/// Power series of the Allan variance in `λ` up to `λ⁴`; the next term is below 10⁻⁷ of the result.
fn slow_avar(rate: Complex, n: f64) -> f64 {
    let square = rate * rate;
    let (n2, n3) = (n * n, n * n * n);
    rate.re * ((2.0 * n2 + 1.0) / (3.0 * n)) - square.re * (n2 / 2.0)
        + (square * rate).re * ((1.4 * n3 - n / 3.0 - 1.0 / (15.0 * n)) / 6.0)
        - (square * square).re * ((2.0 * n2 * n2 - n2) / 24.0)
}

/// Sum variances at 0, 1, 2 … strides, with `1 − zᵃ⁺ᵇ = u + v − uv` for `u = 1 − zᵃ`, `v = 1 − zᵇ`.
fn sum_variances(rate: Complex, stride: f64, table: &mut [f64]) {
    if (rate * (stride * table.len() as f64)).square() < 1e-6 {
        // At these strides the process is a random walk, and the differences below would cancel.
        for (k, sum_variance) in table.iter_mut().enumerate() {
            let m = k as f64 * stride;
            *sum_variance = m - m * m * m;
        }
        return;
    }
    let (line, bend) = line_and_bend(rate);
    let step = (rate * stride).one_minus_exp();
    let mut one_minus_power = Complex { re: 0.0, im: 0.0 };
    for (k, sum_variance) in table.iter_mut().enumerate() {
        *sum_variance = line * (k as f64 * stride) - (bend * one_minus_power).re;
        one_minus_power = one_minus_power + step - one_minus_power * step;
    }
}

/// A number whose real part is the covariance of second differences at `2n`, to be multiplied by `z` per sample.
fn covariance_at_2n(rate: Complex, n: f64) -> Complex {
    let (_, bend) = line_and_bend(rate);
    let one_minus_power = (rate * n).one_minus_exp();
    let square = one_minus_power * one_minus_power;
    bend * square * square * (-1.0 / (4.0 * n * n))
}

/// Sum of the squares of the covariances at the lags `2n + stride, 2n + 2·stride …`
fn squared_covariance_tail(rate: Complex, n: f64, stride: f64) -> f64 {
    squared_tail(covariance_at_2n(rate, n), rate * stride)
}

/// [`squared_covariance_tail`] from the covariance `at_2n` at a lag of `2n`, which decays by `exp(−step)` per stride.
pub(super) fn squared_tail(at_2n: Complex, step: Complex) -> f64 {
    let first = at_2n - at_2n * step.one_minus_exp();
    let steady = first.square() / -expm1(-2.0 * step.re);
    (steady + (first * first * (step * 2.0).one_minus_exp().inverse()).re) / 2.0
}

/// Discrete spectrum of `exp(−decay·|j|)` at `angle` radians per sample.
fn lorentzian(decay: f64, angle: f64) -> f64 {
    let z = exp(-decay);
    (1.0 - z * z) / (1.0 - 2.0 * z * cos(angle) + z * z)
}

#[derive(Debug, Clone, Copy)]
pub(super) struct Complex {
    pub(super) re: f64,
    pub(super) im: f64,
}

impl Complex {
    /// `1 − exp(−self)`, without cancellation near 0.
    pub(super) fn one_minus_exp(self) -> Self {
        let shrink = expm1(-self.re);
        let half = sin(self.im / 2.0);
        Self { re: 2.0 * half * half * (1.0 + shrink) - shrink, im: (1.0 + shrink) * sin(self.im) }
    }

    pub(super) fn inverse(self) -> Self {
        let square = self.square();
        Self { re: self.re / square, im: -self.im / square }
    }

    fn square(self) -> f64 {
        self.re * self.re + self.im * self.im
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
