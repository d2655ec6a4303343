//! Effects that the declared noise model (N, B, K) does not include, injected where they arise in a real part.
//!
//! Most effects are sensed: they pass the digital filter and the quantization. Angle quantization and repeated outputs
//! come after the filter. The sample clock is the part's, a filter setting is the controller's, and the host drops
//! samples.
//! Each effect draws from its own random stream, so the noise is the same with and without it.

use crate::environment::{Environment, EnvironmentSource, EnvironmentState};
use crate::noise::{GaussMarkovProcess, NarrowBandProcess, TelegraphProcess};
use crate::registers::OutputRegister;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::f64::consts::PI;

/// The first random stream of the environment and the effects; lower ones belong to the noise of the channels.
const FIRST_STREAM: u64 = 64;
/// Limits of the ratio in [`InjectedEffect::SampleClock`].
const CLOCK_RATIO_LIMITS: (f64, f64) = (0.5, 2.0);

/// One effect; `channel` is the affected output. U is the unit of that output, such as °/s.
#[derive(Clone, Debug, PartialEq)]
pub enum InjectedEffect {
    /// A spectral line, `amplitude·sin(2π·frequency·t + phase)`, which may lie above the Nyquist frequency and alias.
    Sinusoid {
        channel: OutputRegister,
        /// Frequency, Hz.
        frequency_hz: f64,
        /// Amplitude, U.
        amplitude: f64,
        /// Phase at time 0, rad.
        phase_rad: f64,
    },
    /// Noise in a narrow band: covariance `deviation²·exp(−π·bandwidth·τ)·cos(2π·frequency·τ)`.
    Resonance {
        channel: OutputRegister,
        /// Middle of the band, Hz.
        frequency_hz: f64,
        /// Width at half of the peak density, Hz.
        bandwidth_hz: f64,
        /// Standard deviation, U.
        deviation: f64,
    },
    /// First-order Gauss-Markov noise: covariance `deviation²·exp(−τ/time_constant)`.
    Markov {
        channel: OutputRegister,
        /// Correlation time, s.
        time_constant_s: f64,
        /// Standard deviation, U.
        deviation: f64,
    },
    /// Random telegraph noise, two equally likely levels: covariance `(amplitude/2)²·exp(−τ/time_constant)`.
    Telegraph {
        channel: OutputRegister,
        /// Correlation time, s; half of the mean time between jumps.
        time_constant_s: f64,
        /// Difference of the levels, U.
        amplitude: f64,
    },
    /// Quantization noise of IEEE Std 952: the rate is the difference of an angle kept in steps of `√12·coefficient`.
    Quantization {
        channel: OutputRegister,
        /// Q, U·s.
        coefficient: f64,
    },
    /// A drift `slope·t`.
    RateRamp {
        channel: OutputRegister,
        /// R, U/s.
        slope: f64,
    },
    /// The part's digital filter in all channels: two cascaded averages of 2^`taps_log2` samples.
    FilterBandwidth {
        /// M, 1 to 6.
        taps_log2: u8,
    },
    /// Sensitivity to the temperature of the [`Environment`].
    Temperature {
        channel: OutputRegister,
        /// Sensitivity, U/°C.
        sensitivity: f64,
    },
    /// Sensitivity to the supply voltage of the [`Environment`].
    Supply {
        channel: OutputRegister,
        /// Sensitivity, U/V.
        sensitivity: f64,
    },
    /// Sensitivity to the specific force of the [`Environment`].
    Acceleration {
        channel: OutputRegister,
        /// Sensitivity to the force along x, y and z, U/g.
        sensitivity: [f64; 3],
    },
    /// A Gauss-Markov process that several channels share and that no output measures.
    CommonMode {
        /// The channels; each has the whole process.
        channels: Vec<OutputRegister>,
        /// Correlation time, s.
        time_constant_s: f64,
        /// Standard deviation, U.
        deviation: f64,
    },
    /// Single samples with an error of `size`, up or down, at random times.
    Spikes {
        channel: OutputRegister,
        /// Mean number per hour.
        rate_per_hour: f64,
        /// Size of a spike, U.
        size: f64,
    },
    /// A lasting change of the bias.
    BiasStep {
        channel: OutputRegister,
        /// Time of the step, s from time 0.
        time_s: f64,
        /// Size of the step, U.
        size: f64,
    },
    /// The host misses samples at random.
    DroppedSamples {
        /// Fraction of all samples, 0 to 1.
        fraction: f64,
    },
    /// The outputs repeat the previous sample, flagged as new data, at random.
    RepeatedSamples {
        /// Fraction of all samples, 0 to 1.
        fraction: f64,
    },
    /// The frequency of the part's sample clock is not the nominal one.
    SampleClock {
        /// True rate over nominal rate, ½ to 2.
        ratio: f64,
    },
}

impl InjectedEffect {
    /// The name of this kind of effect in reports.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Sinusoid { .. } => "sinusoid",
            Self::Resonance { .. } => "resonance",
            Self::Markov { .. } => "markov",
            Self::Telegraph { .. } => "telegraph",
            Self::Quantization { .. } => "quantization",
            Self::RateRamp { .. } => "rate_ramp",
            Self::FilterBandwidth { .. } => "filter_bandwidth",
            Self::Temperature { .. } => "temperature",
            Self::Supply { .. } => "supply",
            Self::Acceleration { .. } => "acceleration",
            Self::CommonMode { .. } => "common_mode",
            Self::Spikes { .. } => "spikes",
            Self::BiasStep { .. } => "bias_step",
            Self::DroppedSamples { .. } => "dropped_samples",
            Self::RepeatedSamples { .. } => "repeated_samples",
            Self::SampleClock { .. } => "sample_clock",
        }
    }

    /// The channels that show the effect; empty if it affects the samples of all channels.
    pub fn channels(&self) -> &[OutputRegister] {
        match self {
            Self::Sinusoid { channel, .. }
            | Self::Resonance { channel, .. }
            | Self::Markov { channel, .. }
            | Self::Telegraph { channel, .. }
            | Self::Quantization { channel, .. }
            | Self::RateRamp { channel, .. }
            | Self::Temperature { channel, .. }
            | Self::Supply { channel, .. }
            | Self::Acceleration { channel, .. }
            | Self::Spikes { channel, .. }
            | Self::BiasStep { channel, .. } => std::slice::from_ref(channel),
            Self::CommonMode { channels, .. } => channels,
            Self::FilterBandwidth { .. }
            | Self::DroppedSamples { .. }
            | Self::RepeatedSamples { .. }
            | Self::SampleClock { .. } => &[],
        }
    }
}

/// Effects on a part in addition to its declared noise; none by default.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SensorScenario {
    /// The environment, which the part's own outputs show; no other channel depends on it without an effect.
    pub environment: Environment,
    /// Effects that the noise model does not declare. Their order selects the random streams.
    pub effects: Vec<InjectedEffect>,
}

impl SensorScenario {
    /// The filter setting M; 0 without [`InjectedEffect::FilterBandwidth`].
    pub fn taps_log2(&self) -> u8 {
        let taps = |effect: &InjectedEffect| match effect {
            InjectedEffect::FilterBandwidth { taps_log2 } => Some(*taps_log2),
            _ => None,
        };
        self.effects.iter().find_map(taps).unwrap_or(0)
    }

    /// Fraction of the samples that the host misses, 0 to 1; 0 without [`InjectedEffect::DroppedSamples`].
    pub fn missed_fraction(&self) -> f64 {
        let fraction = |effect: &InjectedEffect| match effect {
            InjectedEffect::DroppedSamples { fraction } => Some(probability(*fraction)),
            _ => None,
        };
        self.effects.iter().find_map(fraction).unwrap_or(0.0)
    }

    /// True over nominal sample rate, limited to ½ to 2; 1 without [`InjectedEffect::SampleClock`].
    fn clock_ratio(&self) -> f64 {
        let ratio = |effect: &InjectedEffect| match effect {
            InjectedEffect::SampleClock { ratio } if !ratio.is_nan() => Some(*ratio),
            _ => None,
        };
        let (low, high) = CLOCK_RATIO_LIMITS;
        self.effects.iter().find_map(ratio).map_or(1.0, |ratio| ratio.clamp(low, high))
    }
}

/// Limits a number to 0 to 1; NaN becomes 0.
fn probability(fraction: f64) -> f64 {
    if fraction > 0.0 { fraction.min(1.0) } else { 0.0 }
}

/// Generates the environment and the effects of a scenario, sample by sample.
#[derive(Clone, Debug)]
pub struct EffectSource {
    environment: EnvironmentSource,
    active: Vec<ActiveEffect>,
    clock_ratio: f64,
}

#[derive(Clone, Debug)]
struct ActiveEffect {
    effect: InjectedEffect,
    state: EffectState,
    random: ChaCha8Rng,
}

#[derive(Clone, Debug)]
enum EffectState {
    None,
    Resonance(NarrowBandProcess),
    Markov(GaussMarkovProcess),
    Telegraph(TelegraphProcess),
    Quantization(AngleQuantizer),
}

impl EffectSource {
    /// A source. The same scenario and seed give the same values.
    pub fn new(scenario: &SensorScenario, seed: u64) -> Self {
        let stream = |number: usize| {
            let mut random = ChaCha8Rng::seed_from_u64(seed);
            random.set_stream(FIRST_STREAM + number as u64);
            random
        };
        let active = |(number, effect): (usize, &InjectedEffect)| ActiveEffect {
            state: EffectState::new(effect),
            effect: effect.clone(),
            random: stream(1 + number),
        };
        Self {
            environment: EnvironmentSource::new(scenario.environment, stream(0)),
            active: scenario.effects.iter().enumerate().map(active).collect(),
            clock_ratio: scenario.clock_ratio(),
        }
    }

    /// True over nominal sample rate, ½ to 2.
    pub(crate) fn clock_ratio(&self) -> f64 {
        self.clock_ratio
    }

    /// Adds environment and effects at `time_s` to the sensed value of every channel, in burst order.
    pub fn disturb(&mut self, values: &mut [f64; 12], time_s: f64, period_s: f64) {
        let environment = self.environment.next(time_s, period_s);
        values[OutputRegister::Temp as usize] += environment.temperature_c;
        values[OutputRegister::Supply as usize] += environment.supply_v;
        for (value, force_g) in values[OutputRegister::AcclX as usize..].iter_mut().zip(environment.force_g) {
            *value += force_g;
        }
        for active in &mut self.active {
            let sensed = active.sensed(time_s, period_s, &environment);
            for channel in active.effect.channels() {
                values[*channel as usize] += sensed;
            }
        }
    }

    /// Applies the angle quantization of `channel` to a filtered value, before it is rounded to counts.
    pub fn digitize(&mut self, channel: OutputRegister, value: f64, period_s: f64) -> f64 {
        self.active.iter_mut().fold(value, |value, active| match &mut active.state {
            EffectState::Quantization(quantizer) if active.effect.channels() == [channel] => {
                quantizer.quantize(value, period_s)
            }
            _ => value,
        })
    }

    /// True if the outputs repeat the previous sample now. To be called once per sample.
    pub(crate) fn repeats_sample(&mut self) -> bool {
        let repeats = |active: &mut ActiveEffect| match active.effect {
            InjectedEffect::RepeatedSamples { fraction } => active.random.random_bool(probability(fraction)),
            _ => false,
        };
        // Every effect draws at every sample, so no stream depends on another.
        self.active.iter_mut().fold(false, |any, active| repeats(active) | any)
    }
}

impl EffectState {
    fn new(effect: &InjectedEffect) -> Self {
        match *effect {
            InjectedEffect::Resonance { frequency_hz, bandwidth_hz, .. } => {
                Self::Resonance(NarrowBandProcess::new(frequency_hz, bandwidth_hz))
            }
            InjectedEffect::Markov { time_constant_s, .. } | InjectedEffect::CommonMode { time_constant_s, .. } => {
                Self::Markov(GaussMarkovProcess::new(time_constant_s))
            }
            InjectedEffect::Telegraph { time_constant_s, .. } => {
                Self::Telegraph(TelegraphProcess::new(time_constant_s))
            }
            InjectedEffect::Quantization { coefficient, .. } => Self::Quantization(AngleQuantizer::new(coefficient)),
            _ => Self::None,
        }
    }
}

impl ActiveEffect {
    /// The value that the effect adds to each of its channels before the filter.
    fn sensed(&mut self, time_s: f64, period_s: f64, environment: &EnvironmentState) -> f64 {
        use InjectedEffect as Effect;
        let random = &mut self.random;
        match (&self.effect, &mut self.state) {
            (&Effect::Sinusoid { frequency_hz, amplitude, phase_rad, .. }, _) => {
                amplitude * (2.0 * PI * (frequency_hz * time_s).fract() + phase_rad).sin()
            }
            (Effect::Resonance { deviation, .. }, EffectState::Resonance(process)) => {
                deviation * process.next(time_s, period_s, random)
            }
            (Effect::Markov { deviation, .. } | Effect::CommonMode { deviation, .. }, EffectState::Markov(process)) => {
                deviation * process.next(period_s, random)
            }
            (Effect::Telegraph { amplitude, .. }, EffectState::Telegraph(process)) => {
                amplitude * process.next(period_s, random)
            }
            (Effect::RateRamp { slope, .. }, _) => slope * time_s,
            (Effect::Temperature { sensitivity, .. }, _) => sensitivity * environment.temperature_c,
            (Effect::Supply { sensitivity, .. }, _) => sensitivity * environment.supply_v,
            (Effect::Acceleration { sensitivity, .. }, _) => {
                sensitivity.iter().zip(environment.force_g).map(|(per_g, force_g)| per_g * force_g).sum()
            }
            (&Effect::Spikes { rate_per_hour, size, .. }, _) => {
                let struck = random.random_bool(probability(-(-rate_per_hour * period_s / 3600.0).exp_m1()));
                let sign = if random.random_bool(0.5) { 1.0 } else { -1.0 };
                if struck { sign * size } else { 0.0 }
            }
            (&Effect::BiasStep { time_s: step_s, size, .. }, _) if time_s >= step_s => size,
            _ => 0.0,
        }
    }
}

/// Rounds an angle to steps, and gives the rate that is the difference of the rounded angles.
#[derive(Clone, Debug)]
struct AngleQuantizer {
    /// Step of the angle, U·s.
    step: f64,
    /// The true angle less the rounded one, in steps, −½ to ½. Only this is stored, so a long record loses no digits.
    remainder: f64,
}

impl AngleQuantizer {
    /// `coefficient` is Q, the standard deviation of an error that is uniform over a step of √12·Q.
    fn new(coefficient: f64) -> Self {
        Self { step: 12f64.sqrt() * coefficient, remainder: 0.0 }
    }

    /// The rate over one sample period of `period_s`.
    fn quantize(&mut self, rate: f64, period_s: f64) -> f64 {
        let angle = self.remainder + rate * period_s / self.step;
        let counted = angle.round();
        self.remainder = angle - counted;
        counted * self.step / period_s
    }
}
