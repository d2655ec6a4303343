//! A noise model: terms with their coefficients, and what they do together.

pub(crate) mod freedom;

use crate::Point;
use crate::confidence::Shares;
use crate::term::Kind;
use freedom::{Flicker, degrees_of_freedom};
use heapless::Vec;

/// Terms that a model can hold.
pub const MAX_TERMS: usize = 8;
/// Shape parameters that a term can have.
pub const MAX_SHAPE: usize = 2;

/// A fitted term with its 95 % bounds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Term {
    /// What the coefficient belongs to, with the estimates of its shape.
    pub kind: Kind,
    /// Coefficient; 0 when the data does not show the term.
    pub value: f64,
    /// Lower bound; 0 when the data is compatible with the absence of the term.
    pub low: f64,
    /// Upper bound, above 0 wherever there is data.
    pub high: f64,
    /// Bounds of the shape's parameters, in the order of [`Kind::shape`].
    pub shape: [(f64, f64); MAX_SHAPE],
}

impl Term {
    /// A coefficient that is known, or whose bounds are still to be found.
    #[must_use]
    pub fn exact(kind: Kind, value: f64) -> Self {
        let shape = kind.shape().map(|(_, value)| (value, value));
        Self { kind, value, low: value, high: value, shape }
    }
}

/// A sum of noise terms.
#[derive(Debug, Clone, PartialEq)]
pub struct Model {
    sample_period: f64,
    terms: Vec<Term, MAX_TERMS>,
}

impl Model {
    /// The first [`MAX_TERMS`] of `terms` in samples every `sample_period` seconds.
    #[must_use]
    pub fn new(sample_period: f64, terms: impl IntoIterator<Item = Term>) -> Self {
        Self { sample_period, terms: terms.into_iter().take(MAX_TERMS).collect() }
    }

    /// The same in place.
    pub(crate) fn set(&mut self, sample_period: f64, terms: impl Iterator<Item = Term>) {
        self.sample_period = sample_period;
        self.terms.clear();
        self.terms.extend(terms.take(MAX_TERMS));
    }

    /// Seconds between samples.
    #[must_use]
    pub fn sample_period(&self) -> f64 {
        self.sample_period
    }

    /// The terms in the order that was asked for.
    #[must_use]
    pub fn terms(&self) -> &[Term] {
        &self.terms
    }

    /// What the terms are.
    pub(crate) fn kinds(&self) -> Vec<Kind, MAX_TERMS> {
        self.terms.iter().map(|term| term.kind).collect()
    }

    pub(crate) fn terms_mut(&mut self) -> &mut [Term] {
        &mut self.terms
    }

    /// Modelled Allan variance at averaging factor `n`.
    #[must_use]
    pub fn avar(&self, n: u64) -> f64 {
        self.contributions(n).map(|(_, avar)| avar).sum()
    }

    /// Modelled two-sided power spectral density at `frequency` in Hz; lines have none.
    #[must_use]
    pub fn density(&self, frequency: f64) -> f64 {
        let of = |term: &Term| term.value * term.value * term.kind.process().density(frequency, self.sample_period);
        self.present().map(of).sum()
    }

    /// What part of the modelled variance at averaging factor `n` is due to which power law, roughly where a term is
    /// none.
    #[must_use]
    pub fn shares(&self, n: u64) -> Shares {
        let total = self.avar(n);
        if total <= 0.0 {
            return Shares::WHITE;
        }
        shares(self.contributions(n).map(|(kind, avar)| (kind, avar / total)), n, self.sample_period)
    }

    /// Equivalent degrees of freedom of a measured point if the model is true.
    #[must_use]
    pub fn edf(&self, point: &Point) -> f64 {
        let avar = self.avar(point.n);
        let parts: Vec<(Kind, f64), MAX_TERMS> =
            self.contributions(point.n).map(|(kind, part)| (kind, part / avar)).collect();
        degrees_of_freedom(&parts, point, self.sample_period, &Flicker::NONE).0
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

    fn present(&self) -> impl Iterator<Item = &Term> {
        self.terms.iter().filter(|term| term.value > 0.0)
    }

    fn contributions(&self, n: u64) -> impl Iterator<Item = (Kind, f64)> + '_ {
        self.present().map(move |term| (term.kind, term.value * term.value * term.kind.avar(n, self.sample_period)))
    }
}

/// The power laws that terms with such shares resemble at averaging factor `n`.
pub(crate) fn shares(parts: impl Iterator<Item = (Kind, f64)>, n: u64, sample_period: f64) -> Shares {
    let mut shares = Shares { white: 0.0, ..Shares::WHITE };
    for (kind, part) in parts {
        let share = kind.share(part, n, sample_period);
        shares.white += share.white;
        shares.flicker += share.flicker;
        shares.random_walk += share.random_walk;
        shares.quantization += share.quantization;
    }
    shares
}
