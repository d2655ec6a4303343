//! The search for the shapes of terms: coordinate by coordinate in the logarithm, the coefficients following.

use super::points::Points;
use super::problem::Problem;
use crate::Kind;
use crate::math::{absf, exp};
use crate::model::{MAX_SHAPE, MAX_TERMS};

const ROUNDS: usize = 12;
/// First step: a factor of about 1.2 each way.
const FIRST_STEP: f64 = 0.18;
/// Steps shorter than this, relative to the parameter, are taken for none.
const LAST_STEP: f64 = 2e-4;
/// Rise of the deviance on both sides together up to which a parabola holds: a step of a standard deviation.
const NEAR: f32 = 2.0;
/// What a round has to gain for another one to be worth while: a tenth of a standard deviation.
const WORTH_WHILE: f32 = 0.01;
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

/// Moves the shapes of all terms that are free to where the deviance is least, at the present weights, and returns it.
///
/// Stops where it is as soon as `keep_on`, which is asked before every step, says no.
#[inline(never)]
pub(super) fn search<const POINTS: usize>(
    points: &Points<POINTS>,
    problem: &mut Problem<POINTS>,
    free: Free,
    keep_on: &mut dyn FnMut() -> bool,
) -> f32 {
    let mut deviance = problem.minimise(points);
    // Decided before any of them moves.
    let mut moving = [false; MAX_TERMS];
    moving.iter_mut().zip(&problem.kinds).for_each(|(moving, kind)| *moving = free.has(kind));
    let mut steps = [[FIRST_STEP; MAX_SHAPE]; MAX_TERMS];
    for _ in 0..ROUNDS {
        let (before, mut bracketed) = (deviance, true);
        for term in (0..problem.kinds.len()).filter(|&term| moving[term]) {
            for index in problem.kinds[term].freedom() {
                if !keep_on() {
                    return deviance;
                }
                let near;
                (deviance, near) = walk(points, problem, (term, index), &mut steps[term][index], deviance);
                bracketed &= near;
            }
        }
        if bracketed && before - deviance < WORTH_WHILE {
            break;
        }
    }
    deviance
}

/// Walks along one parameter: on while it goes down, then with a step of the size that the bow suggests. Returns the
/// deviance, and whether the minimum is known to a fraction of its uncertainty.
fn walk<const POINTS: usize>(
    points: &Points<POINTS>,
    problem: &mut Problem<POINTS>,
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
        // The minimum is bracketed: go to the parabola's, and look closer next time.
        let curvature = before - 2.0 * deviance + after;
        let vertex = if curvature > 0.0 { 0.5 * *step * f64::from((before - after) / curvature) } else { 0.0 };
        let there = trial(vertex);
        let foretold = deviance - 0.5 * curvature * (vertex / *step * vertex / *step) as f32;
        near = *step < LAST_STEP || (curvature < NEAR && absf(there - foretold) < WORTH_WHILE);
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

fn shifted(kind: Kind, index: usize, shift: f64, sample_period: f64) -> Kind {
    let mut shape = kind.shape().map(|(_, value)| value);
    shape[index] *= exp(shift);
    if let Kind::Markov(_) = kind {
        shape[index] = shape[index].max(SHORTEST * sample_period);
    }
    kind.with_shape(shape)
}
