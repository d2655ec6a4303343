//! From a curve to coefficients: the non-negative fit of a gamma likelihood.
//!
//! An estimate of the Allan variance with `edf` degrees of freedom is gamma distributed around the true one, so the
//! coefficients minimise `Σ edf/2·(ln m + v/m)`. Fisher scoring turns that into a sequence of small non-negative
//! least-squares problems; the degrees of freedom follow the fitted mixture of noises, which is iterated too.

mod least_squares;

use crate::chi_square::NORMAL_975;
use crate::confidence::{Shares, octave_correlation};
use crate::{Curve, Kind, math};
use heapless::Vec;
use least_squares::{Matrix, Vector, inverse, non_negative};

/// Terms that a model can hold.
pub const MAX_TERMS: usize = 4;
const MAX_OCTAVES: usize = 32;
const EDF_ROUNDS: usize = 4;
const SCORING_ROUNDS: usize = 60;

/// A fitted coefficient with its 95 % bounds, in the unit of its [`Kind`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Term {
    /// What the coefficient belongs to.
    pub kind: Kind,
    /// Estimate; 0 when the data does not show the term.
    pub value: f64,
    /// Lower bound; 0 when the data is compatible with the absence of the term.
    pub low: f64,
    /// Upper bound, above 0 wherever there is data.
    pub high: f64,
}

/// A sum of noise terms.
#[derive(Debug, Clone, PartialEq)]
pub struct Model {
    sample_period: f64,
    terms: Vec<Term, MAX_TERMS>,
}

impl Model {
    /// The terms in the order that was asked for.
    #[must_use]
    pub fn terms(&self) -> &[Term] {
        &self.terms
    }

    /// Modelled Allan variance at averaging factor `n`.
    #[must_use]
    pub fn avar(&self, n: u64) -> f64 {
        self.contributions(n).map(|(_, avar)| avar).sum()
    }

    /// What part of the modelled variance at averaging factor `n` is due to which noise.
    #[must_use]
    pub fn shares(&self, n: u64) -> Shares {
        let total = self.avar(n);
        if total <= 0.0 {
            return Shares::WHITE;
        }
        let mut shares = Shares { white: 0.0, ..Shares::WHITE };
        for (kind, avar) in self.contributions(n) {
            let share = kind.share(avar / total);
            shares.white += share.white;
            shares.flicker += share.flicker;
            shares.random_walk += share.random_walk;
            shares.quantization += share.quantization;
        }
        shares
    }

    /// The same model with the samples' unit replaced: every coefficient times `lsb`.
    #[must_use]
    pub fn scaled(mut self, lsb: f64) -> Self {
        for term in &mut self.terms {
            term.value *= lsb;
            term.low *= lsb;
            term.high *= lsb;
        }
        self
    }

    fn contributions(&self, n: u64) -> impl Iterator<Item = (Kind, f64)> + '_ {
        self.terms.iter().map(move |term| (term.kind, term.value * term.value * term.kind.avar(n, self.sample_period)))
    }
}

/// Fits the terms of `kinds` (the first [`MAX_TERMS`] of them, each once) to all points of a curve.
///
/// A curve without points, or of a channel that never changed, gives coefficients of 0.
#[must_use]
pub fn fit<const OCTAVES: usize>(curve: &Curve<OCTAVES>, kinds: &[Kind]) -> Model {
    let kinds: Vec<Kind, MAX_TERMS> = kinds.iter().copied().take(MAX_TERMS).collect();
    let mut problem = Problem::new(curve, &kinds);
    let mut squares = [0.0; MAX_TERMS];
    let mut model = problem.model(curve.sample_period(), &squares);
    for _ in 0..EDF_ROUNDS {
        squares = problem.minimise();
        model = problem.model(curve.sample_period(), &squares);
        problem.weigh(curve, &model);
    }
    problem.bound(&mut model, &squares);
    model
}

struct Octave {
    basis: Vector<MAX_TERMS>,
    measured: f64,
    edf: f64,
    shares: Shares,
}

/// The octaves with a positive variance, and the terms.
struct Problem {
    kinds: Vec<Kind, MAX_TERMS>,
    octaves: Vec<Octave, MAX_OCTAVES>,
}

impl Problem {
    fn new<const OCTAVES: usize>(curve: &Curve<OCTAVES>, kinds: &[Kind]) -> Self {
        let octaves = curve.points().iter().filter(|point| point.avar > 0.0).map(|point| {
            let mut basis = [0.0; MAX_TERMS];
            for (entry, kind) in basis.iter_mut().zip(kinds) {
                *entry = kind.avar(point.n, curve.sample_period());
            }
            Octave { basis, measured: point.avar, edf: point.edf, shares: Shares::WHITE }
        });
        Self { kinds: kinds.iter().copied().collect(), octaves: octaves.take(MAX_OCTAVES).collect() }
    }

    /// The squares of the coefficients that minimise the gamma deviance at the present weights.
    fn minimise(&self) -> Vector<MAX_TERMS> {
        let start = self.scoring_step(|octave| octave.measured);
        let (mut squares, mut deviance) = (start, self.deviance(&start));
        for _ in 0..SCORING_ROUNDS {
            let proposed = self.scoring_step(|octave| modelled(octave, &squares));
            let Some((next, lower)) = self.descend(&squares, &proposed, deviance) else {
                break;
            };
            let settled = deviance - lower <= 1e-12 * math::abs(deviance);
            (squares, deviance) = (next, lower);
            if settled {
                break;
            }
        }
        squares
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

    fn deviance(&self, squares: &Vector<MAX_TERMS>) -> f64 {
        let of = |octave: &Octave| {
            let ratio = octave.measured / modelled(octave, squares);
            octave.edf * (ratio - 1.0 - math::ln(ratio))
        };
        self.octaves.iter().map(of).sum()
    }

    /// Non-negative least squares with the variances that `expected` tells.
    fn scoring_step(&self, expected: impl Fn(&Octave) -> f64) -> Vector<MAX_TERMS> {
        let (normal, right) = self.normal_equations(expected);
        non_negative(&normal, &right, self.kinds.len())
    }

    fn normal_equations(&self, expected: impl Fn(&Octave) -> f64) -> (Matrix<MAX_TERMS>, Vector<MAX_TERMS>) {
        let mut normal = [[0.0; MAX_TERMS]; MAX_TERMS];
        let mut right = [0.0; MAX_TERMS];
        for octave in &self.octaves {
            let variance = expected(octave);
            let weight = octave.edf / 2.0 / (variance * variance);
            for (i, row) in normal.iter_mut().enumerate() {
                right[i] += weight * octave.basis[i] * octave.measured;
                for (j, entry) in row.iter_mut().enumerate() {
                    *entry += weight * octave.basis[i] * octave.basis[j];
                }
            }
        }
        (normal, right)
    }

    /// Takes the degrees of freedom from the mixture of noises that `model` says.
    fn weigh<const OCTAVES: usize>(&mut self, curve: &Curve<OCTAVES>, model: &Model) {
        let points = curve.points().iter().filter(|point| point.avar > 0.0);
        for (octave, point) in self.octaves.iter_mut().zip(points) {
            octave.shares = model.shares(point.n);
            octave.edf = point.edf_of(octave.shares);
        }
    }

    fn model(&self, sample_period: f64, squares: &Vector<MAX_TERMS>) -> Model {
        let term = |(&kind, &square): (&Kind, &f64)| {
            let value = math::sqrt(square);
            Term { kind, value, low: value, high: value }
        };
        Model { sample_period, terms: self.kinds.iter().zip(squares).map(term).collect() }
    }

    /// Sets the 95 % bounds from the sandwich covariance: the octaves are not independent, and independent ones
    /// would claim 1.5 to 1.8 times too little.
    fn bound(&self, model: &mut Model, squares: &Vector<MAX_TERMS>) {
        let count = self.kinds.len();
        let (normal, _) = self.normal_equations(|octave| modelled(octave, squares));
        let Some(inverse) = inverse(&normal, count) else {
            return;
        };
        let score = self.score_covariance(squares);
        for (i, term) in model.terms.iter_mut().enumerate() {
            let mut variance = 0.0;
            for (j, row) in score.iter().enumerate().take(count) {
                for (k, entry) in row.iter().enumerate().take(count) {
                    variance += inverse[i][j] * entry * inverse[k][i];
                }
            }
            let half_width = NORMAL_975 * math::sqrt(variance.max(0.0));
            term.low = math::sqrt((squares[i] - half_width).max(0.0));
            term.high = math::sqrt(squares[i] + half_width);
        }
    }

    fn score_covariance(&self, squares: &Vector<MAX_TERMS>) -> Matrix<MAX_TERMS> {
        let mut covariance = [[0.0; MAX_TERMS]; MAX_TERMS];
        for (a, first) in self.octaves.iter().enumerate() {
            for (b, second) in self.octaves.iter().enumerate() {
                let correlation = octave_correlation(a.abs_diff(b), first.shares, second.shares);
                let scale = math::sqrt(first.edf * second.edf) / 2.0 * correlation
                    / (modelled(first, squares) * modelled(second, squares));
                for (i, row) in covariance.iter_mut().enumerate() {
                    for (j, entry) in row.iter_mut().enumerate() {
                        *entry += scale * first.basis[i] * second.basis[j];
                    }
                }
            }
        }
        covariance
    }
}

fn modelled(octave: &Octave, squares: &Vector<MAX_TERMS>) -> f64 {
    octave.basis.iter().zip(squares).map(|(basis, square)| basis * square).sum()
}
