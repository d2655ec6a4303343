//! A part of a recording, and the effects hidden in it.

use super::hidden_kind::HiddenKind;
use super::hide::{HiddenEffect, has_samples_read_again, no_environment};
use super::noise_estimate::NoiseEstimate;
use crate::undeclared::channel_under_test::ChannelUnderTest;
use crate::undeclared::detection_limit::required_ratio;
use crate::undeclared::draw::{draw_effects, knock_shares};
use crate::undeclared::effect::EffectKind;
use crate::undeclared::generator::{Sampling, TrueRecording};
use crate::undeclared::outside::{OutsideEffect, OutsideKind};
use crate::undeclared::outside_limit::with_strength;
use adis16405_driver::Channel;
use measurement::{MeasuredChannel, Measurement};
use noise_analysis::report::Report;
use rand::SeedableRng;
use rand::seq::IndexedRandom;
use rand_chacha::ChaCha8Rng;
use std::cmp::Reverse;
use std::collections::BTreeMap;
use virtual_sensor::{OutputRegister, SensorScenario};

/// Least acceptable fraction of the required strength.
const LEAST_STRENGTH: f64 = 0.95;
/// Largest factor on a size whose strength does not grow with it.
const LARGEST_SIZE: f64 = 10.0;
/// Number of draws for a channel with noise above a count.
const DRAWS: usize = 100;
/// Full scale for unknown ranges, in deviations of a sample.
const UNKNOWN_FULL_SCALE: f64 = 1000.0;
/// Random stream of the first kind of effect; `measured` and `hide` have others.
const DRAWN: u64 = 1;

pub(super) struct Stretch<'a> {
    pub(super) recording: &'a str,
    pub(super) seed: u64,
    pub(super) from_s: f64,
    pub(super) samples: Measurement,
    pub(super) noise: NoiseEstimate,
    pub(super) report: Report,
}

impl Stretch<'_> {
    /// An effect of `kind` at `strength`, with the strength obtained; `None` if no channel is suitable.
    pub(super) fn draw(&self, kind: HiddenKind, strength: f64) -> Option<(HiddenEffect, f64)> {
        // Each kind has its own random numbers, so a new kind changes no other.
        let of_kind = match kind {
            HiddenKind::Known(kind) => kind as u64,
            HiddenKind::Outside(kind) => EffectKind::ALL.len() as u64 + kind as u64,
        };
        let mut random = ChaCha8Rng::seed_from_u64(self.seed);
        random.set_stream(DRAWN + of_kind);
        let truth = self.described();
        let channel = |random: &mut ChaCha8Rng| self.noise.channels.choose(random).copied();
        let first = *self.noise.channels.first()?;
        match kind {
            // The true losses and repetitions of the stretch are unknown.
            HiddenKind::Known(EffectKind::DroppedSamples) if self.samples.periods() > self.samples.len() as u64 => None,
            HiddenKind::Known(EffectKind::RepeatedSamples) if has_samples_read_again(&self.samples) => None,
            HiddenKind::Known(kind) => {
                let of_channel = |random: &mut ChaCha8Rng| channel(random).unwrap_or(first);
                // The strength of drift beside a walk grows more slowly than its size.
                let ranges = [1.0, LARGEST_SIZE].map(|most| (strength, most * strength));
                let mut drawn = ranges.into_iter().map(|range| {
                    draw_effects(&[kind], range, LEAST_STRENGTH * strength, &truth, of_channel, &mut random)
                });
                let (effects, strengths, _) = drawn.find(|(.., is_as_asked)| *is_as_asked)?;
                let effect = effects.into_iter().next()?;
                let is_here = effect.channels().iter().all(|channel| self.noise.channels.contains(channel));
                is_here.then_some((HiddenEffect::Known(kind, effect), *strengths.first()?))
            }
            HiddenKind::Outside(kind) => {
                let record = (truth.seconds, truth.sampling.period_s());
                let place = |channel: OutputRegister| ChannelUnderTest::new(&truth, channel, &[]);
                let mut drawn = (0..DRAWS).filter_map(|_| {
                    let channel = channel(&mut random).filter(|&channel| !place(channel).is_below_a_count())?;
                    let unit = OutsideEffect::draw_unit(kind, channel, record, &mut random);
                    let counts = &self.measured(simulation::channel(channel))?.counts;
                    let are_seen = kind != OutsideKind::MissingCodes || are_seen_to_be_missing(counts, &unit, strength);
                    are_seen.then_some((channel, unit))
                });
                let (channel, mut unit) = drawn.next()?;
                drop(drawn);
                if kind == OutsideKind::Knock {
                    unit.shares = knock_shares(channel, &self.noise.model, &mut random);
                    unit.shares.retain(|(channel, _)| self.noise.channels.contains(channel));
                }
                let (effect, strength) = with_strength(unit, strength, &no_environment(), &place(channel));
                Some((HiddenEffect::Outside(effect), strength))
            }
        }
    }

    fn measured(&self, channel: Channel) -> Option<&MeasuredChannel> {
        self.samples.channels.iter().find(|of| of.profile.name == channel.name())
    }

    fn described(&self) -> TrueRecording {
        let size = |channel: Channel| self.measured(channel).map_or(1.0, |of| of.profile.lsb);
        let full_scale = |channel: Channel| {
            let measured = self.measured(channel);
            let white = self.noise.model.channel(simulation::output_register(channel)).angle_random_walk;
            let noise = white * self.samples.sample_rate_hz.sqrt();
            measured.and_then(|of| of.profile.range).unwrap_or(UNKNOWN_FULL_SCALE * noise)
        };
        TrueRecording {
            sampling: Sampling {
                rate_hz: self.samples.sample_rate_hz,
                resolutions: Channel::ALL.map(size),
                full_scales: Channel::ALL.map(full_scale),
                corners_hz: self.noise.corners_hz,
            },
            seconds: self.samples.periods() as f64 / self.samples.sample_rate_hz,
            seed: self.seed,
            noise: self.noise.model.clone(),
            scenario: SensorScenario::default(),
            outside: Vec::new(),
            host_clock_ratio: 1.0,
        }
    }
}

/// True if the second missing code of `counts` is significant at `strength`; its probability is exp(−n) for n expected
/// samples.
fn are_seen_to_be_missing(counts: &[i32], effect: &OutsideEffect, strength: f64) -> bool {
    let mut samples: BTreeMap<i32, u32> = BTreeMap::new();
    counts.iter().for_each(|&code| *samples.entry(code).or_insert(0) += 1);
    let missing = samples.iter().filter(|(code, _)| effect.is_missing(**code));
    let mut missing: Vec<u32> = missing.map(|(_, samples)| *samples).collect();
    missing.sort_unstable_by_key(|samples| Reverse(*samples));
    let required = strength * strength * required_ratio(samples.len() as f64);
    missing.get(1).is_some_and(|&samples| f64::from(samples) >= required)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every fourth of a hundred codes is missing. The second needs ½z² = 6.9 samples at strength 1, and nine times as
    /// many at 3.
    #[test]
    fn missing_codes_are_hidden_where_two_of_them_have_samples() {
        let mut random = ChaCha8Rng::seed_from_u64(1);
        let record = (120.0, 0.01);
        let unit = OutsideEffect::draw_unit(OutsideKind::MissingCodes, OutputRegister::GyroX, record, &mut random);
        let unit = OutsideEffect { frequencies_hz: [0.25, 0.0], ..unit };
        let of_each = |samples: i32| -> Vec<i32> { (0..100 * samples).map(|at| at % 100 - 50).collect() };
        for (samples, strength, expected) in [(6, 1.0, false), (7, 1.0, true), (62, 3.0, false), (63, 3.0, true)] {
            assert_eq!(are_seen_to_be_missing(&of_each(samples), &unit, strength), expected, "{samples}");
        }
        // Only one missing code is within the range.
        let few: Vec<i32> = (0..10_000).map(|at| at % 3 - 1).collect();
        assert!(!are_seen_to_be_missing(&few, &unit, 1.0));
    }
}
