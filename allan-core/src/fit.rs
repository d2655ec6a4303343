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
mod problem;
mod shape;

pub use goodness::Goodness;
pub(crate) use improvement::{Baseline, Rival};

use crate::model::{MAX_TERMS, Model};
use crate::{Curve, Kind};
use heapless::Vec;
use problem::Problem;

const EDF_ROUNDS: usize = 4;

/// Fits the coefficients of `kinds` (the first [`MAX_TERMS`] of them, each once) to all points of a curve; their
/// shapes stay as they are given.
///
/// A curve without points, or of a channel that never changed, gives coefficients of 0.
#[must_use]
pub fn fit<const POINTS: usize>(curve: &Curve<POINTS>, kinds: &[Kind]) -> Model {
    let mut problem = Problem::new(curve, kinds);
    let mut model = problem.settle(curve, EDF_ROUNDS);
    bounds::set(&problem, &mut model);
    model
}

/// Whether `model`, which was fitted to `curve`, is enough to describe it.
#[must_use]
pub fn goodness<const POINTS: usize>(curve: &Curve<POINTS>, model: &Model) -> Goodness {
    goodness::judge(&Problem::of(curve, model))
}

/// `Σ edf·(v/m − 1 − ln(v/m))` of `model`, which was fitted to `curve`.
pub(crate) fn deviance<const POINTS: usize>(curve: &Curve<POINTS>, model: &Model) -> f64 {
    let problem = Problem::of(curve, model);
    problem.deviance(&problem.squares)
}

/// Fits the coefficients of `kinds` and also the shapes of those that have one, from the given ones on.
#[must_use]
pub fn fit_shapes<const POINTS: usize>(curve: &Curve<POINTS>, kinds: &[Kind]) -> Model {
    fit_free_shapes(curve, kinds, &[])
}

/// As [`fit_shapes`], leaving those of `kinds` that are `fixed` as they are.
pub(crate) fn fit_free_shapes<const POINTS: usize>(curve: &Curve<POINTS>, kinds: &[Kind], fixed: &[Kind]) -> Model {
    let mut kinds: Vec<Kind, MAX_TERMS> = kinds.iter().copied().take(MAX_TERMS).collect();
    let mut problem = Problem::new(curve, &kinds);
    let mut model = problem.settle(curve, 2);
    if kinds.iter().any(|kind| !kind.freedom().is_empty()) {
        for _ in 0..2 {
            shape::search(&mut problem, &mut kinds, fixed);
            model = problem.settle(curve, 2);
        }
    }
    bounds::set(&problem, &mut model);
    model
}
