//! What the octaves are worth to the regression, and how much of that they repeat of each other.

use crate::confidence::{pure_octave_correlation, roots};
use crate::math::{abs, sqrt};
use crate::{Model, Point};

/// What one octave is worth.
pub(super) struct Octave {
    pub(super) n: u64,
    edf: f32,
    /// Degrees of freedom over the variance of the channel without what it follows.
    pub(super) weight: f64,
    /// [`roots`] of the shares of the noises.
    roots: [f32; 3],
}

/// Degrees of freedom from which on an octave's own variance is known better than by a poor model: to 25 %.
const WELL_KNOWN: f64 = 30.0;
/// Octaves to which noise behind a filter, or a line, gives a form that N, B and K cannot have.
const SHORT: usize = 6;
/// Standard deviations by which one of them tells a poor model.
const MISFIT: f64 = 6.0;

/// Whether `model` misses the shortest octaves of the curve, each worth thousands of degrees of freedom, that it was fitted
/// to: what it does to come near them, it does to the long ones too.
pub(super) fn is_poor(model: &Model, points: &[Point]) -> bool {
    points.iter().take(SHORT).any(|point| {
        let sigmas = (point.avar / model.avar(point.n) - 1.0) * sqrt(model.edf(point) / 2.0);
        abs(sigmas) > MISFIT
    })
}

impl Octave {
    /// Of a point of the channel's curve under the model of it, which may be poor; `None` where nothing moves.
    pub(super) fn of(point: &Point, model: &Model, is_poor: bool) -> Option<Self> {
        let edf = model.edf(point);
        // What a good model lacks is noise to the regression too.
        let variance = if is_poor && edf >= WELL_KNOWN { point.avar } else { model.avar(point.n).max(point.avar) };
        (variance > 0.0).then(|| Self {
            n: point.n,
            edf: edf as f32,
            weight: edf / variance,
            roots: roots(model.shares(point.n)).map(|root| root as f32),
        })
    }

    /// Correlation of the variances of two octaves, `lag` apart.
    fn correlation(&self, other: &Self, lag: usize) -> f64 {
        let of = |noise: usize| f64::from(self.roots[noise] * other.roots[noise]) * pure_octave_correlation(lag, noise);
        (0..3).map(of).sum()
    }
}

/// Variance of a sum over the octaves of products whose variance at averaging factor `n` goes as `common(n)`: what two
/// covariates have in common.
pub(super) fn scatter<const COUPLED: usize>(octaves: &[Octave], common: impl Fn(u64) -> f64) -> f64 {
    let mut roots = [0.0; COUPLED];
    for (root, octave) in roots.iter_mut().zip(octaves) {
        let common = common(octave.n);
        let modulus = sqrt(octave.weight * abs(common));
        *root = if common < 0.0 { -modulus } else { modulus };
    }
    correlated(octaves, |k| roots[k])
}

/// Degrees of freedom of one sensitivity: of the octaves, each as the covariate's variance counts, less what they
/// repeat of each other.
pub(super) fn freedom(octaves: &[Octave], measured: impl Fn(u64) -> f64) -> f64 {
    let counts = |octave: &Octave| octave.weight * measured(octave.n);
    let sum: f64 = octaves.iter().map(counts).sum();
    let square = correlated(octaves, |k| counts(&octaves[k]) / sqrt(f64::from(octaves[k].edf)));
    if square > 0.0 { sum * sum / square } else { 0.0 }
}

/// `Σ rₖₗ·fₖ·fₗ` with the correlations of the octaves.
fn correlated(octaves: &[Octave], factor: impl Fn(usize) -> f64) -> f64 {
    let mut sum = 0.0;
    for (k, a) in octaves.iter().enumerate() {
        let mut along = factor(k) / 2.0;
        for (l, b) in octaves.iter().enumerate().take(k) {
            along += a.correlation(b, k - l) * factor(l);
        }
        sum += 2.0 * factor(k) * along;
    }
    sum
}
