//! The hidden effects: their kinds, the distributions of their parameters, and their sizes.

use super::channel_under_test::RecordLength;
use super::environment::{frequency_factor, log_uniform};
use clap::ValueEnum;
use rand::Rng;
use rand_chacha::ChaCha8Rng;
use serde::Serialize;
use simulation::SAMPLE_RATE_HZ;
use std::f64::consts::PI;
use virtual_sensor::{InjectedEffect, OutputRegister};

pub(super) const GYROS: [OutputRegister; 3] = [OutputRegister::GyroX, OutputRegister::GyroY, OutputRegister::GyroZ];

/// Declares [`EffectKind`]: each kind with its name in a report.
macro_rules! kinds {
    ($($kind:ident = $name:literal,)*) => {
        /// Kind of a hidden effect, a variant of the virtual sensor's effects.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, ValueEnum, Serialize)]
        #[value(rename_all = "snake_case")]
        #[serde(rename_all = "snake_case")]
        #[allow(missing_docs, reason = "each is documented at the virtual sensor's effect of the same name")]
        pub enum EffectKind { $($kind,)* }

        impl EffectKind {
            /// Every kind, in the order of the tables.
            pub const ALL: [Self; [$($name),*].len()] = [$(Self::$kind),*];

            /// The name of this kind in a report.
            pub const fn name(self) -> &'static str {
                match self { $(Self::$kind => $name),* }
            }
        }
    };
}

kinds! {
    Sinusoid = "sinusoid",
    Resonance = "resonance",
    Markov = "markov",
    Telegraph = "telegraph",
    Quantization = "quantization",
    RateRamp = "rate_ramp",
    FilterBandwidth = "filter_bandwidth",
    Temperature = "temperature",
    Supply = "supply",
    Acceleration = "acceleration",
    CommonMode = "common_mode",
    Spikes = "spikes",
    BiasStep = "bias_step",
    DroppedSamples = "dropped_samples",
    RepeatedSamples = "repeated_samples",
    SampleClock = "sample_clock",
}

/// An effect of size 1 in `channel`, or in another gyro if the channel is unsuitable.
pub(super) fn draw_unit(
    kind: EffectKind,
    channel: OutputRegister,
    record: RecordLength,
    random: &mut ChaCha8Rng,
) -> InjectedEffect {
    // An accelerometer's noise is about one count, so coarser quanta have no white error.
    let of_gyros = matches!(kind, EffectKind::Quantization | EffectKind::Acceleration);
    let channel = if of_gyros && !GYROS.contains(&channel) { GYROS[random.random_range(0..3)] } else { channel };
    let nyquist = 0.5 / record.period_s;
    let factor = frequency_factor(record.seconds, record.period_s);
    let sign = |random: &mut ChaCha8Rng| if random.random_bool(0.5) { 1.0 } else { -1.0 };
    match kind {
        EffectKind::Sinusoid => {
            let frequency_hz = log_uniform(random, 0.1 * factor, 0.9 * nyquist);
            InjectedEffect::Sinusoid { channel, frequency_hz, amplitude: 1.0, phase_rad: random.random_range(-PI..PI) }
        }
        EffectKind::Resonance => {
            let frequency_hz = log_uniform(random, factor, 0.8 * nyquist);
            let bandwidth_hz = frequency_hz * log_uniform(random, 0.02, 0.2);
            InjectedEffect::Resonance { channel, frequency_hz, bandwidth_hz, deviation: 1.0 }
        }
        EffectKind::Markov => {
            let time_constant_s = log_uniform(random, 0.05, 60.0) / factor;
            InjectedEffect::Markov { channel, time_constant_s, deviation: 1.0 }
        }
        EffectKind::Telegraph => {
            let time_constant_s = log_uniform(random, 0.05, 20.0) / factor;
            InjectedEffect::Telegraph { channel, time_constant_s, amplitude: 1.0 }
        }
        EffectKind::CommonMode => {
            let time_constant_s = log_uniform(random, 10.0, 100.0) / factor;
            InjectedEffect::CommonMode { channels: GYROS.to_vec(), time_constant_s, deviation: 1.0 }
        }
        EffectKind::Quantization => InjectedEffect::Quantization { channel, coefficient: 1.0 },
        EffectKind::FilterBandwidth => InjectedEffect::FilterBandwidth { taps_log2: random.random_range(1..=6) },
        EffectKind::RateRamp => InjectedEffect::RateRamp { channel, slope: sign(random) },
        EffectKind::BiasStep => {
            let size = sign(random);
            InjectedEffect::BiasStep { channel, time_s: record.seconds * random.random_range(0.15..0.85), size }
        }
        EffectKind::Temperature => InjectedEffect::Temperature { channel, sensitivity: sign(random) },
        EffectKind::Supply => InjectedEffect::Supply { channel, sensitivity: sign(random) },
        EffectKind::Acceleration => {
            let direction = [0; 3].map(|_| random.random_range(-1.0..1.0f64));
            let length = direction.iter().map(|part| part * part).sum::<f64>().sqrt().max(1e-3);
            InjectedEffect::Acceleration { channel, sensitivity: direction.map(|part| part / length) }
        }
        EffectKind::Spikes => {
            let rate_per_hour = factor * log_uniform(random, 10.0, 2000.0);
            InjectedEffect::Spikes { channel, rate_per_hour, size: 1.0 }
        }
        EffectKind::DroppedSamples => InjectedEffect::DroppedSamples { fraction: 1.0 },
        EffectKind::RepeatedSamples => InjectedEffect::RepeatedSamples { fraction: 1.0 },
        EffectKind::SampleClock => InjectedEffect::SampleClock { ratio: 1.0 + sign(random) },
    }
}

/// The parameter that [`draw_unit`] sets to 1; `None` if it is not one number of its own, or fixed.
fn size_mut(effect: &mut InjectedEffect) -> Option<&mut f64> {
    match effect {
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
        | InjectedEffect::RepeatedSamples { fraction: size } => Some(size),
        InjectedEffect::Acceleration { .. }
        | InjectedEffect::SampleClock { .. }
        | InjectedEffect::FilterBandwidth { .. } => None,
    }
}

pub(super) fn size(effect: &InjectedEffect) -> f64 {
    match effect {
        InjectedEffect::Acceleration { sensitivity, .. } => {
            sensitivity.iter().map(|part| part * part).sum::<f64>().sqrt()
        }
        InjectedEffect::SampleClock { ratio } => (ratio - 1.0).abs(),
        _ => size_mut(&mut effect.clone()).map_or(1.0, |size| size.abs()),
    }
}

/// The effect with its size multiplied by `factor`; a filter's size is fixed.
pub(super) fn scaled(mut effect: InjectedEffect, factor: f64) -> InjectedEffect {
    match &mut effect {
        InjectedEffect::Acceleration { sensitivity, .. } => sensitivity.iter_mut().for_each(|part| *part *= factor),
        InjectedEffect::SampleClock { ratio } => *ratio = 1.0 + (*ratio - 1.0) * factor,
        effect => size_mut(effect).into_iter().for_each(|size| *size *= factor),
    }
    effect
}

/// The parameters with their names in a report; times count from the sensor's start.
pub(super) fn parameters(effect: &InjectedEffect) -> Vec<(&'static str, f64)> {
    match *effect {
        InjectedEffect::Sinusoid { frequency_hz, amplitude, .. } => {
            vec![("frequency", frequency_hz), ("amplitude", amplitude)]
        }
        InjectedEffect::Resonance { frequency_hz, bandwidth_hz, deviation, .. } => {
            vec![("frequency", frequency_hz), ("bandwidth", bandwidth_hz), ("deviation", deviation)]
        }
        InjectedEffect::Markov { time_constant_s, deviation, .. }
        | InjectedEffect::CommonMode { time_constant_s, deviation, .. } => {
            vec![("time_constant", time_constant_s), ("deviation", deviation)]
        }
        InjectedEffect::Telegraph { time_constant_s, amplitude, .. } => {
            vec![("time_constant", time_constant_s), ("amplitude", amplitude)]
        }
        InjectedEffect::Quantization { coefficient, .. } => vec![("value", coefficient)],
        InjectedEffect::RateRamp { slope, .. } => vec![("slope", slope)],
        InjectedEffect::FilterBandwidth { taps_log2 } => vec![("taps", f64::from(1u32 << taps_log2))],
        InjectedEffect::Temperature { sensitivity, .. } | InjectedEffect::Supply { sensitivity, .. } => {
            vec![("sensitivity", sensitivity)]
        }
        InjectedEffect::Acceleration { sensitivity: [x, y, z], .. } => {
            vec![("sensitivity_x", x), ("sensitivity_y", y), ("sensitivity_z", z)]
        }
        InjectedEffect::Spikes { rate_per_hour, size, .. } => vec![("rate", rate_per_hour), ("size", size)],
        InjectedEffect::BiasStep { time_s, size, .. } => vec![("time", time_s), ("size", size)],
        InjectedEffect::DroppedSamples { fraction } | InjectedEffect::RepeatedSamples { fraction } => {
            vec![("fraction", fraction)]
        }
        InjectedEffect::SampleClock { ratio } => vec![("rate_hz", SAMPLE_RATE_HZ * ratio)],
    }
}
