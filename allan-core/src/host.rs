//! Additions for an analysis of whole recordings on a host to the calls above (feature `host`): curves that are put together
//! or changed, covariances of many channels, and fits with shapes that were estimated elsewhere.

use crate::cascade::Cascade;
use crate::coupling::Coupling;
use crate::curve::{AllanPoint, Curve, CurveView};
use crate::fit::{Baseline, FreeShapes, estimate, set_free_bounds};
use crate::model::Model;
use crate::term::{AllTerms, NoiseTerm};

/// Part of a measured variance that remains of it when rounding is taken off.
const LEAST_LEFT: f64 = 0.01;

impl<const OCTAVES: usize> Curve<OCTAVES> {
    /// This curve at averaging factors below `from`, and at longer ones that of the means of each `samples` samples in a row,
    /// which are `means`.
    ///
    /// Second differences of such means are those of the samples at `samples` times the averaging factor, so that a long
    /// record need not be kept to be looked at again: its means are enough. An empty curve leaves the points of the means
    /// alone. Points for which there is no room are left out, the longest averaging times first.
    #[must_use]
    pub fn continued_by_means(mut self, means: &Self, samples: u64, from: u64) -> Self {
        self.points.retain(|point| point.n < from);
        let points = means.points.iter().map(|point| AllanPoint { n: point.n.saturating_mul(samples), ..*point });
        let free = OCTAVES - self.points.len();
        self.points.extend(points.filter(|point| point.n >= from).take(free));
        self.sample_period = means.sample_period / samples as f64;
        self.samples = means.samples.saturating_mul(samples);
        self
    }

    /// Takes what rounding to counts adds off the variance of every point: `variance` of its averaging factor, as far as a hundredth of
    /// what was measured remains. It becomes part of `interpolation`, and the confidence is set anew: the scatter is that of
    /// the measured variance.
    pub fn subtract_rounding(&mut self, variance: impl Fn(u64) -> f64) {
        for point in &mut self.points {
            let left = (point.avar - variance(point.n)).max(LEAST_LEFT * point.avar);
            (point.interpolation, point.avar) = (point.interpolation + point.avar - left, left);
        }
        self.reset_confidence();
    }

    /// Replaces the variance of every point with a positive one. The bounds change in proportion, the degrees of freedom
    /// not at all.
    pub fn replace_avar(&mut self, avar: impl Fn(&AllanPoint) -> f64) {
        self.set_variances(avar);
    }
}

/// The second differences that the newest sample of a channel completed: computed once for all the channels that it is coupled with.
#[derive(Debug, Clone, Copy)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct NewestDifferences<const OCTAVES: usize> {
    now: (u64, u64),
    due: usize,
    octaves: [Option<i64>; OCTAVES],
}

impl<const OCTAVES: usize> NewestDifferences<OCTAVES> {
    /// The state of this channel, until its next sample.
    #[must_use]
    pub fn of<const OVERLAP: usize>(channel: &Cascade<OCTAVES, OVERLAP>) -> Self {
        let due = channel.octaves_due();
        let mut octaves = [None; OCTAVES];
        for (octave, newest) in octaves.iter_mut().enumerate().take(due) {
            *newest = channel.newest_difference(octave);
        }
        Self { now: channel.now(), due, octaves }
    }
}

impl<const OCTAVES: usize> Coupling<OCTAVES> {
    /// As [`observe`](Self::observe), by the newest differences of both channels.
    pub fn observe_differences(&mut self, a: &NewestDifferences<OCTAVES>, b: &NewestDifferences<OCTAVES>) {
        self.add_newest(a.now == b.now, a.due, |octave| (a.octaves[octave], b.octaves[octave]));
    }
}

/// Fits the coefficients of `kinds` and their shape parameters as [`fit_shapes`](crate::fit::fit_shapes) does, but keeps the
/// shapes of the sinusoids and filters in `known`, which were estimated elsewhere. The bounds are those of a filter that is known
/// exactly.
#[must_use]
pub fn fit_shapes_except<'a>(curve: impl Into<CurveView<'a>>, kinds: &[NoiseTerm], known: &[NoiseTerm]) -> Model {
    let curve = curve.into();
    let mut model = Model::new(0.0, []);
    estimate::<AllTerms>(curve, kinds, FreeShapes::AllExcept(known), &mut || true, &mut model);
    let filter = known.iter().find(|kind| matches!(kind, NoiseTerm::Filtered(_)));
    let free = FreeShapes::AllExcept(filter.map(core::slice::from_ref).unwrap_or_default());
    set_free_bounds(curve, &mut model, free);
    model
}

/// Compares sets of terms with fixed shapes by their deviance from one curve, all at the degrees of freedom that one fitted
/// model gives to its points.
pub struct DevianceComparison<'a>(Baseline<'a>);

impl<'a> DevianceComparison<'a> {
    /// For `curve`, with the degrees of freedom of `model`.
    #[must_use]
    pub fn new(curve: impl Into<CurveView<'a>>, model: &Model) -> Self {
        let mut baseline = Baseline::empty(curve.into());
        baseline.fill(model);
        Self(baseline)
    }

    /// `Σ edf·(v/m − 1 − ln(v/m))` with the coefficients of `kinds` that make it least; infinite without terms.
    pub fn deviance(&mut self, kinds: &[NoiseTerm]) -> f64 {
        f64::from(self.0.deviance - self.0.fall(kinds))
    }

    /// The same where the Allan variances of some terms at some averaging factors, for a coefficient of 1 and behind the filter of `kinds`, are
    /// known: several channels behind one filter share them.
    pub fn deviance_with(&mut self, kinds: &[NoiseTerm], known: impl Fn(&NoiseTerm, u64) -> Option<f64>) -> f64 {
        f64::from(self.0.deviance - self.0.fall_with(kinds, known))
    }
}
