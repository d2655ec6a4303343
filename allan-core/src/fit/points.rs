//! The points of a curve, and what each is worth under a model.

use crate::confidence::{Shares, pure_octave_correlation, roots};
use crate::math::{absf, log2, sqrtf};
use crate::model::freedom::Flicker;
use crate::{Curve, Point};
use heapless::Vec;

/// What is known of a measured point beside the point itself, and what it is worth.
pub(super) struct Measured {
    /// Where it stands in the curve.
    at: u16,
    octave: f32,
    pub(super) edf: f32,
    /// Part of the scatter that is not the memory of narrow terms, which all points share.
    near: f32,
    /// [`roots`] of the shares of the noises.
    roots: [f32; 3],
}

/// The points of a curve with a positive variance.
pub(super) struct Points<'a, const POINTS: usize> {
    pub(super) curve: &'a Curve<POINTS>,
    pub(super) measured: Vec<Measured, POINTS>,
    pub(super) flicker: Flicker,
}

impl<'a, const POINTS: usize> Points<'a, POINTS> {
    /// None yet. Filled where it stands: it is too large to be handed about on a small stack.
    #[inline(always)]
    pub(super) const fn empty(curve: &'a Curve<POINTS>) -> Self {
        Self { curve, measured: Vec::new(), flicker: Flicker::NONE }
    }

    /// Takes those of the curve, weighed by the noise that it names itself.
    pub(super) fn take(&mut self) {
        self.flicker.take(self.curve.points().last().map_or(1, |point| point.overlap));
        let positive = self.curve.points().iter().enumerate().filter(|(_, point)| point.avar > 0.0);
        self.measured.extend(positive.map(|(at, point)| Measured {
            at: at as u16,
            octave: log2(point.n as f64) as f32,
            edf: point.edf as f32,
            near: 1.0,
            roots: roots(Shares::WHITE).map(|root| root as f32),
        }));
    }

    /// What was measured.
    pub(super) fn point(&self, at: usize) -> &Point {
        &self.curve.points()[usize::from(self.measured[at].at)]
    }

    /// Every [`Point`] in turn.
    pub(super) fn all(&self) -> impl Iterator<Item = &Point> {
        (0..self.measured.len()).map(|at| self.point(at))
    }

    /// Takes degrees of freedom, all and those that forget, and the shares of the noises for those of a point.
    pub(super) fn set(&mut self, at: usize, (edf, near_edf): (f64, f64), shares: Shares) {
        let measured = &mut self.measured[at];
        measured.edf = edf as f32;
        measured.near = (edf / near_edf) as f32;
        measured.roots = roots(shares).map(|root| root as f32);
    }

    /// Variances of `Σ weights·residual`, of residuals in their standard deviations.
    pub(super) fn variances<const SUMS: usize>(&self, weights: [&[f32; POINTS]; SUMS]) -> [f32; SUMS] {
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

/// Correlation of the errors of two points. What narrow terms remember raises and lowers all points together.
pub(super) fn correlation(a: &Measured, b: &Measured) -> f32 {
    let octaves = (absf(a.octave - b.octave) + 0.5) as usize;
    let of = |noise: usize| a.roots[noise] * b.roots[noise] * pure_octave_correlation(octaves, noise) as f32;
    let near: f32 = (0..3).map(of).sum();
    sqrtf(a.near * b.near) * near + sqrtf((1.0 - a.near).max(0.0) * (1.0 - b.near).max(0.0))
}
