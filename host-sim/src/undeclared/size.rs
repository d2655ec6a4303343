//! An effect of a given strength: its shape at random, its size from the limit of that shape.

use super::draw::log_uniform;
use super::kind::Kind;
use super::limit::spectrum::{self, Record};
use super::limit::{events, needed, size, telegraph_from_markov, waveform};
use crate::sensor::effect::EffectSource;
use crate::sensor::{ChannelNoise, Effect, Hidden, NoiseModel, Surroundings};
use crate::trace::block::BLOCKS;
use crate::trace::sample_clock::HOST_CLOCK;
use adis16405_driver::{Channel, GyroRange};
use rand::Rng;
use rand_chacha::ChaCha8Rng;
use std::f64::consts::PI;

/// Octaves of time constants that can be told apart in half an hour.
const TIME_CONSTANTS: f64 = 12.0;
/// Independent times of a step.
const TIMES: f64 = 40.0;
/// Axes along which a force may act.
const AXES: f64 = 3.0;
const GYROS: [Channel; 3] = [Channel::GyroX, Channel::GyroY, Channel::GyroZ];
/// Largest quantum of an angle, in white angle steps of a sample: with coarser ones the error is not white. In an
/// accelerometer, whose noise is about a count, it would not be either.
const COARSEST: f64 = 1.0;
/// Largest part of the samples that is lost or repeated.
const MOST: f64 = 0.02;
/// Farthest that a clock is off.
const FARTHEST: f64 = 0.01;

/// What an effect is hidden in.
pub(super) struct Scene<'a> {
    pub(super) noise: &'a NoiseModel,
    pub(super) surroundings: Surroundings,
    pub(super) record: Record,
    pub(super) seed: u64,
}

/// An effect of about `strength` times the limit, and its exact strength: some kinds cannot be made as weak or as
/// strong as asked.
pub(super) fn hide(
    kind: Kind,
    channel: Channel,
    strength: f64,
    scene: &Scene<'_>,
    random: &mut ChaCha8Rng,
) -> (Effect, f64) {
    let of_gyros = matches!(kind, Kind::Quantization | Kind::Acceleration);
    let channel = if of_gyros && !GYROS.contains(&channel) { GYROS[random.random_range(0..3)] } else { channel };
    let place = Place { channel, noise: scene.noise.channel(channel), record: scene.record };
    match kind {
        Kind::Sinusoid | Kind::Resonance | Kind::Quantization | Kind::FilterBandwidth => {
            spectral(kind, strength, &place, random)
        }
        Kind::Markov | Kind::Telegraph | Kind::CommonMode => slow(kind, strength, &place, scene, random),
        Kind::RateRamp | Kind::BiasStep | Kind::Temperature | Kind::Supply => {
            shifting(kind, strength, &place, scene, random)
        }
        Kind::Acceleration => acceleration(strength, &place, scene, random),
        Kind::Spikes | Kind::DroppedSamples | Kind::RepeatedSamples | Kind::SampleClock => {
            occasional(kind, strength, &place, scene, random)
        }
    }
}

struct Place<'a> {
    channel: Channel,
    noise: &'a ChannelNoise,
    record: Record,
}

impl Place<'_> {
    fn resolution(&self) -> f64 {
        self.channel.lsb(GyroRange::Dps300)
    }

    /// Density of what is declared.
    fn declared(&self, frequency: f64) -> f64 {
        spectrum::declared(self.noise, self.resolution(), self.record.period_s, frequency)
    }

    /// The deviation at which a process of density `shape`, for a deviation of 1, is at the limit.
    fn deviation(&self, places: f64, peak: Option<(f64, f64)>, shape: impl Fn(f64) -> f64) -> f64 {
        // In units of the white noise of a sample, so that the search begins near.
        let white = self.noise.angle_random_walk / self.record.period_s.sqrt();
        let ratio = |relative: f64| {
            let square = (relative * white).powi(2);
            let truth = |frequency: f64| self.declared(frequency) + square * shape(frequency);
            self.record.against_declared(self.noise, self.resolution(), peak, truth)
        };
        white * size(needed(places), ratio)
    }
}

fn spectral(kind: Kind, strength: f64, place: &Place<'_>, random: &mut ChaCha8Rng) -> (Effect, f64) {
    let Place { channel, record, .. } = *place;
    let period_s = record.period_s;
    match kind {
        Kind::Sinusoid => {
            let frequency_hz = log_uniform(random, 0.1, 0.45 / period_s);
            let looks = 0.5 * record.seconds / period_s;
            let limit = (needed(looks) / record.line(place.declared(frequency_hz))).sqrt();
            let phase_rad = random.random_range(-PI..PI);
            (Effect::Sinusoid { channel, frequency_hz, amplitude: strength * limit, phase_rad }, strength)
        }
        Kind::Resonance => {
            let frequency_hz = log_uniform(random, 1.0, 0.4 / period_s);
            let bandwidth_hz = frequency_hz * log_uniform(random, 0.02, 0.2);
            let shape = |frequency: f64| spectrum::resonance(frequency_hz, bandwidth_hz, period_s, frequency);
            let looks = 0.5 / period_s / bandwidth_hz;
            let limit = place.deviation(looks, Some((frequency_hz, bandwidth_hz)), shape);
            (Effect::Resonance { channel, frequency_hz, bandwidth_hz, deviation: strength * limit }, strength)
        }
        Kind::Quantization => {
            let limit = place.deviation(1.0, None, |frequency| spectrum::quantization(period_s, frequency));
            let white = place.noise.angle_random_walk * period_s.sqrt();
            let coefficient = (strength * limit).min(COARSEST * white / 12f64.sqrt());
            (Effect::Quantization { channel, coefficient }, coefficient / limit)
        }
        _ => {
            let taps_log2 = random.random_range(1..=6);
            let truth = |frequency: f64| {
                let rounding = place.resolution().powi(2) / 12.0 * period_s;
                let sensed = place.declared(frequency) - rounding;
                sensed * spectrum::filter(taps_log2, period_s, frequency) + rounding
            };
            let ratio = record.against_declared(place.noise, place.resolution(), None, truth);
            (Effect::FilterBandwidth { taps_log2 }, (ratio / needed(1.0)).sqrt())
        }
    }
}

fn slow(kind: Kind, strength: f64, place: &Place<'_>, scene: &Scene<'_>, random: &mut ChaCha8Rng) -> (Effect, f64) {
    let Place { channel, record, .. } = *place;
    let shape =
        |time_constant_s: f64| move |frequency: f64| spectrum::markov(time_constant_s, record.period_s, frequency);
    match kind {
        Kind::Markov => {
            let time_constant_s = log_uniform(random, 0.05, 60.0);
            let limit = place.deviation(TIME_CONSTANTS, None, shape(time_constant_s));
            (Effect::Markov { channel, time_constant_s, deviation: strength * limit }, strength)
        }
        Kind::Telegraph => {
            let time_constant_s = log_uniform(random, 0.05, 20.0);
            let any = 2.0 * place.deviation(TIME_CONSTANTS, None, shape(time_constant_s));
            let density = place.declared(0.5 / (PI * time_constant_s));
            let from_markov = |amplitude: f64| {
                let seconds = record.seconds;
                telegraph_from_markov(amplitude, time_constant_s, density, record.period_s, seconds, scene.seed)
            };
            let unit = (density / time_constant_s).sqrt();
            let limit = any.max(unit * size(needed(1.0), |relative| from_markov(relative * unit)));
            (Effect::Telegraph { channel, time_constant_s, amplitude: strength * limit }, strength)
        }
        _ => {
            let time_constant_s = log_uniform(random, 10.0, 100.0);
            let shape = shape(time_constant_s);
            let resolution = Channel::GyroX.lsb(GyroRange::Dps300);
            let alone = GYROS.map(|gyro| {
                let noise = *scene.noise.channel(gyro);
                move |frequency: f64| spectrum::declared(&noise, resolution, record.period_s, frequency)
            });
            let alone: [&dyn Fn(f64) -> f64; 3] = [&alone[0], &alone[1], &alone[2]];
            let coherent =
                |deviation: f64| record.coherent(|frequency| deviation * deviation * shape(frequency), &alone);
            let limit = size(needed(TIME_CONSTANTS), coherent);
            let channels = GYROS.to_vec();
            (Effect::CommonMode { channels, time_constant_s, deviation: strength * limit }, strength)
        }
    }
}

fn shifting(kind: Kind, strength: f64, place: &Place<'_>, scene: &Scene<'_>, random: &mut ChaCha8Rng) -> (Effect, f64) {
    let Place { channel, record, .. } = *place;
    let block_s = record.seconds / BLOCKS as f64;
    let limit = |places: f64, values: &[f64]| {
        (needed(places) / waveform::ratio(values, place.noise, place.resolution(), record)).sqrt()
    };
    let sign = if random.random_bool(0.5) { strength } else { -strength };
    let effect = match kind {
        Kind::RateRamp => {
            let ramp: Vec<f64> = (0..BLOCKS).map(|block| block as f64 * block_s).collect();
            Effect::RateRamp { channel, slope: sign * limit(1.0, &ramp) }
        }
        Kind::BiasStep => {
            let time_s = record.seconds * random.random_range(0.15..0.85);
            let step: Vec<f64> =
                (0..BLOCKS).map(|block| (1.0 - (time_s / block_s - block as f64)).clamp(0.0, 1.0)).collect();
            Effect::BiasStep { channel, time_s, size: sign * limit(TIMES, &step) }
        }
        Kind::Temperature => {
            let course = course(scene, Channel::Temp);
            Effect::Temperature { channel, sensitivity: sign * limit(1.0, &course) }
        }
        _ => {
            let course = course(scene, Channel::Supply);
            Effect::Supply { channel, sensitivity: sign * limit(1.0, &course) }
        }
    };
    (effect, strength)
}

/// What the surroundings do to `channel`, as means of blocks.
fn course(scene: &Scene<'_>, channel: Channel) -> Vec<f64> {
    let Record { seconds, period_s } = scene.record;
    let mut source = EffectSource::new(&Hidden { surroundings: scene.surroundings, effects: Vec::new() }, scene.seed);
    let width = (seconds / period_s / BLOCKS as f64) as usize;
    (0..BLOCKS)
        .map(|block| {
            let value = |at: usize| {
                let mut values = [0.0; 12];
                source.disturb(&mut values, (block * width + at) as f64 * period_s, period_s);
                values[channel as usize]
            };
            (0..width).map(value).sum::<f64>() / width as f64
        })
        .collect()
}

/// To a force in a random direction.
fn acceleration(strength: f64, place: &Place<'_>, scene: &Scene<'_>, random: &mut ChaCha8Rng) -> (Effect, f64) {
    let channel = place.channel;
    let motion = scene.surroundings.motion;
    let force = |frequency: f64| {
        motion.deviation_g.powi(2) * spectrum::markov(motion.time_constant_s, scene.record.period_s, frequency)
    };
    let ratio = scene.record.matched(force, |frequency| place.declared(frequency));
    let sensitivity = strength * (needed(AXES) / ratio).sqrt();
    let direction = [0; 3].map(|_| random.random_range(-1.0..1.0f64));
    let length = direction.iter().map(|part| part * part).sum::<f64>().sqrt().max(1e-3);
    (Effect::Acceleration { channel, sensitivity: direction.map(|part| sensitivity * part / length) }, strength)
}

fn occasional(
    kind: Kind,
    strength: f64,
    place: &Place<'_>,
    scene: &Scene<'_>,
    random: &mut ChaCha8Rng,
) -> (Effect, f64) {
    let Place { channel, record, .. } = *place;
    let samples = record.seconds / record.period_s;
    match kind {
        Kind::Spikes => {
            let rate_per_hour = log_uniform(random, 10.0, 2000.0);
            let probability = rate_per_hour * record.period_s / 3600.0;
            let limit = size(needed(1.0), |size| events::spikes(samples, probability, size));
            let white = place.noise.angle_random_walk.powi(2) / record.period_s + place.resolution().powi(2) / 12.0;
            (Effect::Spikes { channel, rate_per_hour, size: strength * limit * white.sqrt() }, strength)
        }
        Kind::DroppedSamples => {
            let limit = events::count(0.0);
            let fraction = (strength * strength * limit / samples).min(MOST);
            (Effect::DroppedSamples { fraction }, fraction * samples / limit)
        }
        Kind::RepeatedSamples => {
            let limit = events::count(samples * equal_by_chance(scene));
            let fraction = (strength * strength * limit / samples).min(MOST);
            (Effect::RepeatedSamples { fraction }, fraction * samples / limit)
        }
        _ => {
            let limit = size(needed(1.0), |off| events::clock(off * HOST_CLOCK)) * HOST_CLOCK;
            let off = (strength * strength * limit).min(FARTHEST);
            let sign = if random.random_bool(0.5) { 1.0 } else { -1.0 };
            (Effect::SampleClock { ratio: 1.0 + sign * off }, off / limit)
        }
    }
}

/// Probability that the six inertial channels equal the sample before: that of rounded white noise is `q/(2√π·σ)`.
fn equal_by_chance(scene: &Scene<'_>) -> f64 {
    let equal = |channel: &Channel| {
        let white = scene.noise.channel(*channel).angle_random_walk / scene.record.period_s.sqrt();
        (channel.lsb(GyroRange::Dps300) / (2.0 * PI.sqrt() * white)).min(1.0)
    };
    Channel::INERTIAL.iter().map(equal).product()
}
