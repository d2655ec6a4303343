//! As much of the complex numbers as an exponential needs.

use crate::math::{cos, exp, expm1, sin, sqrt};
use core::ops::{Add, Div, Mul, Sub};

#[derive(Debug, Clone, Copy)]
pub(super) struct Complex {
    pub(super) re: f64,
    pub(super) im: f64,
}

impl Complex {
    pub(super) const ONE: Self = Self { re: 1.0, im: 0.0 };

    /// `1 − exp(−self)` without cancellation near 0.
    pub(super) fn one_minus_exp(self) -> Self {
        let shrink = expm1(-self.re);
        let half = sin(self.im / 2.0);
        Self { re: 2.0 * half * half * (1.0 + shrink) - shrink, im: (1.0 + shrink) * sin(self.im) }
    }

    /// `exp(−self)`.
    pub(super) fn decay(self) -> Self {
        let modulus = exp(-self.re);
        Self { re: modulus * cos(self.im), im: -modulus * sin(self.im) }
    }

    pub(super) fn magnitude(self) -> f64 {
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
