//! Non-stationarity: changes of the noise over a record, and the errors on the second half of models that allow for them.
//!
//! ```text
//! Series ─► EpochCurves ─► Stationarity ─► FittedPart: which part of the first half the model of a channel is fitted to
//!                │
//!                └─► TrackedModel: parameters that change from epoch to epoch
//!                        ├─► track: each epoch of the second half predicted from those before it
//!                        ├─► IntervalCoverage: how many octaves lie within their prediction intervals
//!                        ├─► expected_drift, beyond_drift: the error beyond the drift that the first half shows
//!                        ├─► RelatedLine: the frequency of a line by a related line of another channel
//!                        └─► Baselines: the same predictions without added terms
//! all channels ─► CommonModeRegression
//! ```
//!
//! Tests and models use the first half alone. Tracking uses each epoch of the second half after its prediction, and a
//! related line uses the second half of another channel; their errors are reported apart.

mod common_mode_regression;
mod epochs;
mod prediction;
mod prediction_intervals;
mod related_line;
mod tracked_parameters;

#[cfg(test)]
mod tests;

pub use common_mode_regression::{CommonModeRegression, HoldOutGain, OctaveShares};
pub(crate) use epochs::EpochCurves;
pub use epochs::{FittedPart, Stationarity};
pub use prediction::{Baselines, TrackingErrors};
pub use prediction_intervals::IntervalCoverage;
use related_line::LineSource;
pub use related_line::RelatedLine;
pub use tracked_parameters::TrackedSet;

use crate::OCTAVES;
use crate::record::sample_curves::SampleCurves;
use crate::samples::series::Series;
use allan_core::{Curve, Model};
use prediction::{beyond_drift, expected_drift, select_tracked, track};
use serde::Serialize;
use tracked_parameters::{EpochEstimate, TrackedModel};

/// The change of a channel's noise over the record.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Nonstationarity {
    /// The two quarters of the first half compared; absent if no octave can be compared.
    pub quarters: Option<Stationarity>,
    pub fitted_to: FittedPart,
    /// The parameters that change among the epochs of the first half.
    pub tracked: TrackedSet,
    pub epoch_s: f64,
    pub epochs: Vec<EpochParameters>,
    /// Deviance per point of `after` on the second half, beyond the drift expected from the first half.
    pub beyond_drift: f64,
    pub tracking: TrackingErrors,
    pub baselines: Baselines,
    pub intervals: IntervalCoverage,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub related_line: Option<RelatedLine>,
}

/// The parameters of a channel's model in one epoch, by the epoch's own curve.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct EpochParameters {
    /// Start of the epoch, s from the first sample.
    pub from_s: f64,
    /// Variance of the white noise over that of `after`.
    pub white_noise_ratio: f64,
    pub white_noise_error: f64,
    /// Frequency of the moving line, Hz; absent without one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub line_hz: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub line_error_hz: Option<f64>,
}

pub(crate) struct ChannelEpochs {
    curves: EpochCurves,
    quarters: Option<Stationarity>,
    part: FittedPart,
}

pub(crate) struct TracedChannel<'a> {
    pub name: &'static str,
    /// Without the samples that the rules of the first half exclude.
    pub series: &'a Series,
    /// Curves of the samples, if `series` has means.
    pub samples: &'a SampleCurves,
    /// `None` if the record is too short for epochs.
    pub epochs: Option<&'a ChannelEpochs>,
    /// The baseline model of the first half.
    pub baseline: &'a Model,
    /// Model of the first half with the added terms, fitted to the part that `epochs` names.
    pub model: &'a Model,
}

impl ChannelEpochs {
    /// Compares the two quarters of the first half of `curves`; `model` describes both together.
    pub(crate) fn compare(curves: EpochCurves, model: &Model) -> Self {
        let quarters = Stationarity::compare(&curves.quarters[0], &curves.quarters[1], model);
        Self { part: FittedPart::select(quarters), quarters, curves }
    }

    pub(crate) fn quarter_curves(&self) -> &[Curve<OCTAVES>; 2] {
        &self.curves.quarters
    }

    /// The curve of the later quarter, if the noise changes: it is nearer in time to the second half.
    pub(crate) fn recent_curve(&self) -> Option<Curve<OCTAVES>> {
        (self.part == FittedPart::LaterQuarter).then(|| self.curves.median_curve())
    }
}

/// Describes the noise of channel `of`; `None` if the record is too short, or the channel constant for an epoch.
pub(crate) fn describe<'a>(channels: &[TracedChannel<'a>], of: usize) -> Option<Nonstationarity> {
    let TracedChannel { series, epochs, baseline, model, .. } = channels[of];
    let ChannelEpochs { curves, quarters, part } = epochs.filter(|of| of.curves.changes_in_second_half())?;
    let epochs = [&curves.fitted_epochs[..], &curves.unseen_epochs[..]];
    let (tracked_model, _) = TrackedModel::select_line(model.clone(), epochs[0]);
    let tracked = select_tracked(&tracked_model, epochs[0]);
    let epochs_used = match part {
        FittedPart::FirstHalf => epochs[0].len(),
        FittedPart::LaterQuarter => curves.latest_epochs().len(),
    };
    let drift = expected_drift(&tracked_model, tracked, epochs[0], epochs_used, epochs[1].len());
    // Show the level over time even if it does not change.
    let shown = if tracked == TrackedSet::Nothing { TrackedSet::Level } else { tracked };
    let parameters = |(range, epoch): (&std::ops::Range<u64>, &Curve<OCTAVES>)| {
        let EpochEstimate { parameters: [level, line], error, .. } = tracked_model.estimate(epoch, shown);
        let line_hz = tracked_model.line_frequency().map(|frequency| frequency * line.exp());
        EpochParameters {
            from_s: (range.start - series.span.start) as f64 * series.period_s,
            white_noise_ratio: level.exp(),
            white_noise_error: level.exp() * error[0],
            line_hz,
            line_error_hz: line_hz.map(|frequency| frequency * error[1]),
        }
    };
    let source = |of: &TracedChannel<'a>| LineSource { name: of.name, series: of.series, samples: of.samples };
    let sources: Vec<LineSource> = channels.iter().map(source).collect();
    Some(Nonstationarity {
        quarters: *quarters,
        fitted_to: *part,
        tracked,
        epoch_s: curves.epoch_s,
        epochs: curves.ranges.iter().flatten().zip(epochs.into_iter().flatten()).map(parameters).collect(),
        beyond_drift: beyond_drift(&tracked_model, drift, &curves.unseen),
        tracking: track(&tracked_model, tracked, epochs, &curves.unseen),
        baselines: Baselines::new(curves, baseline, model),
        intervals: IntervalCoverage::of_second_half(curves, model),
        related_line: RelatedLine::find(&sources, of, &tracked_model, curves),
    })
}
