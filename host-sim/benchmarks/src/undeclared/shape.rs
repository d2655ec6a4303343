//! The shape of an effect, drawn at random, and its size.

use super::draw::log_uniform;
use super::kind::Kind;
use super::place::Scene;
use rand::Rng;
use rand_chacha::ChaCha8Rng;
use std::f64::consts::PI;
use virtual_sensor::{InjectedEffect, OutputRegister};

pub(super) const GYROS: [OutputRegister; 3] = [OutputRegister::GyroX, OutputRegister::GyroY, OutputRegister::GyroZ];

/// An effect of size 1.
pub(super) fn draw(kind: Kind, channel: OutputRegister, scene: &Scene<'_>, random: &mut ChaCha8Rng) -> InjectedEffect {
    // An accelerometer's noise is about a count: the error of a coarser quantum would not be white.
    let of_gyros = matches!(kind, Kind::Quantization | Kind::Acceleration);
    let channel = if of_gyros && !GYROS.contains(&channel) { GYROS[random.random_range(0..3)] } else { channel };
    let nyquist = 0.5 / scene.record.period_s;
    let sign = |random: &mut ChaCha8Rng| if random.random_bool(0.5) { 1.0 } else { -1.0 };
    match kind {
        Kind::Sinusoid => {
            let frequency_hz = log_uniform(random, 0.1, 0.9 * nyquist);
            InjectedEffect::Sinusoid { channel, frequency_hz, amplitude: 1.0, phase_rad: random.random_range(-PI..PI) }
        }
        Kind::Resonance => {
            let frequency_hz = log_uniform(random, 1.0, 0.8 * nyquist);
            let bandwidth_hz = frequency_hz * log_uniform(random, 0.02, 0.2);
            InjectedEffect::Resonance { channel, frequency_hz, bandwidth_hz, deviation: 1.0 }
        }
        Kind::Markov => {
            InjectedEffect::Markov { channel, time_constant_s: log_uniform(random, 0.05, 60.0), deviation: 1.0 }
        }
        Kind::Telegraph => {
            InjectedEffect::Telegraph { channel, time_constant_s: log_uniform(random, 0.05, 20.0), amplitude: 1.0 }
        }
        Kind::CommonMode => {
            let channels = GYROS.to_vec();
            InjectedEffect::CommonMode { channels, time_constant_s: log_uniform(random, 10.0, 100.0), deviation: 1.0 }
        }
        Kind::Quantization => InjectedEffect::Quantization { channel, coefficient: 1.0 },
        Kind::FilterBandwidth => InjectedEffect::FilterBandwidth { taps_log2: random.random_range(1..=6) },
        Kind::RateRamp => InjectedEffect::RateRamp { channel, slope: sign(random) },
        Kind::BiasStep => {
            let size = sign(random);
            InjectedEffect::BiasStep { channel, time_s: scene.record.seconds * random.random_range(0.15..0.85), size }
        }
        Kind::Temperature => InjectedEffect::Temperature { channel, sensitivity: sign(random) },
        Kind::Supply => InjectedEffect::Supply { channel, sensitivity: sign(random) },
        Kind::Acceleration => {
            let direction = [0; 3].map(|_| random.random_range(-1.0..1.0f64));
            let length = direction.iter().map(|part| part * part).sum::<f64>().sqrt().max(1e-3);
            InjectedEffect::Acceleration { channel, sensitivity: direction.map(|part| part / length) }
        }
        Kind::Spikes => InjectedEffect::Spikes { channel, rate_per_hour: log_uniform(random, 10.0, 2000.0), size: 1.0 },
        Kind::DroppedSamples => InjectedEffect::DroppedSamples { fraction: 1.0 },
        Kind::RepeatedSamples => InjectedEffect::RepeatedSamples { fraction: 1.0 },
        Kind::SampleClock => InjectedEffect::SampleClock { ratio: 1.0 + sign(random) },
    }
}

/// What is 1 in a shape, whatever its sign.
pub(super) fn size(effect: &InjectedEffect) -> f64 {
    match *effect {
        InjectedEffect::Sinusoid { amplitude, .. } | InjectedEffect::Telegraph { amplitude, .. } => amplitude,
        InjectedEffect::Resonance { deviation, .. }
        | InjectedEffect::Markov { deviation, .. }
        | InjectedEffect::CommonMode { deviation, .. } => deviation,
        InjectedEffect::Quantization { coefficient, .. } => coefficient,
        InjectedEffect::RateRamp { slope, .. } => slope.abs(),
        InjectedEffect::FilterBandwidth { .. } => 1.0,
        InjectedEffect::Temperature { sensitivity, .. } | InjectedEffect::Supply { sensitivity, .. } => {
            sensitivity.abs()
        }
        InjectedEffect::Acceleration { sensitivity, .. } => {
            sensitivity.iter().map(|part| part * part).sum::<f64>().sqrt()
        }
        InjectedEffect::Spikes { size, .. } | InjectedEffect::BiasStep { size, .. } => size.abs(),
        InjectedEffect::DroppedSamples { fraction } | InjectedEffect::RepeatedSamples { fraction } => fraction,
        InjectedEffect::SampleClock { ratio } => (ratio - 1.0).abs(),
    }
}

/// `factor` times the size; a filter has none.
pub(super) fn scaled(mut effect: InjectedEffect, factor: f64) -> InjectedEffect {
    match &mut effect {
        InjectedEffect::Sinusoid { amplitude: size, .. }
        | InjectedEffect::Telegraph { amplitude: size, .. }
        | InjectedEffect::Resonance { deviation: size, .. }
        | InjectedEffect::Markov { deviation: size, .. }
        | InjectedEffect::CommonMode { deviation: size, .. }
        | InjectedEffect::Quantization { coefficient: size, .. }
        | InjectedEffect::RateRamp { slope: size, .. }
        | InjectedEffect::Temperature { sensitivity: size, .. }
        | InjectedEffect::Supply { sensitivity: size, .. }
        | InjectedEffect::Spikes { size, .. }
        | InjectedEffect::BiasStep { size, .. }
        | InjectedEffect::DroppedSamples { fraction: size }
        | InjectedEffect::RepeatedSamples { fraction: size } => *size *= factor,
        InjectedEffect::Acceleration { sensitivity, .. } => sensitivity.iter_mut().for_each(|part| *part *= factor),
        InjectedEffect::SampleClock { ratio } => *ratio = 1.0 + (*ratio - 1.0) * factor,
        InjectedEffect::FilterBandwidth { .. } => {}
    }
    effect
}
