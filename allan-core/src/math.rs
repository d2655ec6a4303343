//! Elementary functions: the only module that calls a floating-point library.
//!
//! They are called as functions, never as methods, since `x.sqrt()` is `std`'s on the host. Reported figures come from
//! `libm`, or from [`sin`] and [`cos`] below; the coarse `micromath` only selects the noise type.
//!
//! Largest error (relative where the result is above 1) and instructions per call on a Cortex-M4F and a Cortex-M0+:
//!
//! | | `libm` error | instructions | `micromath` error | instructions |
//! |---|---|---|---|---|
//! | `sqrt` | 0 | 182, 1127 | 6e-2 | 21, 61 |
//! | `ln` | 2e-16 | 2568, 6824 | 1e-1 | 48, 1609 |
//! | `log2` | 0 | 3276, 8253 | 2e-1 | 50, 1725 |
//! | `exp` | 2e-16 | 2633, 7093 | 6e-4 | 128, 2603 |
//! | `expm1` | 0 | 3938, 9996 | — | — |
//! | `floor` | 0 | 48, 78 | 0 | 21, 337 |
//! | `abs` | 0 | 18, 20 | 0 | 13, 20 |
//! | `ln_gamma` | 8e-15 | 4990, 13796 | — | — |

use core::cmp::Ordering;
use core::f64::consts::FRAC_2_PI;
use core::iter::Sum;
use core::ops::{Add, AddAssign, Div, Mul, Sub};

/// A floating-point number, in single precision where that spares small processors soft double arithmetic.
pub(crate) trait Real:
    Copy + PartialOrd + Add<Output = Self> + AddAssign + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self> + Sum
{
    const ZERO: Self;
    /// Relative size below which the difference of two sums of a few dozen numbers counts as a rounding error.
    const ROUNDING: Self;

    /// A constant, rounded to nearest.
    fn constant(value: f64) -> Self;
    fn from_integer(value: u128) -> Self;
    fn from_word(value: u64) -> Self;
    fn from_single(value: f32) -> Self;
    fn single(self) -> f32;
    fn double(self) -> f64;
    fn sqrt(self) -> Self;
    fn order(&self, other: &Self) -> Ordering;
}

impl Real for f64 {
    const ZERO: Self = 0.0;
    const ROUNDING: Self = 1e-12;

    fn constant(value: f64) -> Self {
        value
    }

    fn from_integer(value: u128) -> Self {
        value as Self
    }

    fn from_word(value: u64) -> Self {
        value as Self
    }

    fn from_single(value: f32) -> Self {
        value.into()
    }

    fn single(self) -> f32 {
        self as f32
    }

    fn double(self) -> f64 {
        self
    }

    fn sqrt(self) -> Self {
        sqrt(self)
    }

    fn order(&self, other: &Self) -> Ordering {
        self.total_cmp(other)
    }
}

impl Real for f32 {
    const ZERO: Self = 0.0;
    const ROUNDING: Self = 2e-6;

    #[inline(always)] // so that the conversion happens at compile time
    fn constant(value: f64) -> Self {
        value as Self
    }

    fn from_integer(value: u128) -> Self {
        value as Self
    }

    fn from_word(value: u64) -> Self {
        value as Self
    }

    fn from_single(value: f32) -> Self {
        value
    }

    fn single(self) -> f32 {
        self
    }

    fn double(self) -> f64 {
        self.into()
    }

    fn sqrt(self) -> Self {
        sqrtf(self)
    }

    fn order(&self, other: &Self) -> Ordering {
        self.total_cmp(other)
    }
}

/// `x·2^exponent` without arithmetic; `x` itself if it is 0, subnormal, infinite or not a number.
pub(crate) fn times_power_of_two(x: f64, exponent: u32) -> f64 {
    let known = x.to_bits() >> 52 & 0x7ff;
    let scaled = known + u64::from(exponent);
    if known == 0 || scaled >= 0x7ff { x } else { f64::from_bits(x.to_bits() + (u64::from(exponent) << 52)) }
}

pub(crate) fn sqrt(x: f64) -> f64 {
    libm::sqrt(x)
}

/// √x in single precision, with a relative error below 2⁻²²; 0 for subnormal, `x` for negative and not finite ones.
pub(crate) fn sqrt_in_single(x: f64) -> f64 {
    let bits = x.to_bits();
    let known = bits >> 52;
    if known == 0 || known >= 0x7ff {
        return if known == 0 { 0.0 } else { x };
    }
    // x = m·4^half with 1 ≤ m < 4. Exponents are stored with an offset of 1023.
    let half = known.div_ceil(2).wrapping_sub(512);
    let root = sqrtf(f64::from_bits(bits.wrapping_sub(half << 53)) as f32);
    f64::from_bits(f64::from(root).to_bits().wrapping_add(half << 52))
}

pub(crate) fn sqrtf(x: f32) -> f32 {
    libm::sqrtf(x)
}

pub(crate) fn lnf(x: f32) -> f32 {
    libm::logf(x)
}

pub(crate) fn absf(x: f32) -> f32 {
    libm::fabsf(x)
}

pub(crate) fn ln(x: f64) -> f64 {
    libm::log(x)
}

pub(crate) fn log2(x: f64) -> f64 {
    libm::log2(x)
}

/// Base-2 logarithm of a positive ratio of variances, with an absolute error below 0.2 from 2⁻³⁰ to 2³⁰.
pub(crate) fn coarse_log2(x: f64) -> f64 {
    f64::from(micromath::F32Ext::log2(x as f32))
}

pub(crate) fn exp(x: f64) -> f64 {
    libm::exp(x)
}

/// Limits `x` to `low..=high`. `f64::clamp` would link 12 kB of flash for the message of its panic.
pub(crate) fn clamp<F: Real>(x: F, low: F, high: F) -> F {
    if x < low {
        low
    } else if x > high {
        high
    } else {
        x
    }
}

/// `exp(x) − 1`, exact near 0.
pub(crate) fn expm1(x: f64) -> f64 {
    libm::expm1(x)
}

pub(crate) fn floor(x: f64) -> f64 {
    libm::floor(x)
}

/// True if `x` is neither infinite nor NaN: `f64::is_finite` without a comparison in double precision.
pub(crate) fn is_finite(x: f64) -> bool {
    x.to_bits() >> 52 & 0x7ff != 0x7ff
}

pub(crate) fn ln_gamma(x: f64) -> f64 {
    libm::lgamma(x)
}

pub(crate) fn abs(x: f64) -> f64 {
    libm::fabs(x)
}

/// π/2 as two parts, the first of 33 bits: its product with a count of quarter turns up to 2²⁰ is exact.
const QUARTER: (f64, f64) = (1.570_796_326_734_125_6, 6.077_100_506_506_192e-11);

/// Ratios of successive Taylor coefficients; the truncation error within an eighth of a turn is below 10⁻¹⁷.
const SINE: [f64; 7] = [1.0 / 6.0, 1.0 / 20.0, 1.0 / 42.0, 1.0 / 72.0, 1.0 / 110.0, 1.0 / 156.0, 1.0 / 210.0];
const COSINE: [f64; 8] =
    [1.0 / 2.0, 1.0 / 12.0, 1.0 / 30.0, 1.0 / 56.0, 1.0 / 90.0, 1.0 / 132.0, 1.0 / 182.0, 1.0 / 240.0];

/// Sine of `x` radians, with an absolute error below the larger of 2.5·10⁻¹⁶ and 1.2·10⁻¹⁶·|x|, for |x| up to 10⁶.
///
/// The sine of `libm` takes 5 kB of flash and three times as many instructions.
pub(crate) fn sin(x: f64) -> f64 {
    sine_after_quarters(x, 0)
}

/// Cosine of `x` radians, with the error bound of [`sin`].
pub(crate) fn cos(x: f64) -> f64 {
    sine_after_quarters(x, 1)
}

/// Sine of `x` plus a number of quarter turns.
#[inline(never)] // one copy for sine and cosine
fn sine_after_quarters(x: f64, quarters: i64) -> f64 {
    let whole = floor(x * FRAC_2_PI + 0.5);
    let rest = (x - whole * QUARTER.0) - whole * QUARTER.1;
    let square = rest * rest;
    let quarters = whole as i64 + quarters;
    let modulus = if quarters & 1 == 0 { rest * series(square, &SINE) } else { series(square, &COSINE) };
    if quarters & 2 == 0 { modulus } else { -modulus }
}

fn series(square: f64, ratios: &[f64]) -> f64 {
    ratios.iter().rev().fold(1.0, |sum, ratio| 1.0 - square * ratio * sum)
}

#[cfg(test)]
mod tests {
    #[test]
    fn the_square_root_in_single_precision_has_its_digits_over_the_whole_range() {
        for k in -10_000..=10_000 {
            let x = (f64::from(k) / 10.0).exp2();
            let (found, exact) = (super::sqrt_in_single(x), x.sqrt());
            assert!((found / exact - 1.0).abs() < 2.0_f64.powi(-22), "{x}: {found} and {exact}");
        }
        assert_eq!([0.0, f64::MIN_POSITIVE / 2.0, f64::INFINITY].map(super::sqrt_in_single), [0.0, 0.0, f64::INFINITY]);
    }

    #[test]
    fn the_coarse_logarithm_is_within_0_2() {
        let worst =
            (-3_000..=3_000).map(|k| f64::from(k) / 100.0).map(|log| (super::coarse_log2(log.exp2()) - log).abs());
        let worst = worst.fold(0.0, f64::max);
        assert!(worst < 0.2, "{worst}");
    }

    #[test]
    fn sine_and_cosine_agree_with_the_standard_library() {
        for k in -200_000..=200_000 {
            let x = f64::from(k) * 0.001_234_5;
            for x in [x, 1e5 * x] {
                let bound = 2.5e-16_f64.max(1.2e-16 * x.abs());
                assert!((super::sin(x) - x.sin()).abs() <= bound, "sin {x}: {} {}", super::sin(x), x.sin());
                assert!((super::cos(x) - x.cos()).abs() <= bound, "cos {x}: {} {}", super::cos(x), x.cos());
            }
        }
    }
}
