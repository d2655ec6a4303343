//! Processes whose autocovariance decays exponentially: the Markov process at a real rate, the resonance at a complex one.
//!
//! With `r_j = Re z^j` the variance of a sum of `m` samples is `Re[m(1+z)/(1−z) − 2z(1−z^m)/(1−z)²]`, from which the
//! Allan variance follows. `z = exp(−λ)` is close to 1 wherever the process is slow, so everything is written in
//! `1 − z`, and where even that cancels, as a power series in `λ`.

mod complex;

use super::Process;
use crate::math::{cos, exp};
use complex::Complex;
use core::f64::consts::PI;

/// Exponentially correlated noise of variance 1, first-order Gauss–Markov: `r(t) = exp(−|t|/T)`.
///
/// Sampled it is an AR(1) process, and its Allan variance is exactly that one's; random telegraph noise has the same.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Markov {
    /// T: correlation time, s, above 0.
    pub time_constant: f64,
}

/// A damped oscillation of variance 1 driven by white noise: `r(t) = exp(−π·Δf·|t|)·cos(2πf·t)`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Resonance {
    /// f: centre frequency, Hz.
    pub frequency: f64,
    /// Δf: full width of the spectral line at half its height, Hz, above 0.
    pub bandwidth: f64,
}

/// Below this `|λ·n|` the power series is the better one.
const SLOW: f64 = 0.03;

/// What decays as `Re exp(−λ·|j|)` from one sample to the next.
trait Decaying {
    /// λ: decay and angle a sample.
    fn rate(&self, sample_period: f64) -> Complex;

    /// The shortest record, in s, that can tell the process from its neighbours.
    fn record_needed(&self) -> f64;
}

impl Decaying for Markov {
    fn rate(&self, sample_period: f64) -> Complex {
        Complex { re: sample_period / self.time_constant, im: 0.0 }
    }

    fn record_needed(&self) -> f64 {
        20.0 * self.time_constant
    }
}

impl Decaying for Resonance {
    fn rate(&self, sample_period: f64) -> Complex {
        Complex { re: PI * self.bandwidth * sample_period, im: 2.0 * PI * self.frequency * sample_period }
    }

    fn record_needed(&self) -> f64 {
        10.0 / self.bandwidth
    }
}

impl<T: Decaying> Process for T {
    fn structure(&self, m: f64, sample_period: f64) -> f64 {
        structure(self.rate(sample_period), m)
    }

    fn density(&self, frequency: f64, sample_period: f64) -> f64 {
        let Complex { re: decay, im: centre } = self.rate(sample_period);
        let angle = 2.0 * PI * frequency * sample_period;
        (line(decay, angle - centre) + line(decay, angle + centre)) * sample_period / 2.0
    }

    fn record_needed(&self, _sample_period: f64) -> f64 {
        Decaying::record_needed(self)
    }

    fn avar(&self, n: u64, sample_period: f64) -> f64 {
        avar(self.rate(sample_period), n as f64)
    }

    fn structures(&self, stride: f64, sample_period: f64, table: &mut [f64]) {
        structures(self.rate(sample_period), stride, table);
    }

    fn memory_beyond(&self, n: u64, stride: f64, sample_period: f64) -> f64 {
        memory_beyond(self.rate(sample_period), n as f64, stride)
    }
}

fn structure(rate: Complex, m: f64) -> f64 {
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

/// The first four powers of `λ`; the next one is below 10⁻⁷ of the result.
fn slow_avar(rate: Complex, n: f64) -> f64 {
    let square = rate * rate;
    let (n2, n3) = (n * n, n * n * n);
    let sum = rate * ((2.0 * n2 + 1.0) / (3.0 * n)) - square * (n2 / 2.0)
        + square * rate * ((1.4 * n3 - n / 3.0 - 1.0 / (15.0 * n)) / 6.0)
        - square * square * ((2.0 * n2 * n2 - n2) / 24.0);
    sum.re
}

/// Structures of 0, 1, 2 … strides, the power of `z` following from stride to stride as `1 − zᵃ⁺ᵇ = u + v − uv`.
fn structures(rate: Complex, stride: f64, table: &mut [f64]) {
    if (rate * stride).magnitude() * (table.len() as f64) < 1e-3 {
        // So slow it is a random walk to them, and the sums below would cancel.
        for (k, structure) in table.iter_mut().enumerate() {
            let m = k as f64 * stride;
            *structure = m - m * m * m;
        }
        return;
    }
    let one_minus_z = rate.one_minus_exp();
    let z = Complex::ONE - one_minus_z;
    let line = (Complex::ONE + z) / one_minus_z;
    let bend = z / (one_minus_z * one_minus_z) * 2.0;
    let step = (rate * stride).one_minus_exp();
    let mut one_minus_power = Complex { re: 0.0, im: 0.0 };
    for (k, structure) in table.iter_mut().enumerate() {
        *structure = (line * (k as f64 * stride) - bend * one_minus_power).re;
        one_minus_power = one_minus_power + step - one_minus_power * step;
    }
}

/// What the covariance at a lag of `2n` is the real part of; from there on it turns and decays as `z^lag`.
fn memory(rate: Complex, n: f64) -> Complex {
    let one_minus_z = rate.one_minus_exp();
    let square = (rate * n).one_minus_exp() * (rate * n).one_minus_exp();
    let z = Complex::ONE - one_minus_z;
    z * square * square / (one_minus_z * one_minus_z) * (-1.0 / (2.0 * n * n))
}

/// Sum of the squares of the covariances at the lags `2n + stride, 2n + 2·stride …`
fn memory_beyond(rate: Complex, n: f64, stride: f64) -> f64 {
    let step = rate * stride;
    let first = memory(rate, n) * step.decay();
    let square = first * first;
    let steady = (first.re * first.re + first.im * first.im) / -crate::math::expm1(-2.0 * step.re);
    (steady + (square / (step * 2.0).one_minus_exp()).re) / 2.0
}

/// Discrete spectrum of `exp(−decay·|j|)` at `angle` radians a sample.
fn line(decay: f64, angle: f64) -> f64 {
    let z = exp(-decay);
    (1.0 - z * z) / (1.0 - 2.0 * z * cos(angle) + z * z)
}
