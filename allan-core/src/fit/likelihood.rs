//! The likelihood of the points of a curve under a sum of terms with given shapes, and the coefficients that maximise
//! it.
//!
//! Variances are relative to the measured ones, and an amount of 1 contributes at most 1 to a point. Single precision
//! is enough, except in the normal equations, where only power laws need no double precision.

use super::least_squares::{MOST, entry, non_negative, triangle};
use crate::confidence::{pure_octave_correlation, roots};
use crate::curve::{AllanPoint, CurveView};
use crate::math::{Real, absf, lnf, sqrtf};
use crate::model::{
    FittedTerm, FlickerCorrelations, MAX_TERMS, Model, degrees_of_freedom, filter_of, variance_fractions,
};
use crate::noise_type::VarianceFractions;
use crate::term::{NoiseTerm, TermSet};
use core::f32::consts::LN_2;
use core::marker::PhantomData;
use heapless::Vec;

/// Largest number of points that a fit uses: one more than a cascade can have octaves.
pub const MAX_POINTS: usize = 32;

/// A measured point: its index in the curve and its statistical properties under the present model.
pub(super) struct Measured {
    at: u16,
    /// `log2 n`.
    octave: f32,
    pub(super) edf: f32,
    /// Fraction of the scatter without the long-lasting correlations of narrow-band terms.
    near: f32,
    /// [`roots`] of the variance fractions.
    roots: [f32; 3],
}

/// The points of a curve with a positive variance.
pub(super) struct Points<'a> {
    pub(super) curve: CurveView<'a>,
    pub(super) measured: Vec<Measured, MAX_POINTS>,
    flicker: FlickerCorrelations,
}

impl<'a> Points<'a> {
    /// An empty list, to be filled in place: it is too large to be moved over a small stack.
    #[inline(always)]
    pub(super) const fn empty(curve: CurveView<'a>) -> Self {
        Self { curve, measured: Vec::new(), flicker: FlickerCorrelations::EMPTY }
    }

    /// Sets the points to those of the curve, with the degrees of freedom that the curve gives.
    pub(super) fn fill<T: TermSet>(&mut self) {
        // If there are more points than a cascade has octaves, those between octaves are left out.
        let all = self.curve.points().len() <= MAX_POINTS;
        let is_used = |point: &AllanPoint| point.avar > 0.0 && (all || point.n.is_power_of_two());
        let last = self.curve.points().iter().rfind(|point| is_used(point));
        self.flicker.fill::<T>(last.map_or(1, |point| point.overlap));
        let used = self.curve.points().iter().enumerate().filter(|(_, point)| is_used(point));
        self.measured.extend(used.take(MAX_POINTS).map(|(at, point)| Measured {
            at: at as u16,
            octave: lnf(point.n as f32) / LN_2,
            edf: point.edf as f32,
            near: 1.0,
            roots: roots::<T::Real>(VarianceFractions::WHITE).map(T::Real::single),
        }));
    }

    pub(super) fn point(&self, at: usize) -> &AllanPoint {
        &self.curve.points()[usize::from(self.measured[at].at)]
    }

    pub(super) fn all(&self) -> impl Iterator<Item = &AllanPoint> {
        (0..self.measured.len()).map(|at| self.point(at))
    }

    /// Sets the degrees of freedom of a point, with and without narrow-band correlations, and its variance fractions.
    fn set<F: Real>(&mut self, at: usize, (edf, near_edf): (F, F), fractions: VarianceFractions) {
        let measured = &mut self.measured[at];
        measured.edf = edf.single();
        measured.near = (edf / near_edf).single();
        measured.roots = roots::<F>(fractions).map(F::single);
    }

    /// Variances of the sums `Σ weights·residual` of standardised residuals.
    pub(super) fn variances<const SUMS: usize>(&self, weights: [&[f32; MAX_POINTS]; SUMS]) -> [f32; SUMS] {
        let mut variances = [0.0; SUMS];
        for (i, a) in self.measured.iter().enumerate() {
            for (j, b) in self.measured.iter().enumerate().take(i + 1) {
                let both = if i == j { 1.0 } else { 2.0 * correlation(a, b) };
                variances.iter_mut().zip(weights).for_each(|(sum, weights)| *sum += both * weights[i] * weights[j]);
            }
        }
        variances
    }
}

/// Correlation of the errors of two points.
pub(super) fn correlation(a: &Measured, b: &Measured) -> f32 {
    let octaves = (absf(a.octave - b.octave) + 0.5) as usize;
    let product = |noise: usize| a.roots[noise] * b.roots[noise] * pure_octave_correlation(octaves, noise) as f32;
    let near: f32 = (0..3).map(product).sum();
    sqrtf(a.near * b.near) * near + sqrtf((1.0 - a.near).max(0.0) * (1.0 - b.near).max(0.0))
}

pub(super) const MAX_PARAMETERS: usize = MOST;
const SCORING_ROUNDS: usize = 40;
/// Decrease of the deviance below which the iteration ends.
const CONVERGED: f32 = 1e-3;
/// [`CONVERGED`] as a fraction of the deviance, for models that fit badly.
const CONVERGED_FRACTION: f32 = 1e-6;

/// Mean deviance of a point above which a second start is tried.
const FAR_OFF: f32 = 5.0;

/// Terms with the squares of their coefficients (amounts), and the contribution of each to the points.
pub(super) struct Problem<T> {
    pub(super) kinds: Vec<NoiseTerm, MAX_TERMS>,
    /// Squared coefficient for an amount of 1.
    pub(super) units: [f64; MAX_TERMS],
    pub(super) amounts: [f32; MAX_TERMS],
    /// Derivatives of modelled over measured variance to amounts, then to [differentiated](Self::differentiate) log
    /// shapes.
    pub(super) columns: [[f32; MAX_POINTS]; MAX_PARAMETERS],
    terms: PhantomData<T>,
}

impl<T: TermSet> Problem<T> {
    /// An empty problem, to be filled in place: it is too large to be moved over a small stack.
    #[inline(always)]
    pub(super) const fn empty() -> Self {
        Self {
            kinds: Vec::new(),
            units: [0.0; MAX_TERMS],
            amounts: [0.0; MAX_TERMS],
            columns: [[0.0; MAX_POINTS]; MAX_PARAMETERS],
            terms: PhantomData,
        }
    }

    /// Sets the terms to the first [`MAX_TERMS`] of `kinds`; unchanged ones keep their columns.
    #[inline(never)] // here and below: so that stack frames do not add up in the caller
    pub(super) fn set_terms(&mut self, points: &Points, kinds: &[NoiseTerm]) {
        let before = filter_of(&self.kinds);
        let mut is_known = [false; MAX_TERMS];
        let given = || kinds.iter().filter(|kind| T::contains(kind)).take(MAX_TERMS);
        is_known
            .iter_mut()
            .zip(self.kinds.iter().zip(given()))
            .for_each(|(is_known, (own, new))| *is_known = own == new);
        self.kinds = given().copied().collect();
        let is_same_filter = filter_of(&self.kinds) == before;
        for (term, is_known) in is_known.into_iter().enumerate().take(self.kinds.len()) {
            if !is_known {
                self.amounts[term] = 0.0;
            }
            if !is_known || (!is_same_filter && self.kinds[term].passes_filter()) {
                self.set_column(points, term);
            }
        }
    }

    /// Sets terms, coefficients and the points' confidence to those of a model.
    #[inline(never)]
    pub(super) fn fill_from_model(&mut self, points: &mut Points, model: &Model) {
        self.kinds = model.kinds();
        for (term, &FittedTerm { value, .. }) in model.terms().iter().enumerate() {
            self.set_column(points, term);
            self.amounts[term] = (value * value / self.units[term]) as f32;
        }
        self.set_confidence(points);
    }

    /// Computes the coefficients and the degrees of freedom that depend on them in turn, `rounds` times.
    pub(super) fn fit_with_confidence(&mut self, points: &mut Points, rounds: usize) {
        for _ in 0..rounds {
            self.minimise(points);
            if self.amounts.iter().any(|&amount| amount > 0.0) {
                self.set_confidence(points);
            }
        }
    }

    #[inline(never)]
    pub(super) fn set_confidence(&self, points: &mut Points) {
        let period = points.curve.sample_period();
        for at in 0..points.measured.len() {
            let modelled = self.modelled(at, &self.amounts);
            let part = |term: usize| T::Real::from_single(self.amounts[term] * self.columns[term][at] / modelled);
            let present = (0..self.kinds.len()).filter(|&term| self.amounts[term] > 0.0);
            let parts: Vec<(NoiseTerm, T::Real), MAX_TERMS> =
                present.map(|term| (self.kinds[term], part(term))).collect();
            let point = points.point(at);
            let fractions = variance_fractions::<T>(
                parts.iter().map(|&(kind, part)| (kind, part.single().into())),
                point.n,
                period,
            );
            let edf = degrees_of_freedom::<T>(&parts, point, period, &points.flicker);
            points.set(at, edf, fractions);
        }
    }

    /// Replaces a term by one with another shape; its coefficient stays.
    #[inline(never)]
    pub(super) fn set_kind(&mut self, points: &Points, term: usize, kind: NoiseTerm) {
        self.kinds[term] = kind;
        self.set_column(points, term);
        if let NoiseTerm::Filtered(_) = kind {
            for other in 0..self.kinds.len() {
                if self.kinds[other].passes_filter() {
                    self.set_column(points, other);
                }
            }
        }
    }

    /// Sets the contributions of a term to the points; its coefficient stays.
    #[inline(never)]
    fn set_column(&mut self, points: &Points, term: usize) {
        let period = points.curve.sample_period();
        let (kind, filter) = (self.kinds[term], filter_of(&self.kinds));
        let mut largest = 0.0_f64;
        for (known, point) in (0..MAX_POINTS).zip(points.all()) {
            let share = T::avar(&kind, filter.as_ref(), point.n, period) / point.avar;
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

    /// Sets the amounts to those that minimise the deviance at the present degrees of freedom, and returns it.
    #[inline(never)]
    pub(super) fn minimise(&mut self, points: &Points) -> f32 {
        let mut deviance = self.deviance(points);
        // A bad start may lead to a local minimum: try a step with the measured variances.
        if deviance > FAR_OFF * points.measured.len() as f32 {
            let start = self.amounts;
            self.amounts = self.scoring_step(points, false);
            let other = self.deviance(points);
            if other < deviance {
                deviance = other;
            } else {
                self.amounts = start;
            }
        }
        for _ in 0..SCORING_ROUNDS {
            let proposed = self.scoring_step(points, true);
            let Some(lower) = self.descend(points, &proposed, deviance) else { break };
            let fall = deviance - lower;
            deviance = lower;
            if fall <= CONVERGED.max(CONVERGED_FRACTION * deviance) {
                break;
            }
        }
        deviance
    }

    /// Moves the amounts towards `proposed`, halving the step until the deviance falls; `None` if it does not.
    fn descend(&mut self, points: &Points, proposed: &[f32; MAX_TERMS], deviance: f32) -> Option<f32> {
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

    /// `Σ edf·(v/m − 1 − ln(v/m))`; infinite if the model has no variance at a point.
    pub(super) fn deviance(&self, points: &Points) -> f32 {
        self.deviance_at(points, &self.amounts)
    }

    fn deviance_at(&self, points: &Points, amounts: &[f32; MAX_TERMS]) -> f32 {
        let term = |at: usize| points.measured[at].edf * unit_deviance(self.modelled(at, amounts));
        let sum: f32 = (0..points.measured.len()).map(term).sum();
        if sum.is_nan() { f32::INFINITY } else { sum }
    }

    /// Modelled over measured variance at a point.
    pub(super) fn modelled(&self, at: usize, amounts: &[f32; MAX_TERMS]) -> f32 {
        let terms = self.columns.iter().zip(amounts).take(self.kinds.len());
        terms.map(|(column, amount)| amount * column[at]).sum()
    }

    /// One step of Fisher scoring, weighted by the modelled or the measured variances.
    #[inline(never)]
    fn scoring_step(&self, points: &Points, modelled: bool) -> [f32; MAX_TERMS] {
        let mut normal = [T::Real::ZERO; triangle(MAX_TERMS)];
        let mut right = [T::Real::ZERO; MAX_TERMS];
        let terms = self.kinds.len();
        for (at, point) in points.measured.iter().enumerate() {
            let variance = if modelled { self.modelled(at, &self.amounts) } else { 1.0 };
            let weight = point.edf / 2.0 / (variance * variance);
            for i in 0..terms {
                let weighted = T::Real::from_single(weight) * T::Real::from_single(self.columns[i][at]);
                right[i] += weighted;
                for j in 0..=i {
                    normal[entry(i, j)] += weighted * T::Real::from_single(self.columns[j][at]);
                }
            }
        }
        let mut solution = self.amounts.map(T::Real::from_single);
        non_negative(&normal, &right, terms, &mut solution);
        solution.map(T::Real::single)
    }

    /// The squared coefficient of a term.
    pub(super) fn square(&self, term: usize) -> f64 {
        f64::from(self.amounts[term]) * self.units[term]
    }

    /// The terms with their coefficients, without bounds.
    pub(super) fn terms(&self) -> impl Iterator<Item = FittedTerm> {
        self.kinds.iter().enumerate().map(|(term, &kind)| FittedTerm::exact(kind, T::sqrt(self.square(term))))
    }
}

/// `u − ln(1 + u)` with `1 + u` the measured over the modelled variance.
fn unit_deviance(modelled: f32) -> f32 {
    let excess = (1.0 - modelled) / modelled;
    if absf(excess) > 0.25 {
        return excess + lnf(modelled);
    }
    // ln(1 + u) = 2·artanh(u/(2 + u)); the first term of the series cancels with u.
    let s = excess / (2.0 + excess);
    let square = s * s;
    s * (excess - 2.0 * square * (1.0 / 3.0 + square * (1.0 / 5.0 + square * (1.0 / 7.0 + square / 9.0))))
}

#[cfg(test)]
mod tests {
    use super::unit_deviance;

    #[test]
    fn the_deviance_of_close_variances_does_not_cancel() {
        for k in -400..400 {
            let modelled = (f64::from(k) / 100.0).exp2() as f32;
            let ratio = 1.0 / f64::from(modelled);
            // In double precision the difference is exact to some 10⁻¹⁶/u²; rounding of the ratio contributes 10⁻⁷ of u.
            let exact = (ratio - 1.0) - ratio.ln();
            let found = f64::from(unit_deviance(modelled));
            assert!((found - exact).abs() <= 2e-6 * exact + 3e-7 * (ratio - 1.0).abs(), "{modelled}: {found}, {exact}");
        }
        assert_eq!(unit_deviance(1.0), 0.0);
    }
}
