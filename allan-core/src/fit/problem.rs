//! The likelihood of a curve under terms of given shapes, and the coefficients that make it largest.
//!
//! Everything is relative to what was measured, and each term in a unit of its own: a modelled variance is around 1, and
//! so is the largest that a term adds to any point. Single precision will do: a rounding is 10⁻⁷ of what the data tells to
//! 10⁻⁴ at best. Only normal equations, which hold the squares of what tells two terms apart, take double.

use super::least_squares::{entry, non_negative, triangle};
use super::points::Points;
use crate::Kind;
use crate::math::{absf, lnf, sqrt};
use crate::model::freedom::degrees_of_freedom;
use crate::model::{MAX_TERMS, Model, Term, shares};
use heapless::Vec;

/// Coefficients and parameters of shapes together.
pub(super) const MAX_PARAMETERS: usize = super::least_squares::MOST;
const SCORING_ROUNDS: usize = 40;
/// A fall of the deviance that is none: an error of the coefficients of less than a thirtieth of their uncertainty. Where
/// the model is far off, as a share of the deviance.
const SETTLED: f32 = 1e-3;
const SETTLED_SHARE: f32 = 1e-6;

/// Deviance of a point above which another start may lead further down.
const FAR_OFF: f32 = 5.0;

/// Terms with the squares of their coefficients, and what each does to the points.
pub(super) struct Problem<const POINTS: usize> {
    pub(super) kinds: Vec<Kind, MAX_TERMS>,
    /// Squares of the coefficients that amounts of 1 stand for.
    pub(super) units: [f64; MAX_TERMS],
    pub(super) amounts: [f32; MAX_TERMS],
    /// Derivatives of the modelled variance, over the measured one, at every point: to the amounts of the terms, and
    /// where those of the shapes are asked for, to them.
    pub(super) columns: [[f32; POINTS]; MAX_PARAMETERS],
}

impl<const POINTS: usize> Problem<POINTS> {
    /// Without terms. Filled where it stands: a problem is too large to be handed about on a small stack.
    #[inline(always)]
    pub(super) const fn empty() -> Self {
        Self {
            kinds: Vec::new(),
            units: [0.0; MAX_TERMS],
            amounts: [0.0; MAX_TERMS],
            columns: [[0.0; POINTS]; MAX_PARAMETERS],
        }
    }

    /// Takes the first [`MAX_TERMS`] of `kinds` for its terms; those that it has already keep their columns and amounts.
    #[inline(never)] // here and below: so that stack frames do not add up
    pub(super) fn take(&mut self, points: &Points<POINTS>, kinds: &[Kind]) {
        self.kinds.truncate(kinds.len());
        for (term, &kind) in kinds.iter().enumerate().take(MAX_TERMS) {
            if self.kinds.get(term) != Some(&kind) {
                // There is room for as many.
                let _ = if term == self.kinds.len() { self.kinds.push(kind) } else { Ok(()) };
                self.amounts[term] = 0.0;
                self.set_kind(points, term, kind);
            }
        }
    }

    /// Takes the terms and the coefficients of a model, which also weighs the points.
    #[inline(never)]
    pub(super) fn take_model(&mut self, points: &mut Points<POINTS>, model: &Model) {
        for (term, &Term { kind, value, .. }) in model.terms().iter().enumerate() {
            // A model has no more terms than a problem.
            let _ = self.kinds.push(kind);
            self.set_kind(points, term, kind);
            self.amounts[term] = (value * value / self.units[term]) as f32;
        }
        self.weigh(points);
    }

    /// Alternates between the coefficients and the degrees of freedom that follow from them.
    pub(super) fn settle(&mut self, points: &mut Points<POINTS>, rounds: usize) {
        for _ in 0..rounds {
            self.minimise(points);
            if self.amounts.iter().any(|&amount| amount > 0.0) {
                self.weigh(points);
            }
        }
    }

    /// Takes the points' degrees of freedom from the mixture that the terms are now.
    #[inline(never)]
    pub(super) fn weigh(&self, points: &mut Points<POINTS>) {
        let period = points.curve.sample_period();
        for at in 0..points.measured.len() {
            let modelled = self.modelled(at, &self.amounts);
            let part = |term: usize| f64::from(self.amounts[term] * self.columns[term][at] / modelled);
            let present = (0..self.kinds.len()).filter(|&term| self.amounts[term] > 0.0);
            let parts: Vec<(Kind, f64), MAX_TERMS> = present.map(|term| (self.kinds[term], part(term))).collect();
            let point = points.point(at);
            let shares = shares(parts.iter().copied(), point.n, period);
            let freedom = degrees_of_freedom(&parts, point, period, &points.flicker);
            points.set(at, freedom, shares);
        }
    }

    /// Replaces a term by one of the same kind in another shape; its coefficient stays.
    #[inline(never)]
    pub(super) fn set_kind(&mut self, points: &Points<POINTS>, term: usize, kind: Kind) {
        self.kinds[term] = kind;
        let mut largest = 0.0_f64;
        for (known, point) in (0..POINTS).zip(points.all()) {
            let share = kind.avar(point.n, points.curve.sample_period()) / point.avar;
            let column = &mut self.columns[term];
            if share > largest {
                let shrink = (largest / share) as f32;
                column[..known].iter_mut().for_each(|entry| *entry *= shrink);
                largest = share;
            }
            column[known] = (share / largest) as f32;
        }
        let unit = if largest > 0.0 { 1.0 / largest } else { 1.0 };
        self.amounts[term] *= (self.units[term] / unit) as f32;
        self.units[term] = unit;
    }

    /// Finds the amounts that minimise the deviance at the present weights, and returns it.
    #[inline(never)]
    pub(super) fn minimise(&mut self, points: &Points<POINTS>) -> f32 {
        let mut deviance = self.deviance(points);
        // Far off, by the variances that were measured: there are minima on the way from where a smaller model was left.
        if deviance > FAR_OFF * points.measured.len() as f32 {
            let left = self.amounts;
            self.amounts = self.scoring_step(points, false);
            let start = self.deviance(points);
            // Never worse than where a smaller model was left.
            if start < deviance {
                deviance = start;
            } else {
                self.amounts = left;
            }
        }
        for _ in 0..SCORING_ROUNDS {
            let proposed = self.scoring_step(points, true);
            let Some(lower) = self.descend(points, &proposed, deviance) else { break };
            let fall = deviance - lower;
            deviance = lower;
            if fall <= SETTLED.max(SETTLED_SHARE * deviance) {
                break;
            }
        }
        deviance
    }

    /// Goes towards `proposed` as far as the deviance falls; `None` where it does not fall at all.
    fn descend(&mut self, points: &Points<POINTS>, proposed: &[f32; MAX_TERMS], deviance: f32) -> Option<f32> {
        let mut length = 1.0;
        for _ in 0..20 {
            let mut next = self.amounts;
            for (entry, target) in next.iter_mut().zip(proposed) {
                *entry += length * (target - *entry);
            }
            let lower = self.deviance_at(points, &next);
            if lower < deviance {
                self.amounts = next;
                return Some(lower);
            }
            length /= 2.0;
        }
        None
    }

    /// `Σ edf·(v/m − 1 − ln(v/m))`; infinite where the model says that there is no variance.
    pub(super) fn deviance(&self, points: &Points<POINTS>) -> f32 {
        self.deviance_at(points, &self.amounts)
    }

    fn deviance_at(&self, points: &Points<POINTS>, amounts: &[f32; MAX_TERMS]) -> f32 {
        let of = |at: usize| points.measured[at].edf * distance(self.modelled(at, amounts));
        let sum: f32 = (0..points.measured.len()).map(of).sum();
        if sum.is_nan() { f32::INFINITY } else { sum }
    }

    /// The variance at a point that the terms add up to, over the measured one.
    pub(super) fn modelled(&self, at: usize, amounts: &[f32; MAX_TERMS]) -> f32 {
        let terms = self.columns.iter().zip(amounts).take(self.kinds.len());
        terms.map(|(column, amount)| amount * column[at]).sum()
    }

    /// Non-negative least squares with the variances that are modelled, or with the measured ones.
    #[inline(never)]
    fn scoring_step(&self, points: &Points<POINTS>, modelled: bool) -> [f32; MAX_TERMS] {
        let mut normal = [0.0_f64; triangle(MAX_TERMS)];
        let mut right = [0.0_f64; MAX_TERMS];
        let terms = self.kinds.len();
        for (at, point) in points.measured.iter().enumerate() {
            let variance = if modelled { self.modelled(at, &self.amounts) } else { 1.0 };
            let weight = point.edf / 2.0 / (variance * variance);
            for i in 0..terms {
                let weighted = f64::from(weight) * f64::from(self.columns[i][at]);
                right[i] += weighted;
                for j in 0..=i {
                    normal[entry(i, j)] += weighted * f64::from(self.columns[j][at]);
                }
            }
        }
        let mut solution = self.amounts.map(f64::from);
        non_negative(&normal, &right, terms, &mut solution);
        solution.map(|amount| amount as f32)
    }

    pub(super) fn square(&self, term: usize) -> f64 {
        f64::from(self.amounts[term]) * self.units[term]
    }

    /// The terms with their coefficients, without bounds.
    pub(super) fn terms(&self) -> impl Iterator<Item = Term> {
        self.kinds.iter().enumerate().map(|(term, &kind)| Term::exact(kind, sqrt(self.square(term))))
    }
}

/// `u − ln(1 + u)` with `1 + u` measured over modelled: what a point's deviance is for one degree of freedom.
fn distance(modelled: f32) -> f32 {
    let excess = (1.0 - modelled) / modelled;
    if absf(excess) > 0.25 {
        return excess + lnf(modelled);
    }
    // ln(1 + u) = 2·artanh(u/(2 + u)), less its first term.
    let s = excess / (2.0 + excess);
    let square = s * s;
    s * (excess - 2.0 * square * (1.0 / 3.0 + square * (1.0 / 5.0 + square * (1.0 / 7.0 + square / 9.0))))
}

#[cfg(test)]
mod tests {
    use super::distance;

    #[test]
    fn the_distance_of_close_variances_does_not_cancel() {
        for k in -400..400 {
            let modelled = (f64::from(k) / 100.0).exp2() as f32;
            let ratio = 1.0 / f64::from(modelled);
            // In double precision the difference has some 10⁻¹⁶/u² left, and rounding of the ratio is 10⁻⁷ of u.
            let exact = (ratio - 1.0) - ratio.ln();
            let found = f64::from(distance(modelled));
            assert!((found - exact).abs() <= 2e-6 * exact + 3e-7 * (ratio - 1.0).abs(), "{modelled}: {found}, {exact}");
        }
        assert_eq!(distance(1.0), 0.0);
    }
}
