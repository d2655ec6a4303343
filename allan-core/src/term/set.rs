//! Sets of terms that a fit can contain: the code of the other terms is not linked.

use super::{MovingAverageFilter, NoiseTerm};
use crate::confidence::{NORMAL_975, chi_square_quantile};
use crate::math::{Real, lnf, sqrt, sqrt_in_single, sqrtf};
use crate::noise_type::VarianceFractions;
use core::f64::consts::{LN_2, PI};
use core::ops::Range;

/// The methods of terms that a fit needs. A term outside the set contributes nothing.
pub(crate) trait TermSet {
    /// The numbers of the normal equations and of the correlations.
    type Real: Real;

    fn contains(kind: &NoiseTerm) -> bool;

    fn avar(kind: &NoiseTerm, filter: Option<&MovingAverageFilter>, n: u64, sample_period: f64) -> f64;

    /// [`NoiseTerm::sum_variances`] at strides of `n/overlap` samples.
    fn sum_variances(kind: &NoiseTerm, n: u64, overlap: u32, sample_period: f64, table: &mut [Self::Real]);

    fn squared_covariance_tail(kind: &NoiseTerm, n: u64, stride: Self::Real, sample_period: f64) -> Self::Real;

    fn phase_variance(kind: &NoiseTerm, count: u64, stride: f64, sample_period: f64) -> Self::Real;

    fn share(kind: &NoiseTerm, fraction: f64, n: u64, sample_period: f64) -> VarianceFractions;

    /// True if a term of the set has shape parameters.
    const SHAPES: bool;

    fn free_parameters(kind: &NoiseTerm) -> Range<usize>;

    /// The 2.5 % or, if `upper`, 97.5 % quantile of the standardised gamma distribution (Pearson type III).
    fn gamma_quantile(skewness: f32, upper: bool) -> f32;

    /// The square root of a squared coefficient.
    fn sqrt(x: f64) -> f64;
}

pub(crate) enum AllTerms {}

impl TermSet for AllTerms {
    type Real = f64;

    const SHAPES: bool = true;

    fn contains(_: &NoiseTerm) -> bool {
        true
    }

    fn avar(kind: &NoiseTerm, filter: Option<&MovingAverageFilter>, n: u64, sample_period: f64) -> f64 {
        kind.avar_behind(filter, n, sample_period)
    }

    fn sum_variances(kind: &NoiseTerm, n: u64, overlap: u32, sample_period: f64, table: &mut [f64]) {
        kind.sum_variances(n as f64 / f64::from(overlap), sample_period, table);
    }

    fn squared_covariance_tail(kind: &NoiseTerm, n: u64, stride: f64, sample_period: f64) -> f64 {
        kind.squared_covariance_tail(n, stride, sample_period)
    }

    fn phase_variance(kind: &NoiseTerm, count: u64, stride: f64, sample_period: f64) -> f64 {
        kind.phase_variance(count, stride, sample_period)
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

    fn sqrt(x: f64) -> f64 {
        sqrt(x)
    }
}

/// The power laws of IEEE Std 952: Q, N, B, K and R.
pub(crate) enum PowerLawTerms {}

impl TermSet for PowerLawTerms {
    type Real = f32;

    const SHAPES: bool = false;

    fn contains(kind: &NoiseTerm) -> bool {
        !matches!(
            kind,
            NoiseTerm::Filtered(_)
                | NoiseTerm::LowPass(_)
                | NoiseTerm::Markov(_)
                | NoiseTerm::Resonance(_)
                | NoiseTerm::Sinusoid(_)
        )
    }

    fn avar(kind: &NoiseTerm, _: Option<&MovingAverageFilter>, n: u64, sample_period: f64) -> f64 {
        // The closed forms of the processes, without a sum in double precision.
        let tau = n as f64 * sample_period;
        let n = n as f32;
        match kind {
            NoiseTerm::Quantization => 3.0 / (tau * tau),
            NoiseTerm::AngleRandomWalk => 1.0 / tau,
            NoiseTerm::BiasInstability => 2.0 * LN_2 / PI,
            NoiseTerm::RateRandomWalk => sample_period * f64::from(n / 3.0 + 1.0 / (6.0 * n)),
            NoiseTerm::RateRamp => tau * tau / 2.0,
            _ => 0.0,
        }
    }

    /// The table is in units of the stride. A random walk lacks the term to which second differences are blind.
    fn sum_variances(kind: &NoiseTerm, _: u64, _: u32, _: f64, table: &mut [f32]) {
        for (k, entry) in (0_u16..).map(f32::from).zip(table) {
            *entry = match kind {
                _ if k == 0.0 => 0.0,
                NoiseTerm::Quantization => 1.0,
                NoiseTerm::AngleRandomWalk => k,
                NoiseTerm::BiasInstability => -k * k * lnf(k),
                NoiseTerm::RateRandomWalk => -k * k * k,
                NoiseTerm::RateRamp => -k * k * k * k,
                _ => 0.0,
            };
        }
    }

    fn squared_covariance_tail(_: &NoiseTerm, _: u64, _: f32, _: f64) -> f32 {
        0.0
    }

    fn phase_variance(_: &NoiseTerm, _: u64, _: f64, _: f64) -> f32 {
        0.0
    }

    fn share(kind: &NoiseTerm, fraction: f64, n: u64, sample_period: f64) -> VarianceFractions {
        if Self::contains(kind) { kind.share(fraction, n, sample_period) } else { VarianceFractions::WHITE }
    }

    fn free_parameters(_: &NoiseTerm) -> Range<usize> {
        0..0
    }

    /// The approximation of E. Wilson and M. Hilferty (Abramowitz and Stegun, Handbook of Mathematical Functions,
    /// 26.4.17).
    fn gamma_quantile(skewness: f32, upper: bool) -> f32 {
        let normal = if upper { NORMAL_975 as f32 } else { -NORMAL_975 as f32 };
        // The degrees of freedom `ν` are 8/skewness², and the approximation uses 2/(9ν).
        let ninth = skewness * skewness / 36.0;
        let cube = (1.0 - ninth + normal * sqrtf(ninth)).max(0.0);
        (cube * cube * cube - 1.0) * 2.0 / skewness
    }

    fn sqrt(x: f64) -> f64 {
        sqrt_in_single(x)
    }
}
