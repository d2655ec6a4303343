//! The points of a curve, and what each is worth under a model.

use crate::confidence::{Shares, octave_correlation};
use crate::math::{abs, log2, sqrt};
use crate::model::{FlickerCovariances, Model};
use crate::{Curve, Point};
use heapless::Vec;

/// A measured point with what is known of it before the coefficients are.
pub(super) struct Measured {
    pub(super) n: u64,
    pub(super) avar: f64,
    pub(super) edf: f64,
    /// Without the memory of narrow terms, which all points share.
    near_edf: f64,
    octave: f64,
    shares: Shares,
}

/// The points with a positive variance.
pub(super) struct Points<const POINTS: usize> {
    pub(super) sample_period: f64,
    pub(super) measured: Vec<Measured, POINTS>,
}

impl<const POINTS: usize> Points<POINTS> {
    /// None yet.
    #[inline(always)]
    pub(super) const fn empty() -> Self {
        Self { sample_period: 0.0, measured: Vec::new() }
    }

    /// Takes those of a curve, weighed by the noise that the curve itself names.
    pub(super) fn take(&mut self, curve: &Curve<POINTS>) {
        self.sample_period = curve.sample_period();
        self.measured.extend(positive(curve).map(|point| Measured {
            n: point.n,
            avar: point.avar,
            edf: point.edf,
            near_edf: point.edf,
            octave: log2(point.n as f64),
            shares: Shares::WHITE,
        }));
    }

    /// Takes the degrees of freedom from the mixture of noises that `model` says.
    pub(super) fn weigh(&mut self, curve: &Curve<POINTS>, model: &Model) {
        let flicker = FlickerCovariances::new(curve.points().last().map_or(1, |point| point.overlap));
        for (measured, point) in self.measured.iter_mut().zip(positive(curve)) {
            measured.shares = model.shares(point.n);
            (measured.edf, measured.near_edf) = model.degrees_of_freedom(point, &flicker);
        }
    }

    /// Variances of `Σ weights·residual`, of residuals in their standard deviations.
    pub(super) fn variances<const SUMS: usize>(&self, weights: [&[f64; POINTS]; SUMS]) -> [f64; SUMS] {
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
pub(super) fn correlation(a: &Measured, b: &Measured) -> f64 {
    let octaves = abs(a.octave - b.octave);
    let (near_a, near_b) = (a.edf / a.near_edf, b.edf / b.near_edf);
    sqrt(near_a * near_b) * octave_correlation((octaves + 0.5) as usize, a.shares, b.shares)
        + sqrt((1.0 - near_a).max(0.0) * (1.0 - near_b).max(0.0))
}

fn positive<const POINTS: usize>(curve: &Curve<POINTS>) -> impl Iterator<Item = &Point> {
    curve.points().iter().filter(|point| point.avar > 0.0)
}
