//! Tail probabilities, quantiles and bounds of the normal and of the Poisson distribution.
//!
//! The normal distribution is not taken from statrs yet: its error function differs in the last digits, which the reports
//! print.

use statrs::function::gamma::gamma_lr;
use std::f64::consts::{PI, SQRT_2};

pub use allan_core::confidence::NORMAL_975;

/// Probability that a standard normal number exceeds `z`.
pub fn upper_tail(z: f64) -> f64 {
    0.5 * libm::erfc(z / SQRT_2)
}

/// Density of the standard normal distribution.
pub(crate) fn density(z: f64) -> f64 {
    (-0.5 * z * z).exp() / (2.0 * PI).sqrt()
}

/// The `z` from 0 to 40 that a standard normal number exceeds with `probability` (at most ½), by bisection.
pub fn quantile(probability: f64) -> f64 {
    let (mut low, mut high) = (0.0, 40.0);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if upper_tail(middle) > probability { low = middle } else { high = middle }
    }
    0.5 * (low + high)
}

/// Probability that a Poisson number of the given mean is `count` or more.
pub fn poisson_tail(count: u64, mean: f64) -> f64 {
    match count {
        0 => 1.0,
        _ if mean <= 0.0 => 0.0,
        count => gamma_lr(count as f64, mean),
    }
}

/// 95 % bounds of the mean of a Poisson distribution that has yielded `count` (Byar's approximation of Garwood's exact
/// bounds).
pub(crate) fn poisson_bounds(count: f64) -> (f64, f64) {
    let bound = |count: f64, z: f64| count * (1.0 - 1.0 / (9.0 * count) + z / (3.0 * count.sqrt())).powi(3);
    let low = if count > 0.0 { bound(count, -NORMAL_975).max(0.0) } else { 0.0 };
    (low, bound(count + 1.0, NORMAL_975))
}
