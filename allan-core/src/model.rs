//! A noise model: terms with their coefficients, and what they do together.

use crate::Point;
use crate::confidence::Shares;
use crate::math::clamp;
use crate::term::{BiasInstability, Kind, Process};
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
        let mut shares = Shares { white: 0.0, ..Shares::WHITE };
        for (kind, avar) in self.contributions(n) {
            let share = kind.share(avar / total, n, self.sample_period);
            shares.white += share.white;
            shares.flicker += share.flicker;
            shares.random_walk += share.random_walk;
            shares.quantization += share.quantization;
        }
        shares
    }

    /// Equivalent degrees of freedom of a measured point if the model is true.
    ///
    /// By the sums of Greenhall and Riley over the second differences' covariances. A deterministic term repeats in
    /// every record, so it blurs an estimate only together with the noise; a narrow resonance remembers its
    /// amplitude, so it blurs it more than its share says.
    #[must_use]
    pub fn edf(&self, point: &Point) -> f64 {
        self.degrees_of_freedom(point, &FlickerCovariances::NONE).0
    }

    /// The same, and without the memory of narrow terms beyond two averaging times.
    pub(crate) fn degrees_of_freedom(&self, point: &Point, flicker: &FlickerCovariances) -> (f64, f64) {
        let avar = self.avar(point.n);
        let (near, far) = self.blur(point, flicker);
        // As many as there are differences where nothing random is modelled at all.
        let of = |blur: f64| clamp(point.count as f64 * avar * avar / blur, 1.0_f64.min(point.count as f64), 1e18);
        (of(near + far), of(near))
    }

    /// Sums of the squared covariances: up to two averaging times (four with flicker noise), and beyond.
    fn blur(&self, point: &Point, flicker: &FlickerCovariances) -> (f64, f64) {
        let stride = point.n as f64 / f64::from(point.overlap);
        let has_flicker = self.present().any(|term| term.kind == Kind::BiasInstability);
        let reach = if has_flicker { 4 } else { 2 } * u64::from(point.overlap);
        let count = point.count as f64;
        let mut near = 0.0;
        for lag in 0..=reach.min(point.count.saturating_sub(1)) {
            let (mut noise, mut certain) = (0.0, 0.0);
            for term in self.present() {
                let covariance = match term.kind {
                    Kind::BiasInstability => flicker.at(lag as u32, point.overlap),
                    kind => kind.process().covariance(lag as f64 * stride, point.n, self.sample_period),
                };
                *if term.kind.is_deterministic() { &mut certain } else { &mut noise } +=
                    term.value * term.value * covariance;
            }
            let weight = if lag == 0 { 1.0 } else { 2.0 * (1.0 - lag as f64 / count) };
            near += weight * noise * (noise + 2.0 * certain);
        }
        // With flicker noise the near sum goes further than the memory begins; both are small there.
        let of = |term: &Term| {
            let square = term.value * term.value;
            square * square * term.kind.process().memory_beyond(point.n, stride, self.sample_period)
        };
        (near, 2.0 * self.present().map(of).sum::<f64>())
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

/// Covariances of flicker noise, worked out once for all points: they depend on the distance in averaging times alone.
pub(crate) struct FlickerCovariances {
    overlap: u32,
    /// Every `1/overlap` averaging times, up to 4 of them at 8-fold overlap.
    table: Vec<f64, 33>,
}

impl FlickerCovariances {
    /// Each worked out when it is asked for.
    const NONE: Self = Self { overlap: 1, table: Vec::new() };

    /// For points of this overlap and of those that divide it.
    pub(crate) fn new(overlap: u32) -> Self {
        Self { overlap, table: (0..33).map(|lag| Self::of(lag, overlap)).collect() }
    }

    fn of(lag: u32, overlap: u32) -> f64 {
        BiasInstability.covariance(f64::from(lag), u64::from(overlap), 1.0)
    }

    fn at(&self, lag: u32, overlap: u32) -> f64 {
        let known = (lag * self.overlap).is_multiple_of(overlap).then(|| lag * self.overlap / overlap);
        let known = known.and_then(|lag| self.table.get(lag as usize)).copied();
        known.unwrap_or_else(|| Self::of(lag, overlap))
    }
}
