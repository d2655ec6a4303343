//! Sentences on changes of the noise, the common mode, and the errors on the second half.

use crate::finding_text::channel_list;
use crate::formatting::{capital, count, words};
use crate::rounding::{NONE, extremes, signed, significant, span};
use crate::summary::{self, off_percent};
use noise_analysis::nonstationarity::{FittedPart, RelatedLine, TrackedSet};
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

fn sentence(text: &str) -> String {
    let stop = if text.ends_with('.') { "" } else { "." };
    format!("{}{stop}", capital(text))
}

fn per_point(deviance: f64) -> String {
    significant(deviance, 2)
}

fn chance(p_value: f64) -> String {
    match 1.0 / p_value {
        odds if odds >= 1e15 => "chance does not explain it".to_owned(),
        odds if odds >= 2.0 => format!("chance explains it once in {} times", significant(odds, 2)),
        _ => "chance explains it".to_owned(),
    }
}

/// Changes of a channel's noise; empty for short records.
pub(crate) fn course(channel: &ChannelReport) -> Vec<String> {
    let Some(changes) = &channel.nonstationarity else { return Vec::new() };
    let related = changes.related_line.as_ref().map(|related| related_line(&channel.name, related));
    [stationarity(changes), movement(changes), tracking(changes)]
        .into_iter()
        .chain(related)
        .map(|text| sentence(&text))
        .collect()
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

fn stationarity(changes: &Nonstationarity) -> String {
    let Some(quarters) = changes.quarters else {
        return "The first half is too short to compare its two quarters.".to_owned();
    };
    let difference = format!(
        "Between the two quarters of the first half the Allan variance differs most at τ = {}: by {} %; {}.",
        span(quarters.tau_s),
        signed(100.0 * (quarters.variance_ratio - 1.0), 2),
        chance(quarters.p_value),
    );
    let part = match changes.fitted_to {
        FittedPart::FirstHalf => "The model is fitted to the whole first half.".to_owned(),
        FittedPart::LaterQuarter => format!(
            "The noise changes, so the model is fitted to the later quarter, which is nearer in time to the second half: to the \
             medians of its stretches of {}, which a disturbance of a few of them does not move.",
            span(changes.epoch_s)
        ),
    };
    format!("{difference} {part}")
}

fn movement(changes: &Nonstationarity) -> String {
    let (low, high) = extremes(changes.epochs.iter().map(|epoch| 100.0 * (epoch.white_noise_ratio - 1.0)));
    let error = changes.epochs.iter().map(|epoch| epoch.white_noise_error).fold(0.0, f64::max);
    let level = format!(
        "from one stretch of {} to the next the variance of the white noise lies between {} % and {} % of the model's own (each \
         ± {} %)",
        span(changes.epoch_s),
        signed(low, 2),
        signed(high, 2),
        significant(100.0 * error, 2),
    );
    let (lowest, highest) = extremes(changes.epochs.iter().filter_map(|epoch| epoch.line_hz));
    match changes.tracked {
        TrackedSet::Nothing => format!("No parameter of the first half moves: {level}."),
        TrackedSet::Level => format!("The white noise of the first half moves: {level}."),
        TrackedSet::LevelAndLine => {
            format!("A line moves, between {lowest:.2} and {highest:.2} Hz over the record; {level}.")
        }
    }
}

/// Errors of the prediction by stretch, and the coverage.
fn tracking(changes: &Nonstationarity) -> String {
    let moved = match changes.tracked {
        TrackedSet::Nothing => "With nothing to follow, the model leaves",
        TrackedSet::Level => {
            "With the white noise followed, each stretch predicted from those before it, the model leaves"
        }
        TrackedSet::LevelAndLine => {
            "With the white noise and the line followed, each stretch predicted from those before it, the model leaves"
        }
    };
    let held = changes.intervals;
    format!(
        "{moved} {} a point on a single stretch of the second half, against {} as it stands. Of {} octaves of these stretches {} \
         ({}) lie within the 95 % prediction intervals that the stretches before them give. Beyond the drift that the steps of \
         the first half let expect, the model leaves {} on the second half.",
        per_point(changes.tracking.one_step),
        per_point(changes.tracking.one_step_static),
        count(held.octaves as u64),
        count(held.within as u64),
        share(held.within, held.octaves),
        per_point(changes.beyond_drift),
    )
}

fn share(part: usize, whole: usize) -> String {
    if whole == 0 { NONE.to_owned() } else { format!("{:.1} %", 100.0 * part as f64 / whole as f64) }
}

fn related_line(name: &str, related: &RelatedLine) -> String {
    let [own, other] = [name, related.channel.as_str()].map(|name| channel_list([name]));
    let ratio = match related.ratio {
        (1, 1) => "the same frequency".to_owned(),
        (above, below) => format!("{above}/{below} of its frequency"),
    };
    format!(
        "The line shows in {other} too, at {ratio}: the frequencies of the first half have the ratio {:.4} ± {:.4}, and their steps \
         are correlated by {:.2}; {}. One cause moves both. With the line where {other} has it in the second half, the model leaves \
         {}; this uses the second half of {other}, and not that of {own}.",
        related.measured_ratio,
        related.measured_ratio_deviation,
        related.correlation,
        chance(related.p_value),
        per_point(related.unseen),
    )
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
