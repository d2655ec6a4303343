//! What another set of terms gains over a fitted model, measured against what chance would gain.

use super::parameter::take_away;
use super::points::Points;
use super::problem::Problem;
use super::shape::{self, Free};
use crate::math::{ln, sqrt};
use crate::model::{MAX_TERMS, Model};
use crate::{Curve, Kind};
use heapless::Vec;

/// A fitted model, ready to be compared with others at the weights that it gives to the points.
pub(crate) struct Baseline<const POINTS: usize> {
    points: Points<POINTS>,
    deviance: f64,
    modelled: [f64; POINTS],
    /// What its own parameters can explain: this many orthonormal columns.
    directions: usize,
    explained: Problem<POINTS>,
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

impl<const POINTS: usize> Baseline<POINTS> {
    /// Of nothing yet: filled where it stands, being too large to be handed about on a small stack.
    #[inline(always)]
    pub(crate) const fn empty() -> Self {
        Self {
            points: Points::empty(),
            deviance: 0.0,
            modelled: [0.0; POINTS],
            directions: 0,
            explained: Problem::empty(),
        }
    }

    #[inline(never)]
    pub(crate) fn take(&mut self, curve: &Curve<POINTS>, model: &Model) {
        let Self { points, deviance, modelled, directions, explained } = self;
        points.take(curve);
        explained.take_model(points, curve, model);
        *deviance = explained.minimise(points);
        modelled.iter_mut().enumerate().for_each(|(at, entry)| *entry = explained.modelled(at, &explained.squares));
        *directions = explained.orthonormal(points);
    }

    /// How much lower the deviance of `kinds` is with the best coefficients.
    #[inline(never)]
    pub(crate) fn fall(&self, kinds: &[Kind]) -> f64 {
        let mut problem = Problem::empty();
        problem.take(&self.points, kinds);
        self.deviance - problem.minimise(&self.points)
    }

    /// Fits the coefficients of `kinds` and the shapes of those that are `free`.
    #[inline(never)]
    pub(crate) fn shaped_rival(&self, kinds: &[Kind], free: Free, keep_on: &mut dyn FnMut() -> bool) -> Rival {
        let mut problem = Problem::empty();
        problem.take(&self.points, kinds);
        shape::search(&self.points, &mut problem, free, keep_on);
        let deviance = problem.minimise(&self.points);
        self.compared(&problem, deviance)
    }

    /// The variance of the residual along the change of the model says what chance would gain.
    fn compared(&self, rival: &Problem<POINTS>, deviance: f64) -> Rival {
        let mut change = [0.0; POINTS];
        for (at, (entry, point)) in change.iter_mut().zip(&self.points.measured).enumerate() {
            let ratio = rival.modelled(at, &rival.squares) / self.modelled[at];
            *entry = sqrt(point.edf / 2.0) * ln(ratio);
        }
        for known in &self.explained.columns[..self.directions] {
            take_away(&mut change, known);
        }
        let length: f64 = change.iter().map(|entry| entry * entry).sum();
        let [variance] = self.points.variances([&change]);
        let scatter = variance / length;
        let fall = if length > 0.0 { self.deviance - deviance } else { 0.0 };
        Rival { kinds: rival.kinds.clone(), fall, scatter: scatter.max(1.0) }
    }
}
