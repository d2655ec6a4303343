//! Whether a model is enough: the probability of a residual as large as the one that was seen.

use super::points::{Measured, Points, correlation};
use super::problem::{MAX_PARAMETERS, Problem};
use crate::chi_square;

/// How well a model describes the curve that it was fitted to.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Goodness {
    /// `Σ edf·(v/m − 1 − ln(v/m))` over all points.
    pub deviance: f64,
    /// Probability of a deviance at least as large if the model is true.
    pub p_value: f64,
}

/// Judges the fitted `problem`, whose columns it uses up.
///
/// The deviance is a sum of squares of correlated normal residuals from which the fit has taken the directions of its
/// parameters. Its law is that of a scaled χ² with the same mean and variance (F. Satterthwaite, Biometrics 2, 1946).
pub(super) fn judge<const POINTS: usize>(points: &Points<POINTS>, problem: &mut Problem<POINTS>) -> Goodness {
    let deviance = f64::from(problem.deviance(points));
    let count = problem.orthonormal(points);
    let (mean, square) = traces(&points.measured, &problem.columns[..count]);
    let (mean, square) = (f64::from(mean), f64::from(square));
    let dof = mean * mean / square;
    let p_value = if mean > 1e-5 { chi_square::upper_tail(deviance * mean / square, dof) } else { 1.0 };
    Goodness { deviance, p_value }
}

/// The traces of `PR` and of its square, with the correlations `R` and the projection `P = 1 − Σ ddᵀ` that leaves the
/// directions `d` out: `tr R − Σ dᵀRd` and `tr R² − 2 Σ |Rd|² + Σ (dᵀRe)²`.
#[inline(never)]
fn traces<const POINTS: usize>(measured: &[Measured], directions: &[[f32; POINTS]]) -> (f32, f32) {
    let (mut mean, mut square) = (0.0, 0.0);
    let mut between = [[0.0; MAX_PARAMETERS]; MAX_PARAMETERS];
    for (i, a) in measured.iter().enumerate() {
        let mut turned = [0.0; MAX_PARAMETERS];
        for (j, b) in measured.iter().enumerate() {
            let entry = correlation(a, b);
            mean += if i == j { entry } else { 0.0 };
            square += entry * entry;
            turned.iter_mut().zip(directions).for_each(|(turned, direction)| *turned += entry * direction[j]);
        }
        for (row, direction) in between.iter_mut().zip(directions) {
            row.iter_mut().zip(turned).for_each(|(entry, turned)| *entry += direction[i] * turned);
        }
        square -= 2.0 * turned.iter().map(|entry| entry * entry).sum::<f32>();
    }
    for (i, row) in between.iter().enumerate() {
        mean -= row[i];
        square += row.iter().map(|entry| entry * entry).sum::<f32>();
    }
    (mean, square)
}
