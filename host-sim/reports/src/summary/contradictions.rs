//! Places at which the data contradict a model.

use super::channels::inertial;
use super::model_error::is_fitted_to_later_quarter;
use crate::coefficients::CHANCE;
use crate::finding_text::{channel_list, channel_name};
use crate::formatting::counted_places;
use crate::rounding::{significant, span};
use noise_analysis::distributions::quantile;
use noise_analysis::report::assessment::Innovations;
use noise_analysis::report::{ChannelReport, ModelErrorReport, Report};

/// Variance of a fit to another half, over an octave's own.
const FITTED_TO_HALF: f64 = 1.0;

/// Variance of a fit to the medians of a quarter: half the samples, a fourth more scatter.
const FITTED_TO_QUARTER: f64 = 2.0 * 1.25 * 1.25;

/// A point of the unseen half farther from the model than chance explains.
struct FarOff {
    sigma: f64,
    /// Absolute logarithm of measured over modelled σ.
    logarithm: f64,
    /// Channel, averaging time and departure in words.
    place: String,
}

/// One of each channel, the least probable first.
fn far_off(report: &Report) -> Vec<FarOff> {
    let channels = inertial(report).count() as f64;
    let is_far_off = |channel: &ChannelReport, sigma: f64| {
        let fitted = if is_fitted_to_later_quarter(channel) { FITTED_TO_QUARTER } else { FITTED_TO_HALF };
        let octaves = channel.curve.len() as f64;
        sigma > (1.0 + fitted).sqrt() * quantile(CHANCE / 2.0 / (channels * octaves).max(1.0))
    };
    let far = |channel: &ChannelReport| {
        let ModelErrorReport { worst_sigma, worst_tau_s, worst_ratio, .. } = channel.after.unseen;
        let sigma = worst_sigma.map(f64::abs).filter(|&sigma| is_far_off(channel, sigma))?;
        let (tau, times) = (span(worst_tau_s?), 1.0 / worst_ratio?);
        let change = 100.0 * (times - 1.0);
        let size = if change.abs() < 100.0 {
            format!("{} % {}", significant(change.abs(), 2), if change < 0.0 { "below" } else { "above" })
        } else {
            format!("{} times", significant(times, 2))
        };
        let place = format!("{} at τ = {tau}: σ is {size} the model", channel_name(channel));
        Some(FarOff { sigma, logarithm: times.ln().abs(), place })
    };
    let mut far: Vec<FarOff> = inertial(report).filter_map(far).collect();
    far.sort_by(|a, b| b.sigma.total_cmp(&a.sigma));
    far
}

/// Channels in which a Kalman filter with the model is surer of itself than chance explains.
fn claiming_too_much(report: &Report) -> Vec<&String> {
    let channels = inertial(report).count() as f64;
    let is_unsure = |of: &Innovations| channels * of.chance_of_small_claim() < CHANCE;
    let unsure = inertial(report).filter(|channel| channel.assessment.innovations.as_ref().is_some_and(is_unsure));
    unsure.map(|channel| &channel.name).collect()
}

pub fn contradictions(report: &Report) -> Vec<String> {
    let standard_errors = |far: &FarOff| format!("{} ({} standard errors)", far.place, significant(far.sigma, 2));
    let unsure = claiming_too_much(report);
    let filter = (!unsure.is_empty()).then(|| {
        format!("a Kalman filter with the models of {} claims a smaller error than it has", channel_list(unsure))
    });
    far_off(report).iter().map(standard_errors).chain(filter).collect()
}

pub(crate) fn contradictions_in_short(report: &Report) -> Option<String> {
    let (far, unsure) = (far_off(report), claiming_too_much(report));
    let largest = far.iter().max_by(|a, b| a.logarithm.total_cmp(&b.logarithm)).map(|far| far.place.clone());
    let filter = || {
        let of = if let [one] = &unsure[..] { channel_list([one]) } else { format!("{} channels", unsure.len()) };
        format!("a Kalman filter of {of} claims too small an error")
    };
    let text = largest.or_else(|| (!unsure.is_empty()).then(filter))?;
    Some(counted_places(far.len() + usize::from(!unsure.is_empty()), &text))
}
