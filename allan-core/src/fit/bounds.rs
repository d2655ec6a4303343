//! How far the data fixes the parameters: the sandwich covariance.
//!
//! The points of a curve are not independent, and independent ones would claim 1.5 to 1.8 times too little.

use super::least_squares::{Matrix, Vector, dot, inverse};
use super::problem::{MAX_POINTS, Measured, Problem};
use crate::chi_square::NORMAL_975;
use crate::confidence::octave_correlation;
use crate::math::{abs, exp, log2, sqrt};
use crate::model::{MAX_SHAPE, Model};
use heapless::Vec;

/// Coefficients and parameters of shapes together.
pub(super) const MAX_PARAMETERS: usize = 12;
/// Relative step of the numerical derivative to a shape's parameter.
const STEP: f64 = 1e-3;

/// What a column of the Jacobian belongs to.
#[derive(Clone, Copy)]
enum Parameter {
    /// The square of the coefficient of a term.
    Square(usize),
    /// The logarithm of a parameter of a term's shape.
    Shape(usize, usize),
}

/// Sets the 95 % bounds of all parameters of the fitted `model`.
pub(super) fn set(problem: &Problem, model: &mut Model) {
    let parameters = parameters(problem);
    let jacobian = |point: &Measured| {
        let mut row = [0.0; MAX_PARAMETERS];
        for (entry, parameter) in row.iter_mut().zip(&parameters) {
            *entry = derivative(problem, point, *parameter) / dot(&point.basis, &problem.squares);
        }
        row
    };
    let rows: Vec<Vector<MAX_PARAMETERS>, MAX_POINTS> = problem.points.iter().map(jacobian).collect();
    let Some(inverse) = inverse(&information(problem, &rows), parameters.len()) else {
        return;
    };
    let score = score_covariance(problem, &rows);
    for (i, parameter) in parameters.iter().enumerate() {
        let mut variance = 0.0;
        for (j, row) in score.iter().enumerate().take(parameters.len()) {
            variance += inverse[i][j] * dot(row, &inverse[i]);
        }
        let half_width = NORMAL_975 * sqrt(variance.max(0.0));
        match *parameter {
            Parameter::Square(term) => {
                let square = problem.squares[term];
                let term = &mut model.terms_mut()[term];
                term.low = sqrt((square - half_width).max(0.0));
                term.high = sqrt(square + half_width);
            }
            Parameter::Shape(term, index) => {
                let term = &mut model.terms_mut()[term];
                let (_, value) = term.kind.shape()[index];
                term.shape[index] = (value * exp(-half_width), value * exp(half_width));
            }
        }
    }
}

/// Every coefficient, and the shape of every term that is there.
fn parameters(problem: &Problem) -> Vec<Parameter, MAX_PARAMETERS> {
    let coefficients = (0..problem.kinds.len()).map(Parameter::Square);
    let shapes = problem
        .kinds
        .iter()
        .enumerate()
        .filter(|(term, _)| problem.squares[*term] > 0.0)
        .flat_map(|(term, kind)| kind.freedom().map(move |index| Parameter::Shape(term, index)));
    coefficients.chain(shapes).take(MAX_PARAMETERS).collect()
}

/// What each parameter of a term that is there does to the points, in their standard deviations.
pub(super) fn tangents(problem: &Problem) -> Vec<[f64; MAX_POINTS], MAX_PARAMETERS> {
    let there = |parameter: &&Parameter| match **parameter {
        Parameter::Square(term) | Parameter::Shape(term, _) => problem.squares[term] > 0.0,
    };
    let tangent = |parameter: &Parameter| {
        let mut tangent = [0.0; MAX_POINTS];
        for (entry, point) in tangent.iter_mut().zip(&problem.points) {
            *entry =
                sqrt(point.edf / 2.0) * derivative(problem, point, *parameter) / dot(&point.basis, &problem.squares);
        }
        // Of a length near 1, so that one threshold serves all.
        let length = sqrt(dot(&tangent, &tangent));
        tangent.map(|entry| entry / length.max(f64::MIN_POSITIVE))
    };
    parameters(problem).iter().filter(there).map(tangent).collect()
}

/// How the modelled variance at a point changes with a parameter.
fn derivative(problem: &Problem, point: &Measured, parameter: Parameter) -> f64 {
    match parameter {
        Parameter::Square(term) => point.basis[term],
        Parameter::Shape(term, index) => {
            let kind = problem.kinds[term];
            let at = |factor: f64| {
                let mut shape: [f64; MAX_SHAPE] = kind.shape().map(|(_, value)| value);
                shape[index] *= factor;
                kind.with_shape(shape).avar(point.n, problem.sample_period)
            };
            problem.squares[term] * (at(1.0 + STEP) - at(1.0 - STEP)) / (2.0 * STEP)
        }
    }
}

fn information(problem: &Problem, rows: &[Vector<MAX_PARAMETERS>]) -> Matrix<MAX_PARAMETERS> {
    let mut information = [[0.0; MAX_PARAMETERS]; MAX_PARAMETERS];
    for (point, row) in problem.points.iter().zip(rows) {
        add_outer(&mut information, point.edf / 2.0, row, row);
    }
    information
}

fn score_covariance(problem: &Problem, rows: &[Vector<MAX_PARAMETERS>]) -> Matrix<MAX_PARAMETERS> {
    let mut covariance = [[0.0; MAX_PARAMETERS]; MAX_PARAMETERS];
    for (first, a) in problem.points.iter().zip(rows) {
        for (second, b) in problem.points.iter().zip(rows) {
            let scale = sqrt(first.edf * second.edf) / 2.0 * correlation(first, second);
            add_outer(&mut covariance, scale, a, b);
        }
    }
    covariance
}

fn add_outer(sum: &mut Matrix<MAX_PARAMETERS>, scale: f64, a: &Vector<MAX_PARAMETERS>, b: &Vector<MAX_PARAMETERS>) {
    for (row, a) in sum.iter_mut().zip(a) {
        for (entry, b) in row.iter_mut().zip(b) {
            *entry += scale * a * b;
        }
    }
}

/// Correlation of the errors of two points. What narrow terms remember raises and lowers all points together.
pub(super) fn correlation(a: &Measured, b: &Measured) -> f64 {
    let octaves = abs(log2(a.n as f64 / b.n as f64));
    let (near_a, near_b) = (a.edf / a.near_edf, b.edf / b.near_edf);
    sqrt(near_a * near_b) * octave_correlation((octaves + 0.5) as usize, a.shares, b.shares)
        + sqrt((1.0 - near_a).max(0.0) * (1.0 - near_b).max(0.0))
}
