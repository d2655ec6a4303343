//! The search for the shapes of terms: coordinate by coordinate in the logarithm, the coefficients following.

use super::points::Points;
use super::problem::Problem;
use crate::Kind;
use crate::math::exp;
use crate::model::{MAX_SHAPE, MAX_TERMS};

const ROUNDS: usize = 12;
/// First step: a factor of about 1.2 each way.
const FIRST_STEP: f64 = 0.18;
const LAST_STEP: f64 = 2e-4;
/// Samples: neighbours that correlate more briefly do so behind a filter.
const SHORTEST: f64 = 1.5;

/// Which shapes are searched for.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Free<'a> {
    /// None of them.
    Nothing,
    /// All but those of the sinusoids among these, which something better than a curve has told.
    AllBut(&'a [Kind]),
}

impl Free<'_> {
    pub(super) fn has(self, kind: &Kind) -> bool {
        let told = |known: &[Kind]| matches!(kind, Kind::Sinusoid(_)) && known.contains(kind);
        !kind.freedom().is_empty() && matches!(self, Self::AllBut(known) if !told(known))
    }
}

/// Moves the shapes of all terms that are free to where the deviance is least, at the present weights.
///
/// Stops where it is as soon as `keep_on`, which is asked before every step, says no.
#[inline(never)]
pub(super) fn search<const POINTS: usize>(
    points: &Points<POINTS>,
    problem: &mut Problem<POINTS>,
    free: Free,
    keep_on: &mut dyn FnMut() -> bool,
) {
    let mut deviance = problem.minimise(points);
    // Decided before any of them moves.
    let mut moving = [false; MAX_TERMS];
    moving.iter_mut().zip(&problem.kinds).for_each(|(moving, kind)| *moving = free.has(kind));
    let mut steps = [[FIRST_STEP; MAX_SHAPE]; MAX_TERMS];
    for _ in 0..ROUNDS {
        for term in (0..problem.kinds.len()).filter(|&term| moving[term]) {
            for index in problem.kinds[term].freedom() {
                if !keep_on() {
                    return;
                }
                deviance = walk(points, problem, (term, index), &mut steps[term][index], deviance);
            }
        }
        let settled = |term: usize| steps[term][problem.kinds[term].freedom()].iter().all(|&step| step < LAST_STEP);
        if (0..problem.kinds.len()).filter(|&term| moving[term]).all(settled) {
            break;
        }
    }
}

/// Walks along one parameter: on while it goes down, then with a step of the size that the bow suggests.
fn walk<const POINTS: usize>(
    points: &Points<POINTS>,
    problem: &mut Problem<POINTS>,
    at: (usize, usize),
    step: &mut f64,
    mut deviance: f64,
) -> f64 {
    let (term, index) = at;
    let mut here = problem.kinds[term];
    let shifted = |kind, shift| shifted(kind, index, shift, points.sample_period);
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
        // The minimum is bracketed: go to the parabola's, and look closer next time.
        let curvature = before - 2.0 * deviance + after;
        let vertex = if curvature > 0.0 { 0.5 * *step * (before - after) / curvature } else { 0.0 };
        let there = trial(vertex);
        if there < deviance {
            here = shifted(here, vertex);
            deviance = there;
        }
        *step /= 4.0;
        break;
    }
    problem.set_kind(points, term, here);
    problem.minimise(points).min(deviance)
}

fn shifted(kind: Kind, index: usize, shift: f64, sample_period: f64) -> Kind {
    let mut shape = kind.shape().map(|(_, value)| value);
    shape[index] *= exp(shift);
    if let Kind::Markov(_) = kind {
        shape[index] = shape[index].max(SHORTEST * sample_period);
    }
    kind.with_shape(shape)
}
