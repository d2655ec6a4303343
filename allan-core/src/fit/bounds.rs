//! How far the data fixes the parameters: 95 % bounds from the sandwich covariance.
//!
//! The points of a curve are not independent, and independent ones would claim 1.5 to 1.8 times too little. A
//! coefficient that few degrees of freedom tell would also be claimed too well wherever it came out too small: its
//! bounds are the values under which the estimate lies at the end of *their* scatter (test inversion), not of its own.

use super::least_squares::{entry, solve, triangle};
use super::parameter::Parameter;
use super::points::Points;
use super::problem::{MAX_PARAMETERS, Problem};
use crate::Curve;
use crate::chi_square::quantile;
use crate::confidence::NORMAL_975;
use crate::math::{absf, exp, sqrt, sqrtf};
use crate::model::{MAX_TERMS, Model};

/// Standard deviation over the estimate of an amount below which its own scatter is good enough: the bounds of the
/// coefficient are then a hundredth of their distance off.
const SMALL: f32 = 0.02;
/// A candidate of 0 would leave a model of one term without any variance.
const NEXT_TO_NOTHING: f32 = 1e-4;
const SEARCH_ROUNDS: usize = 5;

/// Sets the bounds of all parameters of `model`, which was fitted to the curve.
#[inline(never)] // here and below: so that stack frames do not add up
pub(crate) fn set<const POINTS: usize>(curve: &Curve<POINTS>, model: &mut Model) {
    let (mut points, mut problem) = (Points::empty(curve), Problem::empty());
    points.take();
    problem.take_model(&mut points, model);
    let parameters = problem.differentiate(&points);
    let estimate = problem.amounts;
    for (column, parameter) in parameters.iter().enumerate() {
        let Some(own) = scatter(&points, &problem, parameters.len(), column) else { return };
        match *parameter {
            Parameter::Amount(term) => {
                let direction = core::array::from_fn(|other| own.direction[other] / own.direction[term]);
                let mut candidates = Candidates {
                    points: &mut points,
                    problem: &mut problem,
                    parameters: parameters.len(),
                    estimate,
                    direction,
                    term,
                };
                let (low, high) = candidates.bounds(&own);
                let coefficient = |amount: f32| sqrt(f64::from(amount) * problem.units[term]);
                let set = &mut model.terms_mut()[term];
                (set.low, set.high) = (coefficient(low), coefficient(high));
                if problem.amounts != estimate {
                    problem.amounts = estimate;
                    problem.weigh(&mut points);
                }
            }
            Parameter::Shape(term, index) => {
                let term = &mut model.terms_mut()[term];
                let (_, value) = term.kind.shape()[index];
                let half_width = NORMAL_975 * f64::from(own.deviation);
                term.shape[index] = (value * exp(-half_width), value * exp(half_width));
            }
        }
    }
}

/// How the estimate of a parameter scatters.
struct Scatter {
    deviation: f32,
    skewness: f32,
    /// How far beyond its estimate the data pulls the parameter: below 0 only for a square that may not follow.
    pull: f32,
    /// What the other parameters do where this one is moved and they are fitted again, up to a factor.
    direction: [f32; MAX_PARAMETERS],
}

impl Scatter {
    /// What the estimate exceeds its expectation by with probability `1 − p`: the quantile of the gamma distribution
    /// with the same deviation and skewness (Pearson's type III).
    fn quantile(&self, p: f64) -> f32 {
        // Below, the distribution is normal up to a hundredth of a deviation.
        let skewness = f64::from(self.skewness.max(0.02));
        let dof = 8.0 / (skewness * skewness);
        self.deviation * ((quantile(p, dof) - dof) / sqrt(2.0 * dof)) as f32
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
        skewed[at] *= sqrtf(sqrtf(8.0 / point.edf));
        pull += weights[at] * sqrtf(point.edf / 2.0) * (1.0 / problem.modelled(at, &problem.amounts) - 1.0);
    }
    let [variance, skewness] = points.variances([&weights, &skewed]);
    let skewness = skewness / variance;
    Some(Scatter { deviation: sqrtf(variance), skewness, pull, direction })
}

/// The parameter's column of the inverse information; `weights` become those of the standardised residuals in its
/// estimate.
#[inline(never)]
fn direction<const POINTS: usize>(
    points: &Points<POINTS>,
    problem: &Problem<POINTS>,
    parameters: usize,
    column: usize,
    weights: &mut [f32; POINTS],
) -> Option<[f32; MAX_PARAMETERS]> {
    let mut information = [0.0_f64; triangle(MAX_PARAMETERS)];
    for (at, (weight, point)) in weights.iter_mut().zip(&points.measured).enumerate() {
        *weight = sqrtf(point.edf / 2.0) / problem.modelled(at, &problem.amounts);
        for i in 0..parameters {
            let weighted = *weight * *weight * problem.columns[i][at];
            (0..=i).for_each(|j| information[entry(i, j)] += f64::from(weighted) * f64::from(problem.columns[j][at]));
        }
    }
    let mut direction = [0.0; MAX_PARAMETERS];
    direction[column] = 1.0;
    solve(&mut information, &mut direction, (1 << parameters) - 1)?;
    let direction = direction.map(|entry| entry as f32);
    for (at, weight) in weights.iter_mut().enumerate() {
        *weight *= direction.iter().zip(&problem.columns).map(|(x, column)| x * column[at]).sum::<f32>();
    }
    Some(direction)
}

/// Values that the amount of one term could have.
struct Candidates<'a, 'b, const POINTS: usize> {
    points: &'a mut Points<'b, POINTS>,
    problem: &'a mut Problem<POINTS>,
    parameters: usize,
    estimate: [f32; MAX_TERMS],
    direction: [f32; MAX_TERMS],
    term: usize,
}

impl<const POINTS: usize> Candidates<'_, '_, POINTS> {
    fn bounds(&mut self, own: &Scatter) -> (f32, f32) {
        let amount = self.estimate[self.term];
        if amount == 0.0 {
            // Below 0, but no further than chance would often have it: an upper bound must not vanish with bad luck
            // (power-constrained limits: G. Cowan et al., arXiv:1105.3166).
            let observed = own.pull.max(-own.deviation).min(0.0);
            return (0.0, self.high(observed, own));
        }
        if own.deviation < SMALL * amount {
            let half_width = NORMAL_975 as f32 * own.deviation;
            return (amount - half_width, amount + half_width);
        }
        (self.low(amount, own), self.high(amount, own))
    }

    /// The value whose upper tail begins at what was observed.
    fn low(&mut self, observed: f32, own: &Scatter) -> f32 {
        let nearly_nothing = NEXT_TO_NOTHING * observed;
        let excess = self.quantile(nearly_nothing, 0.975) - observed;
        if excess >= 0.0 {
            return 0.0;
        }
        self.root(0.975, observed, (nearly_nothing, excess), (observed, own.quantile(0.975)))
    }

    /// The value whose lower tail ends at what was observed.
    fn high(&mut self, observed: f32, own: &Scatter) -> f32 {
        let distance = -own.quantile(0.025);
        let further = observed + 1.5 * distance;
        let excess = self.quantile(further, 0.025) - observed;
        self.root(0.025, observed, (observed, -distance), (further, excess))
    }

    /// Where a quantile of the estimate is what was observed, from two values with their excess: the secant method.
    fn root(&mut self, p: f64, observed: f32, mut a: (f32, f32), mut b: (f32, f32)) -> f32 {
        for _ in 0..SEARCH_ROUNDS {
            let slope = ((b.1 - a.1) / (b.0 - a.0)).max(0.02);
            let next = (b.0 - b.1 / slope).max(0.0);
            if absf(next - b.0) < 0.01 * absf(next - observed) {
                return next;
            }
            (a, b) = (b, (next, self.quantile(next, p) - observed));
        }
        b.0
    }

    /// A quantile of the estimate if the amount is `value`, the other terms following.
    fn quantile(&mut self, value: f32, p: f64) -> f32 {
        let change = value - self.estimate[self.term];
        for (other, entry) in self.problem.amounts.iter_mut().enumerate() {
            *entry = (self.estimate[other] + change * self.direction[other]).max(0.0);
        }
        self.problem.weigh(self.points);
        let scatter = scatter(self.points, self.problem, self.parameters, self.term);
        scatter.map_or(f32::NAN, |scatter| value + scatter.quantile(p))
    }
}
