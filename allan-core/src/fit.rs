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
pub(crate) use improvement::{Baseline, Rival};
pub(crate) use shape::Free;

use crate::model::Model;
use crate::{Curve, Kind};
use points::Points;
use problem::Problem;

const EDF_ROUNDS: usize = 4;

/// Fits the coefficients of `kinds` (the first [`MAX_TERMS`](crate::model::MAX_TERMS) of them, each once) to all points
/// of a curve; their shapes stay as they are given.
///
/// A curve without points, or of a channel that never changed, gives coefficients of 0.
#[must_use]
pub fn fit<const POINTS: usize>(curve: &Curve<POINTS>, kinds: &[Kind]) -> Model {
    fit_free_shapes(curve, kinds, Free::Nothing, &mut || true)
}

/// Whether `model`, which was fitted to `curve`, is enough to describe it.
#[must_use]
#[inline(never)] // so that its stack is not everybody's
pub fn goodness<const POINTS: usize>(curve: &Curve<POINTS>, model: &Model) -> Goodness {
    let (mut points, mut problem) = (Points::empty(), Problem::empty());
    points.take(curve);
    problem.take_model(&mut points, curve, model);
    goodness::judge(&points, &mut problem)
}

/// `Σ edf·(v/m − 1 − ln(v/m))` of `model`, which was fitted to `curve`.
#[inline(never)]
pub(crate) fn deviance<const POINTS: usize>(curve: &Curve<POINTS>, model: &Model) -> f64 {
    let (mut points, mut problem) = (Points::empty(), Problem::empty());
    points.take(curve);
    problem.take_model(&mut points, curve, model);
    problem.deviance(&points)
}

/// Fits the coefficients of `kinds` and also the shapes of those that have one, from the given ones on.
#[must_use]
pub fn fit_shapes<const POINTS: usize>(curve: &Curve<POINTS>, kinds: &[Kind]) -> Model {
    fit_free_shapes(curve, kinds, Free::AllBut(&[]), &mut || true)
}

/// As [`fit_shapes`], of those that are `free`.
#[inline(never)] // so that its stack is not everybody's
pub(crate) fn fit_free_shapes<const POINTS: usize>(
    curve: &Curve<POINTS>,
    kinds: &[Kind],
    free: Free,
    keep_on: &mut dyn FnMut() -> bool,
) -> Model {
    let (mut points, mut problem) = (Points::empty(), Problem::empty());
    points.take(curve);
    problem.take(&points, kinds);
    let searched = problem.kinds.iter().any(|kind| free.has(kind));
    problem.settle(&mut points, curve, if searched { 2 } else { EDF_ROUNDS });
    if searched {
        for _ in 0..2 {
            shape::search(&points, &mut problem, free, keep_on);
            problem.settle(&mut points, curve, 2);
        }
    }
    let mut model = problem.model(points.sample_period);
    bounds::set(&mut points, curve, &mut problem, &mut model);
    model
}
