//! A part of a recording, and the effects that are drawn for it.

use super::hidden_kind::HiddenKind;
use super::hide::{HiddenEffect, no_environment};
use crate::undeclared::channel_under_test::ChannelUnderTest;
use crate::undeclared::draw::{draw_effects, knock_shares};
use crate::undeclared::effect::EffectKind;
use crate::undeclared::generator::{Sampling, TrueRecording};
use crate::undeclared::outside::{OutsideEffect, OutsideKind};
use crate::undeclared::outside_limit::with_strength;
use adis16405_driver::Channel;
use measurement::Measurement;
use noise_analysis::report::Report;
use rand::SeedableRng;
use rand::seq::IndexedRandom;
use rand_chacha::ChaCha8Rng;
use virtual_sensor::{NoiseModel, OutputRegister, SensorScenario};

/// Part of the strength that is asked for which an effect must have.
const LEAST_STRENGTH: f64 = 0.95;
/// Largest size of an effect whose strength does not grow with it, over the one at the strength that is asked for.
const LARGEST_SIZE: f64 = 10.0;
/// Number of draws of a channel whose noise is not below a count.
const DRAWS: usize = 100;
/// Random stream of the first kind of effect; those of the stretches and of what is added are in `measured` and `hide`.
const DRAWN: u64 = 1;

/// A part of a recording, with its own report.
pub(super) struct Stretch<'a> {
    pub(super) recording: &'a str,
    /// Seed of everything that is drawn for it.
    pub(super) seed: u64,
    pub(super) from_s: f64,
    pub(super) samples: Measurement,
    /// Gyros and accelerometers that change.
    pub(super) channels: Vec<OutputRegister>,
    pub(super) noise: NoiseModel,
    pub(super) report: Report,
}

impl Stretch<'_> {
    /// An effect of `kind` at `strength` with its own strength; `None` where no channel of the stretch can have it.
    pub(super) fn draw(&self, kind: HiddenKind, strength: f64) -> Option<(HiddenEffect, f64)> {
        // Each kind has its own random numbers, so that one more kind changes none of the others.
        let of_kind = match kind {
            HiddenKind::Known(kind) => kind as u64,
            HiddenKind::Outside(kind) => EffectKind::ALL.len() as u64 + kind as u64,
        };
        let mut random = ChaCha8Rng::seed_from_u64(self.seed);
        random.set_stream(DRAWN + of_kind);
        let truth = self.described();
        let channel = |random: &mut ChaCha8Rng| self.channels.choose(random).copied();
        let first = *self.channels.first()?;
        match kind {
            HiddenKind::Known(kind) => {
                let of_channel = |random: &mut ChaCha8Rng| channel(random).unwrap_or(first);
                // The strength of a slow drift beside a walk grows more slowly than its size.
                let ranges = [1.0, LARGEST_SIZE].map(|most| (strength, most * strength));
                let mut drawn = ranges.into_iter().map(|range| {
                    draw_effects(&[kind], range, LEAST_STRENGTH * strength, &truth, of_channel, &mut random)
                });
                let (effects, strengths, _) = drawn.find(|(.., is_as_asked)| *is_as_asked)?;
                let effect = effects.into_iter().next()?;
                let is_here = effect.channels().iter().all(|channel| self.channels.contains(channel));
                is_here.then_some((HiddenEffect::Known(kind, effect), *strengths.first()?))
            }
            HiddenKind::Outside(kind) => {
                let place = |channel: OutputRegister| ChannelUnderTest::new(&truth, channel, &[]);
                let mut drawn = (0..DRAWS).filter_map(|_| channel(&mut random));
                let channel = drawn.find(|&channel| !place(channel).is_below_a_count())?;
                let mut unit = OutsideEffect::draw_unit(kind, channel, truth.seconds, &mut random);
                if kind == OutsideKind::Knock {
                    unit.shares = knock_shares(channel, &self.noise, &mut random);
                    unit.shares.retain(|(channel, _)| self.channels.contains(channel));
                }
                let (effect, strength) = with_strength(unit, strength, &no_environment(), &place(channel));
                Some((HiddenEffect::Outside(effect), strength))
            }
        }
    }

    /// The stretch as the detection limit knows it: noise of N, B and K.
    fn described(&self) -> TrueRecording {
        let size = |channel: Channel| {
            let measured = self.samples.channels.iter().find(|of| of.profile.name == channel.name());
            measured.map_or(1.0, |of| of.profile.lsb)
        };
        TrueRecording {
            sampling: Sampling { rate_hz: self.samples.sample_rate_hz, resolutions: Channel::ALL.map(size) },
            seconds: self.samples.periods() as f64 / self.samples.sample_rate_hz,
            seed: self.seed,
            noise: self.noise.clone(),
            scenario: SensorScenario::default(),
            outside: Vec::new(),
            host_clock_ratio: 1.0,
        }
    }
}
