//! Probabilities of the normal and of the Poisson law.

use std::f64::consts::{PI, SQRT_2};

pub use allan_core::confidence::NORMAL_975;

/// Probability that a standard normal number exceeds `z`.
pub fn upper_tail(z: f64) -> f64 {
    0.5 * libm::erfc(z / SQRT_2)
}

/// Density of the standard normal law.
pub fn density(z: f64) -> f64 {
    (-0.5 * z * z).exp() / (2.0 * PI).sqrt()
}

/// The `z ≥ 0` that a standard normal number exceeds with `probability` (at most ½).
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
    if count == 0 {
        return 1.0;
    }
    if mean <= 0.0 {
        return 0.0;
    }
    let term = |at: f64| (at * mean.ln() - mean - libm::lgamma(at + 1.0)).exp();
    let count = count as f64;
    // From the end that is nearer to the mean outwards, where each term is smaller than the one before.
    if count <= mean {
        let (mut sum, mut at, mut next) = (0.0, count - 1.0, term(count - 1.0));
        while at >= 0.0 && next > 1e-17 * sum {
            sum += next;
            next *= at / mean;
            at -= 1.0;
        }
        return (1.0 - sum).max(0.0);
    }
    let (mut sum, mut at, mut next) = (0.0, count, term(count));
    while next > 1e-17 * sum {
        sum += next;
        at += 1.0;
        next *= mean / at;
    }
    sum
}

/// 95 % bounds of the mean of a Poisson number that came out as `count` (Byar's approximation of the exact ones).
pub fn poisson_bounds(count: f64) -> (f64, f64) {
    let bound = |count: f64, z: f64| count * (1.0 - 1.0 / (9.0 * count) + z / (3.0 * count.sqrt())).powi(3);
    let low = if count > 0.0 { bound(count, -NORMAL_975).max(0.0) } else { 0.0 };
    (low, bound(count + 1.0, NORMAL_975))
}
