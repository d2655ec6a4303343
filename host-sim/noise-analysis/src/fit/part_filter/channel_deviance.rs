//! The deviance of the curve of one channel as a function of the filter.

use super::decimation::slowest;
use crate::OCTAVES;
use crate::fit::noise_terms::is_white;
use crate::fit::octave_covariance::relative_covariance;
use crate::fit::sample_coefficients::SamplesOfCurve;
use crate::fit::traced_model::COST_OF_A_TERM;
use crate::samples::rounding::Rounding;
use allan_core::host::DevianceComparison;
use allan_core::model::{FittedTerm, MAX_TERMS};
use allan_core::term::{MovingAverageFilter, Sinusoid};
use allan_core::{AllanPoint, Curve, Model, NoiseTerm};
use nalgebra::{DMatrix, DVector};

/// Rounding takes at most this part of a measured variance: it is white only where the noise is larger.
const MOST_ROUNDING: f64 = 0.5;
/// Relative step of numerical derivatives.
const DERIVATIVE_STEP: f64 = 1e-3;

/// An inertial channel and what it says of the filter.
pub(crate) struct FilteredChannel<'a> {
    /// As in reports.
    pub name: &'static str,
    /// Without the share of its covariates.
    pub curve: &'a Curve<OCTAVES>,
    /// Its own model, whose terms beside the white noise it keeps.
    pub model: &'a Model,
    /// Of its samples. Errors that are correlated are not in the curve any more.
    pub rounding: &'a Rounding,
    /// Whether rounding adds white noise and nothing else. A channel that is not dithered says nothing of the filter.
    pub is_dithered: bool,
    /// Its samples, and the frequencies of lines in their spectrum, Hz, where they are kept.
    pub samples: Option<(SamplesOfCurve<'a>, Vec<f64>)>,
}

/// The curve of a channel without the white noise of its rounding.
pub(super) fn without_rounding(channel: &FilteredChannel) -> Curve<OCTAVES> {
    let mut curve = channel.curve.clone();
    if !channel.rounding.is_correlated() {
        let variance = channel.rounding.variance();
        curve.replace_avar(|point| point.avar - (variance / point.n as f64).min(MOST_ROUNDING * point.avar));
    }
    curve
}

/// Allan variances behind a filter, which all channels share.
pub(super) struct VariancesBehind {
    filter: MovingAverageFilter,
    /// Of each kind for a coefficient of 1, at averaging factors of 1, 2, 4 and so on.
    kinds: [(NoiseTerm, Vec<f64>); 3],
}

impl VariancesBehind {
    /// At so many octaves, of channels that are sampled every `period` seconds.
    pub(super) fn new(filter: MovingAverageFilter, octaves: u32, period: f64) -> Self {
        let filtered = FittedTerm::exact(NoiseTerm::Filtered(filter), 1.0);
        let kinds = [filtered.kind, NoiseTerm::BiasInstability, NoiseTerm::RateRandomWalk];
        let of_kind = |kind: NoiseTerm| {
            let own = FittedTerm::exact(kind, 1.0);
            let model = Model::new(period, [filtered, own]);
            (kind, (0..octaves).map(|octave| model.part(&own, 1 << octave)).collect())
        };
        Self { filter, kinds: kinds.map(of_kind) }
    }

    fn avar(&self, kind: &NoiseTerm, n: u64) -> Option<f64> {
        let (_, octaves) = self.kinds.iter().find(|(of, _)| of == kind)?;
        n.is_power_of_two().then(|| octaves.get(n.trailing_zeros() as usize).copied())?
    }
}

/// The deviance of a channel, and what it must exceed to be worth the terms that were added.
pub(super) struct Cost {
    pub(super) deviance: f64,
    of_terms: f64,
}

impl Cost {
    pub(super) fn total(&self) -> f64 {
        self.deviance + self.of_terms
    }
}

/// The deviance of one channel as a function of the filter.
pub(super) struct ChannelDeviance<'a> {
    pub(super) name: &'static str,
    comparison: DevianceComparison<'a>,
    curve: &'a Curve<OCTAVES>,
    /// The terms of the channel beside its white noise.
    others: Vec<NoiseTerm>,
    /// Lines of its spectrum.
    lines: Vec<NoiseTerm>,
    /// By how much the deviance exceeds that of a curve which a filter describes, at least 1; what it is divided by.
    pub(super) dispersion: f64,
    /// Each filter that may be read slowly, at the decimation that fits this channel best.
    pub(super) slowest: Vec<MovingAverageFilter>,
}

impl<'a> ChannelDeviance<'a> {
    pub(super) fn new(channel: &FilteredChannel<'a>, curve: &'a Curve<OCTAVES>) -> Self {
        let model = channel.model;
        let kinds = model.terms().iter().map(|term| term.kind).filter(|kind| !is_white(kind));
        // With room for the filter and the white noise after it.
        let others = kinds.take(MAX_TERMS - 2).collect();
        Self {
            name: channel.name,
            comparison: DevianceComparison::new(curve, model),
            curve,
            others,
            lines: channel.samples.iter().flat_map(|(_, lines)| lines).map(|&frequency| sinusoid(frequency)).collect(),
            dispersion: 1.0,
            slowest: Vec::new(),
        }
    }

    /// Sets the dispersion by the least deviance with any of `filters`, at their own rate or read slowly, or with none; and the
    /// decimations that fit best.
    pub(super) fn fit_alone(&mut self, filters: &[MovingAverageFilter]) {
        let mut least = self.unfiltered();
        for &filter in filters {
            least = least.min(self.deviance(filter));
            if let Some(slow) = slowest(filter, |read| self.deviance(read)) {
                least = least.min(self.deviance(slow));
                self.slowest.push(slow);
            }
        }
        self.dispersion = self.dispersion_by(least);
    }

    /// The dispersion, if this is the least deviance.
    pub(super) fn dispersion_by(&self, least: f64) -> f64 {
        // The white noise, the other terms, and the decimation are fitted.
        let freedom = self.curve.points().len().saturating_sub(self.others.len() + 2).max(1);
        if least.is_finite() { (least / freedom as f64).max(1.0) } else { 1.0 }
    }

    pub(super) fn sample_period(&self) -> f64 {
        self.curve.sample_period()
    }

    pub(super) fn unfiltered(&mut self) -> f64 {
        self.comparison.deviance(&[&[NoiseTerm::AngleRandomWalk], self.others.as_slice()].concat()) / self.dispersion
    }

    pub(super) fn deviance(&mut self, filter: MovingAverageFilter) -> f64 {
        self.comparison.deviance(&kinds(NoiseTerm::Filtered(filter), &self.others)) / self.dispersion
    }

    /// The same with the Allan variances behind the filter from elsewhere.
    pub(super) fn deviance_behind(&mut self, behind: &VariancesBehind) -> f64 {
        let kinds = kinds(NoiseTerm::Filtered(behind.filter), &self.others);
        self.comparison.deviance_with(&kinds, |kind, n| behind.avar(kind, n)) / self.dispersion
    }

    /// With `filtered` in place of the white noise, and with the other terms of the channel, or without those of them that may stand in for
    /// another filter, or with the lines of its spectrum in their place, whichever costs least. It is not divided by the dispersion.
    pub(super) fn cost_behind(&mut self, filtered: NoiseTerm) -> Cost {
        let stands_in = |kind: &&NoiseTerm| matches!(kind, NoiseTerm::Markov(_) | NoiseTerm::Quantization);
        let fewer: Vec<NoiseTerm> = self.others.iter().filter(|kind| !stands_in(kind)).copied().collect();
        let lines = self.lines.iter().filter(|line| !self.others.contains(line));
        let with_lines: Vec<NoiseTerm> = fewer.iter().chain(lines).take(MAX_TERMS - 2).copied().collect();
        let mut cost = |others: &[NoiseTerm]| {
            let added = others.iter().filter(|kind| !NoiseTerm::BASELINE.contains(kind)).count();
            let deviance = self.comparison.deviance(&kinds(filtered, others));
            Cost { deviance, of_terms: COST_OF_A_TERM * added as f64 }
        };
        let others = [cost(&fewer), cost(&with_lines)];
        others.into_iter().fold(cost(&self.others), |least, of| if of.total() < least.total() { of } else { least })
    }

    /// Variance of the decimation's score over its information, at least 1: by how much the deviance falls and rises more
    /// than for independent points.
    pub(super) fn scatter(&self, filter: MovingAverageFilter) -> f64 {
        let model = allan_core::fit::fit(self.curve, &kinds(NoiseTerm::Filtered(filter), &self.others));
        let points: Vec<&AllanPoint> =
            self.curve.points().iter().filter(|point| point.avar > 0.0 && model.avar(point.n) > 0.0).collect();
        let present: Vec<&FittedTerm> = model.terms().iter().filter(|term| term.value > 0.0).collect();
        let filtered = present.iter().find(|term| matches!(term.kind, NoiseTerm::Filtered(_)));
        let Some(filtered) = filtered else { return 1.0 };
        let shorter = |factor: f64| {
            let read = MovingAverageFilter { decimation: filter.decimation * factor, ..filter };
            NoiseTerm::Filtered(read)
        };
        let share = |point: &AllanPoint, term: &FittedTerm| model.part(term, point.n) / model.avar(point.n);
        let direction = DVector::from_iterator(
            points.len(),
            points.iter().map(|point| {
                let [from, to] = [1.0 - DERIVATIVE_STEP, 1.0 + DERIVATIVE_STEP].map(|factor| {
                    let mut term = **filtered;
                    term.kind = shorter(factor);
                    share(point, &term)
                });
                (to - from) / (2.0 * DERIVATIVE_STEP)
            }),
        );
        let amounts = DMatrix::from_fn(points.len(), present.len(), |at, term| share(points[at], present[term]));
        let weights = DVector::from_iterator(points.len(), points.iter().map(|point| model.edf(point) / 2.0));
        let weighted = DMatrix::from_diagonal(&weights) * &amounts;
        let Some(information) = (amounts.transpose() * &weighted).cholesky() else { return 1.0 };
        // What the amounts of the terms cannot imitate.
        let own = &direction - &amounts * information.solve(&(weighted.transpose() * &direction));
        let score = own.component_mul(&weights);
        let variance = (score.transpose() * relative_covariance(&model, &points) * &score)[(0, 0)];
        (variance / score.dot(&own)).max(1.0)
    }
}

fn sinusoid(frequency: f64) -> NoiseTerm {
    NoiseTerm::Sinusoid(Sinusoid { frequency })
}

/// White noise behind a filter, `filtered`, with the terms `others`. At the filter's own rate white noise after the filter is told from what
/// passed it; read slowly it is not.
pub(super) fn kinds(filtered: NoiseTerm, others: &[NoiseTerm]) -> Vec<NoiseTerm> {
    let is_read_slowly = matches!(filtered, NoiseTerm::Filtered(filter) if filter.decimation != 1.0);
    let after = (!is_read_slowly).then_some(NoiseTerm::AngleRandomWalk);
    std::iter::once(filtered).chain(others.iter().copied()).chain(after).collect()
}
