//! Recordings with hidden effects, drawn from a seed. Noise, temperature, supply, clock and motion vary.

use super::channel_under_test::{ChannelUnderTest, RecordLength};
use super::detection_limit::{HOST_CLOCK_TOLERANCE, smallest_size, strength};
use super::effect::{EffectKind, GYROS, draw_unit, scaled, size};
use super::environment::log_uniform;
use super::generator::{Sampling, TrueRecording};
use super::outside::{OutsideEffect, OutsideKind};
use super::outside_limit::with_strength as outside_with_strength;
use rand::seq::{IndexedRandom, SliceRandom};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::Serialize;
use virtual_sensor::{Environment, InjectedEffect, NoiseModel, OutputRegister, SensorScenario};
use virtual_sensor::{Motion, SupplyProfile, TemperatureProfile};

const STRENGTH: (f64, f64) = (0.3, 30.0);
/// Strengths for pairs, triples and effects outside the vocabulary.
const STRENGTH_OF_PAIR: (f64, f64) = (2.0, 30.0);
/// Fraction of recordings with a motion that no effect needs.
const MOVED: f64 = 0.2;

/// Largest quantum over the angle increment's deviation by white noise; a coarser one has no white error.
const LARGEST_QUANTUM: f64 = 1.0;
const LARGEST_FRACTION: f64 = 0.02;
/// Largest sensitivities to temperature, supply and acceleration, in deg/s per degC, V and g: thirty times the data
/// sheet's.
const LARGEST_SENSITIVITIES: [f64; 3] = [0.3, 9.6, 1.5];
const LARGEST_CLOCK_ERROR: f64 = 0.01;
/// Largest size over full scale.
const LARGEST_PART: f64 = 0.1;
/// Number of draws after which a set with a weak effect is accepted.
const DRAWS: usize = 100;

#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum RecordingGroup {
    Nothing,
    Single(EffectKind),
    Pair,
    Triple,
    Outside(OutsideKind),
}

#[derive(Debug, Clone, PartialEq)]
pub struct DrawnRecording {
    /// Seed; with length and kinds it determines all other fields.
    pub seed: u64,
    /// Kinds of the effects, in the order of `simulation`.
    pub kinds: Vec<EffectKind>,
    /// Sizes of the effects over their detection limits.
    pub strengths: Vec<f64>,
    pub simulation: TrueRecording,
}

impl DrawnRecording {
    /// The recording of a group and a seed, `seconds` s long.
    pub fn from_group(group: RecordingGroup, seconds: f64, seed: u64) -> Self {
        match group {
            RecordingGroup::Nothing => Self::draw(&[], seconds, seed),
            RecordingGroup::Single(kind) => Self::draw(&[kind], seconds, seed),
            RecordingGroup::Pair => Self::draw(&Self::several::<2>(seed), seconds, seed),
            RecordingGroup::Triple => Self::draw(&Self::several::<3>(seed), seconds, seed),
            RecordingGroup::Outside(kind) => Self::draw_outside(kind, seconds, seed),
        }
    }

    /// A recording, `seconds` s long, with an effect outside the vocabulary of the analysis.
    pub fn draw_outside(kind: OutsideKind, seconds: f64, seed: u64) -> Self {
        let nothing = Self::draw(&[], seconds, seed);
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        random.set_stream(u64::MAX - 3);
        let mut simulation = nothing.simulation;
        // The motion of an accelerometer would hide any other effect.
        let gyros = &OutputRegister::INERTIAL[..3];
        let channel = gyros.choose(&mut random).copied().unwrap_or(OutputRegister::GyroX);
        let strength = log_uniform(&mut random, STRENGTH_OF_PAIR.0, STRENGTH_OF_PAIR.1);
        let mut unit = OutsideEffect::draw_unit(kind, channel, (seconds, simulation.sampling.period_s()), &mut random);
        if kind == OutsideKind::Knock {
            unit.shares = knock_shares(channel, &simulation.noise, &mut random);
        }
        let environment = simulation.environment(simulation.samples());
        let place = ChannelUnderTest::new(&simulation, channel, &[]);
        let (effect, strength) = outside_with_strength(unit, strength, &environment, &place);
        simulation.outside.push(effect);
        Self { simulation, strengths: vec![strength], ..nothing }
    }

    /// A recording, `seconds` s long, with effects of `kinds`.
    pub fn draw(kinds: &[EffectKind], seconds: f64, seed: u64) -> Self {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        random.set_stream(u64::MAX);
        let noise = noise(&mut random);
        let environment = environment(&mut random, kinds.contains(&EffectKind::Acceleration));
        let host_clock_ratio = 1.0 + random.random_range(-HOST_CLOCK_TOLERANCE..HOST_CLOCK_TOLERANCE);
        let scenario = SensorScenario { environment, effects: Vec::new() };
        let sampling = Sampling::adis16405();
        let outside = Vec::new();
        let mut simulation = TrueRecording { sampling, seconds, seed, noise, scenario, outside, host_clock_ratio };
        let channels = if environment.motion.deviation_g > 0.0 {
            &OutputRegister::INERTIAL[..3]
        } else {
            &OutputRegister::INERTIAL
        };
        let channel = |random: &mut ChaCha8Rng| channels.choose(random).copied().unwrap_or(OutputRegister::GyroX);
        let shared = random.random_bool(0.5).then(|| channel(&mut random));
        let channel = |random: &mut ChaCha8Rng| shared.unwrap_or_else(|| channel(random));
        let (range, at_least) = if kinds.len() > 1 { (STRENGTH_OF_PAIR, STRENGTH_OF_PAIR.0) } else { (STRENGTH, 0.0) };
        let (effects, strengths, _) = draw_effects(kinds, range, at_least, &simulation, channel, &mut random);
        simulation.scenario.effects = effects;
        Self { seed, kinds: kinds.to_vec(), strengths, simulation }
    }

    /// The kinds of the pair or triple of a seed, all different.
    pub fn several<const KINDS: usize>(seed: u64) -> [EffectKind; KINDS] {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        random.set_stream(u64::MAX - 1);
        let mut all = EffectKind::ALL;
        let (chosen, _) = all.partial_shuffle(&mut random, KINDS);
        std::array::from_fn(|at| chosen[at])
    }
}

/// The factors of a knock in all channels: 1 in `channel`, ±½ … 1 in the others, relative to the white noise.
pub(super) fn knock_shares(
    channel: OutputRegister,
    noise: &NoiseModel,
    random: &mut ChaCha8Rng,
) -> Vec<(OutputRegister, f64)> {
    let white = |of: OutputRegister| noise.channel(of).angle_random_walk;
    let mut share = |of: OutputRegister| {
        let factor = random.random_range(0.5..1.0) * if random.random_bool(0.5) { 1.0 } else { -1.0 };
        (of, if of == channel { 1.0 } else { factor * white(of) / white(channel) })
    };
    OutputRegister::INERTIAL.map(&mut share).to_vec()
}

/// Effects of `kinds` with strengths from `range`. They are drawn again if weaker than `at_least`, in noise below a
/// count, or larger than [`LARGEST_PART`] of full scale. The flag is true if the last draw fulfils this.
pub(super) fn draw_effects(
    kinds: &[EffectKind],
    range: (f64, f64),
    at_least: f64,
    recording: &TrueRecording,
    channel: impl Fn(&mut ChaCha8Rng) -> OutputRegister,
    random: &mut ChaCha8Rng,
) -> (Vec<InjectedEffect>, Vec<f64>, bool) {
    let mut drawn = (Vec::new(), Vec::new(), false);
    for _ in 0..DRAWS {
        let mut effects: Vec<InjectedEffect> = Vec::new();
        for &kind in kinds {
            let channel = channel(random);
            let strength = log_uniform(random, range.0, range.1);
            let unit = draw_unit(kind, channel, RecordLength::new(recording), random);
            let limit = smallest_size(&unit, recording, &effects);
            effects.push(with_strength(unit, strength, limit, recording));
        }
        let strengths: Vec<f64> = (0..effects.len()).map(|at| strength_beside(&effects, at, recording)).collect();
        let is_outside = effects.iter().any(|effect| {
            let full_scale =
                |channel: OutputRegister| recording.sampling.full_scales[simulation::channel(channel) as usize];
            let change = largest_change(effect, recording.seconds);
            effect.channels().iter().any(|&channel| {
                change > LARGEST_PART * full_scale(channel)
                    || ChannelUnderTest::new(recording, channel, &effects).is_below_a_count()
            })
        });
        let is_as_asked = !is_outside && strengths.iter().all(|strength| *strength >= at_least);
        drawn = (effects, strengths, is_as_asked);
        if is_as_asked {
            break;
        }
    }
    drawn
}

/// Largest change of the output in the channel's unit; 0 for sizes in other units.
fn largest_change(effect: &InjectedEffect, seconds: f64) -> f64 {
    match effect {
        InjectedEffect::RateRamp { .. } => size(effect) * seconds,
        InjectedEffect::Sinusoid { .. }
        | InjectedEffect::Resonance { .. }
        | InjectedEffect::Markov { .. }
        | InjectedEffect::Telegraph { .. }
        | InjectedEffect::CommonMode { .. }
        | InjectedEffect::Spikes { .. }
        | InjectedEffect::BiasStep { .. } => size(effect),
        _ => 0.0,
    }
}

fn strength_beside(effects: &[InjectedEffect], at: usize, recording: &TrueRecording) -> f64 {
    let others: Vec<InjectedEffect> =
        effects.iter().enumerate().filter(|(other, _)| *other != at).map(|(_, effect)| effect.clone()).collect();
    strength(&effects[at], recording, &others)
}

/// The effect with `strength` times `limit`, or with the largest size.
fn with_strength(unit: InjectedEffect, strength: f64, limit: f64, recording: &TrueRecording) -> InjectedEffect {
    // Significance grows with the root of the number of events, so that number grows with the square.
    let squared = strength * strength * limit;
    let size = match unit {
        InjectedEffect::Quantization { channel, .. } => {
            let place = ChannelUnderTest::new(recording, channel, &[]);
            let white = place.white_density() * place.record.mean(|frequency| place.noise_gains(frequency)[0]);
            let increment = (white * recording.sampling.period_s()).sqrt();
            (strength * limit).min(LARGEST_QUANTUM * increment / 12f64.sqrt())
        }
        InjectedEffect::DroppedSamples { .. } | InjectedEffect::RepeatedSamples { .. } => squared.min(LARGEST_FRACTION),
        InjectedEffect::SampleClock { .. } => squared.min(LARGEST_CLOCK_ERROR),
        InjectedEffect::Temperature { channel, .. } if GYROS.contains(&channel) => {
            (strength * limit).min(LARGEST_SENSITIVITIES[0])
        }
        InjectedEffect::Supply { channel, .. } if GYROS.contains(&channel) => {
            (strength * limit).min(LARGEST_SENSITIVITIES[1])
        }
        InjectedEffect::Acceleration { .. } => (strength * limit).min(LARGEST_SENSITIVITIES[2]),
        _ => strength * limit,
    };
    scaled(unit, size)
}

/// The noise of the paper, with a random factor of 0.5 … 2 per coefficient.
fn noise(random: &mut ChaCha8Rng) -> NoiseModel {
    let mut noise = NoiseModel::paper();
    for channel in OutputRegister::INERTIAL {
        let noise = noise.channel_mut(channel);
        noise.angle_random_walk *= log_uniform(random, 0.5, 2.0);
        noise.bias_instability *= log_uniform(random, 0.5, 2.0);
        noise.rate_random_walk *= log_uniform(random, 0.5, 2.0);
    }
    noise
}

/// A random environment; it has a motion if `moved`, which is true if an effect needs one.
fn environment(random: &mut ChaCha8Rng, moved: bool) -> Environment {
    let temperature = TemperatureProfile {
        rise_c: log_uniform(random, 2.0, 12.0),
        time_constant_s: log_uniform(random, 200.0, 1200.0),
        cycle_c: log_uniform(random, 0.3, 2.0),
        period_s: log_uniform(random, 400.0, 1500.0),
    };
    let supply = SupplyProfile {
        load_v: log_uniform(random, 0.02, 0.1),
        load_time_s: log_uniform(random, 10.0, 60.0),
        cycle_v: log_uniform(random, 0.01, 0.05),
        period_s: log_uniform(random, 200.0, 1500.0),
    };
    let moves = random.random_bool(MOVED) || moved;
    let motion = Motion {
        deviation_g: if moves { log_uniform(random, 0.03, 0.3) } else { 0.0 },
        time_constant_s: log_uniform(random, 1.0, 20.0),
    };
    Environment { temperature, supply, motion }
}
