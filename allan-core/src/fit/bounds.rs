//! How far the data fixes the parameters: 95 % bounds from the sandwich covariance.
//!
//! The points of a curve are not independent, and independent ones would claim 1.5 to 1.8 times too little. A
//! coefficient that few degrees of freedom tell would also be claimed too well wherever it came out too small: its
//! bounds are the values under which the estimate lies at the end of *their* scatter (test inversion), not of its own.

use super::least_squares::{Matrix, Vector, dot, solve_in_place};
use super::parameter::Parameter;
use super::points::Points;
use super::problem::{MAX_PARAMETERS, Problem};
use crate::Curve;
use crate::chi_square::quantile;
use crate::confidence::NORMAL_975;
use crate::math::{abs, clamp, exp, sqrt};
use crate::model::{MAX_TERMS, Model};

/// Standard deviation over the estimate of a square below which its own scatter is good enough: the bounds of the
/// coefficient are then a hundredth of their distance off.
const SMALL: f64 = 0.02;
/// A candidate of 0 would leave a model of one term without any variance.
const NEXT_TO_NOTHING: f64 = 1e-4;
const SEARCH_ROUNDS: usize = 5;

/// Sets the bounds of all parameters of the fitted `model`; uses up the weights and the coefficients of the problem.
#[inline(never)]
pub(super) fn set<const POINTS: usize>(
    points: &mut Points<POINTS>,
    curve: &Curve<POINTS>,
    problem: &mut Problem<POINTS>,
    model: &mut Model,
) {
    let parameters = problem.differentiate(points);
    let estimate = problem.squares;
    for (column, parameter) in parameters.iter().enumerate() {
        let Some(own) = scatter(points, problem, parameters.len(), column) else { return };
        match *parameter {
            Parameter::Square(term) => {
                let direction = core::array::from_fn(|other| own.direction[other] / own.direction[term]);
                let mut candidates =
                    Candidates { points, curve, problem, parameters: parameters.len(), estimate, direction, term };
                let (low, high) = candidates.bounds(&own);
                let set = &mut model.terms_mut()[term];
                (set.low, set.high) = (sqrt(low), sqrt(high));
                if problem.squares != estimate {
                    problem.squares = estimate;
                    problem.weigh(points, curve);
                }
            }
            Parameter::Shape(term, index) => {
                let term = &mut model.terms_mut()[term];
                let (_, value) = term.kind.shape()[index];
                let half_width = NORMAL_975 * own.deviation;
                term.shape[index] = (value * exp(-half_width), value * exp(half_width));
            }
        }
    }
}

/// How the estimate of a parameter scatters.
struct Scatter {
    deviation: f64,
    skewness: f64,
    /// How far beyond its estimate the data pulls the parameter: below 0 only for a square that may not follow.
    pull: f64,
    /// What the other parameters do where this one is moved and they are fitted again, up to a factor.
    direction: Vector<MAX_PARAMETERS>,
}

impl Scatter {
    /// What the estimate exceeds its expectation by with probability `1 − p`: the quantile of the gamma distribution
    /// with the same deviation and skewness (Pearson's type III).
    fn quantile(&self, p: f64) -> f64 {
        // Below, the distribution is normal up to a hundredth of a deviation.
        let skewness = self.skewness.max(0.02);
        let dof = 8.0 / (skewness * skewness);
        self.deviation * (quantile(p, dof) - dof) / sqrt(2.0 * dof)
    }
}

/// The scatter of the parameter of a column, if the model is true as the problem has it: the sandwich covariance
/// `H⁻¹·JᵀRJ·H⁻¹`, with the skewness of the points weighed by what they add to it.
#[inline(never)]
fn scatter<const POINTS: usize>(
    points: &Points<POINTS>,
    problem: &Problem<POINTS>,
    parameters: usize,
    column: usize,
) -> Option<Scatter> {
    let mut weights = [0.0; POINTS];
    let direction = direction(points, problem, parameters, column, &mut weights)?;
    // A point's estimate is χ² with as many degrees of freedom, whose skewness is √(8/edf).
    let mut skewed = weights;
    let mut pull = 0.0;
    for (at, point) in points.measured.iter().enumerate() {
        skewed[at] *= sqrt(sqrt(8.0 / point.edf));
        pull += weights[at] * sqrt(point.edf / 2.0) * (point.avar / problem.modelled(at, &problem.squares) - 1.0);
    }
    let [variance, skewness] = points.variances([&weights, &skewed]);
    let skewness = skewness / variance;
    Some(Scatter { deviation: sqrt(variance), skewness, pull, direction })
}

/// The parameter's column of the inverse information; `weights` become those of the standardised residuals in its
/// estimate.
#[inline(never)]
fn direction<const POINTS: usize>(
    points: &Points<POINTS>,
    problem: &Problem<POINTS>,
    parameters: usize,
    column: usize,
    weights: &mut [f64; POINTS],
) -> Option<Vector<MAX_PARAMETERS>> {
    let mut information: Matrix<MAX_PARAMETERS> = [[0.0; MAX_PARAMETERS]; MAX_PARAMETERS];
    for (at, (weight, point)) in weights.iter_mut().zip(&points.measured).enumerate() {
        *weight = sqrt(point.edf / 2.0) / problem.modelled(at, &problem.squares);
    }
    for (i, row) in information.iter_mut().enumerate().take(parameters) {
        let mut weighted = problem.columns[i];
        weighted.iter_mut().zip(weights.iter()).for_each(|(entry, weight)| *entry *= weight * weight);
        row.iter_mut().zip(&problem.columns).take(i + 1).for_each(|(entry, column)| *entry = dot(&weighted, column));
    }
    let mut direction = [0.0; MAX_PARAMETERS];
    direction[column] = 1.0;
    solve_in_place(&mut information, &mut direction, (1 << parameters) - 1)?;
    for (at, weight) in weights.iter_mut().enumerate() {
        *weight *= direction.iter().zip(&problem.columns).map(|(x, column)| x * column[at]).sum::<f64>();
    }
    Some(direction)
}

/// Values that the square of one coefficient could have.
struct Candidates<'a, const POINTS: usize> {
    points: &'a mut Points<POINTS>,
    curve: &'a Curve<POINTS>,
    problem: &'a mut Problem<POINTS>,
    parameters: usize,
    estimate: Vector<MAX_TERMS>,
    direction: Vector<MAX_TERMS>,
    term: usize,
}

impl<const POINTS: usize> Candidates<'_, POINTS> {
    fn bounds(&mut self, own: &Scatter) -> (f64, f64) {
        let square = self.estimate[self.term];
        if square == 0.0 {
            // Below 0, but no further than chance would often have it: an upper bound must not vanish with bad luck
            // (power-constrained limits: G. Cowan et al., arXiv:1105.3166).
            let observed = clamp(own.pull, -own.deviation, 0.0);
            return (0.0, self.high(observed, own));
        }
        if own.deviation < SMALL * square {
            let half_width = NORMAL_975 * own.deviation;
            return (square - half_width, square + half_width);
        }
        (self.low(square, own), self.high(square, own))
    }

    /// The value whose upper tail begins at what was observed.
    fn low(&mut self, observed: f64, own: &Scatter) -> f64 {
        let nearly_nothing = NEXT_TO_NOTHING * observed;
        let excess = self.quantile(nearly_nothing, 0.975) - observed;
        if excess >= 0.0 {
            return 0.0;
        }
        self.root(0.975, observed, (nearly_nothing, excess), (observed, own.quantile(0.975)))
    }

    /// The value whose lower tail ends at what was observed.
    fn high(&mut self, observed: f64, own: &Scatter) -> f64 {
        let distance = -own.quantile(0.025);
        let further = observed + 1.5 * distance;
        let excess = self.quantile(further, 0.025) - observed;
        self.root(0.025, observed, (observed, -distance), (further, excess))
    }

    /// Where a quantile of the estimate is what was observed, from two values with their excess: the secant method.
    fn root(&mut self, p: f64, observed: f64, mut a: (f64, f64), mut b: (f64, f64)) -> f64 {
        for _ in 0..SEARCH_ROUNDS {
            let slope = ((b.1 - a.1) / (b.0 - a.0)).max(0.02);
            let next = (b.0 - b.1 / slope).max(0.0);
            if abs(next - b.0) < 0.01 * abs(next - observed) {
                return next;
            }
            (a, b) = (b, (next, self.quantile(next, p) - observed));
        }
        b.0
    }

    /// A quantile of the estimate if the square is `value`, the other terms following.
    fn quantile(&mut self, value: f64, p: f64) -> f64 {
        let change = value - self.estimate[self.term];
        for (other, entry) in self.problem.squares.iter_mut().enumerate() {
            *entry = (self.estimate[other] + change * self.direction[other]).max(0.0);
        }
        self.problem.weigh(self.points, self.curve);
        let scatter = scatter(self.points, self.problem, self.parameters, self.term);
        scatter.map_or(f64::NAN, |scatter| value + scatter.quantile(p))
    }
}
