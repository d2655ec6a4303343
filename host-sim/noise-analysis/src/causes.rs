//! One finding a cause: merges what the channels show of one cause, and says how much of each channel it explains and whether
//! the second half of the record agrees with the first.
//!
//! ```text
//! effects of every channel ─► periodic (lines and their harmonics) ─► Cause ─► shares
//! effects of the first half alone ──────────────────────────────────────────┴► validation
//! ```

mod cause;
mod harmonic_series;
mod line;
mod periodic;
mod shares;
mod validation;
mod waveform;

#[cfg(test)]
mod tests;

use crate::findings::{Effect, Finding, Parameter, Validation};
use crate::report::ChannelReport;
use cause::{Cause, Shown};
use measurement::SensorProfile;
use std::collections::BTreeMap;
use std::f64::consts::TAU;

/// Kinds that the sensor, its bus or its environment have once: whatever channels show one of them show the same cause.
const ONCE: [&str; 10] = [
    "dropped_samples",
    "repeated_samples",
    "sample_clock",
    "filter_bandwidth",
    "temperature",
    "temperature_squared",
    "thermal_lag",
    "supply",
    "acceleration",
    "vibration_rectification",
];
/// Kinds that are one cause in the channels of one unit.
const ONCE_A_UNIT: [&str; 2] = ["common_mode", "shared_drift"];
/// Frequency of a line, in units of `1/(2πT)` of a common-mode drift with the time constant T, at which the drift has a tenth of
/// its density at low frequencies: 1/(1 + 3²).
const WITHIN_COMMON_MODE: f64 = 3.0;

/// The causes of the `effects` of all channels. Each channel is given the effects by which it reports a cause, which refer to the
/// finding; `first_half` are the effects of the same channels from the first half alone.
pub(crate) fn find(
    channels: &mut [ChannelReport],
    effects: &[Vec<Effect>],
    first_half: &[Vec<Effect>],
    profile: &SensorProfile,
    duration_s: f64,
) -> Vec<Finding> {
    let causes = merged(&with_units(channels, effects), duration_s);
    let half = merged(&with_units(channels, first_half), 0.5 * duration_s);
    let findings: Vec<Finding> = causes.iter().map(|cause| finding(cause, channels, &half, profile)).collect();
    let mut reported: Vec<Vec<Effect>> = vec![Vec::new(); channels.len()];
    for (number, cause) in causes.into_iter().enumerate() {
        for Shown { channel, effect, .. } in cause.shown {
            reported[channel].push(Effect { finding: number, ..effect });
        }
    }
    for (channel, effects) in channels.iter_mut().zip(reported) {
        channel.effects = effects;
    }
    findings
}

fn with_units<'e>(channels: &'e [ChannelReport], effects: &'e [Vec<Effect>]) -> Vec<(&'e str, &'e [Effect])> {
    channels.iter().map(|channel| channel.unit.as_str()).zip(effects.iter().map(Vec::as_slice)).collect()
}

/// The causes of the effects of all channels, each with its unit, in the order in which the channels first show them.
fn merged(channels: &[(&str, &[Effect])], duration_s: f64) -> Vec<Cause> {
    let mut causes = periodic::causes(channels, duration_s);
    let periodic = causes.len();
    for (channel, (unit, effects)) in channels.iter().enumerate() {
        for effect in effects.iter().filter(|effect| !line::is_line(effect)) {
            if is_common_line(effect, channel, &causes[..periodic]) {
                continue;
            }
            let is_same = |cause: &&mut Cause| {
                let known = &cause.shown[0];
                let is_known_here = cause.shown.iter().any(|shown| shown.channel == channel);
                // Bands of one channel are two of them.
                let is_other_band = is_known_here && effect.kind == "unexplained";
                !is_other_band && is_one_cause(&known.effect, channels[known.channel].0, effect, unit)
            };
            let shown = Shown { channel, effect: effect.clone(), parts: vec![effect.clone()] };
            match causes.iter_mut().find(is_same) {
                Some(cause) => cause.shown.push(shown),
                None => causes.push(Cause { shown: vec![shown] }),
            }
        }
    }
    // What is left in one channel of a drift that others showed as a line is that line's.
    causes.retain(|cause| cause.shown.len() > 1 || cause.shown[0].effect.kind != "common_mode");
    causes.sort_by_key(|cause| cause.shown[0].channel);
    causes
}

/// Whether a common-mode drift of a channel is a line that the channel has in common with others, in its band.
fn is_common_line(effect: &Effect, channel: usize, periodic: &[Cause]) -> bool {
    let time_constant = effect.parameters.get("time_constant").filter(|_| effect.kind == "common_mode");
    time_constant.is_some_and(|time_constant| {
        let is_in_band = |shown: &Shown| {
            let frequency = shown.effect.parameters.get("frequency");
            shown.channel == channel
                && frequency.is_some_and(|of| TAU * of.value * time_constant.value < WITHIN_COMMON_MODE)
        };
        periodic.iter().any(|cause| cause.shown.len() > 1 && cause.shown.iter().any(is_in_band))
    })
}

/// Whether effects of two channels are the same cause.
fn is_one_cause(a: &Effect, unit: &str, b: &Effect, other_unit: &str) -> bool {
    if a.kind != b.kind {
        return false;
    }
    let both = |name: &str| Some((a.parameters.get(name)?, b.parameters.get(name)?));
    let is_at_one_time = || match (both("from"), both("to")) {
        (Some((from, other_from)), Some((to, other_to))) => {
            from.value <= other_to.value && other_from.value <= to.value
        }
        _ => both("time").is_some_and(|(time, other)| time.low <= other.high && other.low <= time.high),
    };
    // What has no name in several channels at one frequency.
    let is_at_one_frequency = || {
        let has = |of: &Parameter, value: f64| (of.low..=of.high).contains(&value);
        a.kind == "unexplained"
            && both("frequency").is_some_and(|(one, other)| has(one, other.value) && has(other, one.value))
    };
    // A filter of the first order in one channel, and the filter of the part.
    let is_one_filter = a.parameters.contains_key("bandwidth") == b.parameters.contains_key("bandwidth");
    if ONCE.contains(&a.kind.as_str()) {
        return is_one_filter;
    }
    (ONCE_A_UNIT.contains(&a.kind.as_str()) && unit == other_unit) || is_at_one_time() || is_at_one_frequency()
}

/// A cause as it is reported.
fn finding(cause: &Cause, channels: &[ChannelReport], half: &[Cause], profile: &SensorProfile) -> Finding {
    let clearest = cause.clearest();
    let name = |shown: &Shown| channels[shown.channel].name.clone();
    let share = |shown: &Shown| Some((name(shown), shares::percent(shown, channels, profile)?));
    let evidence = match cause.shown.len() {
        1 => clearest.effect.evidence.clone(),
        count => format!("{}: {}; one cause in {count} channels", name(clearest), clearest.effect.evidence),
    };
    Finding {
        kind: clearest.effect.kind.clone(),
        channels: cause.shown.iter().map(name).collect(),
        parameters: clearest.effect.parameters.clone(),
        evidence,
        validated: validate(cause, half),
        share_percent: cause.shown.iter().filter_map(share).collect::<BTreeMap<_, _>>(),
    }
}

/// Compares what the whole record shows of a cause with what the first half alone shows.
fn validate(cause: &Cause, half: &[Cause]) -> Validation {
    let in_half = |shown: &Shown| {
        let of_channel = half.iter().flat_map(|cause| &cause.shown).filter(|other| other.channel == shown.channel);
        of_channel.map(|other| &other.effect).filter(|other| validation::is_same(&shown.effect, other)).min_by(
            |a, b| {
                let distance = |of: &Effect| validation::distance(&shown.effect, of);
                distance(a).total_cmp(&distance(b))
            },
        )
    };
    let pairs: Vec<(&Effect, &Effect)> =
        cause.shown.iter().filter_map(|shown| Some((&shown.effect, in_half(shown)?))).collect();
    validation::compare(&pairs)
}
