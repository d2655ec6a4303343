//! Sentences on changes of the noise, the common mode, and the errors on the second half.

use crate::finding_text::{Sentences, channel_list};
use crate::formatting::{count, words};
use crate::rounding::{NONE, extremes, significant, span};
use crate::summary::{self, off_percent};
use noise_analysis::report::{ChannelReport, CommonModeRegression, ModelErrorReport, Nonstationarity, Report};

/// Averaging times of the common mode, s: the nearest octaves are told.
const COMMON_MODE_TAU_S: [f64; 3] = [0.01, 40.0, 160.0];

/// Coverage of the predictions, and the common mode; empty if no channel is followed.
pub(crate) fn all_channels(report: &Report) -> Vec<String> {
    let followed = || report.channels.iter().filter_map(|channel| channel.nonstationarity.as_ref());
    let Some(first) = followed().next() else { return Vec::new() };
    let common = report.common_mode.iter().flat_map(common_mode);
    [coverage(followed(), first.epoch_s)].into_iter().chain(common).collect()
}

/// Changes of a channel's noise; empty for short records.
pub(crate) fn course(channel: &ChannelReport) -> Vec<String> {
    let Some(changes) = &channel.nonstationarity else { return Vec::new() };
    let Nonstationarity { epochs, intervals, quarters, .. } = changes;
    let (low, high) = extremes(epochs.iter().map(|epoch| 100.0 * (epoch.white_noise_ratio - 1.0)));
    let (lowest, highest) = extremes(epochs.iter().filter_map(|epoch| epoch.line_hz));
    let sentences = Sentences::of("course", changes)
        .with("own", channel_list([&channel.name]))
        .with("difference", quarters.map(|of| 100.0 * (of.variance_ratio - 1.0)))
        .with("low", low)
        .with("high", high)
        .with("error", 100.0 * epochs.iter().map(|epoch| epoch.white_noise_error).fold(0.0, f64::max))
        .with("lowest_hz", lowest)
        .with("highest_hz", highest)
        .with("share", share(intervals.within, intervals.octaves));
    (0..4).filter_map(|position| sentences.sentence(position)).filter(|text| !text.is_empty()).collect()
}

pub(crate) fn model(channel: &ChannelReport) -> String {
    let off = |error: &ModelErrorReport| {
        error.rms_percent.map_or_else(|| NONE.to_owned(), |of| format!("{} %", off_percent(of)))
    };
    let terms: Vec<String> = channel.after.terms.iter().map(|term| words(term.kind())).collect();
    let [without, with] = summary::models(channel);
    let excluding = without.unseen_excluding.as_ref().zip(with.unseen_excluding.as_ref());
    let excluding = excluding.map_or_else(String::new, |(before, after)| {
        format!(" Without the spikes and knocks of both halves {} become {}.", off(before), off(after))
    });
    let error = match channel.effects.is_empty() {
        true => off(&with.unseen),
        false => format!("{} with N, B and K, and by {} with what was found", off(&without.unseen), off(&with.unseen)),
    };
    let events = channel.after.events.as_ref().map_or_else(String::new, |events| {
        let rate = &events.rate_per_hour;
        format!(
            ", with {} spikes and knocks an hour [{}, {}], as the first half has them",
            significant(rate.value, 2),
            significant(rate.low, 2),
            significant(rate.high, 2)
        )
    });
    format!(
        "On the second half, which the models had not seen, σ is off by {error} ({}{events}). \
         The curve of the first half itself is off by {}: a model of stationary noise cannot be expected to do better.{excluding}",
        terms.join(", "),
        off(&channel.first_half_curve),
    )
}

fn share(part: usize, whole: usize) -> String {
    if whole == 0 { NONE.to_owned() } else { format!("{:.1} %", 100.0 * part as f64 / whole as f64) }
}

fn coverage<'a>(channels: impl Iterator<Item = &'a Nonstationarity>, epoch_s: f64) -> String {
    let (octaves, within) = channels.fold((0, 0), |(octaves, within), changes| {
        (octaves + changes.intervals.octaves, within + changes.intervals.within)
    });
    format!(
        "Of all {} octaves of the stretches of {} in the second half {} lie within their 95 % prediction intervals.",
        count(octaves as u64),
        span(epoch_s),
        share(within, octaves),
    )
}

fn common_mode(of: &CommonModeRegression) -> Vec<String> {
    let list = |values: &[f64], text: &dyn Fn(f64) -> String| -> String {
        let each =
            of.channels.iter().zip(values).map(|(name, &value)| format!("{} {}", channel_list([name]), text(value)));
        each.collect::<Vec<_>>().join(", ")
    };
    // The nearest of `taus` to each of `wanted`.
    let nearest = |taus: &[f64], wanted: &[f64]| {
        let distance = |at: usize, tau: f64| (taus[at] / tau).ln().abs();
        let near = |&tau: &f64| (0..taus.len()).min_by(|&a, &b| distance(a, tau).total_cmp(&distance(b, tau)));
        let mut places: Vec<usize> = wanted.iter().filter_map(near).collect();
        places.dedup();
        places
    };
    let taus: Vec<f64> = of.shares.iter().map(|at| at.tau_s).collect();
    let shares = nearest(&taus, &COMMON_MODE_TAU_S).into_iter().map(|at| {
        let octave = &of.shares[at];
        let shown = list(&octave.share, &|share| format!("{:.0} %", 100.0 * share));
        format!("At τ = {} the other channels predict of the variance in the first half: {shown}.", span(octave.tau_s))
    });
    let taus: Vec<f64> = of.gains.iter().map(|at| at.tau_s).collect();
    let gains = nearest(&taus, &COMMON_MODE_TAU_S[1..]).into_iter().map(|at| {
        let octave = &of.gains[at];
        let shown = list(&octave.ratio, &|ratio| format!("{ratio:.2}"));
        format!(
            "With the weights of the first half at τ = {} subtracted, the Allan deviation of the second half at τ = {} is this times \
             what it was: {shown}.",
            span(of.weights_tau_s),
            span(octave.tau_s),
        )
    });
    let untrusted: Vec<&String> =
        of.channels.iter().zip(&of.trusted).filter(|(_, is)| !**is).map(|(name, _)| name).collect();
    let note = (!untrusted.is_empty()).then(|| {
        format!(
            "In {} the weights of the first quarter did not make the second quarter better: do not subtract them there.",
            channel_list(untrusted)
        )
    });
    shares.chain(gains).chain(note).collect()
}
