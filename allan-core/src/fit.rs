//! From a curve to the coefficients of a model: the maximum of a gamma likelihood over non-negative coefficients.
//!
//! An estimate `v` with `edf` degrees of freedom is gamma distributed around the variance `m`, so the coefficients
//! minimise `Σ edf/2·(ln m + v/m)`, by Fisher scoring. Degrees of freedom and coefficients are computed in turn, and
//! shape parameters searched around them.

mod bounds;
pub(crate) mod least_squares;
mod likelihood;
mod shape;

pub use likelihood::MAX_POINTS;
pub(crate) use shape::FreeShapes;

use crate::confidence::chi_square_upper_tail;
use crate::curve::CurveView;
use crate::math::{lnf, sqrtf};
use crate::model::{MAX_TERMS, Model};
use crate::term::{AllTerms, NoiseTerm, PowerLawTerms, TermSet};
use heapless::Vec;
use likelihood::{MAX_PARAMETERS, Measured, Points, Problem, correlation};
use shape::remove_component;

/// Number of alternations between coefficients and degrees of freedom.
const EDF_ROUNDS: usize = 4;

/// Fits the coefficients of `kinds` to all points of a curve; shape parameters stay as given.
///
/// The first [`MAX_TERMS`] of `kinds` are used, each of which must occur once. Coefficients are in the unit of the
/// curve (see [`NoiseTerm::unit`]), with 95 % bounds. They maximise the gamma likelihood of the [module](self). A curve
/// without points, or of a channel that never changed, gives coefficients of 0. Only the octaves of a
/// curve with more than [`MAX_POINTS`] points are used.
///
/// # Cost
/// | `fit::fit` | Cortex-M4F | Cortex-M0+ |
/// |---|---|---|
/// | instructions | 30 million | 120 million |
/// | stack, bytes | 7,010 | 6,960 |
/// | flash, bytes | 42,400 | — |
///
/// See [`guide::costs`](crate::guide::costs) for how they are counted.
#[must_use]
pub fn fit<'a>(curve: impl Into<CurveView<'a>>, kinds: &[NoiseTerm]) -> Model {
    fit_of::<AllTerms>(curve.into(), kinds)
}

/// Fits as [`fit`] does, but only power laws (Q, N, B, K and R): other `kinds` are left out, and their code is not
/// linked.
///
/// The coefficients are those of [`fit`] to about four digits, and the bounds differ by up to 3 % of their distance to
/// the coefficient.
///
/// # Cost
/// | `fit::fit_power_laws` | Cortex-M4F | Cortex-M0+ |
/// |---|---|---|
/// | instructions | 7.5 million | 60.4 million |
/// | stack, bytes | 6,620 | 6,480 |
/// | flash, bytes | 14,900 | — |
///
/// See [`guide::costs`](crate::guide::costs) for how they are counted.
#[must_use]
pub fn fit_power_laws<'a>(curve: impl Into<CurveView<'a>>, kinds: &[NoiseTerm]) -> Model {
    fit_of::<PowerLawTerms>(curve.into(), kinds)
}

fn fit_of<T: TermSet>(curve: CurveView, kinds: &[NoiseTerm]) -> Model {
    let mut model = Model::new(0.0, []);
    estimate::<T>(curve, kinds, FreeShapes::None, &mut || true, &mut model);
    bounds::set::<T>(curve, &mut model);
    model
}

/// Fits the coefficients of `kinds` as [`fit`] does, and their shape parameters in s and Hz ([`NoiseTerm::shape`]),
/// starting from the given ones.
///
/// # Cost
/// | `fit::fit_shapes` | Cortex-M4F | Cortex-M0+ |
/// |---|---|---|
/// | instructions | 77.9 million | 284 million |
/// | stack, bytes | 7,120 | 7,010 |
/// | flash, bytes | 42,400 | — |
///
/// See [`guide::costs`](crate::guide::costs) for how they are counted.
#[must_use]
pub fn fit_shapes<'a>(curve: impl Into<CurveView<'a>>, kinds: &[NoiseTerm]) -> Model {
    let curve = curve.into();
    let mut model = Model::new(0.0, []);
    estimate::<AllTerms>(curve, kinds, FreeShapes::AllExcept(&[]), &mut || true, &mut model);
    set_bounds(curve, &mut model);
    model
}

pub(crate) fn set_bounds(curve: CurveView, model: &mut Model) {
    bounds::set::<AllTerms>(curve, model);
}

/// Sets the bounds of `model`, which was fitted to `curve`; shapes that are not `free` count as exactly known.
#[cfg(feature = "host")]
pub(crate) fn set_free_bounds(curve: CurveView, model: &mut Model, free: FreeShapes) {
    bounds::set_free::<AllTerms>(curve, model, free);
}

/// Tests whether `model`, which was fitted to `curve`, describes it within its uncertainty: the [`Goodness`] of the
/// fit.
///
/// # Cost
/// | `fit::goodness` | Cortex-M4F | Cortex-M0+ |
/// |---|---|---|
/// | instructions | 2.9 million | 12.8 million |
/// | stack, bytes | 5,120 | 4,990 |
/// | flash, bytes | 35,200 | — |
///
/// See [`guide::costs`](crate::guide::costs) for how they are counted.
#[must_use]
pub fn goodness<'a>(curve: impl Into<CurveView<'a>>, model: &Model) -> Goodness {
    goodness_in(curve.into(), model)
}

#[inline(never)] // here and below: the stack frame would otherwise be part of every caller's
fn goodness_in(curve: CurveView, model: &Model) -> Goodness {
    let (mut points, mut problem) = (Points::empty(curve), Problem::<AllTerms>::empty());
    points.fill::<AllTerms>();
    problem.fill_from_model(&mut points, model);
    goodness_of(&points, &mut problem)
}

/// `Σ edf·(v/m − 1 − ln(v/m))` of `model`, which was fitted to `curve`.
#[inline(never)]
pub(crate) fn deviance(curve: CurveView, model: &Model) -> f32 {
    let (mut points, mut problem) = (Points::empty(curve), Problem::<AllTerms>::empty());
    points.fill::<AllTerms>();
    problem.fill_from_model(&mut points, model);
    problem.deviance(&points)
}

/// Sets `model` to the fitted coefficients of `kinds` and the shapes of `free` ones; ends if `keep_on` returns false.
#[inline(never)]
pub(crate) fn estimate<T: TermSet>(
    curve: CurveView,
    kinds: &[NoiseTerm],
    free: FreeShapes,
    keep_on: &mut dyn FnMut() -> bool,
    model: &mut Model,
) {
    let (mut points, mut problem) = (Points::empty(curve), Problem::<T>::empty());
    points.fill::<T>();
    problem.set_terms(&points, kinds);
    let searched = problem.kinds.iter().any(|kind| free.has::<T>(kind));
    problem.fit_with_confidence(&mut points, if searched { 2 } else { EDF_ROUNDS });
    if searched {
        for _ in 0..2 {
            shape::search(&points, &mut problem, free, keep_on);
            problem.fit_with_confidence(&mut points, 2);
        }
    }
    model.set(curve.sample_period(), problem.terms());
}

/// The goodness of a fit: how well a model describes the curve that it was fitted to.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub struct Goodness {
    /// `Σ edf·(v/m − 1 − ln(v/m))` over all points, 0 or more.
    pub deviance: f64,
    /// Probability, 0 to 1, of a deviance at least this large if the model is correct. It is computed from a scaled χ²
    /// distribution (F. Satterthwaite, Biometrics 2, 1946).
    pub p_value: f64,
}

/// Goodness of the fitted `problem`, whose columns are overwritten.
///
/// The deviance is that of correlated normal residuals: a scaled χ² with the same mean and variance (F. Satterthwaite,
/// Biometrics 2, 1946).
fn goodness_of(points: &Points, problem: &mut Problem<AllTerms>) -> Goodness {
    let deviance = f64::from(problem.deviance(points));
    let count = problem.orthonormal(points);
    let (mean, square) = traces(&points.measured, &problem.columns[..count]);
    let (mean, square) = (f64::from(mean), f64::from(square));
    let dof = mean * mean / square;
    let p_value = if mean > 1e-5 { chi_square_upper_tail(deviance * mean / square, dof) } else { 1.0 };
    Goodness { deviance, p_value }
}

/// The traces of `PR` and `(PR)²` for the correlations `R` and the projection `P = 1 − Σ ddᵀ` off the directions `d`.
#[inline(never)]
fn traces(measured: &[Measured], directions: &[[f32; MAX_POINTS]]) -> (f32, f32) {
    let (mut mean, mut square) = (0.0, 0.0);
    let mut between = [[0.0; MAX_PARAMETERS]; MAX_PARAMETERS];
    for (i, a) in measured.iter().enumerate() {
        let mut product = [0.0; MAX_PARAMETERS];
        for (j, b) in measured.iter().enumerate() {
            let entry = correlation(a, b);
            mean += if i == j { entry } else { 0.0 };
            square += entry * entry;
            product.iter_mut().zip(directions).for_each(|(sum, direction)| *sum += entry * direction[j]);
        }
        for (row, direction) in between.iter_mut().zip(directions) {
            row.iter_mut().zip(product).for_each(|(entry, sum)| *entry += direction[i] * sum);
        }
        square -= 2.0 * product.iter().map(|entry| entry * entry).sum::<f32>();
    }
    for (i, row) in between.iter().enumerate() {
        mean -= row[i];
        square += row.iter().map(|entry| entry * entry).sum::<f32>();
    }
    (mean, square)
}

/// A fitted model that other sets of terms are compared with, at its degrees of freedom.
pub(crate) struct Baseline<'a> {
    points: Points<'a>,
    pub(crate) deviance: f32,
    modelled: [f32; MAX_POINTS],
    /// Number of orthonormal directions of its own parameters in `explained`.
    directions: usize,
    explained: [[f32; MAX_POINTS]; MAX_PARAMETERS],
    tried: Problem<AllTerms>,
}

/// The improvement of the fit by another set of terms.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Improvement {
    fall: f32,
    /// Mean decrease of the deviance per parameter by chance: 1 for independent points, more for correlated ones.
    scatter: f32,
}

impl Improvement {
    /// Decrease of the deviance in units of its scatter: χ² with one degree of freedom by chance.
    pub(crate) fn score(&self) -> f64 {
        f64::from(self.fall / self.scatter)
    }

    /// Decrease of the deviance beyond `cost`, which is in units of the scatter.
    pub(crate) fn gain(&self, cost: f32) -> f32 {
        self.fall - cost * self.scatter
    }
}

impl<'a> Baseline<'a> {
    /// An empty baseline, to be filled in place: it is too large to be moved over a small stack.
    #[inline(always)]
    pub(crate) const fn empty(curve: CurveView<'a>) -> Self {
        Self {
            points: Points::empty(curve),
            deviance: 0.0,
            modelled: [0.0; MAX_POINTS],
            directions: 0,
            explained: [[0.0; MAX_POINTS]; MAX_PARAMETERS],
            tried: Problem::empty(),
        }
    }

    #[inline(never)]
    pub(crate) fn fill(&mut self, model: &Model) {
        let Self { points, deviance, modelled, directions, explained, tried } = self;
        points.fill::<AllTerms>();
        tried.fill_from_model(points, model);
        *deviance = tried.minimise(points);
        modelled.iter_mut().enumerate().for_each(|(at, entry)| *entry = tried.modelled(at, &tried.amounts));
        *directions = tried.orthonormal(points);
        *explained = tried.columns;
        // The columns were overwritten by the orthonormal directions.
        tried.kinds.clear();
    }

    #[inline(never)]
    pub(crate) fn fall(&mut self, kinds: &[NoiseTerm]) -> f32 {
        self.tried.set_terms(&self.points, kinds);
        self.deviance - self.tried.minimise(&self.points)
    }

    /// Improvement by the terms `kinds` with their best coefficients and the best shapes of those that are `free`.
    #[inline(never)]
    pub(crate) fn improvement(
        &mut self,
        kinds: &[NoiseTerm],
        free: FreeShapes,
        keep_on: &mut dyn FnMut() -> bool,
    ) -> Improvement {
        self.tried.set_terms(&self.points, kinds);
        let deviance = shape::search(&self.points, &mut self.tried, free, keep_on);
        self.compared(deviance)
    }

    pub(crate) fn tried(&self) -> &Vec<NoiseTerm, MAX_TERMS> {
        &self.tried.kinds
    }

    /// The improvement of the tried model. Its scatter is the variance of the residual along the change of the model.
    fn compared(&self, deviance: f32) -> Improvement {
        let mut change = [0.0; MAX_POINTS];
        for (at, (entry, point)) in change.iter_mut().zip(&self.points.measured).enumerate() {
            let ratio = self.tried.modelled(at, &self.tried.amounts) / self.modelled[at];
            *entry = sqrtf(point.edf / 2.0) * lnf(ratio);
        }
        for known in &self.explained[..self.directions] {
            remove_component(&mut change, known);
        }
        let length: f32 = change.iter().map(|entry| entry * entry).sum();
        let [variance] = self.points.variances([&change]);
        let scatter = variance / length;
        let fall = if length > 0.0 { self.deviance - deviance } else { 0.0 };
        Improvement { fall, scatter: scatter.max(1.0) }
    }
}
