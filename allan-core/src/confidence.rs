//! Confidence of a point of a curve: equivalent degrees of freedom, χ² bounds, and the correlation between octaves.
//!
//! Degrees of freedom: C. Greenhall and W. Riley, "Uncertainty of stability variances based on finite differences"
//! (PTTI 2003), for differences every `n/P` samples.

use crate::math::{Real, abs, clamp, exp, ln, ln_gamma, sqrt};
use crate::noise_type::VarianceFractions;

/// The normal quantile of 0.975: half the width of a 95 % interval in standard deviations.
pub const NORMAL_975: f64 = 1.959_963_984_540_054;

/// Equivalent degrees of freedom of the mean of `count` squared second differences at averaging factor `n`, taken every
/// `n/overlap` samples.
///
/// `n` is in samples, and `overlap` is 1 to 16. With the correlation matrix `R` of the `M = count` differences, the
/// result is `M²/tr R²` (Greenhall and Riley, 2003): at least 1 for a count of at least 1.
#[must_use]
pub fn edf(n: u64, count: u64, overlap: u32, fractions: VarianceFractions) -> f64 {
    ChiSquareApproximation::new(Difference::Second, n, count, overlap, fractions).edf
}

/// Correlation coefficient of the Allan variances measured at two octaves that are `lag` octaves apart, for near-full
/// overlap; `a` and `b` are the noise mixtures at the two octaves.
///
/// The result is between 0 and 1. It is exact for lags of up to three octaves of pure noises in an infinite record;
/// beyond, it decays geometrically.
#[must_use]
pub fn octave_correlation(lag: usize, a: VarianceFractions, b: VarianceFractions) -> f64 {
    let (a, b): ([f64; 3], [f64; 3]) = (roots(a), roots(b));
    (0..3).map(|noise| a[noise] * b[noise] * pure_octave_correlation(lag, noise)).sum()
}

/// Square roots of the variance fractions of white, flicker and random-walk noise.
pub(crate) fn roots<F: Real>(fractions: VarianceFractions) -> [F; 3] {
    // Angle quantization counts as white noise, which decorrelates more slowly: an upper bound.
    let VarianceFractions { white, flicker, random_walk, quantization } = fractions;
    let [white, quantization] = [white, quantization].map(F::constant);
    [white + quantization, F::constant(flicker), F::constant(random_walk)].map(F::sqrt)
}

/// [`octave_correlation`] of one pure noise: 0 is white, 1 flicker, 2 random walk.
pub(crate) fn pure_octave_correlation(lag: usize, noise: usize) -> f64 {
    const TABLE: [[f64; 4]; 3] = [[1.0, 0.530, 0.187, 0.066], [1.0, 0.689, 0.309, 0.121], [1.0, 0.888, 0.676, 0.488]];
    let table = &TABLE[noise];
    match table.get(lag) {
        Some(&value) => value,
        None => (4..=lag).fold(table[3], |value, _| value * table[3] / table[2]),
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Difference {
    /// Second differences of the phase: Allan variance.
    Second,
    /// Third differences of the phase: Hadamard variance.
    Third,
}

impl Difference {
    /// Autocorrelation of the differences at lag `x`, in averaging times, by the autocovariance `law` of the phase.
    fn correlation(self, law: &dyn Fn(f64) -> f64, x: f64) -> f64 {
        // Binomial coefficients of twice the order, with alternating signs, from the middle on.
        let coefficients: &[f64] = match self {
            Self::Second => &[6.0, -4.0, 1.0],
            Self::Third => &[20.0, -15.0, 6.0, -1.0],
        };
        let at = |x: f64| {
            let pairs = coefficients
                .iter()
                .zip(0_u8..)
                .skip(1)
                .map(|(c, k)| c * (law(x - f64::from(k)) + law(x + f64::from(k))));
            coefficients[0] * law(x) + pairs.sum::<f64>()
        };
        at(x) / at(0.0)
    }

    /// Lag, in averaging times, beyond which squared correlations are below 10⁻³.
    const fn reach(self, fractions: VarianceFractions) -> u64 {
        let order = match self {
            Self::Second => 2,
            Self::Third => 3,
        };
        if fractions.flicker > 0.0 { 4 } else { order }
    }
}

/// Number of lags from 0 to 4 averaging times at 16-fold overlap.
const LAGS: usize = 4 * 16 + 1;

/// The distribution of a mean of squared, correlated Gaussian differences.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct ChiSquareApproximation {
    /// Equivalent degrees of freedom: those of the χ² distribution with the same relative variance.
    pub(crate) edf: f64,
    /// Third cumulant relative to that of this χ² distribution, less 1; about 0.1 to 0.3.
    excess_skewness: f64,
}

impl ChiSquareApproximation {
    /// The distribution for `count` differences at averaging factor `n`, one every `n/overlap ≥ n/16` samples. With
    /// their correlation matrix `R`, `edf = M²/tr R²` and `1 + excess_skewness = tr R³·M/(tr R²)²`.
    pub(crate) fn new(difference: Difference, n: u64, count: u64, overlap: u32, fractions: VarianceFractions) -> Self {
        let reach =
            (difference.reach(fractions) * u64::from(overlap)).min(count.saturating_sub(1)).min(LAGS as u64 - 1);
        let reach = reach as usize;
        let mut rho = [0.0; LAGS];
        for (lag, rho) in rho.iter_mut().enumerate().take(reach + 1).skip(1) {
            *rho = difference_correlation(difference, fractions, lag as f64 / f64::from(overlap), n);
        }
        let m = count as f64;
        let (mut pairs, mut triples) = (0.0, 0.0);
        for a in 1..=reach {
            pairs += (1.0 - a as f64 / m) * rho[a] * rho[a];
            for b in 1..=reach - a {
                triples += (1.0 - (a + b) as f64 / m).max(0.0) * rho[a] * rho[b] * rho[a + b];
            }
        }
        let (square, cube) = (1.0 + 2.0 * pairs, 1.0 + 6.0 * pairs + 6.0 * triples);
        Self { edf: m / square, excess_skewness: (cube / (square * square) - 1.0).max(0.0) }
    }

    /// 95 % bounds of the true variance if `estimate` is a measured variance less `subtracted`.
    ///
    /// They are the bounds of the measured variance, less `subtracted`; the lower one ends at 0. The χ² quantiles are
    /// multiplied by the Cornish–Fisher term `exp(⅔(z² − 1)·excess_skewness/edf · e^(±c/√edf))` with `c` fitted to
    /// exact distributions (Imhof's integral): they cover 94.7 to 95.6 % for edf of at least 3.
    pub(crate) fn bounds(&self, estimate: f64, subtracted: f64) -> (f64, f64) {
        const LOWER_TAIL: f64 = 2.7;
        const UPPER_TAIL: f64 = -3.3;
        let measured = estimate + subtracted;
        let term = 2.0 / 3.0 * (NORMAL_975 * NORMAL_975 - 1.0) * self.excess_skewness / self.edf;
        let bound = |p: f64, damping: f64| {
            let quantile = chi_square_quantile(p, self.edf) * exp(term * exp(damping / sqrt(self.edf)));
            measured * self.edf / quantile - subtracted
        };
        (bound(0.975, UPPER_TAIL).max(0.0), bound(0.025, LOWER_TAIL))
    }
}

/// Correlation of two differences of noise with these variance fractions, `distance` averaging times of `n` samples apart.
fn difference_correlation(difference: Difference, fractions: VarianceFractions, distance: f64, n: u64) -> f64 {
    let mut sum = 0.0;
    if fractions.white > 0.0 {
        sum += fractions.white * difference.correlation(&abs, distance);
    }
    if fractions.flicker > 0.0 {
        let law = |x: f64| if x == 0.0 { 0.0 } else { x * x * ln(abs(x)) };
        sum += fractions.flicker * difference.correlation(&law, distance);
    }
    if fractions.random_walk > 0.0 {
        // Generalised autocovariance of the double sum of white noise: |k|³ − |k| at a lag of k samples.
        let per_sample = 1.0 / (n as f64 * n as f64);
        let law = |x: f64| abs(x) * (x * x - per_sample);
        sum += fractions.random_walk * difference.correlation(&law, distance);
    }
    if fractions.quantization > 0.0 {
        let law = |x: f64| if x == 0.0 { 1.0 } else { 0.0 };
        sum += fractions.quantization * difference.correlation(&law, distance);
    }
    sum
}

/// Degrees of freedom above which the Wilson–Hilferty approximation is within 2·10⁻⁶ in probability.
const LARGE: f64 = 2_000.0;

/// The `p` quantile of the χ² distribution with `dof > 0` degrees of freedom.
///
/// Newton's method from the Wilson–Hilferty approximation (Abramowitz and Stegun, Handbook of Mathematical Functions,
/// 26.4.17).
pub(crate) fn chi_square_quantile(p: f64, dof: f64) -> f64 {
    let cube = 1.0 - 2.0 / (9.0 * dof) + normal_quantile(p) * sqrt(2.0 / (9.0 * dof));
    let guess = dof * cube * cube * cube;
    if dof > LARGE {
        return guess;
    }
    let shape = dof / 2.0;
    // If the cube is near or below 0, `P(a, x) ≈ x^a / Γ(a+1)` gives a positive start.
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
pub(crate) fn chi_square_upper_tail(x: f64, dof: f64) -> f64 {
    clamp(1.0 - gamma_p(dof / 2.0, x / 2.0), 0.0, 1.0)
}

/// The regularised lower incomplete gamma function `P(a, x)` (Abramowitz and Stegun 6.5.29 and 6.5.31).
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

/// The `p` quantile of the normal distribution within 4.5·10⁻⁴ (Abramowitz and Stegun 26.2.23).
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
    use super::*;
    use statrs::distribution::{ChiSquared, ContinuousCDF};

    /// The cases: noise, overlap, differences, edf, and exact quantiles (2.5 %, 97.5 %) of the mean square (Imhof's
    /// integral).
    const EXACT: &[(VarianceFractions, u32, u64, f64, f64, f64)] = &[
        (VarianceFractions::WHITE, 1, 7, 4.900, 0.1879, 2.6106),
        (VarianceFractions::WHITE, 4, 13, 5.302, 0.2355, 2.5657),
        (VarianceFractions::WHITE, 8, 17, 4.074, 0.2046, 2.8373),
        (VarianceFractions::WHITE, 8, 33, 6.895, 0.3014, 2.3521),
        (VarianceFractions::WHITE, 8, 113, 21.535, 0.5190, 1.7010),
        (VarianceFractions::FLICKER, 1, 7, 6.314, 0.2271, 2.3764),
        (VarianceFractions::FLICKER, 4, 13, 4.375, 0.1765, 2.7290),
        (VarianceFractions::FLICKER, 8, 17, 3.131, 0.1199, 3.1032),
        (VarianceFractions::FLICKER, 8, 33, 5.408, 0.2197, 2.5292),
        (VarianceFractions::FLICKER, 8, 113, 17.043, 0.4608, 1.7886),
        (VarianceFractions::RANDOM_WALK, 1, 7, 6.323, 0.2304, 2.3793),
        (VarianceFractions::RANDOM_WALK, 4, 13, 3.355, 0.1301, 3.0207),
        (VarianceFractions::RANDOM_WALK, 8, 33, 4.167, 0.1680, 2.7807),
        (VarianceFractions::RANDOM_WALK, 8, 113, 13.419, 0.4107, 1.9033),
        (VarianceFractions::QUANTIZATION, 1, 7, 3.885, 0.1496, 2.8503),
        (VarianceFractions::QUANTIZATION, 4, 13, 7.943, 0.2973, 2.2218),
        (VarianceFractions::QUANTIZATION, 8, 17, 11.534, 0.3769, 1.9827),
        (VarianceFractions::QUANTIZATION, 8, 33, 19.389, 0.4864, 1.7333),
        (VarianceFractions::QUANTIZATION, 8, 113, 60.310, 0.6798, 1.3913),
    ];

    #[test]
    fn bounds_are_the_quantiles_of_the_exact_distribution() {
        for &(fractions, overlap, count, edf, low, high) in EXACT {
            let law = ChiSquareApproximation::new(Difference::Second, 64, count, overlap, fractions);
            // The tolerance allows for flicker correlations beyond four averaging times, which are left out.
            assert!((law.edf / edf - 1.0).abs() < 5e-3, "{fractions:?}, {overlap}, {count}: edf {}", law.edf);
            let (lower, upper) = law.bounds(1.0, 0.0);
            // The probability beyond each bound is within 0.3 percentage points of 2.5 %.
            assert!((upper * low - 1.0).abs() < 0.06, "{fractions:?}, {overlap}, {count}: {}", 1.0 / upper);
            assert!((lower * high - 1.0).abs() < 0.01, "{fractions:?}, {overlap}, {count}: {}", 1.0 / lower);
        }
    }

    #[test]
    fn bounds_hold_the_estimate_however_little_a_subtraction_leaves() {
        for fractions in [VarianceFractions::WHITE, VarianceFractions::QUANTIZATION] {
            for count in [5, 20, 100] {
                let law = ChiSquareApproximation::new(Difference::Second, 64, count, 8, fractions);
                let (measured_low, measured_high) = law.bounds(10.0, 0.0);
                for estimate in [9.0, 5.0, 1.0, 0.1] {
                    let (low, high) = law.bounds(estimate, 10.0 - estimate);
                    assert!((0.0..estimate).contains(&low) && high > estimate, "{count}, {estimate}: {low} to {high}");
                    // The bounds are those of the measured variance less the subtracted one, and not below 0.
                    assert!((high - (measured_high - 10.0 + estimate)).abs() < 1e-12, "{count}, {estimate}: {high}");
                    assert!(low == 0.0 || (low - (measured_low - 10.0 + estimate)).abs() < 1e-12, "{count}: {low}");
                }
            }
        }
    }

    #[test]
    fn chi_square_quantiles_agree_with_statrs() {
        for dof in [0.3, 1.0, 2.24, 3.0, 9.82, 45.76, 189.75, 1_999.0, 2_001.0, 66_666.0] {
            let reference = ChiSquared::new(dof).unwrap();
            for p in [0.025, 0.975] {
                let covered = reference.cdf(chi_square_quantile(p, dof));
                assert!((covered - p).abs() < 2e-6, "dof {dof}: {covered} instead of {p}");
            }
        }
    }
}
