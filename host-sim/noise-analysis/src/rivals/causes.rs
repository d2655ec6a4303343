//! One finding a cause: merges what the channels show of one cause, and says how much of each channel it explains and whether
//! the second half of the record agrees with the first.
//!
//! ```text
//! effects of every channel ─► periodic (lines and their harmonics) ─► Cause ─► shares
//! effects of the first half alone ──────────────────────────────────────────┴► validation
//! ```

mod comb;
mod grouping;
mod line;
mod periodic;
mod shares;
mod validation;
mod waveform;

#[cfg(test)]
mod tests;

use crate::effects::Effect;
use crate::effects::findings::{ChannelEffect, Finding, Validation};
use crate::report::ChannelReport;
use crate::rivals::cause::{Cause, Shown};
use crate::rivals::table::{CauseClaim, stands_as_cause};
use grouping::join;
use measurement::SensorProfile;
use shares::Shares;

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
    let mut reported: Vec<Vec<ChannelEffect>> = vec![Vec::new(); channels.len()];
    for (finding, cause) in causes.into_iter().enumerate() {
        for Shown { channel, effect, .. } in cause.shown {
            reported[channel].push(ChannelEffect { effect, finding });
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
    let periodic = periodic::causes(channels, duration_s);
    let stands = |effect: &Effect, channel: usize| {
        let claim = CauseClaim { effect, channel, shown_by: None, periodic: &periodic };
        !effect.is_line() && stands_as_cause(&claim)
    };
    let all =
        channels.iter().enumerate().flat_map(|(channel, (_, effects))| effects.iter().map(move |of| (channel, of)));
    let others: Vec<(usize, &Effect)> = all.filter(|(channel, effect)| stands(effect, *channel)).collect();
    let mut groups: Vec<Vec<Shown>> = periodic.into_iter().map(|cause| cause.shown).collect();
    let is_same = |known: &Shown, shown: &Shown| {
        // Bands of one channel are two of them.
        let is_other_band = known.channel == shown.channel && matches!(shown.effect, Effect::Unexplained(_));
        let is_same_unit = channels[known.channel].0 == channels[shown.channel].0;
        !is_other_band && known.effect.is_one_cause(&shown.effect, is_same_unit)
    };
    for (channel, effect) in others {
        join(&mut groups, is_same, Shown { channel, effect: effect.clone(), parts: vec![effect.clone()] });
    }
    let mut causes: Vec<Cause> = groups.into_iter().map(|shown| Cause { shown }).collect();
    causes.retain(|cause| {
        let Shown { effect, channel, .. } = &cause.shown[0];
        let shown_by = Some(cause.shown.len());
        stands_as_cause(&CauseClaim { effect, channel: *channel, shown_by, periodic: &[] })
    });
    causes.sort_by_key(|cause| cause.shown[0].channel);
    causes
}

fn finding(cause: &Cause, channels: &[ChannelReport], half: &[Cause], profile: &SensorProfile) -> Finding {
    let clearest = cause.clearest();
    let name = |shown: &Shown| channels[shown.channel].name.clone();
    let shares: Vec<(String, Shares)> =
        cause.shown.iter().filter_map(|shown| Some((name(shown), Shares::new(shown, channels, profile)?))).collect();
    let share = |of: fn(&Shares) -> Option<f64>| {
        shares.iter().filter_map(|(name, shares)| Some((name.clone(), of(shares)?))).collect()
    };
    Finding {
        effect: cause.shown[clearest].effect.clone(),
        channels: cause.shown.iter().map(name).collect(),
        clearest,
        validated: validate(cause, half),
        share_percent: share(|shares| Some(shares.largest)),
        minute_percent: share(|shares| shares.after_minute),
    }
}

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
