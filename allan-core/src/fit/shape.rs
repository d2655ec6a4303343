//! Shape parameters of terms: which are free, derivatives to them, and a coordinate search for their best values in the
//! logarithm.

use super::likelihood::{MAX_PARAMETERS, MAX_POINTS, Points, Problem};
use crate::math::{absf, exp, sqrtf};
use crate::model::{MAX_TERMS, filter_of};
use crate::term::{MAX_SHAPE, NoiseTerm, TermSet};
use heapless::Vec;

const ROUNDS: usize = 12;
/// First step in the logarithm: a factor of about 1.2.
const FIRST_STEP: f64 = 0.18;
/// Step, relative to the parameter, below which it counts as converged.
const LAST_STEP: f64 = 2e-4;
/// Sum of the rises of the deviance on both sides below which its shape counts as a parabola.
const NEAR: f32 = 2.0;
/// Smallest decrease of the deviance in a round that makes another one worthwhile.
const WORTHWHILE: f32 = 0.01;
/// Lower limit of a Markov correlation time, in samples.
const SHORTEST: f64 = 1.5;

/// The shape parameters that a fit adjusts.
#[derive(Debug, Clone, Copy)]
pub(crate) enum FreeShapes<'a> {
    None,
    /// All except the shapes of the sinusoids and filters in this list, which are known from elsewhere.
    AllExcept(&'a [NoiseTerm]),
}

impl FreeShapes<'_> {
    pub(super) fn has<T: TermSet>(self, kind: &NoiseTerm) -> bool {
        let can_be_known = matches!(kind, NoiseTerm::Sinusoid(_) | NoiseTerm::Filtered(_) | NoiseTerm::LowPass(_));
        let is_fixed = |known: &[NoiseTerm]| can_be_known && known.contains(kind);
        !T::free_parameters(kind).is_empty() && matches!(self, Self::AllExcept(known) if !is_fixed(known))
    }
}

/// Sets all free shapes to those with the least deviance, and returns it; ends if `keep_on` returns false.
#[inline(never)]
pub(super) fn search<T: TermSet>(
    points: &Points,
    problem: &mut Problem<T>,
    free: FreeShapes,
    keep_on: &mut dyn FnMut() -> bool,
) -> f32 {
    let mut deviance = problem.minimise(points);
    // Known lines are recognised by their frequency, so this precedes any change of shape.
    let mut is_free = [false; MAX_TERMS];
    is_free.iter_mut().zip(&problem.kinds).for_each(|(is_free, kind)| *is_free = free.has::<T>(kind));
    let mut steps = [[FIRST_STEP; MAX_SHAPE]; MAX_TERMS];
    for _ in 0..ROUNDS {
        let (before, mut bracketed) = (deviance, true);
        for term in (0..problem.kinds.len()).filter(|&term| is_free[term]) {
            for index in T::free_parameters(&problem.kinds[term]) {
                if !keep_on() {
                    return deviance;
                }
                let near;
                (deviance, near) = line_search(points, problem, (term, index), &mut steps[term][index], deviance);
                bracketed &= near;
            }
        }
        if bracketed && before - deviance < WORTHWHILE {
            break;
        }
    }
    deviance
}

/// Steps along a parameter, then to the vertex of a parabola; returns the deviance, and true if the minimum is known.
fn line_search<T: TermSet>(
    points: &Points,
    problem: &mut Problem<T>,
    (term, index): (usize, usize),
    step: &mut f64,
    mut deviance: f32,
) -> (f32, bool) {
    let mut here = problem.kinds[term];
    let mut near = false;
    let shifted = |kind, shift| shifted(kind, index, shift, points.curve.sample_period());
    for _ in 0..4 {
        let mut trial = |shift| {
            problem.set_kind(points, term, shifted(here, shift));
            problem.minimise(points)
        };
        let before = trial(-*step);
        let after = trial(*step);
        let (shift, least) = if before < after { (-*step, before) } else { (*step, after) };
        if least < deviance {
            here = shifted(here, shift);
            deviance = least;
            continue;
        }
        // The minimum is bracketed: go to the parabola's vertex, and take smaller steps next time.
        let curvature = before - 2.0 * deviance + after;
        let vertex = if curvature > 0.0 { 0.5 * *step * f64::from((before - after) / curvature) } else { 0.0 };
        let there = trial(vertex);
        let predicted = deviance - 0.5 * curvature * (vertex / *step * vertex / *step) as f32;
        near = *step < LAST_STEP || (curvature < NEAR && absf(there - predicted) < WORTHWHILE);
        if there < deviance {
            here = shifted(here, vertex);
            deviance = there;
        }
        if !near {
            *step /= 4.0;
        }
        break;
    }
    if problem.kinds[term] != here {
        problem.set_kind(points, term, here);
        deviance = problem.minimise(points).min(deviance);
    }
    (deviance, near)
}

/// The term with one shape parameter multiplied by `exp(shift)`.
fn shifted(kind: NoiseTerm, index: usize, shift: f64, sample_period: f64) -> NoiseTerm {
    let mut shape = kind.shape().values();
    shape[index] *= exp(shift);
    if let NoiseTerm::Markov(_) = kind {
        shape[index] = shape[index].max(SHORTEST * sample_period);
    }
    kind.with_shape(shape)
}

/// Relative step of the numerical derivative to a shape's parameter.
const STEP: f64 = 1e-3;
/// Relative length of the remainder of a direction that rounding can produce.
const ROUNDING: f32 = 1e-4;

/// The parameter to which a column of derivatives belongs.
#[derive(Debug, Clone, Copy)]
pub(super) enum Parameter {
    Amount(usize),
    /// The logarithm of a shape parameter of a term, by its index.
    Shape(usize, usize),
}

impl<T: TermSet> Problem<T> {
    /// Sets the columns of all amounts and of `free` shapes with a positive amount, and lists their parameters.
    #[inline(never)]
    pub(super) fn differentiate(&mut self, points: &Points, free: FreeShapes) -> Vec<Parameter, MAX_PARAMETERS> {
        let mut parameters: Vec<_, MAX_PARAMETERS> = (0..self.kinds.len()).map(Parameter::Amount).collect();
        let is_free = |(term, kind): &(usize, &NoiseTerm)| self.amounts[*term] > 0.0 && free.has::<T>(kind);
        for (term, kind) in self.kinds.iter().enumerate().filter(is_free) {
            // Noise behind a filter hardly changes with its decimation.
            let (square, filter) = (self.square(term), filter_of(&self.kinds));
            for index in T::free_parameters(kind) {
                let Some(column) = self.columns.get_mut(parameters.len()) else { return parameters };
                for (entry, point) in column.iter_mut().zip(points.all()) {
                    let at = |factor: f64| {
                        let mut shape = kind.shape().values();
                        shape[index] *= factor;
                        T::avar(&kind.with_shape(shape), filter.as_ref(), point.n, points.curve.sample_period())
                    };
                    *entry = (square * (at(1.0 + STEP) - at(1.0 - STEP)) / (2.0 * STEP) / point.avar) as f32;
                }
                // There is as much room as there are columns.
                let _ = parameters.push(Parameter::Shape(term, index));
            }
        }
        parameters
    }

    /// Replaces the first columns by an orthonormal basis of their directions, and returns its size.
    #[inline(never)]
    pub(super) fn orthonormal(&mut self, points: &Points) -> usize {
        let parameters = self.differentiate(points, FreeShapes::AllExcept(&[]));
        let mut scale = [0.0; MAX_POINTS];
        for (at, (scale, point)) in scale.iter_mut().zip(&points.measured).enumerate() {
            *scale = sqrtf(point.edf / 2.0) / self.modelled(at, &self.amounts);
        }
        let is_present = |parameter: &Parameter| match *parameter {
            Parameter::Amount(term) | Parameter::Shape(term, _) => self.amounts[term] > 0.0,
        };
        let mut count = 0;
        for column in (0..parameters.len()).filter(|&column| is_present(&parameters[column])) {
            let (known, rest) = self.columns.split_at_mut(column);
            let Some(direction) = rest.first_mut() else { break };
            direction.iter_mut().zip(&scale).for_each(|(entry, scale)| *entry *= scale);
            // The direction is normalised first, so that one threshold holds for all remainders.
            if !normalise(direction, 0.0) {
                continue;
            }
            for known in known.iter().take(count) {
                remove_component(direction, known);
            }
            if normalise(direction, ROUNDING) {
                self.columns.swap(count, column);
                count += 1;
            }
        }
        count
    }
}

/// Normalises a vector; false if its length was not above `least`.
fn normalise(direction: &mut [f32], least: f32) -> bool {
    let length = sqrtf(direction.iter().map(|entry| entry * entry).sum());
    direction.iter_mut().for_each(|entry| *entry /= length);
    length > least
}

/// Removes the component of a vector along a direction of length 1.
pub(super) fn remove_component(vector: &mut [f32], direction: &[f32]) {
    let along: f32 = vector.iter().zip(direction).map(|(a, b)| a * b).sum();
    vector.iter_mut().zip(direction).for_each(|(entry, known)| *entry -= along * known);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Curve;
    use crate::fit::likelihood::Points;
    use crate::term::{AllTerms, Markov, Resonance};

    const SAMPLES: u64 = 1 << 17;
    const MARKOV: NoiseTerm = NoiseTerm::Markov(Markov { time_constant: 8.0 });

    /// Allan variance at 1 Hz of white noise and of a process of variance 4 and correlation `exp(−k/time_constant)`.
    fn avar(n: u64, time_constant: f64) -> f64 {
        let weight = |at: u64| if at < n { -1.0 } else { 1.0 };
        let pairs = |lag: u64| (0..2 * n - lag).map(|at| weight(at) * weight(at + lag)).sum::<f64>();
        let covariance = |lag: u64| 4.0 * (-(lag as f64) / time_constant).exp();
        let markov = covariance(0) * pairs(0) + (1..2 * n).map(|lag| 2.0 * covariance(lag) * pairs(lag)).sum::<f64>();
        1.0 / n as f64 + markov / (2.0 * (n * n) as f64)
    }

    fn curve(time_constant: f64) -> Curve<12> {
        let table: std::vec::Vec<(u64, f64)> =
            (0..9).map(|octave| (1 << octave, avar(1 << octave, time_constant))).collect();
        Curve::from_points(1.0, SAMPLES, 4, &table).expect("a curve")
    }

    fn points(curve: &Curve<12>) -> Points<'_> {
        let mut points = Points::empty(curve.into());
        points.fill::<AllTerms>();
        points
    }

    /// The search starts at a sixth and at six times the true time constant.
    #[test]
    fn the_search_ends_at_the_time_constant_of_the_curve() {
        let curve = curve(20.0);
        let points = points(&curve);
        for start in [20.0 / 6.0, 6.0 * 20.0] {
            let mut problem = Problem::<AllTerms>::empty();
            let from = NoiseTerm::Markov(Markov { time_constant: start });
            problem.set_terms(&points, &[NoiseTerm::AngleRandomWalk, from]);
            let begun = problem.minimise(&points);
            assert_eq!(begun, problem.deviance(&points), "the deviance of the amounts that are set");
            let mut steps = 0;
            let mut count = || {
                steps += 1;
                true
            };
            let deviance = search(&points, &mut problem, FreeShapes::AllExcept(&[]), &mut count);
            let NoiseTerm::Markov(Markov { time_constant }) = problem.kinds[1] else { panic!("{:?}", problem.kinds) };
            // One standard deviation of the time constant, about 1 % with 131,072 samples, raises the deviance by 1.
            assert!((time_constant / 20.0 - 1.0).abs() < 2e-3, "{start}: {time_constant}");
            assert!(deviance < 0.1 && begun > 100.0, "{begun} {deviance}");
            assert_eq!(deviance, problem.deviance(&points));
            assert!(steps <= 5, "{steps} steps");
        }
    }

    #[test]
    fn a_search_that_is_ended_or_has_no_free_shape_keeps_the_shapes() {
        let curve = curve(20.0);
        let points = points(&curve);
        for (free, keep_on) in [(FreeShapes::None, true), (FreeShapes::AllExcept(&[]), false)] {
            let mut problem = Problem::<AllTerms>::empty();
            problem.set_terms(&points, &[NoiseTerm::AngleRandomWalk, MARKOV]);
            let deviance = search(&points, &mut problem, free, &mut || keep_on);
            assert_eq!(problem.kinds[1], MARKOV);
            assert_eq!(deviance, problem.deviance(&points));
        }
    }

    /// The reference sums over all pairs of samples. One of the three terms is absent.
    #[test]
    fn the_derivatives_are_those_of_the_variance_to_the_amounts_and_to_the_free_shapes_of_present_terms() {
        let curve = curve(8.0);
        let points = points(&curve);
        let absent = NoiseTerm::Resonance(Resonance { frequency: 0.1, bandwidth: 0.01 });
        let mut problem = Problem::<AllTerms>::empty();
        problem.set_terms(&points, &[NoiseTerm::AngleRandomWalk, MARKOV, absent]);
        problem.amounts = [0.0; MAX_TERMS];
        (problem.amounts[0], problem.amounts[1]) = ((1.0 / problem.units[0]) as f32, (4.0 / problem.units[1]) as f32);
        let fixed = problem.differentiate(&points, FreeShapes::None);
        assert!(matches!(fixed.as_slice(), [Parameter::Amount(0), Parameter::Amount(1), Parameter::Amount(2)]));
        let parameters = problem.differentiate(&points, FreeShapes::AllExcept(&[]));
        assert!(matches!(parameters[3..], [Parameter::Shape(1, 0)]), "{parameters:?}");
        for (at, point) in points.all().enumerate() {
            let step: f64 = 1e-4;
            let [low, high] = [-step, step].map(|step| avar(point.n, 8.0 * step.exp()));
            let expected = (high - low) / (2.0 * step) / point.avar;
            let found = f64::from(problem.columns[3][at]);
            assert!((found - expected).abs() < 1e-4 * expected.abs() + 1e-6, "{}: {found}, {expected}", point.n);
        }
    }

    #[test]
    fn the_directions_of_present_terms_are_orthonormal() {
        let curve = curve(8.0);
        let points = points(&curve);
        let mut problem = Problem::<AllTerms>::empty();
        problem.set_terms(&points, &[NoiseTerm::AngleRandomWalk, NoiseTerm::RateRandomWalk, MARKOV]);
        problem.amounts = [0.0; MAX_TERMS];
        (problem.amounts[0], problem.amounts[2]) = ((1.0 / problem.units[0]) as f32, (4.0 / problem.units[2]) as f32);
        let count = problem.orthonormal(&points);
        assert_eq!(count, 3);
        let product = |a: usize, b: usize| -> f32 {
            problem.columns[a].iter().zip(&problem.columns[b]).map(|(a, b)| a * b).sum()
        };
        for a in 0..count {
            for b in 0..=a {
                let expected = if a == b { 1.0 } else { 0.0 };
                assert!((product(a, b) - expected).abs() < 1e-4, "{a} {b}: {}", product(a, b));
            }
        }
    }

    #[test]
    fn a_vector_without_length_has_no_direction() {
        let mut direction = [3.0, 4.0];
        assert!(normalise(&mut direction, 0.0));
        assert_eq!(direction, [0.6, 0.8]);
        assert!(!normalise(&mut [0.0, 0.0], 0.0));
    }
}
