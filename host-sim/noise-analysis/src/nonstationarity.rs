//! Non-stationarity: what changes while a record is made, and the errors on the second half of models that allow for the change.
//!
//! ```text
//! Series ─► EpochCurves ─► Stationarity ─► FittedPart: which part of the first half the predictive model is fitted to
//!                │
//!                └─► TrackedModel: parameters that change from epoch to epoch
//!                        ├─► track: each epoch of the second half predicted from those before it
//!                        ├─► expected_drift, beyond_drift: the error beyond the drift that the first half shows
//!                        ├─► RelatedLine: the frequency of a line by a related line of another channel
//!                        └─► Baselines: the same predictions without added terms
//! all channels ─► CommonModeRegression
//! ```
//!
//! The record is cut in the middle. Tests and models use the first half alone, with two exceptions: tracking uses each
//! epoch of the second half after it was predicted, and a related line uses the second half of another channel. Their
//! errors are reported apart from the others.

mod common_mode_regression;
mod epochs;
mod prediction;
mod related_line;
mod tracked_parameters;

#[cfg(test)]
mod tests;

pub use common_mode_regression::{CommonModeRegression, HoldOutGain, OctaveShares};
pub use epochs::{EpochCurves, FittedPart, Stationarity};
pub use prediction::{Baselines, TrackingErrors};
pub use related_line::RelatedLine;
pub use tracked_parameters::{EpochEstimate, MovementTest, ParameterVector, TrackedModel, TrackedSet};

use crate::OCTAVES;
use crate::sampling_faults;
use crate::series::Series;
use allan_core::fit::fit_shapes;
use allan_core::term::MovingAverageFilter;
use allan_core::trace::{LineCandidates, Trace, trace};
use allan_core::{Curve, Model, NoiseTerm};
use epochs::deviance_per_point;
use measurement::{ChannelProfile, Measurement};
use prediction::{beyond_drift, expected_drift, select_tracked, track};

/// What was found in a recording.
#[derive(Debug, Clone)]
pub struct Explanation {
    /// Hz.
    pub sample_rate_hz: f64,
    /// Samples that are used.
    pub samples: u64,
    /// Lost samples, repeated samples and the sample clock: a sentence each.
    pub time_base: Vec<String>,
    /// Inertial channels that were recorded; [`RelatedLine::channel`] is a position in this list.
    pub searched: Vec<ChannelProfile>,
    /// Those whose counts change in every epoch.
    pub channels: Vec<ChannelExplanation>,
    /// Regression of these channels on each other.
    pub common_mode: Option<CommonModeRegression>,
}

/// What was found in a channel. All coefficients are in its unit.
#[derive(Debug, Clone)]
pub struct ChannelExplanation {
    /// The channel.
    pub channel: ChannelProfile,
    /// The curves that everything below is estimated from.
    pub curves: EpochCurves,
    /// The baseline model and the model with added terms, fitted to the first half.
    pub trace: Trace,
    /// Comparison of the two quarters of the first half.
    pub stationarity: Option<Stationarity>,
    /// The part of the first half that the predictive model is fitted to.
    pub part: FittedPart,
    /// The terms of the trace, fitted to that part; to the median curve, if it is the later quarter.
    pub predictive: Model,
    /// The predictive model, and its line that moves most clearly.
    pub tracked_model: TrackedModel,
    /// The parameters that move.
    pub tracked_set: TrackedSet,
    /// Expected change of each parameter from that part to the second half: standard deviations.
    pub drift: ParameterVector,
    /// The parameters over time, in the epochs of the first and of the second half.
    pub profile: [Vec<EpochEstimate>; 2],
    /// Deviance per point of every model.
    pub errors: ModelDeviances,
    /// Errors of the prediction epoch by epoch.
    pub tracking: TrackingErrors,
    /// The same without added terms.
    pub baselines: Baselines,
    /// A line of another channel that moves with this channel's.
    pub related_line: Option<RelatedLine>,
}

/// Deviances per point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ModelDeviances {
    /// Of N, B and K; on the first and on the second half.
    pub baseline: [f64; 2],
    /// With the added terms; on the first and on the second half.
    pub traced: [f64; 2],
    /// Of the curve of the first half itself on the second half: the error of a model that describes the first half exactly.
    pub first_half_curve: f64,
    /// Of the predictive model; on the part that it is fitted to and on the second half.
    pub predictive: [f64; 2],
    /// Of the predictive model on the second half, beyond the expected drift.
    pub beyond_drift: f64,
}

/// Explains the inertial channels of a recording, without those that do not change for a whole epoch or are too short to be
/// cut into epochs.
#[must_use]
pub fn explain(measurement: &Measurement) -> Explanation {
    let inertial = measurement.profiles().filter(|channel| channel.quantity.is_inertial());
    let (searched, series): (Vec<ChannelProfile>, Vec<Series>) =
        inertial.map(|channel| (channel, Series::from_measurement(measurement, &channel))).unzip();
    let explained = |position: usize| {
        let mut explained = explain_channel(
            searched[position],
            &series[position],
            &measurement.profile.filters_read_at(measurement.sample_rate_hz),
        )?;
        explained.related_line = RelatedLine::find(&series, position, &explained.tracked_model, &explained.curves);
        Some(explained)
    };
    let channels: Vec<ChannelExplanation> = (0..series.len()).filter_map(explained).collect();
    let names: Vec<ChannelProfile> = channels.iter().map(|of| of.channel).collect();
    Explanation {
        sample_rate_hz: measurement.sample_rate_hz,
        samples: measurement.len() as u64,
        time_base: sampling_faults::detect(measurement).into_iter().map(|finding| finding.effect.evidence).collect(),
        common_mode: CommonModeRegression::estimate(measurement, &names),
        searched,
        channels,
    }
}

fn explain_channel(
    channel: ChannelProfile,
    series: &Series,
    filters: &[MovingAverageFilter],
) -> Option<ChannelExplanation> {
    let curves = EpochCurves::from_series(series)?;
    let parts = [&curves.quarters[..], &curves.fitted_epochs, &curves.unseen_epochs].concat();
    if parts.iter().any(|part| part.points().iter().all(|point| point.avar == 0.0)) {
        return None;
    }
    let trace = trace(&curves.fitted, LineCandidates::Curve, filters);
    let stationarity = Stationarity::compare(&curves.quarters[0], &curves.quarters[1], &trace.after);
    let part = FittedPart::select(stationarity);
    let epochs = [&curves.fitted_epochs[..], &curves.unseen_epochs[..]];
    let (predictive, fitted_to, epochs_used) = match part {
        FittedPart::FirstHalf => (trace.after.clone(), &curves.fitted, epochs[0].len()),
        FittedPart::LatestQuarter => {
            let kinds: Vec<NoiseTerm> = trace.after.terms().iter().map(|term| term.kind).collect();
            (fit_shapes(&curves.median_curve(), &kinds), &curves.quarters[1], curves.latest_epochs().len())
        }
    };
    let (tracked_model, _) = TrackedModel::select_line(predictive.clone(), epochs[0]);
    let tracked_set = select_tracked(&tracked_model, epochs[0]);
    let drift = expected_drift(&tracked_model, tracked_set, epochs[0], epochs_used, epochs[1].len());
    let first_half = |n: u64| curves.fitted.points().iter().find(|point| point.n == n).map_or(f64::NAN, |p| p.avar);
    let errors = ModelDeviances {
        baseline: [deviance(&trace.before, &curves.fitted), deviance(&trace.before, &curves.unseen)],
        traced: [deviance(&trace.after, &curves.fitted), deviance(&trace.after, &curves.unseen)],
        first_half_curve: deviance_per_point(&curves.unseen, first_half),
        predictive: [deviance(&predictive, fitted_to), deviance(&predictive, &curves.unseen)],
        beyond_drift: beyond_drift(&tracked_model, drift, &curves.unseen),
    };
    // The profile over time shows the level even where it does not move.
    let shown = if tracked_set == TrackedSet::Nothing { TrackedSet::Level } else { tracked_set };
    Some(ChannelExplanation {
        channel,
        stationarity,
        part,
        errors,
        profile: epochs.map(|epochs| epochs.iter().map(|epoch| tracked_model.estimate(epoch, shown)).collect()),
        tracking: track(&tracked_model, tracked_set, epochs, &curves.unseen),
        baselines: Baselines::new(&curves, &trace.before),
        related_line: None,
        trace,
        predictive,
        tracked_model,
        tracked_set,
        drift,
        curves,
    })
}

fn deviance(model: &Model, curve: &Curve<OCTAVES>) -> f64 {
    deviance_per_point(curve, |n| model.avar(n))
}
