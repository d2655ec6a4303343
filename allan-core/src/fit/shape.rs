//! The search for the shapes of terms: coordinate by coordinate in the logarithm, the coefficients following.

use super::problem::Problem;
use crate::Kind;
use crate::math::exp;
use crate::model::MAX_SHAPE;

const ROUNDS: usize = 12;
/// First step: a factor of about 1.2 each way.
const FIRST_STEP: f64 = 0.18;
const LAST_STEP: f64 = 2e-4;
/// Samples: neighbours that correlate more briefly do so behind a filter.
const SHORTEST: f64 = 1.5;

/// Moves the shapes of all `kinds` that have one and are not `fixed` to where the deviance is least, at the present weights.
pub(super) fn search(problem: &mut Problem, kinds: &mut [Kind], fixed: &[Kind]) {
    let mut deviance = problem.minimise();
    let mut free = [false; crate::model::MAX_TERMS];
    free.iter_mut().zip(kinds.iter()).for_each(|(free, kind)| *free = !fixed.contains(kind));
    let mut steps = [[FIRST_STEP; MAX_SHAPE]; crate::model::MAX_TERMS];
    for _ in 0..ROUNDS {
        for term in (0..kinds.len()).filter(|&term| free[term]) {
            for index in kinds[term].freedom() {
                deviance = walk(problem, kinds, (term, index), &mut steps[term][index], deviance);
            }
        }
        let settled = |(steps, kind): (&[f64; MAX_SHAPE], &Kind)| steps[kind.freedom()].iter().all(|&s| s < LAST_STEP);
        let moving = steps.iter().zip(kinds.iter()).zip(free).filter(|(_, free)| *free);
        if moving.map(|(term, _)| term).all(settled) {
            break;
        }
    }
}

/// Walks along one parameter: on while it goes down, then with a step of the size that the bow suggests.
fn walk(problem: &mut Problem, kinds: &mut [Kind], at: (usize, usize), step: &mut f64, mut deviance: f64) -> f64 {
    let (term, index) = at;
    for _ in 0..4 {
        let before = trial(problem, kinds[term], at, -*step);
        let after = trial(problem, kinds[term], at, *step);
        let (shift, least) = if before < after { (-*step, before) } else { (*step, after) };
        if least < deviance {
            kinds[term] = shifted(problem, kinds[term], index, shift);
            deviance = least;
            continue;
        }
        // The minimum is bracketed: go to the parabola's, and look closer next time.
        let curvature = before - 2.0 * deviance + after;
        let vertex = if curvature > 0.0 { 0.5 * *step * (before - after) / curvature } else { 0.0 };
        let there = trial(problem, kinds[term], at, vertex);
        if there < deviance {
            kinds[term] = shifted(problem, kinds[term], index, vertex);
            deviance = there;
        }
        *step /= 4.0;
        break;
    }
    problem.set_kind(term, kinds[term]);
    problem.minimise().min(deviance)
}

fn trial(problem: &mut Problem, kind: Kind, (term, index): (usize, usize), shift: f64) -> f64 {
    let kind = shifted(problem, kind, index, shift);
    problem.set_kind(term, kind);
    problem.minimise()
}

fn shifted(problem: &Problem, kind: Kind, index: usize, shift: f64) -> Kind {
    let mut shape = kind.shape().map(|(_, value)| value);
    shape[index] *= exp(shift);
    if let Kind::Markov(_) = kind {
        shape[index] = shape[index].max(SHORTEST * problem.sample_period);
    }
    kind.with_shape(shape)
}
