//! Sets of terms that a fit can contain: the code of the other terms is not linked.

use super::process::Process;
use super::{AngleRandomWalk, BiasInstability, NoiseTerm, Quantization, RateRamp, RateRandomWalk, with_process};
use crate::confidence::{NORMAL_975, chi_square_quantile};
use crate::math::{lnf, sqrt, sqrtf};
use crate::noise_type::VarianceFractions;
use core::ops::Range;

/// What a fit asks of its terms. A term outside the set contributes nothing.
pub(crate) trait TermSet {
    /// The terms of `kinds` that are in the set.
    fn contains(kind: &NoiseTerm) -> bool;

    /// [`NoiseTerm::avar`].
    fn avar(kind: &NoiseTerm, n: u64, sample_period: f64) -> f64;

    /// [`NoiseTerm::sum_variances`].
    fn sum_variances(kind: &NoiseTerm, stride: f64, sample_period: f64, table: &mut [f64]);

    /// [`NoiseTerm::squared_covariance_tail`].
    fn squared_covariance_tail(kind: &NoiseTerm, n: u64, stride: f64, sample_period: f64) -> f64;

    /// [`NoiseTerm::share`].
    fn share(kind: &NoiseTerm, fraction: f64, n: u64, sample_period: f64) -> VarianceFractions;

    /// Whether a term of the set has shape parameters.
    const SHAPES: bool;

    /// [`NoiseTerm::free_parameters`].
    fn free_parameters(kind: &NoiseTerm) -> Range<usize>;

    /// The 2.5 % quantile, or the 97.5 % quantile if `upper`, of the gamma distribution (Pearson type III) with this
    /// skewness, a mean of 0 and a standard deviation of 1.
    fn gamma_quantile(skewness: f32, upper: bool) -> f32;
}

/// Every [`NoiseTerm`], with exact quantiles.
pub(crate) enum AllTerms {}

impl TermSet for AllTerms {
    const SHAPES: bool = true;

    fn contains(_: &NoiseTerm) -> bool {
        true
    }

    fn avar(kind: &NoiseTerm, n: u64, sample_period: f64) -> f64 {
        kind.avar(n, sample_period)
    }

    fn sum_variances(kind: &NoiseTerm, stride: f64, sample_period: f64, table: &mut [f64]) {
        kind.sum_variances(stride, sample_period, table);
    }

    fn squared_covariance_tail(kind: &NoiseTerm, n: u64, stride: f64, sample_period: f64) -> f64 {
        kind.squared_covariance_tail(n, stride, sample_period)
    }

    fn share(kind: &NoiseTerm, fraction: f64, n: u64, sample_period: f64) -> VarianceFractions {
        kind.share(fraction, n, sample_period)
    }

    fn free_parameters(kind: &NoiseTerm) -> Range<usize> {
        kind.free_parameters()
    }

    fn gamma_quantile(skewness: f32, upper: bool) -> f32 {
        let skewness = f64::from(skewness);
        let dof = 8.0 / (skewness * skewness);
        let p = if upper { 0.975 } else { 0.025 };
        ((chi_square_quantile(p, dof) - dof) / sqrt(2.0 * dof)) as f32
    }
}

/// The power laws of IEEE Std 952: Q, N, B, K and R.
pub(crate) enum PowerLawTerms {}

/// Evaluates an expression with the process of a power law, or another expression for other terms.
macro_rules! with_power_law {
    ($kind:expr, $process:ident => $expression:expr, else $otherwise:expr) => {
        match $kind {
            NoiseTerm::Filtered(_) | NoiseTerm::Markov(_) | NoiseTerm::Resonance(_) | NoiseTerm::Sinusoid(_) => {
                $otherwise
            }
            NoiseTerm::Quantization => with_process!(@one Quantization, $process => $expression),
            NoiseTerm::AngleRandomWalk => with_process!(@one AngleRandomWalk, $process => $expression),
            NoiseTerm::BiasInstability => with_process!(@one BiasInstability, $process => $expression),
            NoiseTerm::RateRandomWalk => with_process!(@one RateRandomWalk, $process => $expression),
            NoiseTerm::RateRamp => with_process!(@one RateRamp, $process => $expression),
        }
    };
}

impl TermSet for PowerLawTerms {
    const SHAPES: bool = false;

    fn contains(kind: &NoiseTerm) -> bool {
        with_power_law!(kind, _process => true, else false)
    }

    fn avar(kind: &NoiseTerm, n: u64, sample_period: f64) -> f64 {
        with_power_law!(kind, process => process.avar(n, sample_period), else 0.0)
    }

    fn sum_variances(kind: &NoiseTerm, stride: f64, sample_period: f64, table: &mut [f64]) {
        if let NoiseTerm::BiasInstability = kind {
            // `−m² ln m` in units of the stride, to whose logarithm second differences are blind. In single precision it has
            // an error of 10⁻⁵ of the covariance of a difference.
            for (k, entry) in table.iter_mut().enumerate().skip(1) {
                let k = k as f32;
                *entry = f64::from(-k * k * lnf(k));
            }
            return;
        }
        with_power_law!(kind, process => process.sum_variances(stride, sample_period, table), else table.fill(0.0));
    }

    fn squared_covariance_tail(_: &NoiseTerm, _: u64, _: f64, _: f64) -> f64 {
        0.0
    }

    fn share(kind: &NoiseTerm, fraction: f64, n: u64, sample_period: f64) -> VarianceFractions {
        with_power_law!(kind, _process => kind.share(fraction, n, sample_period), else VarianceFractions::WHITE)
    }

    fn free_parameters(_: &NoiseTerm) -> Range<usize> {
        0..0
    }

    /// By E. Wilson and M. Hilferty (Abramowitz and Stegun, Handbook of Mathematical Functions, 26.4.17): within 0.03
    /// standard deviations up to a skewness of 2, that of an estimate with 2 degrees of freedom.
    fn gamma_quantile(skewness: f32, upper: bool) -> f32 {
        let normal = if upper { NORMAL_975 as f32 } else { -NORMAL_975 as f32 };
        // With 8/skewness² degrees of freedom, of which the approximation uses 2/9.
        let ninth = skewness * skewness / 36.0;
        let cube = (1.0 - ninth + normal * sqrtf(ninth)).max(0.0);
        (cube * cube * cube - 1.0) * 2.0 / skewness
    }
}
