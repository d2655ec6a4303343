//! The likelihood of a curve under terms of given shapes, and the coefficients that make it largest.

use super::least_squares::{Matrix, Vector, dot, non_negative};
use crate::confidence::Shares;
use crate::model::{MAX_TERMS, Model, Term};
use crate::{Curve, Kind, Point, math};
use heapless::Vec;

/// Points that a fit looks at.
pub(super) const MAX_POINTS: usize = 32;
const SCORING_ROUNDS: usize = 60;

/// A measured point with what is known of it before the coefficients are.
#[derive(Clone)]
pub(super) struct Measured {
    pub(super) n: u64,
    pub(super) avar: f64,
    pub(super) edf: f64,
    /// Without the memory of narrow terms, which all points share.
    pub(super) near_edf: f64,
    pub(super) shares: Shares,
    pub(super) basis: Vector<MAX_TERMS>,
}

/// The points with a positive variance, and the terms.
pub(super) struct Problem {
    pub(super) sample_period: f64,
    pub(super) kinds: Vec<Kind, MAX_TERMS>,
    pub(super) points: Vec<Measured, MAX_POINTS>,
    pub(super) squares: Vector<MAX_TERMS>,
}

impl Problem {
    pub(super) fn new<const POINTS: usize>(curve: &Curve<POINTS>, kinds: &[Kind]) -> Self {
        let measured = |point: &Point| Measured {
            n: point.n,
            avar: point.avar,
            edf: point.edf,
            near_edf: point.edf,
            shares: Shares::WHITE,
            basis: [0.0; MAX_TERMS],
        };
        Self {
            sample_period: curve.sample_period(),
            kinds: Vec::new(),
            points: positive(curve).map(measured).take(MAX_POINTS).collect(),
            squares: [0.0; MAX_TERMS],
        }
        .with_kinds(kinds)
    }

    /// At the coefficients of a model, weighed by it.
    pub(super) fn of<const POINTS: usize>(curve: &Curve<POINTS>, model: &Model) -> Self {
        let kinds: Vec<Kind, MAX_TERMS> = model.terms().iter().map(|term| term.kind).collect();
        let mut problem = Self::new(curve, &kinds);
        for (square, term) in problem.squares.iter_mut().zip(model.terms()) {
            *square = term.value * term.value;
        }
        problem.weigh(curve, model);
        problem
    }

    /// The same points at the same weights, with other terms.
    pub(super) fn with_kinds(&self, kinds: &[Kind]) -> Self {
        let mut other = Self {
            sample_period: self.sample_period,
            kinds: kinds.iter().copied().take(MAX_TERMS).collect(),
            points: self.points.clone(),
            squares: [0.0; MAX_TERMS],
        };
        for term in 0..other.kinds.len() {
            other.set_kind(term, other.kinds[term]);
        }
        other
    }

    /// Alternates between the coefficients and the degrees of freedom that follow from them.
    pub(super) fn settle<const POINTS: usize>(&mut self, curve: &Curve<POINTS>, rounds: usize) -> Model {
        let mut model = self.model();
        for _ in 0..rounds {
            self.minimise();
            model = self.model();
            if self.squares.iter().any(|&square| square > 0.0) {
                self.weigh(curve, &model);
            }
        }
        model
    }

    /// Replaces a term by one of the same kind in another shape.
    pub(super) fn set_kind(&mut self, term: usize, kind: Kind) {
        self.kinds[term] = kind;
        for point in &mut self.points {
            point.basis[term] = kind.avar(point.n, self.sample_period);
        }
    }

    /// Finds the squares of the coefficients that minimise the deviance at the present weights, and returns it.
    pub(super) fn minimise(&mut self) -> f64 {
        let start = self.scoring_step(|point| point.avar);
        let (mut squares, mut deviance) = (start, self.deviance(&start));
        // Never worse than where a smaller model was left.
        let left = self.deviance(&self.squares);
        if left < deviance {
            (squares, deviance) = (self.squares, left);
        }
        for _ in 0..SCORING_ROUNDS {
            let proposed = self.scoring_step(|point| dot(&point.basis, &squares));
            let Some((next, lower)) = self.descend(&squares, &proposed, deviance) else {
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
            let lower = self.deviance(&next);
            if lower < deviance {
                return Some((next, lower));
            }
            length /= 2.0;
        }
        None
    }

    /// `Σ edf·(v/m − 1 − ln(v/m))`; infinite where the model says that there is no variance.
    pub(super) fn deviance(&self, squares: &Vector<MAX_TERMS>) -> f64 {
        let of = |point: &Measured| {
            let ratio = point.avar / dot(&point.basis, squares);
            point.edf * (ratio - 1.0 - math::ln(ratio))
        };
        let sum: f64 = self.points.iter().map(of).sum();
        if sum.is_nan() { f64::INFINITY } else { sum }
    }

    /// Non-negative least squares with the variances that `expected` tells.
    fn scoring_step(&self, expected: impl Fn(&Measured) -> f64) -> Vector<MAX_TERMS> {
        let mut normal: Matrix<MAX_TERMS> = [[0.0; MAX_TERMS]; MAX_TERMS];
        let mut right = [0.0; MAX_TERMS];
        for point in &self.points {
            let variance = expected(point);
            let weight = point.edf / 2.0 / (variance * variance);
            for (i, row) in normal.iter_mut().enumerate().take(self.kinds.len()) {
                right[i] += weight * point.basis[i] * point.avar;
                for (j, entry) in row.iter_mut().enumerate().take(self.kinds.len()) {
                    *entry += weight * point.basis[i] * point.basis[j];
                }
            }
        }
        non_negative(&normal, &right, self.kinds.len())
    }

    /// Takes the degrees of freedom from the mixture of noises that `model` says.
    fn weigh<const POINTS: usize>(&mut self, curve: &Curve<POINTS>, model: &Model) {
        for (measured, point) in self.points.iter_mut().zip(positive(curve)) {
            measured.shares = model.shares(point.n);
            measured.edf = model.edf(point);
            measured.near_edf = model.near_edf(point);
        }
    }

    pub(super) fn model(&self) -> Model {
        let term = |(&kind, &square): (&Kind, &f64)| Term::exact(kind, math::sqrt(square));
        Model::new(self.sample_period, self.kinds.iter().zip(&self.squares).map(term))
    }
}

fn positive<const POINTS: usize>(curve: &Curve<POINTS>) -> impl Iterator<Item = &Point> {
    curve.points().iter().filter(|point| point.avar > 0.0)
}
