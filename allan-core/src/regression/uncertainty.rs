//! Uncertainty of the regression: weights and correlations of the octaves, and sensitivities with Student's distribution.

use crate::confidence::{NORMAL_975, pure_octave_correlation, roots};
use crate::curve::AllanPoint;
use crate::math::{abs, expm1, ln, sqrt};
use crate::model::Model;

pub(super) struct OctaveWeight {
    /// Averaging factor, samples.
    pub(super) n: u64,
    /// Degrees of freedom of the Allan variance of the residual.
    edf: f32,
    /// Degrees of freedom over the Allan variance of the residual.
    pub(super) weight: f64,
    /// [`roots`] of the variance fractions.
    roots: [f32; 3],
}

/// Degrees of freedom above which the measured variance, known to 25 %, is preferred to that of a poor model.
const WELL_KNOWN: f64 = 30.0;
/// Number of shortest octaves that are tested: a filter or a line gives them a form that N, B and K cannot fit.
const SHORT: usize = 6;
/// Residual of one of these octaves, in standard deviations, that marks a poor model.
const MISFIT: f64 = 6.0;

/// True if `model`, fitted to the curve, does not describe its shortest octaves, which dominate the fit.
pub(super) fn is_poor(model: &Model, points: &[AllanPoint]) -> bool {
    points.iter().take(SHORT).any(|point| {
        let sigmas = (point.avar / model.avar(point.n) - 1.0) * sqrt(model.edf(point) / 2.0);
        abs(sigmas) > MISFIT
    })
}

impl OctaveWeight {
    /// The weight of a point of the residual's curve, by the model fitted to that curve; `None` if both variances are
    /// 0.
    pub(super) fn new(point: &AllanPoint, model: &Model, is_poor: bool) -> Option<Self> {
        let edf = model.edf(point);
        // Variance that the model does not explain is noise of the regression too.
        let variance = if is_poor && edf >= WELL_KNOWN { point.avar } else { model.avar(point.n).max(point.avar) };
        (variance > 0.0).then(|| Self {
            n: point.n,
            edf: edf as f32,
            weight: edf / variance,
            roots: roots(model.variance_fractions(point.n)).map(|root: f64| root as f32),
        })
    }

    fn correlation(&self, other: &Self, lag: usize) -> f64 {
        let product =
            |noise: usize| f64::from(self.roots[noise] * other.roots[noise]) * pure_octave_correlation(lag, noise);
        (0..3).map(product).sum()
    }
}

/// Variance of a weighted sum over the octaves, proportional to `common(n)`, the covariance of two covariates.
pub(super) fn sum_variance<const COUPLED: usize>(octaves: &[OctaveWeight], common: impl Fn(u64) -> f64) -> f64 {
    let mut roots = [0.0; COUPLED];
    for (root, octave) in roots.iter_mut().zip(octaves) {
        let common = common(octave.n);
        let modulus = sqrt(octave.weight * abs(common));
        *root = if common < 0.0 { -modulus } else { modulus };
    }
    quadratic_form(octaves, |k| roots[k])
}

/// Equivalent degrees of freedom of one sensitivity, from the octaves and the covariate's variance `measured`.
pub(super) fn edf(octaves: &[OctaveWeight], measured: impl Fn(u64) -> f64) -> f64 {
    let weighted = |octave: &OctaveWeight| octave.weight * measured(octave.n);
    let sum: f64 = octaves.iter().map(weighted).sum();
    let square = quadratic_form(octaves, |k| weighted(&octaves[k]) / sqrt(f64::from(octaves[k].edf)));
    if square > 0.0 { sum * sum / square } else { 0.0 }
}

/// `Σ rₖₗ·fₖ·fₗ` with the correlations `r` of the octaves and the factors `f`.
fn quadratic_form(octaves: &[OctaveWeight], factor: impl Fn(usize) -> f64) -> f64 {
    let mut sum = 0.0;
    for (k, a) in octaves.iter().enumerate() {
        let mut along = factor(k) / 2.0;
        for (l, b) in octaves.iter().enumerate().take(k) {
            along += a.correlation(b, k - l) * factor(l);
        }
        sum += 2.0 * factor(k) * along;
    }
    sum
}

/// The sensitivity of a channel to a covariate, with its uncertainty.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Sensitivity {
    /// Index of the covariate.
    pub covariate: usize,
    /// Sensitivity, in the channel's unit over the covariate's.
    pub value: f64,
    /// Uncertainty, in the same unit: `value ± 1.96·error` is the 95 % interval.
    pub error: f64,
    /// Degrees of freedom of the uncertainty; infinite for a normal distribution.
    pub degrees_of_freedom: f64,
}

impl Sensitivity {
    /// A sensitivity that is known without error.
    #[must_use]
    pub fn exact(covariate: usize, value: f64) -> Self {
        Self { covariate, value, error: 0.0, degrees_of_freedom: f64::INFINITY }
    }

    /// A sensitivity with this standard deviation, which was estimated with these degrees of freedom.
    pub(super) fn new(covariate: usize, value: f64, deviation: f64, degrees_of_freedom: f64) -> Self {
        let widening = student(NORMAL_975, degrees_of_freedom) / NORMAL_975;
        Self { covariate, value, error: deviation * widening, degrees_of_freedom }
    }

    /// 95 % bounds of the value.
    #[must_use]
    pub fn bounds(&self) -> (f64, f64) {
        let half_width = NORMAL_975 * self.error;
        (self.value - half_width, self.value + half_width)
    }

    /// Significance: the normal deviate with the same probability as this distance from 0 by Student's t (D. Wallace, Ann.
    /// Math. Statist. 30, 1959).
    #[must_use]
    pub fn sigmas(&self) -> f64 {
        let widening = student(NORMAL_975, self.degrees_of_freedom) / NORMAL_975;
        let ratio = abs(self.value) * widening / self.error;
        if self.degrees_of_freedom.is_infinite() {
            return ratio;
        }
        sqrt(self.degrees_of_freedom * ln(1.0 + ratio * ratio / self.degrees_of_freedom))
            / wallace(self.degrees_of_freedom)
    }
}

/// The quantile of Student's t with the tail probability of the normal deviate `normal` (Wallace, Ann. Math. Statist.
/// 30, 1959), within 1.2 % for 3 or more degrees of freedom.
fn student(normal: f64, degrees_of_freedom: f64) -> f64 {
    if degrees_of_freedom.is_infinite() {
        return normal;
    }
    let z = normal * wallace(degrees_of_freedom);
    sqrt(degrees_of_freedom * expm1(z * z / degrees_of_freedom))
}

fn wallace(degrees_of_freedom: f64) -> f64 {
    (8.0 * degrees_of_freedom + 3.0) / (8.0 * degrees_of_freedom + 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two-sided 5 % points of Student's t and of the normal distribution, from tables.
    #[test]
    fn bounds_and_significance_follow_students_t() {
        for (freedom, quantile) in [(3.0, 3.182), (5.0, 2.571), (10.0, 2.228), (30.0, 2.042), (f64::INFINITY, 1.960)] {
            let sensitivity = Sensitivity::new(0, quantile, 1.0, freedom);
            assert!((sensitivity.error * NORMAL_975 / quantile - 1.0).abs() < 0.015, "{sensitivity:?}");
            assert!((sensitivity.sigmas() / NORMAL_975 - 1.0).abs() < 0.015, "{sensitivity:?}");
        }
        assert!(Sensitivity::exact(0, 1.0).sigmas().is_infinite());
    }
}
