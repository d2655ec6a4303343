//! What is in a recording, as far as data of hours can tell: effects, what of them moves, what the channels share, and
//! what each piece of that knowledge is worth on the half that was not fitted.
//!
//! ```text
//! Recording ─► deliveries (gaps, repeats, clock)
//!           ├► each channel: Parts ─► trace ─► Stationarity ─► predictive model ─► Tracked, Controls, Companion
//!           └► all together: SlowPart
//! ```

pub mod slow_part;

use crate::OCTAVES;
use crate::series::Series;
use crate::time_course::companion::Companion;
use crate::time_course::control::Controls;
use crate::time_course::drift::{beyond_drift, expected};
use crate::time_course::moving::{Estimate, Free, Moving, State};
use crate::time_course::stationarity::{Part, Stationarity, predictive_part, stationarity};
use crate::time_course::tracking::{Tracked, track, what_moves};
use crate::time_course::typical::typical;
use crate::time_course::{Parts, deviance_per_point};
use crate::trace::{deliveries, sample_clock};
use allan_core::fit::fit_shapes;
use allan_core::term::MovingAverageFilter;
use allan_core::trace::{LineCandidates, Trace, trace};
use allan_core::{Curve, Model, NoiseTerm};
use measurement::{ChannelProfile, Measurement};
use slow_part::SlowPart;

/// What was found in a recording.
#[derive(Debug, Clone)]
pub struct Explanation {
    /// Hz.
    pub sample_rate_hz: f64,
    /// Samples that are used.
    pub samples: u64,
    /// What the samples' arrival shows, a sentence each.
    pub deliveries: Vec<String>,
    /// Inertial channels that were recorded; what [`Companion::channel`] counts.
    pub searched: Vec<ChannelProfile>,
    /// Those whose counts change.
    pub channels: Vec<ChannelExplanation>,
    /// What they share.
    pub slow_part: Option<SlowPart>,
}

/// What was found in a channel. All coefficients in its unit.
#[derive(Debug, Clone)]
pub struct ChannelExplanation {
    /// Which.
    pub channel: ChannelProfile,
    /// The curves that everything below comes from.
    pub parts: Parts,
    /// The declared model, and that with what it lacks, fitted to the first half.
    pub trace: Trace,
    /// Whether the quarters of the first half differ.
    pub stationarity: Option<Stationarity>,
    /// What the predictive model was fitted to.
    pub part: Part,
    /// The terms of the trace, fitted to that part; where the noise moves, to what it mostly is there.
    pub predictive: Model,
    /// The predictive model with what moves in it.
    pub moving: Moving,
    /// What moves.
    pub free: Free,
    /// By how much on average from the part that the predictive model was fitted to to the unseen half, if it goes on as
    /// in the fitted half: standard deviations.
    pub drift: State,
    /// How, epoch by epoch: the fitted half, the unseen half.
    pub course: [Vec<Estimate>; 2],
    /// Deviance per point of every model.
    pub errors: Errors,
    /// The unseen half foretold epoch by epoch.
    pub tracked: Tracked,
    /// The same without knowing any effect.
    pub controls: Controls,
    /// Where else the line that moves shows, if it does.
    pub companion: Option<Companion>,
}

/// Deviance per point: on what each model was fitted to, and on the unseen half.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Errors {
    /// N, B and K; on the fitted and on the unseen half.
    pub declared: [f64; 2],
    /// With what the trace added; on the fitted and on the unseen half.
    pub traced: [f64; 2],
    /// The curve of the fitted half taken for a model of the unseen one: no model that stands still does better for long.
    pub standing_still: f64,
    /// The predictive model; on the part that it was fitted to and on the unseen half.
    pub predictive: [f64; 2],
    /// The predictive model on the unseen half, beyond the drift that the fitted half lets expect.
    pub beyond_drift: f64,
}

/// Explains the inertial channels of a recording; those that never change, or are too short to be cut up, are left out.
#[must_use]
pub fn explain(measurement: &Measurement) -> Explanation {
    let inertial = measurement.profiles().filter(|channel| channel.quantity.is_inertial());
    let (searched, series): (Vec<ChannelProfile>, Vec<Series>) =
        inertial.map(|channel| (channel, Series::of(measurement, &channel))).unzip();
    let explained = |position: usize| {
        let mut explained = explain_channel(searched[position], &series[position], &measurement.profile.filters)?;
        explained.companion = Companion::of(&series, position, &explained.moving, &explained.parts);
        Some(explained)
    };
    let channels: Vec<ChannelExplanation> = (0..series.len()).filter_map(explained).collect();
    let names: Vec<ChannelProfile> = channels.iter().map(|of| of.channel).collect();
    let findings =
        [deliveries::dropped(measurement), deliveries::repeated(measurement), sample_clock::find(measurement)];
    Explanation {
        sample_rate_hz: measurement.sample_rate_hz,
        samples: measurement.len() as u64,
        deliveries: findings.into_iter().flatten().map(|finding| finding.effect.evidence).collect(),
        slow_part: SlowPart::of(measurement, &names),
        searched,
        channels,
    }
}

fn explain_channel(
    channel: ChannelProfile,
    series: &Series,
    filters: &[MovingAverageFilter],
) -> Option<ChannelExplanation> {
    let parts = Parts::of(series)?;
    if parts.quarters.iter().chain([&parts.unseen]).any(|part| part.points().iter().all(|point| point.avar == 0.0)) {
        return None;
    }
    let trace = trace(&parts.fitted, LineCandidates::Curve, filters);
    let stationarity = stationarity(&parts.quarters[0], &parts.quarters[1], &trace.after);
    let part = predictive_part(stationarity);
    let predictive = match part {
        Part::FittedHalf => trace.after.clone(),
        Part::LatestQuarter => {
            let kinds: Vec<NoiseTerm> = trace.after.terms().iter().map(|term| term.kind).collect();
            fit_shapes(&typical(&parts.quarters[1], parts.latest_epochs()), &kinds)
        }
    };
    let (moving, _) = Moving::of(predictive.clone(), &parts.fitted_epochs);
    let free = what_moves(&moving, &parts.fitted_epochs);
    let epochs = [&parts.fitted_epochs[..], &parts.unseen_epochs[..]];
    let learnt = match part {
        Part::FittedHalf => epochs[0],
        Part::LatestQuarter => parts.latest_epochs(),
    };
    let drift = expected(&moving, free, epochs[0], learnt.len(), epochs[1].len());
    let fitted_to = match part {
        Part::FittedHalf => &parts.fitted,
        Part::LatestQuarter => &parts.quarters[1],
    };
    let of_fitted_half = |n: u64| parts.fitted.points().iter().find(|point| point.n == n).map_or(f64::NAN, |p| p.avar);
    let errors = Errors {
        declared: [error(&trace.before, &parts.fitted), error(&trace.before, &parts.unseen)],
        traced: [error(&trace.after, &parts.fitted), error(&trace.after, &parts.unseen)],
        standing_still: deviance_per_point(&parts.unseen, of_fitted_half),
        predictive: [error(&predictive, fitted_to), error(&predictive, &parts.unseen)],
        beyond_drift: beyond_drift(&moving, drift, &parts.unseen),
    };
    let seen = if free == Free::Nothing { Free::Level } else { free };
    Some(ChannelExplanation {
        channel,
        stationarity,
        part,
        errors,
        course: epochs.map(|epochs| epochs.iter().map(|epoch| moving.estimate(epoch, seen)).collect()),
        tracked: track(&moving, free, epochs, &parts.unseen),
        controls: Controls::of(&parts, &trace.before),
        companion: None,
        trace,
        predictive,
        moving,
        free,
        drift,
        parts,
    })
}

fn error(model: &Model, curve: &Curve<OCTAVES>) -> f64 {
    deviance_per_point(curve, |n| model.avar(n))
}
