//! What another set of terms gains over a fitted model, measured against what chance would gain.

use super::parameter::take_away;
use super::points::Points;
use super::problem::{MAX_PARAMETERS, Problem};
use super::shape::{self, Free};
use crate::math::{lnf, sqrtf};
use crate::model::{MAX_TERMS, Model};
use crate::{Curve, Kind};
use heapless::Vec;

/// A fitted model, ready to be compared with others at the weights that it gives to the points.
pub(crate) struct Baseline<'a, const POINTS: usize> {
    points: Points<'a, POINTS>,
    deviance: f32,
    modelled: [f32; POINTS],
    /// What its own parameters can explain: this many orthonormal columns.
    directions: usize,
    explained: [[f32; POINTS]; MAX_PARAMETERS],
    /// The terms that are tried.
    tried: Problem<POINTS>,
}

/// What another set of terms does better.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Improvement {
    /// How much lower its deviance is.
    fall: f32,
    /// What the deviance falls by without a cause, on average for each parameter: points that are correlated move
    /// together.
    scatter: f32,
}

impl Improvement {
    /// Fall of the deviance in units of its scatter: without a cause it is χ² with one degree of freedom.
    pub(crate) fn score(&self) -> f64 {
        f64::from(self.fall / self.scatter)
    }

    /// What is left of the fall when everything that is to be earned, in units of the scatter, is paid.
    pub(crate) fn gain(&self, cost: f32) -> f32 {
        self.fall - cost * self.scatter
    }
}

impl<'a, const POINTS: usize> Baseline<'a, POINTS> {
    /// Of nothing yet: filled where it stands, being too large to be handed about on a small stack.
    #[inline(always)]
    pub(crate) const fn empty(curve: &'a Curve<POINTS>) -> Self {
        Self {
            points: Points::empty(curve),
            deviance: 0.0,
            modelled: [0.0; POINTS],
            directions: 0,
            explained: [[0.0; POINTS]; MAX_PARAMETERS],
            tried: Problem::empty(),
        }
    }

    #[inline(never)]
    pub(crate) fn take(&mut self, model: &Model) {
        let Self { points, deviance, modelled, directions, explained, tried } = self;
        points.take();
        tried.take_model(points, model);
        *deviance = tried.minimise(points);
        modelled.iter_mut().enumerate().for_each(|(at, entry)| *entry = tried.modelled(at, &tried.amounts));
        *directions = tried.orthonormal(points);
        *explained = tried.columns;
        // Its columns are used up.
        tried.kinds.clear();
    }

    /// How much lower the deviance of `kinds` is with the best coefficients.
    #[inline(never)]
    pub(crate) fn fall(&mut self, kinds: &[Kind]) -> f32 {
        self.tried.take(&self.points, kinds);
        self.deviance - self.tried.minimise(&self.points)
    }

    /// What `kinds` do better with the best coefficients, and the best shapes of those that are `free`.
    #[inline(never)]
    pub(crate) fn improvement(&mut self, kinds: &[Kind], free: Free, keep_on: &mut dyn FnMut() -> bool) -> Improvement {
        self.tried.take(&self.points, kinds);
        let deviance = shape::search(&self.points, &mut self.tried, free, keep_on);
        self.compared(deviance)
    }

    /// The terms that were tried last, in the shapes that were found.
    pub(crate) fn tried(&self) -> &Vec<Kind, MAX_TERMS> {
        &self.tried.kinds
    }

    /// The variance of the residual along the change of the model says what chance would gain.
    fn compared(&self, deviance: f32) -> Improvement {
        let mut change = [0.0; POINTS];
        for (at, (entry, point)) in change.iter_mut().zip(&self.points.measured).enumerate() {
            let ratio = self.tried.modelled(at, &self.tried.amounts) / self.modelled[at];
            *entry = sqrtf(point.edf / 2.0) * lnf(ratio);
        }
        for known in &self.explained[..self.directions] {
            take_away(&mut change, known);
        }
        let length: f32 = change.iter().map(|entry| entry * entry).sum();
        let [variance] = self.points.variances([&change]);
        let scatter = variance / length;
        let fall = if length > 0.0 { self.deviance - deviance } else { 0.0 };
        Improvement { fall, scatter: scatter.max(1.0) }
    }
}
