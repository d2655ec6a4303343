//! The only place that calls a floating-point library.
//!
//! Always by function, never by method: `x.sqrt()` would be `std`'s on the host and another one on the target.
//! What ends in a reported figure is `libm`'s, the same to the bit on host and target. `micromath`, small and fast
//! without a double-precision unit, serves where a coarse answer chooses between few cases.

pub(crate) fn sqrt(x: f64) -> f64 {
    libm::sqrt(x)
}

pub(crate) fn ln(x: f64) -> f64 {
    libm::log(x)
}

pub(crate) fn log2(x: f64) -> f64 {
    libm::log2(x)
}

/// Base-2 logarithm of a positive ratio of neighbouring variances, within 0.2 over 2⁻⁴ to 2⁴.
pub(crate) fn coarse_log2(x: f64) -> f64 {
    f64::from(micromath::F32Ext::log2(x as f32))
}

pub(crate) fn exp(x: f64) -> f64 {
    libm::exp(x)
}

/// `exp(x) − 1`, exact near 0.
pub(crate) fn expm1(x: f64) -> f64 {
    libm::expm1(x)
}

pub(crate) fn sin(x: f64) -> f64 {
    libm::sin(x)
}

pub(crate) fn cos(x: f64) -> f64 {
    libm::cos(x)
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
        let worst = (-400..=400).map(|k| f64::from(k) / 100.0).map(|log| (super::coarse_log2(log.exp2()) - log).abs());
        let worst = worst.fold(0.0, f64::max);
        assert!(worst < 0.2, "{worst}");
    }
}
