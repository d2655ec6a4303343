//! Effects hidden in measured noise: each is added to a stretch of a recording, and the report of the stretch with the effect is
//! scored against that of the same stretch untouched.
//!
//! ```text
//! recording ─► stretch ─┬───────────────────────────► analysis ─► report of the noise ──────────────┐
//!                       ├─► N, B, K ─► size ─► effect ─┐                                            ├─► score ─► table
//!                       └──────────────────────────────┴► counts ─► analysis ─► report ─────────────┘
//! ```
//!
//! What is in the noise itself is not known. So an effect is named if a finding of its kind is there that the untouched stretch does
//! not have, and a wrong name is one that the untouched stretch does not have. An effect that needs a quantity beside the noise
//! (temperature, supply, acceleration, a clock) or that would change the noise itself (another filter) is not hidden.

mod hide;
mod noise_estimate;
mod recording;
mod score;
mod table;

pub use recording::{MeasuredNoiseError, NoiseRecording};
pub use score::{MeasuredErrors, MeasuredScore};
pub use table::MeasuredNoiseTable;

use super::draw::{draw_effects, knock_shares};
use super::effect::EffectKind;
use super::environment::EnvironmentCourse;
use super::generator::{Sampling, TrueRecording};
use super::outside::{OutsideEffect, OutsideKind};
use super::outside_limit::with_strength;
use crate::parallel;
use crate::undeclared::channel_under_test::ChannelUnderTest;
use adis16405_driver::Channel;
use hide::HiddenEffect;
use measurement::Measurement;
use noise_analysis::analysis::analyze;
use noise_analysis::report::Report;
use rand::seq::IndexedRandom;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::Serialize;
use std::convert::Infallible;
use virtual_sensor::{NoiseModel, OutputRegister, SensorScenario};

/// Part of the strength that is asked for which an effect must have.
const LEAST_STRENGTH: f64 = 0.95;
/// Largest size of an effect whose strength does not grow with it, over the one at the strength that is asked for.
const LARGEST_SIZE: f64 = 10.0;
/// Number of draws of a channel whose noise is not below a count.
const DRAWS: usize = 100;
/// Random stream of the stretches; those of the effects are in `hide`.
const STRETCHES: u64 = u64::MAX;
const DRAWN: u64 = 1;

/// A kind of effect that is hidden in measured noise.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum HiddenKind {
    /// One that the report has a name for.
    Known(EffectKind),
    /// One that the analysis was not made for.
    Outside(OutsideKind),
}

impl HiddenKind {
    /// Every kind that can be added to samples that were measured, in the order of the table.
    pub const ALL: [Self; 24] = [
        Self::Known(EffectKind::Sinusoid),
        Self::Known(EffectKind::Resonance),
        Self::Known(EffectKind::Markov),
        Self::Known(EffectKind::Telegraph),
        Self::Known(EffectKind::Quantization),
        Self::Known(EffectKind::RateRamp),
        Self::Known(EffectKind::CommonMode),
        Self::Known(EffectKind::Spikes),
        Self::Known(EffectKind::BiasStep),
        Self::Known(EffectKind::DroppedSamples),
        Self::Known(EffectKind::RepeatedSamples),
        Self::Outside(OutsideKind::Chirp),
        Self::Outside(OutsideKind::Decays),
        Self::Outside(OutsideKind::Sawtooth),
        Self::Outside(OutsideKind::ModulatedLine),
        Self::Outside(OutsideKind::HeldValue),
        Self::Outside(OutsideKind::AlternatingConverters),
        Self::Outside(OutsideKind::SelfHeating),
        Self::Outside(OutsideKind::DeadTime),
        Self::Outside(OutsideKind::SupplyDroop),
        Self::Outside(OutsideKind::SwitchedLine),
        Self::Outside(OutsideKind::MissingCodes),
        Self::Outside(OutsideKind::WanderingBand),
        Self::Outside(OutsideKind::Knock),
    ];

    /// Its name in the tables.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Known(kind) => kind.name(),
            Self::Outside(kind) => kind.name(),
        }
    }
}

/// Which effects to hide in which recordings.
#[derive(Debug, Clone, PartialEq)]
pub struct MeasuredNoisePlan {
    /// Recordings of sensors at rest, used in turn.
    pub recordings: Vec<NoiseRecording>,
    /// Number of stretches, in each of which every kind is hidden alone.
    pub stretches: u64,
    /// Length of a stretch, s; a shorter recording is one stretch.
    pub seconds: f64,
    /// Size of every effect over the detection limit for the N, B and K of its channel in the stretch.
    pub strength: f64,
    /// Seed of the first stretch.
    pub seed: u64,
    /// Number of threads.
    pub jobs: usize,
}

/// A part of a recording, with its own report.
struct Stretch<'a> {
    recording: &'a str,
    /// Seed of everything that is drawn for it.
    seed: u64,
    from_s: f64,
    samples: Measurement,
    /// Gyros and accelerometers that change.
    channels: Vec<OutputRegister>,
    noise: NoiseModel,
    report: Report,
}

impl MeasuredNoisePlan {
    /// Hides and scores every effect. `progress` is called with the number of finished analyses and of all.
    #[must_use]
    pub fn run(&self, progress: impl Fn(usize, usize) + Sync) -> MeasuredNoiseTable {
        if self.recordings.is_empty() {
            return MeasuredNoiseTable::default();
        }
        let numbers: Vec<u64> = (0..self.stretches).collect();
        let all = numbers.len() * (1 + HiddenKind::ALL.len());
        let Ok(stretches) = parallel::map(
            &numbers,
            self.jobs,
            |&number| Ok::<_, Infallible>(self.stretch(number)),
            |done, _| progress(done, all),
        );
        let cases: Vec<(&Stretch<'_>, HiddenKind)> =
            stretches.iter().flat_map(|stretch| HiddenKind::ALL.map(|kind| (stretch, kind))).collect();
        let work = |&(stretch, kind): &(&Stretch<'_>, HiddenKind)| {
            let drawn = stretch.draw(kind, self.strength);
            Ok::<_, Infallible>(drawn.map(|(effect, strength)| score::hidden(stretch, kind, &effect, strength)))
        };
        let Ok(scores) = parallel::map(&cases, self.jobs, work, |done, _| progress(numbers.len() + done, all));
        let not_hidden = cases.iter().zip(&scores).filter(|(_, score)| score.is_none()).map(|((_, kind), _)| *kind);
        MeasuredNoiseTable { not_hidden: not_hidden.collect(), scores: scores.into_iter().flatten().collect() }
    }

    fn stretch(&self, number: u64) -> Stretch<'_> {
        let seed = self.seed + number;
        let recording = &self.recordings[(number % self.recordings.len() as u64) as usize];
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        random.set_stream(STRETCHES);
        let whole = &recording.samples;
        let length = ((self.seconds * whole.sample_rate_hz).round() as u64).clamp(1, whole.periods());
        let from = random.random_range(0..=whole.periods() - length);
        let samples = recording::part(whole, from..from + length);
        let (noise, channels) = noise_estimate::noise_model(&samples);
        let report = analyze(&samples);
        let from_s = from as f64 / whole.sample_rate_hz;
        Stretch { recording: &recording.name, seed, from_s, samples, channels, noise, report }
    }
}

impl Stretch<'_> {
    /// An effect of `kind` at `strength` with its own strength; `None` where no channel of the stretch can have it.
    fn draw(&self, kind: HiddenKind, strength: f64) -> Option<(HiddenEffect, f64)> {
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

/// The courses over time that a recording of noise does not tell.
fn no_environment() -> EnvironmentCourse {
    EnvironmentCourse { temperature_c: Vec::new(), supply_v: Vec::new(), force_g: [const { Vec::new() }; 3] }
}

#[cfg(test)]
mod tests;
