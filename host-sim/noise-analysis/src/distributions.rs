//! Tail probabilities, quantiles and bounds of the normal and of the Poisson distribution.

use statrs::distribution::{Continuous, ContinuousCDF, DiscreteCDF, Normal, Poisson};

pub use allan_core::confidence::NORMAL_975;

/// Probability that a standard normal number exceeds `z`.
pub fn upper_tail(z: f64) -> f64 {
    Normal::standard().sf(z)
}

/// Density of the standard normal distribution.
pub(crate) fn density(z: f64) -> f64 {
    Normal::standard().pdf(z)
}

/// The `z` that a standard normal number exceeds with `probability` (above 0 and at most ½).
pub fn quantile(probability: f64) -> f64 {
    -Normal::standard().inverse_cdf(probability)
}

/// Probability that a Poisson number of the given mean is `count` or more.
pub fn poisson_tail(count: u64, mean: f64) -> f64 {
    match (count, Poisson::new(mean)) {
        (0, _) => 1.0,
        (_, Ok(distribution)) => distribution.sf(count - 1),
        // Of a mean of 0.
        (_, Err(_)) => 0.0,
    }
}

/// 95 % bounds of the mean of a Poisson distribution that has yielded `count` (Byar's approximation of Garwood's exact
/// bounds).
pub(crate) fn poisson_bounds(count: f64) -> (f64, f64) {
    let bound = |count: f64, z: f64| count * (1.0 - 1.0 / (9.0 * count) + z / (3.0 * count.sqrt())).powi(3);
    let low = if count > 0.0 { bound(count, -NORMAL_975).max(0.0) } else { 0.0 };
    (low, bound(count + 1.0, NORMAL_975))
}
