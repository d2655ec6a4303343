//! The likelihood of a curve under terms of given shapes, and the coefficients that make it largest.

use super::least_squares::{Matrix, Vector, dot, non_negative};
use super::points::{Measured, Points};
use crate::model::{MAX_TERMS, Model, Term};
use crate::{Curve, Kind, math};
use heapless::Vec;

/// Coefficients and parameters of shapes together.
pub(super) const MAX_PARAMETERS: usize = 12;
const SCORING_ROUNDS: usize = 60;

/// Terms with the squares of their coefficients, and what each does to the points.
pub(super) struct Problem<const POINTS: usize> {
    pub(super) kinds: Vec<Kind, MAX_TERMS>,
    pub(super) squares: Vector<MAX_TERMS>,
    /// Derivatives of the modelled variance at every point: to the squares of the terms, and where those of the
    /// shapes are asked for, to them.
    pub(super) columns: [[f64; POINTS]; MAX_PARAMETERS],
}

impl<const POINTS: usize> Problem<POINTS> {
    /// Without terms. Filled where it stands: a problem is too large to be handed about on a small stack.
    #[inline(always)]
    pub(super) const fn empty() -> Self {
        Self { kinds: Vec::new(), squares: [0.0; MAX_TERMS], columns: [[0.0; POINTS]; MAX_PARAMETERS] }
    }

    /// Takes the first [`MAX_TERMS`] of `kinds` for its terms.
    pub(super) fn take(&mut self, points: &Points<POINTS>, kinds: &[Kind]) {
        self.kinds.extend(kinds.iter().copied().take(MAX_TERMS));
        for term in 0..self.kinds.len() {
            self.set_kind(points, term, self.kinds[term]);
        }
    }

    /// Takes the terms and the coefficients of a model, which also weighs the points.
    #[inline(never)] // here and below: so that stack frames do not add up
    pub(super) fn take_model(&mut self, points: &mut Points<POINTS>, curve: &Curve<POINTS>, model: &Model) {
        points.weigh(curve, model);
        for (term, &Term { kind, value, .. }) in model.terms().iter().enumerate() {
            // A model has no more terms than a problem.
            let _ = self.kinds.push(kind);
            self.squares[term] = value * value;
            self.set_kind(points, term, kind);
        }
    }

    /// Alternates between the coefficients and the degrees of freedom that follow from them.
    pub(super) fn settle(&mut self, points: &mut Points<POINTS>, curve: &Curve<POINTS>, rounds: usize) {
        for _ in 0..rounds {
            self.minimise(points);
            if self.squares.iter().any(|&square| square > 0.0) {
                self.weigh(points, curve);
            }
        }
    }

    /// Weighs the points by what the terms are now.
    #[inline(never)]
    pub(super) fn weigh(&self, points: &mut Points<POINTS>, curve: &Curve<POINTS>) {
        points.weigh(curve, &self.model(points.sample_period));
    }

    /// Replaces a term by one of the same kind in another shape.
    #[inline(never)]
    pub(super) fn set_kind(&mut self, points: &Points<POINTS>, term: usize, kind: Kind) {
        self.kinds[term] = kind;
        for (entry, point) in self.columns[term].iter_mut().zip(&points.measured) {
            *entry = kind.avar(point.n, points.sample_period);
        }
    }

    /// Finds the squares of the coefficients that minimise the deviance at the present weights, and returns it.
    #[inline(never)]
    pub(super) fn minimise(&mut self, points: &Points<POINTS>) -> f64 {
        let start = self.scoring_step(points, None);
        let (mut squares, mut deviance) = (start, self.deviance_at(points, &start));
        // Never worse than where a smaller model was left.
        let left = self.deviance(points);
        if left < deviance {
            (squares, deviance) = (self.squares, left);
        }
        for _ in 0..SCORING_ROUNDS {
            let proposed = self.scoring_step(points, Some(&squares));
            let Some((next, lower)) = self.descend(points, &squares, &proposed, deviance) else {
                break;
            };
            let settled = deviance - lower <= 1e-10 * math::abs(deviance);
            (squares, deviance) = (next, lower);
            if settled {
                break;
            }
        }
        self.squares = squares;
        deviance
    }

    /// Goes towards `proposed` as far as the deviance falls; `None` where it does not fall at all.
    fn descend(
        &self,
        points: &Points<POINTS>,
        from: &Vector<MAX_TERMS>,
        proposed: &Vector<MAX_TERMS>,
        deviance: f64,
    ) -> Option<(Vector<MAX_TERMS>, f64)> {
        let mut length = 1.0;
        for _ in 0..30 {
            let mut next = *from;
            for (entry, target) in next.iter_mut().zip(proposed) {
                *entry += length * (target - *entry);
            }
            let lower = self.deviance_at(points, &next);
            if lower < deviance {
                return Some((next, lower));
            }
            length /= 2.0;
        }
        None
    }

    /// `Σ edf·(v/m − 1 − ln(v/m))`; infinite where the model says that there is no variance.
    pub(super) fn deviance(&self, points: &Points<POINTS>) -> f64 {
        self.deviance_at(points, &self.squares)
    }

    fn deviance_at(&self, points: &Points<POINTS>, squares: &Vector<MAX_TERMS>) -> f64 {
        let of = |(at, point): (usize, &Measured)| {
            let ratio = point.avar / self.modelled(at, squares);
            point.edf * (ratio - 1.0 - math::ln(ratio))
        };
        let sum: f64 = points.measured.iter().enumerate().map(of).sum();
        if sum.is_nan() { f64::INFINITY } else { sum }
    }

    /// The variance at a point that the terms add up to.
    pub(super) fn modelled(&self, at: usize, squares: &Vector<MAX_TERMS>) -> f64 {
        let terms = self.columns.iter().zip(squares).take(self.kinds.len());
        terms.map(|(column, square)| square * column[at]).sum()
    }

    /// Non-negative least squares with the variances that `squares` tell, or with the measured ones.
    #[inline(never)]
    fn scoring_step(&self, points: &Points<POINTS>, squares: Option<&Vector<MAX_TERMS>>) -> Vector<MAX_TERMS> {
        let mut normal: Matrix<MAX_TERMS> = [[0.0; MAX_TERMS]; MAX_TERMS];
        let mut right = [0.0; MAX_TERMS];
        let terms = self.kinds.len();
        let mut weights = [0.0; POINTS];
        for (at, (weight, point)) in weights.iter_mut().zip(&points.measured).enumerate() {
            let variance = squares.map_or(point.avar, |squares| self.modelled(at, squares));
            *weight = point.edf / 2.0 / (variance * variance);
        }
        for (i, (row, right)) in normal.iter_mut().zip(&mut right).enumerate().take(terms) {
            let mut weighted = self.columns[i];
            weighted.iter_mut().zip(&weights).for_each(|(entry, weight)| *entry *= weight);
            *right = weighted.iter().zip(&points.measured).map(|(weighted, point)| weighted * point.avar).sum();
            row.iter_mut().zip(&self.columns).take(terms).for_each(|(entry, column)| *entry = dot(&weighted, column));
        }
        non_negative(&normal, &right, terms)
    }

    pub(super) fn model(&self, sample_period: f64) -> Model {
        let term = |(&kind, &square): (&Kind, &f64)| Term::exact(kind, math::sqrt(square));
        Model::new(sample_period, self.kinds.iter().zip(&self.squares).map(term))
    }
}
