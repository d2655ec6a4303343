//! From a curve to coefficients: the non-negative fit of a gamma likelihood.
//!
//! An estimate of the Allan variance with `edf` degrees of freedom is gamma distributed around the true one, so the
//! coefficients minimise `Σ edf/2·(ln m + v/m)`. Fisher scoring turns that into a sequence of small non-negative
//! least-squares problems; the degrees of freedom follow the fitted mixture of noises, which is iterated too.
//! Parameters of a term's shape are searched for around it.

mod bounds;
mod goodness;
mod improvement;
pub(crate) mod least_squares;
mod parameter;
mod points;
mod problem;
mod shape;

pub use goodness::Goodness;
pub(crate) use improvement::Baseline;
pub(crate) use shape::Free;

use crate::model::Model;
use crate::{Curve, Kind};
pub(crate) use bounds::set as set_bounds;
use points::Points;
use problem::Problem;

const EDF_ROUNDS: usize = 4;

/// Fits the coefficients of `kinds` (the first [`MAX_TERMS`](crate::model::MAX_TERMS) of them, each once) to all points
/// of a curve; their shapes stay as they are given.
///
/// A curve without points, or of a channel that never changed, gives coefficients of 0.
#[must_use]
pub fn fit<const POINTS: usize>(curve: &Curve<POINTS>, kinds: &[Kind]) -> Model {
    let mut model = Model::new(0.0, []);
    estimate(curve, kinds, Free::Nothing, &mut || true, &mut model);
    set_bounds(curve, &mut model);
    model
}

/// Fits the coefficients of `kinds` and also the shapes of those that have one, from the given ones on.
#[must_use]
pub fn fit_shapes<const POINTS: usize>(curve: &Curve<POINTS>, kinds: &[Kind]) -> Model {
    let mut model = Model::new(0.0, []);
    estimate(curve, kinds, Free::AllBut(&[]), &mut || true, &mut model);
    set_bounds(curve, &mut model);
    model
}

/// Whether `model`, which was fitted to `curve`, is enough to describe it.
#[must_use]
#[inline(never)] // here and below: so that its stack is not everybody's
pub fn goodness<const POINTS: usize>(curve: &Curve<POINTS>, model: &Model) -> Goodness {
    let (mut points, mut problem) = (Points::empty(curve), Problem::empty());
    points.take();
    problem.take_model(&mut points, model);
    goodness::judge(&points, &mut problem)
}

/// `Σ edf·(v/m − 1 − ln(v/m))` of `model`, which was fitted to `curve`.
#[inline(never)]
pub(crate) fn deviance<const POINTS: usize>(curve: &Curve<POINTS>, model: &Model) -> f32 {
    let (mut points, mut problem) = (Points::empty(curve), Problem::empty());
    points.take();
    problem.take_model(&mut points, model);
    problem.deviance(&points)
}

/// Coefficients of `kinds`, and the shapes of those that are `free`, without bounds: into `model`.
#[inline(never)]
pub(crate) fn estimate<const POINTS: usize>(
    curve: &Curve<POINTS>,
    kinds: &[Kind],
    free: Free,
    keep_on: &mut dyn FnMut() -> bool,
    model: &mut Model,
) {
    let (mut points, mut problem) = (Points::empty(curve), Problem::empty());
    points.take();
    problem.take(&points, kinds);
    let searched = problem.kinds.iter().any(|kind| free.has(kind));
    problem.settle(&mut points, if searched { 2 } else { EDF_ROUNDS });
    if searched {
        for _ in 0..2 {
            shape::search(&points, &mut problem, free, keep_on);
            problem.settle(&mut points, 2);
        }
    }
    model.set(curve.sample_period(), problem.terms());
}
