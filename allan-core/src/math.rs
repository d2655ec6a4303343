//! The only place that calls a floating-point library.
//!
//! Always by function, never by method: `x.sqrt()` would be `std`'s on the host and another one on the target.
//! Every figure here ends in a report, so all of them are `libm`'s, which are the same on host and target.

pub(crate) fn sqrt(x: f64) -> f64 {
    libm::sqrt(x)
}

pub(crate) fn ln(x: f64) -> f64 {
    libm::log(x)
}

pub(crate) fn log2(x: f64) -> f64 {
    libm::log2(x)
}

pub(crate) fn exp(x: f64) -> f64 {
    libm::exp(x)
}

pub(crate) fn ln_gamma(x: f64) -> f64 {
    libm::lgamma(x)
}

pub(crate) fn abs(x: f64) -> f64 {
    libm::fabs(x)
}
