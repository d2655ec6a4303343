//! What another set of terms gains over a fitted model, measured against what chance would gain.

use super::bounds::correlation;
use super::goodness::orthonormal;
use super::least_squares::dot;
use super::problem::{MAX_POINTS, Measured, Problem};
use super::shape;
use crate::math::{ln, sqrt};
use crate::model::{MAX_TERMS, Model};
use crate::{Curve, Kind};
use heapless::Vec;

/// A fitted model, ready to be compared with others at the weights that it gives to the points.
pub(crate) struct Baseline {
    problem: Problem,
    deviance: f64,
    /// What its own parameters can explain.
    explained: Vec<[f64; MAX_POINTS], { super::bounds::MAX_PARAMETERS }>,
}

/// Another set of terms beside a baseline.
#[derive(Debug, Clone)]
pub(crate) struct Rival {
    pub(crate) kinds: Vec<Kind, MAX_TERMS>,
    /// How much lower its deviance is.
    pub(crate) fall: f64,
    /// What the deviance falls by without a cause, on average for each parameter: points that are correlated move
    /// together.
    pub(crate) scatter: f64,
}

impl Rival {
    /// Fall of the deviance in units of its scatter: without a cause it is χ² with one degree of freedom.
    pub(crate) fn score(&self) -> f64 {
        self.fall / self.scatter
    }

    /// What is left of the fall when everything that is to be earned, in units of the scatter, is paid.
    pub(crate) fn gain(&self, cost: f64) -> f64 {
        self.fall - cost * self.scatter
    }
}

impl Baseline {
    pub(crate) fn new<const POINTS: usize>(curve: &Curve<POINTS>, model: &Model) -> Self {
        let mut problem = Problem::of(curve, model);
        let deviance = problem.minimise();
        let explained = orthonormal(&problem);
        Self { problem, deviance, explained }
    }

    /// How much lower the deviance of `kinds` is with the best coefficients.
    pub(crate) fn fall(&self, kinds: &[Kind]) -> f64 {
        self.deviance - self.problem.with_kinds(kinds).minimise()
    }

    /// Fits the coefficients of `kinds` and the shapes of those that are not `fixed`.
    pub(crate) fn shaped_rival(&self, kinds: &[Kind], fixed: &[Kind]) -> Rival {
        let mut problem = self.problem.with_kinds(kinds);
        problem.minimise();
        let mut kinds = problem.kinds.clone();
        shape::search(&mut problem, &mut kinds, fixed);
        let deviance = problem.minimise();
        self.compared(&problem, deviance)
    }

    /// The variance of the residual along the change of the model says what chance would gain.
    fn compared(&self, rival: &Problem, deviance: f64) -> Rival {
        let mut change = [0.0; MAX_POINTS];
        for ((entry, old), new) in change.iter_mut().zip(&self.problem.points).zip(&rival.points) {
            let ratio = dot(&new.basis, &rival.squares) / dot(&old.basis, &self.problem.squares);
            *entry = sqrt(old.edf / 2.0) * ln(ratio);
        }
        for known in &self.explained {
            let along = dot(&change, known);
            change.iter_mut().zip(known).for_each(|(entry, known)| *entry -= along * known);
        }
        let length = dot(&change, &change);
        let scatter = pairs(&self.problem.points, &change).sum::<f64>() / length;
        let fall = if length > 0.0 { self.deviance - deviance } else { 0.0 };
        Rival { kinds: rival.kinds.clone(), fall, scatter: scatter.max(1.0) }
    }
}

/// The terms of `changeᵀ·R·change`, with the correlations R of the points.
fn pairs<'a>(points: &'a [Measured], change: &'a [f64; MAX_POINTS]) -> impl Iterator<Item = f64> + 'a {
    let of = move |(i, a): (usize, &'a Measured)| {
        points.iter().enumerate().map(move |(j, b)| change[i] * change[j] * correlation(a, b))
    };
    points.iter().enumerate().flat_map(of)
}
