//! Tail probabilities, quantiles and bounds of the normal, Student's, the Poisson and the exponential distribution.

use statrs::distribution::{ChiSquared, Continuous, ContinuousCDF, DiscreteCDF, Normal, Poisson, StudentsT};
use statrs::function::beta::checked_beta_reg;
use statrs::function::gamma::checked_gamma_ur;

pub use allan_core::confidence::NORMAL_975;

/// Variance of the error of rounding to steps of 1, which is uniform over a step where noise reaches over several.
pub(crate) const ROUNDING: f64 = 1.0 / 12.0;

/// Least p-value of what a model describes: what comes of the model itself has less in one of 1,000 records.
pub(crate) const DESCRIBED: f64 = 1e-3;

/// Probability that a standard normal number exceeds `z`.
pub fn upper_tail(z: f64) -> f64 {
    Normal::standard().sf(z)
}

/// Probability that a variable of Student's distribution exceeds `value`; 1 where that is no number, or where there is no freedom.
#[must_use]
pub fn student_tail(value: f64, freedom: f64) -> f64 {
    match StudentsT::new(0.0, 1.0, freedom) {
        Ok(_) if value == f64::INFINITY => 0.0,
        Ok(of) if value.is_finite() => of.sf(value),
        _ => 1.0,
    }
}

/// Density of the standard normal distribution.
pub(crate) fn density(z: f64) -> f64 {
    Normal::standard().pdf(z)
}

/// The `z` that a standard normal number exceeds with `probability` (above 0 and at most ½).
pub fn quantile(probability: f64) -> f64 {
    -Normal::standard().inverse_cdf(probability)
}

/// Probability that the sum of `count` exponential variables of mean 1 exceeds `sum`; 1 where that is no positive number.
pub(crate) fn exponential_sum_tail(count: f64, sum: f64) -> f64 {
    checked_gamma_ur(count, sum).ok().filter(|tail| !tail.is_nan()).unwrap_or(1.0)
}

/// Probability that the sum of the squares of `count` standard normal numbers exceeds `sum`; 1 where one of these is no positive number.
pub(crate) fn chi_squared_tail(sum: f64, count: f64) -> f64 {
    exponential_sum_tail(0.5 * count, 0.5 * sum)
}

/// The value that the sum of the squares of so many standard normal numbers is below with this probability.
pub(crate) fn chi_squared_quantile(probability: f64, count: f64) -> f64 {
    ChiSquared::new(count).map_or(f64::INFINITY, |of| of.inverse_cdf(probability))
}

/// Probability that the mean of `above` exponential variables exceeds `ratio` times that of `below` others; 1 where one is not positive.
pub(crate) fn mean_ratio_tail(ratio: f64, above: f64, below: f64) -> f64 {
    let tail = checked_beta_reg(below, above, below / (below + above * ratio));
    tail.ok().filter(|tail| !tail.is_nan()).unwrap_or(1.0)
}

/// Probability that a Poisson number of the given mean is `count` or more.
pub fn poisson_tail(count: u64, mean: f64) -> f64 {
    match (count, Poisson::new(mean)) {
        (0, _) => 1.0,
        (_, Ok(distribution)) => distribution.sf(count - 1),
        // The mean is 0.
        (_, Err(_)) => 0.0,
    }
}

/// 95 % bounds of the mean of a Poisson distribution that has yielded `count` (Byar's approximation of Garwood's exact bounds).
pub(crate) fn poisson_bounds(count: f64) -> (f64, f64) {
    let bound = |count: f64, z: f64| count * (1.0 - 1.0 / (9.0 * count) + z / (3.0 * count.sqrt())).powi(3);
    let low = if count > 0.0 { bound(count, -NORMAL_975).max(0.0) } else { 0.0 };
    (low, bound(count + 1.0, NORMAL_975))
}

#[cfg(test)]
mod tests {
    use super::{chi_squared_tail, exponential_sum_tail, mean_ratio_tail, student_tail};

    #[test]
    fn tails_of_exponential_variables() {
        // One of them exceeds 2 with e⁻²; of two, the first is twice the second with 1/3.
        assert!((exponential_sum_tail(1.0, 2.0) - (-2.0f64).exp()).abs() < 1e-12);
        assert!((chi_squared_tail(4.0, 2.0) - (-2.0f64).exp()).abs() < 1e-12);
        assert!((mean_ratio_tail(2.0, 1.0, 1.0) - 1.0 / 3.0).abs() < 1e-12);
        // A channel that never changes has sums and means of 0, or none.
        for sum in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert_eq!(exponential_sum_tail(3.0, sum), 1.0);
        }
        for (ratio, above, below) in [(f64::NAN, 1.0, 1.0), (2.0, 0.0, 1.0), (2.0, 1.0, 0.0)] {
            assert_eq!(mean_ratio_tail(ratio, above, below), 1.0);
        }
    }

    /// 2.228 is the 97.5 % quantile of ten degrees of freedom in the tables.
    #[test]
    fn tails_of_student_s_distribution() {
        assert!((student_tail(2.228, 10.0) - 0.025).abs() < 1e-5);
        let odd = [(f64::NAN, 10.0), (f64::NEG_INFINITY, 10.0), (1.0, 0.0), (1.0, f64::NAN)];
        assert!(odd.into_iter().all(|(value, freedom)| student_tail(value, freedom) == 1.0));
        assert_eq!(student_tail(f64::INFINITY, 10.0), 0.0);
    }
}
