//! Whether a model is enough: the probability of a residual as large as the one that was seen.

use super::bounds::{MAX_PARAMETERS, correlation, tangents};
use super::least_squares::dot;
use super::problem::{MAX_POINTS, Problem};
use crate::chi_square;
use crate::math::sqrt;
use heapless::Vec;

/// How well a model describes the curve that it was fitted to.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Goodness {
    /// `Σ edf·(v/m − 1 − ln(v/m))` over all points.
    pub deviance: f64,
    /// Probability of a deviance at least as large if the model is true.
    pub p_value: f64,
}

/// Judges the fitted `problem`.
///
/// The deviance is a sum of squares of correlated normal residuals from which the fit has taken the directions of its
/// parameters. Its law is that of a scaled χ² with the same mean and variance (F. Satterthwaite, Biometrics 2, 1946).
pub(super) fn judge(problem: &Problem) -> Goodness {
    let deviance = problem.deviance(&problem.squares);
    let count = problem.points.len();
    let mut residual = [[0.0; MAX_POINTS]; MAX_POINTS];
    for (row, a) in residual.iter_mut().zip(&problem.points) {
        for (entry, b) in row.iter_mut().zip(&problem.points) {
            *entry = correlation(a, b);
        }
    }
    for direction in orthonormal(problem) {
        let mut along = [0.0; MAX_POINTS];
        for (row, weight) in residual.iter().zip(&direction) {
            for (sum, entry) in along.iter_mut().zip(row) {
                *sum += weight * entry;
            }
        }
        for (row, weight) in residual.iter_mut().zip(&direction) {
            for (entry, taken) in row.iter_mut().zip(&along) {
                *entry -= weight * taken;
            }
        }
    }
    // The traces of the matrix and of its square.
    let (mut mean, mut square) = (0.0, 0.0);
    for (i, row) in residual.iter().enumerate().take(count) {
        mean += row[i];
        square += row.iter().zip(&residual).take(count).map(|(entry, other)| entry * other[i]).sum::<f64>();
    }
    let dof = mean * mean / square;
    let p_value = if mean > 1e-9 { chi_square::upper_tail(deviance * mean / square, dof) } else { 1.0 };
    Goodness { deviance, p_value }
}

/// The directions in the space of standardised residuals that the fit can follow, made orthonormal.
pub(super) fn orthonormal(problem: &Problem) -> Vec<[f64; MAX_POINTS], MAX_PARAMETERS> {
    let mut directions: Vec<[f64; MAX_POINTS], MAX_PARAMETERS> = Vec::new();
    for mut direction in tangents(problem) {
        for known in &directions {
            let along = dot(&direction, known);
            for (entry, known) in direction.iter_mut().zip(known) {
                *entry -= along * known;
            }
        }
        let length = sqrt(dot(&direction, &direction));
        if length > 1e-9 {
            direction.iter_mut().for_each(|entry| *entry /= length);
            // Room for as many as there are parameters.
            let _ = directions.push(direction);
        }
    }
    directions
}
