//! Curves of the halves, quarters and epochs of a record, and the comparison of the quarters.

use crate::OCTAVES;
use crate::fit::signal_share::SignalShare;
use crate::record::sample_curves::SampleCurves;
use crate::robust::median;
use crate::samples::epoch_ranges::epochs;
use crate::samples::exclusion::Exclusion;
use crate::samples::gapped_cascade::GappedCascade;
use crate::samples::rounding::Rounding;
use crate::samples::series::Series;
use allan_core::{AllanPoint, Curve, Model};
use serde::Serialize;
use statrs::distribution::{ContinuousCDF, FisherSnedecor};
use std::ops::Range;

/// p-value, over all comparisons in a channel, below which noise is non-stationary.
pub(crate) const SIGNIFICANCE: f64 = 0.01;

/// Least number of averages in an epoch at an averaging factor that is used.
pub(crate) const MIN_AVERAGES: u64 = 64;

/// Curves in the channel's unit. Models are fitted to the first half; the second half is unseen.
#[derive(Debug, Clone)]
pub(crate) struct EpochCurves {
    pub quarters: [Curve<OCTAVES>; 2],
    pub unseen: Curve<OCTAVES>,
    /// Samples in an epoch, a power of 2.
    pub epoch: u64,
    pub epoch_s: f64,
    /// Epochs up to the middle; the remainder lies before the first.
    pub fitted_epochs: Vec<Curve<OCTAVES>>,
    /// Epochs from the middle on; the remainder lies behind the last.
    pub unseen_epochs: Vec<Curve<OCTAVES>>,
    /// Their sample periods.
    pub(crate) ranges: [Vec<Range<u64>>; 2],
}

impl EpochCurves {
    /// Curves of a series whose second half begins with the sample period `middle`, of at least 24,576 sample periods (two halves
    /// of twelve shortest epochs). `None` of a shorter one, and where the channel does not change for a whole epoch of the first half.
    pub(crate) fn from_series(series: &Series, middle: u64) -> Option<Self> {
        let to = series.span.end;
        let (epoch, ranges) = epochs(series.span.clone(), middle)?;
        let curves = |ranges: &[Range<u64>]| ranges.iter().map(|range| curve(series, range.clone())).collect();
        let curves = Self {
            quarters: quarter_curves(series, middle),
            unseen: curve(series, middle..to),
            epoch,
            epoch_s: epoch as f64 * series.period_s,
            fitted_epochs: curves(&ranges[0]),
            unseen_epochs: curves(&ranges[1]),
            ranges,
        };
        curves.quarters.iter().chain(&curves.fitted_epochs).all(changes).then_some(curves)
    }

    pub(crate) fn changes_in_second_half(&self) -> bool {
        self.unseen_epochs.iter().all(changes)
    }

    /// The same curves by averaging factors in samples, where the series has means, with those of the samples at `shorter` averaging times.
    pub(crate) fn in_samples(self, shorter: &SampleCurves) -> Self {
        let in_samples = |means: &Curve<OCTAVES>, slots: Range<u64>| {
            let of_samples = shorter.within(slots, Exclusion::ByFirstHalf);
            of_samples.map_or_else(|| shorter.in_samples(means), |of_samples| shorter.continued(of_samples, means))
        };
        let epochs = |curves: &[Curve<OCTAVES>], ranges: &[Range<u64>]| {
            let slots = ranges.iter().map(|range| shorter.slots_of(range.clone()));
            curves.iter().zip(slots).map(|(curve, slots)| in_samples(curve, slots)).collect()
        };
        let [fitted, unseen] = &self.ranges;
        let middle = unseen.first().map_or(0, |range| range.start);
        let [quarter, half] = [middle / 2, middle].map(|means| shorter.slots_of(0..means).end);
        let [earlier, later] = &self.quarters;
        Self {
            quarters: [in_samples(earlier, 0..quarter), in_samples(later, quarter..half)],
            unseen: in_samples(&self.unseen, half..u64::MAX),
            fitted_epochs: epochs(&self.fitted_epochs, fitted),
            unseen_epochs: epochs(&self.unseen_epochs, unseen),
            epoch: self.epoch * shorter.samples_per_mean,
            ..self
        }
    }

    /// The same curves without the `signals` of the first half, which go on in the second.
    pub(crate) fn without(mut self, signals: &SignalShare) -> Self {
        if signals.is_empty() {
            return self;
        }
        let left = |curve: &mut Curve<OCTAVES>, times: [f64; 2]| *curve = signals.within(times).left_of(curve);
        let [first, second] = &mut self.quarters;
        left(first, [0.0, 0.5]);
        left(second, [0.5, 1.0]);
        left(&mut self.unseen, [1.0, 2.0]);
        let middle = self.ranges[1].first().map_or(1, |range| range.start) as f64;
        let ranges = self.ranges.iter().flatten();
        for (range, curve) in ranges.zip(self.fitted_epochs.iter_mut().chain(&mut self.unseen_epochs)) {
            left(curve, [range.start, range.end].map(|of| of as f64 / middle));
        }
        self
    }

    /// Epochs of the later quarter of the first half.
    pub(crate) fn latest_epochs(&self) -> &[Curve<OCTAVES>] {
        &self.fitted_epochs[self.fitted_epochs.len() / 2..]
    }

    /// The later quarter's curve with the median of its epochs, at octaves with at least 64 averages in an epoch.
    ///
    /// Some minutes of vibration raise the mean of the quarter and hardly the median of its epochs. The median of variances
    /// with `ν` degrees of freedom is low by the factor `(1 − 2/(9ν))³` (E. Wilson and M. Hilferty, 1931), which is divided
    /// out. The median scatters by a fourth more than the mean; the confidence bounds do not include that.
    pub(crate) fn median_curve(&self) -> Curve<OCTAVES> {
        let mut curve = self.quarters[1].clone();
        curve.replace_avar(|point| median_avar(self.latest_epochs(), point.n).unwrap_or(point.avar));
        curve
    }
}

fn changes(curve: &Curve<OCTAVES>) -> bool {
    curve.points().iter().any(|point| point.avar > 0.0)
}

fn quarter_curves(series: &Series, middle: u64) -> [Curve<OCTAVES>; 2] {
    let from = series.span.start;
    let quarter = from + middle.saturating_sub(from) / 2;
    [curve(series, from..quarter), curve(series, quarter..middle)]
}

/// The curve of `slots`, without correlated rounding errors.
pub(super) fn curve(series: &Series, slots: Range<u64>) -> Curve<OCTAVES> {
    let position = |slot: u64| series.slots.partition_point(|&of| of < slot);
    let range = position(slots.start)..position(slots.end);
    let curve = GappedCascade::of_series(series, range).curve(series.period_s).scaled(series.resolution);
    Rounding::of_curve(&curve, series.resolution).subtracted_from(curve)
}

fn median_avar(epochs: &[Curve<OCTAVES>], n: u64) -> Option<f64> {
    let used = |epoch: &Curve<OCTAVES>| {
        let point = epoch.points().iter().find(|point| point.n == n)?;
        (n * MIN_AVERAGES <= epoch.samples()).then_some(*point)
    };
    let points: Vec<AllanPoint> = epochs.iter().filter_map(used).collect();
    if points.is_empty() {
        return None;
    }
    let middle = median(&mut points.iter().map(|point| point.avar).collect::<Vec<f64>>());
    let edf = points.iter().map(|point| point.edf).sum::<f64>() / points.len() as f64;
    Some(middle / (1.0 - 2.0 / (9.0 * edf)).powi(3))
}

/// The octaves of a curve with `n ≤ M/8`, for comparison with models at the degrees of freedom of one.
pub(crate) struct ComparedCurve {
    points: Vec<(AllanPoint, f64)>,
}

impl ComparedCurve {
    pub(crate) fn new(curve: &Curve<OCTAVES>, model: &Model) -> Self {
        // A variance of 0, of counts that repeat with this averaging time, has no logarithm.
        let points = curve.points().iter().filter(|point| point.n <= curve.samples() / 8 && point.avar > 0.0);
        Self { points: points.map(|point| (*point, model.edf(point))).collect() }
    }

    pub(crate) fn len(&self) -> usize {
        self.points.len()
    }

    /// Its points, each with its degrees of freedom.
    pub(super) fn points(&self) -> &[(AllanPoint, f64)] {
        &self.points
    }

    /// `Σ edf·(ln(m/v) + v/m − 1)` of a model with these Allan variances at the points.
    pub(super) fn deviance(&self, modelled: impl Iterator<Item = f64>) -> f64 {
        let of = |((point, edf), modelled): (&(AllanPoint, f64), f64)| {
            let ratio = point.avar / modelled;
            edf * (ratio - 1.0 - ratio.ln())
        };
        self.points.iter().zip(modelled).map(of).sum()
    }

    /// The mean of this sum for a model with the Allan variance `modelled`.
    pub(crate) fn deviance_per_point(&self, modelled: impl Fn(u64) -> f64) -> f64 {
        self.deviance(self.points.iter().map(|(point, _)| modelled(point.n))) / self.len().max(1) as f64
    }
}

/// Comparison of two stretches at the octave at which they differ most.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Stationarity {
    pub tau_s: f64,
    /// Allan variance of the later stretch over that of the earlier one.
    pub variance_ratio: f64,
    /// Probability of as clear a difference at any octave in the same noise.
    pub p_value: f64,
}

/// The part of the first half that a model for the second half is fitted to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum FittedPart {
    FirstHalf,
    /// The later quarter, nearer in time: the noise is non-stationary.
    LaterQuarter,
}

impl Stationarity {
    /// Compares two stretches octave by octave, up to an eighth of the shorter one. `None` if no octave can be compared.
    ///
    /// The ratio of two variances has Fisher's distribution, with degrees of freedom by `model`. The p-value of the
    /// clearest octave is multiplied by the number of octaves (Bonferroni).
    #[must_use]
    pub fn compare(earlier: &Curve<OCTAVES>, later: &Curve<OCTAVES>, model: &Model) -> Option<Self> {
        let longest = earlier.samples().min(later.samples()) / 8;
        let compare = |(before, after): (&AllanPoint, &AllanPoint)| {
            let ratio = after.avar / before.avar;
            // Repeated counts have no variance at some averaging times.
            if !(ratio.is_finite() && ratio > 0.0) {
                return None;
            }
            let fisher = FisherSnedecor::new(model.edf(after), model.edf(before)).ok()?;
            let p_value = (2.0 * fisher.cdf(ratio).min(fisher.sf(ratio))).min(1.0);
            Some(Self { tau_s: before.tau, variance_ratio: ratio, p_value })
        };
        let pairs = earlier.points().iter().zip(later.points()).filter(|(point, _)| point.n <= longest);
        let octaves: Vec<Self> = pairs.filter_map(compare).collect();
        let clearest = octaves.iter().min_by(|a, b| a.p_value.total_cmp(&b.p_value))?;
        Some(Self { p_value: (clearest.p_value * octaves.len() as f64).min(1.0), ..*clearest })
    }

    #[must_use]
    pub fn is_nonstationary(&self) -> bool {
        self.p_value < SIGNIFICANCE
    }
}

impl FittedPart {
    /// The part to fit to, by the comparison of the two quarters of the first half.
    #[must_use]
    pub fn select(quarters: Option<Stationarity>) -> Self {
        match quarters {
            Some(comparison) if comparison.is_nonstationary() => Self::LaterQuarter,
            _ => Self::FirstHalf,
        }
    }
}
