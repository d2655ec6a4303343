//! The only place that calls a floating-point library.
//!
//! Always by function, never by method: `x.sqrt()` would be `std`'s on the host and another one on the target.
//! What ends in a reported figure is `libm`'s (sine and cosine are [`circle`]'s), the same to the bit on host and
//! target. `micromath`, small and fast without a double-precision unit, serves where a coarse answer chooses between few
//! cases: the noise type.
//!
//! Largest error (relative to the answer where that is above 1) and instructions of a call on a Cortex-M4F and a
//! Cortex-M0+, for the arguments that the estimator meets; held by the test of `tests/instructions`:
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

mod circle;

pub(crate) use circle::{cos, sin};

pub(crate) fn sqrt(x: f64) -> f64 {
    libm::sqrt(x)
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

/// Base-2 logarithm of a positive ratio of variances, within 0.2 over 2⁻³⁰ to 2³⁰.
pub(crate) fn coarse_log2(x: f64) -> f64 {
    f64::from(micromath::F32Ext::log2(x as f32))
}

pub(crate) fn exp(x: f64) -> f64 {
    libm::exp(x)
}

/// As `f64::clamp`, without its panic: what that formats takes 12 kB of a microcontroller's flash.
pub(crate) fn clamp(x: f64, low: f64, high: f64) -> f64 {
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

pub(crate) fn atanh(x: f64) -> f64 {
    libm::atanh(x)
}

pub(crate) fn floor(x: f64) -> f64 {
    libm::floor(x)
}

pub(crate) fn ln_gamma(x: f64) -> f64 {
    libm::lgamma(x)
}

pub(crate) fn abs(x: f64) -> f64 {
    libm::fabs(x)
}

#[cfg(test)]
mod tests {
    #[test]
    fn the_coarse_logarithm_keeps_its_bound() {
        let worst =
            (-3_000..=3_000).map(|k| f64::from(k) / 100.0).map(|log| (super::coarse_log2(log.exp2()) - log).abs());
        let worst = worst.fold(0.0, f64::max);
        assert!(worst < 0.2, "{worst}");
    }
}
