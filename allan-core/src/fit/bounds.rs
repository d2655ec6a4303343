//! 95 % bounds of fitted parameters, from the sandwich covariance of the correlated points.
//!
//! The scatter of a coefficient depends on its value, so uncertain coefficients are bounded by test inversion: for a
//! bound as the true value the estimate is the 2.5 % or 97.5 % quantile.

use super::least_squares::{entry, solve, triangle};
use super::likelihood::{MAX_PARAMETERS, MAX_POINTS, Points, Problem};
use super::shape::{FreeShapes, Parameter};
use crate::confidence::NORMAL_975;
use crate::curve::CurveView;
use crate::math::{Real, absf, exp, sqrtf};
use crate::model::{MAX_TERMS, Model};
use crate::term::TermSet;

/// Relative standard deviation below which the scatter at the estimate is used.
const SMALL: f32 = 0.02;
/// The smallest amount that is tested, over the estimate.
const SMALLEST: f32 = 1e-4;
const SEARCH_ROUNDS: usize = 5;

pub(crate) fn set<T: TermSet>(curve: CurveView, model: &mut Model) {
    set_free::<T>(curve, model, FreeShapes::AllExcept(&[]));
}

/// Sets the bounds of all coefficients of `model`, which was fitted to the curve, and of its `free` shapes.
#[inline(never)] // here and below: so that stack frames do not add up in the caller
pub(crate) fn set_free<T: TermSet>(curve: CurveView, model: &mut Model, free: FreeShapes) {
    let (mut points, mut problem) = (Points::empty(curve), Problem::<T>::empty());
    points.fill::<T>();
    problem.fill_from_model(&mut points, model);
    let parameters = problem.differentiate(&points, free);
    let estimate = problem.amounts;
    if points.measured.len() < parameters.len() {
        return leave_open(&points, &problem, model);
    }
    for (column, parameter) in parameters.iter().enumerate() {
        let Some(own) = scatter(&points, &problem, parameters.len(), column) else {
            return leave_open(&points, &problem, model);
        };
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
                // Far from the estimate the search can leave the range in which a quantile exists.
                let amount = estimate[term];
                let low = if low <= amount { low } else { 0.0 };
                let high = if high >= amount { high } else { largest(candidates.points, candidates.problem, term) };
                let high = high.max(amount);
                let coefficient = |amount: f32| T::sqrt(f64::from(amount) * problem.units[term]);
                let set = &mut model.terms_mut()[term];
                (set.low, set.high) = (coefficient(low), coefficient(high));
                if problem.amounts != estimate {
                    problem.amounts = estimate;
                    problem.set_confidence(&mut points);
                }
            }
            Parameter::Shape(..) if !T::SHAPES => {}
            Parameter::Shape(term, index) => {
                let term = &mut model.terms_mut()[term];
                let half_width = NORMAL_975 * f64::from(own.deviation);
                if let (Some(bounds), Some((_, value))) =
                    (term.shape.iter_mut().nth(index), term.kind.shape().named().nth(index))
                {
                    *bounds = (value * exp(-half_width), value * exp(half_width));
                }
            }
        }
    }
}

/// Sets the bounds of a model whose terms the points do not determine: 0 and the largest amount that they allow.
#[inline(never)]
fn leave_open<T: TermSet>(points: &Points, problem: &Problem<T>, model: &mut Model) {
    for (term, set) in model.terms_mut().iter_mut().enumerate() {
        let amount = largest(points, problem, term).max(problem.amounts[term]);
        (set.low, set.high) = (0.0, T::sqrt(f64::from(amount) * problem.units[term]));
    }
}

/// The largest amount of a term alone that is below the upper 95 % bound of every point; 0 without a point.
fn largest<T: TermSet>(points: &Points, problem: &Problem<T>, term: usize) -> f32 {
    let mut largest = f32::INFINITY;
    for (at, point) in points.measured.iter().enumerate() {
        // χ²/edf has a skewness of √(8/edf) and a deviation of √(2/edf).
        let smallest = 1.0 + sqrtf(2.0 / point.edf) * T::gamma_quantile(sqrtf(8.0 / point.edf), false);
        let bound = 1.0 / (smallest * problem.columns[term][at]);
        // A point excludes no amount if it lacks the term or has too few degrees of freedom for a quantile.
        if bound < largest {
            largest = bound;
        }
    }
    if largest.is_finite() { largest } else { 0.0 }
}

/// The distribution of the estimate of a parameter.
struct Scatter {
    deviation: f32,
    skewness: f32,
    /// The unconstrained step of the parameter from its estimate: negative only for an amount at its limit of 0.
    pull: f32,
    /// Change of all parameters, up to a factor, when this one changes and the others are fitted again.
    direction: [f32; MAX_PARAMETERS],
}

impl Scatter {
    /// The quantile, 97.5 % if `upper`, else 2.5 %, of the estimate less its expectation (Pearson type III).
    fn quantile<T: TermSet>(&self, upper: bool) -> f32 {
        // At lower skewness the distribution is normal to a hundredth of a standard deviation.
        self.deviation * T::gamma_quantile(self.skewness.max(0.02), upper)
    }
}

/// The scatter of a column's parameter under the present amounts: sandwich covariance `H⁻¹·JᵀRJ·H⁻¹`, and skewness.
#[inline(never)]
fn scatter<T: TermSet>(points: &Points, problem: &Problem<T>, parameters: usize, column: usize) -> Option<Scatter> {
    let mut weights = [0.0; MAX_POINTS];
    let direction = direction(points, problem, parameters, column, &mut weights)?;
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

/// The parameter's column of the inverse information, with the `weights` of the residuals; `None` if singular.
#[inline(never)]
fn direction<T: TermSet>(
    points: &Points,
    problem: &Problem<T>,
    parameters: usize,
    column: usize,
    weights: &mut [f32; MAX_POINTS],
) -> Option<[f32; MAX_PARAMETERS]> {
    let mut information = [T::Real::ZERO; triangle(MAX_PARAMETERS)];
    for (at, (weight, point)) in weights.iter_mut().zip(&points.measured).enumerate() {
        *weight = sqrtf(point.edf / 2.0) / problem.modelled(at, &problem.amounts);
        for i in 0..parameters {
            let weighted = *weight * *weight * problem.columns[i][at];
            for (j, column) in problem.columns[..=i].iter().enumerate() {
                information[entry(i, j)] += T::Real::from_single(weighted) * T::Real::from_single(column[at]);
            }
        }
    }
    let mut direction = [T::Real::ZERO; MAX_PARAMETERS];
    direction[column] = T::Real::from_single(1.0);
    solve(&mut information, &mut direction, (1 << parameters) - 1)?;
    let direction = direction.map(T::Real::single);
    for (at, weight) in weights.iter_mut().enumerate() {
        *weight *= direction.iter().zip(&problem.columns).map(|(x, column)| x * column[at]).sum::<f32>();
    }
    Some(direction)
}

/// Test inversion for the amount of one term.
struct Candidates<'a, 'b, T> {
    points: &'a mut Points<'b>,
    problem: &'a mut Problem<T>,
    parameters: usize,
    estimate: [f32; MAX_TERMS],
    direction: [f32; MAX_TERMS],
    term: usize,
}

impl<T: TermSet> Candidates<'_, '_, T> {
    /// 95 % bounds of the amount; `own` is the scatter at the estimate.
    fn bounds(&mut self, own: &Scatter) -> (f32, f32) {
        let amount = self.estimate[self.term];
        if amount == 0.0 {
            // A negative unconstrained estimate counts as at most one standard deviation (power-constrained limits: G.
            // Cowan et al., arXiv:1105.3166).
            let observed = own.pull.max(-own.deviation).min(0.0);
            return (0.0, self.high(observed, own));
        }
        if own.deviation < SMALL * amount {
            let half_width = NORMAL_975 as f32 * own.deviation;
            return (amount - half_width, amount + half_width);
        }
        (self.low(amount, own), self.high(amount, own))
    }

    /// The value under which the observed estimate is the 97.5 % quantile; 0 if there is none.
    fn low(&mut self, observed: f32, own: &Scatter) -> f32 {
        let smallest = SMALLEST * observed;
        let excess = self.quantile(smallest, true) - observed;
        if excess >= 0.0 {
            return 0.0;
        }
        self.root(true, observed, (smallest, excess), (observed, own.quantile::<T>(true)))
    }

    /// The value under which the observed estimate is the 2.5 % quantile.
    fn high(&mut self, observed: f32, own: &Scatter) -> f32 {
        let distance = -own.quantile::<T>(false);
        let further = observed + 1.5 * distance;
        let excess = self.quantile(further, false) - observed;
        self.root(false, observed, (observed, -distance), (further, excess))
    }

    /// The value under which this quantile of the estimate is the observed one, by the secant method.
    fn root(&mut self, upper: bool, observed: f32, mut a: (f32, f32), mut b: (f32, f32)) -> f32 {
        for _ in 0..SEARCH_ROUNDS {
            let slope = ((b.1 - a.1) / (b.0 - a.0)).max(0.02);
            let next = (b.0 - b.1 / slope).max(0.0);
            if absf(next - b.0) < 0.01 * absf(next - observed) {
                return next;
            }
            (a, b) = (b, (next, self.quantile(next, upper) - observed));
        }
        b.0
    }

    /// This quantile of the estimate if the true amount is `value` and the other amounts are fitted to it.
    fn quantile(&mut self, value: f32, upper: bool) -> f32 {
        let change = value - self.estimate[self.term];
        for (other, entry) in self.problem.amounts.iter_mut().enumerate() {
            *entry = (self.estimate[other] + change * self.direction[other]).max(0.0);
        }
        self.problem.set_confidence(self.points);
        let scatter = scatter(self.points, self.problem, self.parameters, self.term);
        scatter.map_or(f32::NAN, |scatter| value + scatter.quantile::<T>(upper))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Curve;
    use crate::term::{AllTerms, NoiseTerm};

    /// Expected bounds use the χ² quantiles 9.591 and 74.22 (Abramowitz and Stegun, table 26.8); a random walk of K = 1
    /// has the Allan variance (2n² + 1)/6n.
    #[test]
    fn no_amount_is_larger_than_the_upper_bound_of_a_point() {
        let curve = Curve::<4>::from_points(1.0, 1000, 4, &[(1, 1.0), (2, 0.5)]).expect("a curve");
        let mut points = Points::empty((&curve).into());
        points.fill::<AllTerms>();
        let mut problem = Problem::<AllTerms>::empty();
        problem.set_terms(&points, &[NoiseTerm::AngleRandomWalk, NoiseTerm::RateRandomWalk]);
        let of_point = |avar: f64, edf: f64, quantile: f64, share: f64| avar * edf / quantile / share;
        for (edf, expected) in
            [([20.0, 100.0], of_point(0.5, 100.0, 74.22, 0.75)), ([100.0, 20.0], of_point(0.5, 20.0, 9.591, 0.75))]
        {
            points.measured.iter_mut().zip(edf).for_each(|(point, edf)| point.edf = edf);
            let square = f64::from(largest(&points, &problem, 1)) * problem.units[1];
            assert!((square / expected - 1.0).abs() < 0.005, "{square}, {expected}");
        }
        // The bound of the shorter time is the smaller one.
        points.measured.truncate(1);
        let square = f64::from(largest(&points, &problem, 1)) * problem.units[1];
        assert!((square / of_point(1.0, 100.0, 74.22, 0.5) - 1.0).abs() < 0.005, "{square}");
        points.measured.clear();
        assert_eq!(largest(&points, &problem, 1), 0.0, "without a point");
    }
}
