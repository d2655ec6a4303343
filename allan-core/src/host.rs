//! Curves that are put together or changed, covariances of many channels, and fits with known shapes (feature `host`).

use crate::cascade::Cascade;
use crate::coupling::Coupling;
use crate::curve::{AllanPoint, Curve, CurveView};
use crate::fit::{FreeShapes, estimate, set_free_bounds};
use crate::model::Model;
use crate::term::{AllTerms, NoiseTerm};

/// Least fraction of a measured variance that remains after the variance of rounding is subtracted.
const LEAST_LEFT: f64 = 0.01;

impl<const OCTAVES: usize> Curve<OCTAVES> {
    /// Joins this curve, at averaging factors below `from`, and `means`, the curve of the means of `samples`
    /// consecutive samples, at longer ones. The longest averaging times are left out if there is no room.
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

    /// Subtracts the variance of rounding to counts, `variance(n)` in the square of the unit, from the point at each
    /// averaging factor `n`. At least a hundredth of the measured variance remains. The subtracted part is added to
    /// `interpolation`.
    pub fn subtract_rounding(&mut self, variance: impl Fn(u64) -> f64) {
        for point in &mut self.points {
            let left = (point.avar - variance(point.n)).max(LEAST_LEFT * point.avar);
            (point.interpolation, point.avar) = (point.interpolation + point.avar - left, left);
        }
        self.reset_confidence();
    }

    /// Replaces the positive variances by those that `avar` returns, in the same unit; the bounds change in proportion.
    pub fn replace_avar(&mut self, avar: impl Fn(&AllanPoint) -> f64) {
        self.set_variances(avar);
    }
}

/// The second differences that the newest sample of a channel completed, for all channels that it is coupled with.
#[derive(Debug, Clone, Copy)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct NewestDifferences<const OCTAVES: usize> {
    now: (u64, u64),
    due: usize,
    octaves: [Option<i64>; OCTAVES],
}

impl<const OCTAVES: usize> NewestDifferences<OCTAVES> {
    /// The differences of `channel`, until its next sample.
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
    /// Adds the products of the newest differences of two channels, as [`observe`](Self::observe) does.
    pub fn observe_differences(&mut self, a: &NewestDifferences<OCTAVES>, b: &NewestDifferences<OCTAVES>) {
        self.add_newest(a.now == b.now, a.due, |octave| (a.octaves[octave], b.octaves[octave]));
    }
}

/// Fits coefficients and shapes as [`fit_shapes`](crate::fit::fit_shapes) does, but keeps the shapes of the sinusoids
/// and filters in `known`.
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
