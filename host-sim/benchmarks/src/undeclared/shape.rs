//! The shape of an effect, drawn at random, and its size.

use super::draw::log_uniform;
use super::kind::Kind;
use super::place::Scene;
use rand::Rng;
use rand_chacha::ChaCha8Rng;
use std::f64::consts::PI;
use virtual_sensor::{Effect, OutputRegister};

pub(super) const GYROS: [OutputRegister; 3] = [OutputRegister::GyroX, OutputRegister::GyroY, OutputRegister::GyroZ];

/// An effect of size 1.
pub(super) fn draw(kind: Kind, channel: OutputRegister, scene: &Scene<'_>, random: &mut ChaCha8Rng) -> Effect {
    // An accelerometer's noise is about a count: the error of a coarser quantum would not be white.
    let of_gyros = matches!(kind, Kind::Quantization | Kind::Acceleration);
    let channel = if of_gyros && !GYROS.contains(&channel) { GYROS[random.random_range(0..3)] } else { channel };
    let nyquist = 0.5 / scene.record.period_s;
    let sign = |random: &mut ChaCha8Rng| if random.random_bool(0.5) { 1.0 } else { -1.0 };
    match kind {
        Kind::Sinusoid => {
            let frequency_hz = log_uniform(random, 0.1, 0.9 * nyquist);
            Effect::Sinusoid { channel, frequency_hz, amplitude: 1.0, phase_rad: random.random_range(-PI..PI) }
        }
        Kind::Resonance => {
            let frequency_hz = log_uniform(random, 1.0, 0.8 * nyquist);
            let bandwidth_hz = frequency_hz * log_uniform(random, 0.02, 0.2);
            Effect::Resonance { channel, frequency_hz, bandwidth_hz, deviation: 1.0 }
        }
        Kind::Markov => Effect::Markov { channel, time_constant_s: log_uniform(random, 0.05, 60.0), deviation: 1.0 },
        Kind::Telegraph => {
            Effect::Telegraph { channel, time_constant_s: log_uniform(random, 0.05, 20.0), amplitude: 1.0 }
        }
        Kind::CommonMode => {
            let channels = GYROS.to_vec();
            Effect::CommonMode { channels, time_constant_s: log_uniform(random, 10.0, 100.0), deviation: 1.0 }
        }
        Kind::Quantization => Effect::Quantization { channel, coefficient: 1.0 },
        Kind::FilterBandwidth => Effect::FilterBandwidth { taps_log2: random.random_range(1..=6) },
        Kind::RateRamp => Effect::RateRamp { channel, slope: sign(random) },
        Kind::BiasStep => {
            let size = sign(random);
            Effect::BiasStep { channel, time_s: scene.record.seconds * random.random_range(0.15..0.85), size }
        }
        Kind::Temperature => Effect::Temperature { channel, sensitivity: sign(random) },
        Kind::Supply => Effect::Supply { channel, sensitivity: sign(random) },
        Kind::Acceleration => {
            let direction = [0; 3].map(|_| random.random_range(-1.0..1.0f64));
            let length = direction.iter().map(|part| part * part).sum::<f64>().sqrt().max(1e-3);
            Effect::Acceleration { channel, sensitivity: direction.map(|part| part / length) }
        }
        Kind::Spikes => Effect::Spikes { channel, rate_per_hour: log_uniform(random, 10.0, 2000.0), size: 1.0 },
        Kind::DroppedSamples => Effect::DroppedSamples { fraction: 1.0 },
        Kind::RepeatedSamples => Effect::RepeatedSamples { fraction: 1.0 },
        Kind::SampleClock => Effect::SampleClock { ratio: 1.0 + sign(random) },
    }
}

/// What is 1 in a shape, whatever its sign.
pub(super) fn size(effect: &Effect) -> f64 {
    match *effect {
        Effect::Sinusoid { amplitude, .. } | Effect::Telegraph { amplitude, .. } => amplitude,
        Effect::Resonance { deviation, .. }
        | Effect::Markov { deviation, .. }
        | Effect::CommonMode { deviation, .. } => deviation,
        Effect::Quantization { coefficient, .. } => coefficient,
        Effect::RateRamp { slope, .. } => slope.abs(),
        Effect::FilterBandwidth { .. } => 1.0,
        Effect::Temperature { sensitivity, .. } | Effect::Supply { sensitivity, .. } => sensitivity.abs(),
        Effect::Acceleration { sensitivity, .. } => sensitivity.iter().map(|part| part * part).sum::<f64>().sqrt(),
        Effect::Spikes { size, .. } | Effect::BiasStep { size, .. } => size.abs(),
        Effect::DroppedSamples { fraction } | Effect::RepeatedSamples { fraction } => fraction,
        Effect::SampleClock { ratio } => (ratio - 1.0).abs(),
    }
}

/// `factor` times the size; a filter has none.
pub(super) fn scaled(mut effect: Effect, factor: f64) -> Effect {
    match &mut effect {
        Effect::Sinusoid { amplitude: size, .. }
        | Effect::Telegraph { amplitude: size, .. }
        | Effect::Resonance { deviation: size, .. }
        | Effect::Markov { deviation: size, .. }
        | Effect::CommonMode { deviation: size, .. }
        | Effect::Quantization { coefficient: size, .. }
        | Effect::RateRamp { slope: size, .. }
        | Effect::Temperature { sensitivity: size, .. }
        | Effect::Supply { sensitivity: size, .. }
        | Effect::Spikes { size, .. }
        | Effect::BiasStep { size, .. }
        | Effect::DroppedSamples { fraction: size }
        | Effect::RepeatedSamples { fraction: size } => *size *= factor,
        Effect::Acceleration { sensitivity, .. } => sensitivity.iter_mut().for_each(|part| *part *= factor),
        Effect::SampleClock { ratio } => *ratio = 1.0 + (*ratio - 1.0) * factor,
        Effect::FilterBandwidth { .. } => {}
    }
    effect
}
