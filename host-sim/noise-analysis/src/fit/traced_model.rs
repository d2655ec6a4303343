//! A noise model that is fitted to a curve, each of its terms with what added it to the baseline. Every edit fits the terms again and
//! keeps the bounds, the goodness and the additions with them.

use crate::OCTAVES;
use crate::bounds::BoundedEstimate;
use crate::fit::noise_terms::{filter_length_s, is_filter, is_white};
use crate::fit::octave_covariance::{is_adjusted_of_filter, with_bounds_behind_a_filter};
use allan_core::fit::{Goodness, fit, goodness};
use allan_core::host::fit_shapes_except;
use allan_core::model::{FittedTerm, MAX_TERMS};
use allan_core::trace::{Residual, Trace};
use allan_core::{AllanPoint, Curve, Model, NoiseTerm};
use statrs::distribution::{ChiSquared, ContinuousCDF};

/// Smallest share of a line in the variance of a point of the curve, in standard deviations of it, that moves the other terms: a
/// smaller one is hidden by the scatter of each point.
const VISIBLE_SIGMAS: f64 = 0.5;
/// Least part of the variance of a point that is left to the other terms beside a line: a line that takes more is traced in the curve.
const LEAST_LEFT: f64 = 0.1;
/// Least decrease of the deviance by a term of two parameters that a trace adds.
pub(crate) const COST_OF_A_TERM: f64 = 18.0;

/// Averaging time, in lengths of the filter, from which on filtered white noise has the Allan variance of white noise within 1 % or 2 %.
const LONG_AGAINST_FILTER: f64 = 8.0;
/// Fewest degrees of freedom for which the bounds of a point of a curve are derived.
const LEAST_EDF: f64 = 3.0;
/// Probability that a truth is above its upper 95 % bound.
const BEYOND_A_BOUND: f64 = 0.025;

/// The origin of a term that was added to the baseline model.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Addition {
    /// Decrease of the deviance, in units of its scatter: the square of a significance in standard deviations.
    pub score: f64,
    /// The residual that the term explains.
    pub residual: Residual,
    /// Place in the order in which the terms were added.
    rank: i32,
}

/// A term to be fitted, with what added it; the baseline's terms, and lines whose size the spectrum has measured, have no addition.
pub(crate) type PlannedTerm = (NoiseTerm, Option<Addition>);

/// Which shapes of the terms a fit searches for.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Shapes {
    Kept,
    /// All but frequencies of sinusoids and filters.
    OfProcesses,
    AllButFilters,
}

/// A model with the curve's verdict on it.
#[derive(Debug, Clone)]
pub(crate) struct TracedModel {
    model: Model,
    additions: Vec<Option<Addition>>,
    pub goodness: Goodness,
    /// Bounds of the adjusted shape of the filter that all channels have: its decimation, or its frequency.
    of_filter: Option<BoundedEstimate>,
}

impl TracedModel {
    pub(crate) fn new(trace: &Trace, curve: &Curve<OCTAVES>) -> Self {
        let mut additions = vec![None; trace.after.terms().len()];
        for (rank, found) in (0..).zip(&trace.added) {
            additions[found.term] = Some(Addition { score: found.score, residual: found.residual, rank });
        }
        let model = within_measured(&trace.after, curve);
        Self { model, additions, goodness: trace.after_goodness, of_filter: None }
    }

    /// The model of at most the first [`MAX_TERMS`] of these `terms` that fits `curve` best, with the bounds of that fit.
    pub(crate) fn fit(curve: &Curve<OCTAVES>, terms: &[PlannedTerm], shapes: Shapes) -> Self {
        let kinds: Vec<NoiseTerm> = terms.iter().map(|(kind, _)| *kind).collect();
        let filters = || kinds.iter().copied().filter(is_filter).collect::<Vec<NoiseTerm>>();
        let model = match shapes {
            Shapes::Kept => fit(curve, &kinds),
            Shapes::OfProcesses => fit_shapes_except(curve, &kinds, &kinds),
            Shapes::AllButFilters => fit_shapes_except(curve, &kinds, &filters()),
        };
        let additions = terms.iter().map(|(_, addition)| *addition).take(MAX_TERMS).collect();
        Self { goodness: goodness(curve, &model), model: within_measured(&model, curve), additions, of_filter: None }
    }

    pub(crate) fn model(&self) -> &Model {
        &self.model
    }

    pub(crate) fn terms(&self) -> impl DoubleEndedIterator<Item = PlannedTerm> + Clone {
        self.model.terms().iter().map(|term| term.kind).zip(self.additions.iter().copied())
    }

    /// The terms that were added to the baseline, in the order in which they were.
    pub(crate) fn added(&self) -> Vec<(&FittedTerm, &Addition)> {
        self.added_at()
            .into_iter()
            .filter_map(|at| Some((&self.model.terms()[at], self.additions[at].as_ref()?)))
            .collect()
    }

    pub(crate) fn added_at(&self) -> Vec<usize> {
        let rank = |at: &usize| self.additions[*at].map(|addition| addition.rank);
        let mut added: Vec<usize> = (0..self.additions.len()).filter(|at| self.additions[*at].is_some()).collect();
        added.sort_by_key(rank);
        added
    }

    pub(crate) fn has_filter(&self) -> bool {
        self.model.terms().iter().any(|term| is_filter(&term.kind))
    }

    pub(crate) fn has_room(&self) -> bool {
        self.model.terms().len() < MAX_TERMS
    }

    /// Deviance with what the added terms must take off at least.
    pub(crate) fn cost(&self) -> f64 {
        self.goodness.deviance + self.cost_of_terms()
    }

    /// The least gain of deviance that justifies the added terms.
    pub(crate) fn cost_of_terms(&self) -> f64 {
        COST_OF_A_TERM * self.additions.iter().flatten().count() as f64
    }

    /// The origin of a term that is added behind all others.
    pub(crate) fn next_addition(&self, score: f64, residual: Residual) -> Addition {
        let rank = self.additions.iter().flatten().map(|addition| addition.rank + 1).max().unwrap_or(0);
        Addition { score, residual, rank }
    }

    /// The same with the term at a position, which nothing has added, as added before all others.
    pub(crate) fn with_first_addition(mut self, at: usize, score: f64, residual: Residual) -> Self {
        let rank = self.additions.iter().flatten().map(|addition| addition.rank - 1).min().unwrap_or(0);
        self.additions[at].get_or_insert(Addition { score, residual, rank });
        self
    }

    /// Other `terms` in place of all, fitted to `curve`.
    pub(crate) fn replaced(&self, curve: &Curve<OCTAVES>, terms: &[PlannedTerm], shapes: Shapes) -> Self {
        Self::fit(curve, terms, shapes).bounded(curve, self.of_filter)
    }

    /// The model without the term at a position, fitted to `curve`.
    pub(crate) fn removed(&self, curve: &Curve<OCTAVES>, removed: usize) -> Self {
        let kept: Vec<PlannedTerm> =
            self.terms().enumerate().filter(|(at, _)| *at != removed).map(|(_, term)| term).collect();
        self.replaced(curve, &kept, Shapes::OfProcesses)
    }

    /// The model with one more term at its end, fitted to `curve` with all shapes as they are. `bounds` gives that term its bounds from
    /// elsewhere. `None` if the curve gives it no variance.
    pub(crate) fn added_to(
        &self,
        curve: &Curve<OCTAVES>,
        term: PlannedTerm,
        bounds: impl FnOnce(&FittedTerm) -> FittedTerm,
    ) -> Option<Self> {
        let terms: Vec<PlannedTerm> = self.terms().chain([term]).collect();
        let fitted = self.replaced(curve, &terms, Shapes::Kept);
        let (last, others) = fitted.model.terms().split_last()?;
        let last = (last.value > 0.0).then(|| bounds(last))?;
        let model = Model::new(curve.sample_period(), others.iter().copied().chain([last]));
        Some(Self { model, ..fitted })
    }

    /// With `lines`, whose sizes the spectrum has measured: the coefficients of the other terms are fitted to what they leave of
    /// `curve`, their shapes and relative bounds stay. `None` if there is no room for them, or if the share of the last one in every
    /// point is hidden by the scatter of the point.
    pub(crate) fn with_lines(&self, curve: &Curve<OCTAVES>, lines: &[FittedTerm]) -> Option<Self> {
        let (model, period_s) = (&self.model, curve.sample_period());
        let last = lines.last()?;
        let is_visible = |point: &AllanPoint| {
            share(last, point, period_s) * (0.5 * model.edf(point)).sqrt() > VISIBLE_SIGMAS * point.avar
        };
        if model.terms().len() + lines.len() > MAX_TERMS || !curve.points().iter().any(is_visible) {
            return None;
        }
        let kinds: Vec<NoiseTerm> = model.terms().iter().map(|term| term.kind).collect();
        let fitted = fit(&left_by(lines, curve), &kinds);
        // The spectrum knows the lines much better than the curve knows the others: their relative errors stay.
        let kept = |(new, old): (&FittedTerm, &FittedTerm)| {
            let scaled = |bound: f64, limit: f64| if old.value > 0.0 { bound * new.value / old.value } else { limit };
            let mut term = new.with_bounds(scaled(old.low, 0.0), scaled(old.high, new.high));
            term.shape = old.shape;
            term
        };
        let kept = fitted.terms().iter().zip(model.terms()).map(kept);
        let model = within_measured(&Model::new(period_s, kept.chain(lines.iter().copied())), curve);
        let additions = self.additions.iter().copied().chain(lines.iter().map(|_| None)).collect();
        Some(Self { goodness: goodness(curve, &model), model, additions, of_filter: self.of_filter })
    }

    /// Fitted, with the shapes of its processes, to what `lines` leave of `curve`.
    pub(crate) fn shaped_beside(&self, curve: &Curve<OCTAVES>, lines: &[FittedTerm]) -> Self {
        let terms: Vec<PlannedTerm> = self.terms().collect();
        Self { of_filter: self.of_filter, ..Self::fit(&left_by(lines, curve), &terms, Shapes::OfProcesses) }
    }

    /// The model with the coefficients and bounds of `model`, which has the same terms.
    pub(crate) fn with_coefficients(self, curve: &Curve<OCTAVES>, model: Model) -> Self {
        Self { goodness: goodness(curve, &model), model, ..self }
    }

    /// The model without the term at a position; the others are unchanged, to be fitted [with lines](Self::with_lines).
    pub(crate) fn before_lines_without(&self, removed: usize) -> Self {
        let is_kept = |at: &usize| *at != removed;
        let kept = (0..self.additions.len()).filter(is_kept);
        let model = Model::new(self.model.sample_period(), kept.clone().map(|at| self.model.terms()[at]));
        Self { model, additions: kept.map(|at| self.additions[at]).collect(), ..*self }
    }

    /// The same with the bounds that `curve`, which it was fitted to, gives to white noise behind a filter, those `of_filter`,
    /// of the sensor, and bounds of shapes that the record can [resolve](resolvable).
    pub(crate) fn bounded(mut self, curve: &Curve<OCTAVES>, of_filter: Option<BoundedEstimate>) -> Self {
        let resolved = |term: &FittedTerm| {
            let mut term = *term;
            for ((name, value), bounds) in term.kind.shape().named().zip(term.shape.iter_mut()) {
                if let Some(common) = of_filter.filter(|_| is_adjusted_of_filter(&term.kind, name)) {
                    *bounds = (common.low, common.high);
                } else if let Some((least, most)) = resolvable(name, curve) {
                    // `max` and `min` take the limit in place of a bound that is not a number.
                    *bounds = (bounds.0.max(least).min(value), bounds.1.min(most).max(value));
                }
            }
            term
        };
        let bounded = with_bounds_behind_a_filter(curve, &self.model, of_filter);
        let model = Model::new(bounded.sample_period(), bounded.terms().iter().map(resolved));
        self.model = within_measured(&model, curve);
        self.of_filter = of_filter;
        self
    }

    /// Position of the first added term that may be absent and of whose shape the record resolves nothing.
    pub(crate) fn unresolved(&self, curve: &Curve<OCTAVES>) -> Option<usize> {
        let is_unresolved = |at: &usize| {
            let term = &self.model.terms()[*at];
            let mut shapes = term.shape.named();
            let is_whole_range = |(name, bounds): (&str, (f64, f64))| {
                resolvable(name, curve).is_some_and(|(least, most)| bounds.0 <= least && bounds.1 >= most)
            };
            term.low == 0.0 && !is_white(&term.kind) && shapes.any(is_whole_range)
        };
        self.added_at().into_iter().find(is_unresolved)
    }
}

/// The variance of a line in a point of a curve of this sample period.
fn share(line: &FittedTerm, point: &AllanPoint, period_s: f64) -> f64 {
    line.value * line.value * line.kind.avar(point.n, period_s)
}

fn left_by(lines: &[FittedTerm], curve: &Curve<OCTAVES>) -> Curve<OCTAVES> {
    let mut others = curve.clone();
    let shares = |point: &AllanPoint| lines.iter().map(|line| share(line, point, curve.sample_period())).sum::<f64>();
    others.replace_avar(|point| (point.avar - shares(point)).max(LEAST_LEFT * point.avar));
    others
}

/// `model` with no upper bound of N, B or K beyond what `curve` allows: all terms are positive, so that none of them alone exceeds the
/// upper bound of what was measured, at any averaging time that is long against the filter. A term that the data does not show has the
/// smallest of these limits; that of one that it shows is at the level of the smallest of so many bounds.
pub(crate) fn within_measured(model: &Model, curve: &Curve<OCTAVES>) -> Model {
    let from = LONG_AGAINST_FILTER * filter_length_s(model).max(curve.sample_period());
    // Few degrees of freedom and counts that repeat give no measured bounds.
    let has_bounds = |point: &&AllanPoint| point.edf >= LEAST_EDF && point.avar > 0.0;
    let points: Vec<&AllanPoint> = curve.points().iter().filter(|point| point.tau >= from).filter(has_bounds).collect();
    let limit = |kind: &NoiseTerm, bound: &dyn Fn(&AllanPoint) -> f64| {
        let of = |point: &&AllanPoint| (bound(point) / kind.avar(point.n, curve.sample_period())).sqrt();
        points.iter().map(of).filter(|limit| !limit.is_nan()).fold(f64::INFINITY, f64::min)
    };
    let of_all = |point: &AllanPoint| {
        let chance = BEYOND_A_BOUND / points.len() as f64;
        let quantile = ChiSquared::new(point.edf).map(|distribution| distribution.inverse_cdf(chance));
        quantile.map_or(f64::INFINITY, |quantile| (point.avar * point.edf / quantile).max(point.high))
    };
    let bounded = |term: &FittedTerm| {
        let is_limited = NoiseTerm::BASELINE.contains(&term.kind) || is_filter(&term.kind);
        let least = if is_limited { limit(&term.kind, &|point| point.high) } else { f64::INFINITY };
        if term.high <= least {
            return *term;
        }
        let limit = if term.low > 0.0 { limit(&term.kind, &of_all) } else { least };
        term.with_bounds(term.low, term.high.min(limit.max(term.value)))
    };
    Model::new(model.sample_period(), model.terms().iter().map(bounded))
}

pub(crate) fn residual(model: &Model, point: &AllanPoint) -> Residual {
    let excess = (point.avar / model.avar(point.n)).sqrt() - 1.0;
    Residual { n: point.n, excess, sigmas: excess * (2.0 * model.edf(point)).sqrt() }
}

/// The range of a shape parameter that a record can resolve: times from a sample period to its length, frequencies and
/// bandwidths from one over its length to half the sample rate.
fn resolvable(name: &str, curve: &Curve<OCTAVES>) -> Option<(f64, f64)> {
    let period = curve.sample_period();
    let duration = curve.samples() as f64 * period;
    match name {
        "time_constant" => Some((period, duration)),
        "frequency" | "bandwidth" => Some((1.0 / duration, 0.5 / period)),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::within_measured;
    use crate::OVERLAP;
    use allan_core::model::FittedTerm;
    use allan_core::{Cascade, Model, NoiseTerm};
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::StandardNormal;

    /// White noise of 100 counts at 100 Hz has N = 10 counts·√s. A fit that says nothing of N, B and K cannot allow more than was
    /// measured: N of 10 within some percent, B of less than the smallest deviation over 0.664.
    #[test]
    fn no_bound_is_beyond_what_was_measured() {
        for seed in 0..10 {
            let mut random = ChaCha8Rng::seed_from_u64(seed);
            let mut cascade = Cascade::<{ crate::OCTAVES }, OVERLAP>::new();
            (0..1 << 16).for_each(|_| cascade.push((100.0 * random.sample::<f64, _>(StandardNormal)).round() as i32));
            let curve = cascade.curve(0.01);
            let nothing = |kind| FittedTerm::exact(kind, 0.0).with_bounds(0.0, 7400.0);
            let known = FittedTerm::exact(NoiseTerm::AngleRandomWalk, 10.0).with_bounds(9.95, 10.05);
            let bounded = within_measured(&Model::new(0.01, NoiseTerm::BASELINE.map(nothing)), &curve);
            let [n, b, k] = bounded.terms() else { panic!("three terms") };
            for point in curve.points().iter().filter(|point| point.tau >= 0.08) {
                let upper = point.high.sqrt();
                assert!(n.high <= upper * point.tau.sqrt() * (1.0 + 1e-9), "{n:?}");
                assert!(b.high <= upper / 0.664 * (1.0 + 1e-3), "{b:?}");
                assert!(k.high <= upper * (3.0 / point.tau).sqrt() * (1.0 + 1e-9), "{k:?}");
            }
            assert!(n.high > 8.0, "seed {seed}: {n:?}");
            // A bound that the fit knows better stays.
            let bounded = within_measured(&Model::new(0.01, [known]), &curve);
            assert_eq!(bounded.terms(), [known], "seed {seed}");
        }
    }
}
