//! Effects that a recording hides: what the declared noise N, B, K does not describe.
//!
//! Each is made where physics makes it: most are sensed, so they pass the part's filter and its quantization;
//! angle quantization and stale outputs come after the filter; the sample clock is the part's; a filter setting is
//! the controller's, a missed sample the host's. An effect has a random stream of its own, so the noise underneath is
//! the same with and without it.

mod angle;
mod process;
mod source;
pub mod surroundings;

pub use source::EffectSource;
pub use surroundings::Surroundings;

use crate::output::OutputRegister;

/// One effect. U is the unit of its channel, such as deg/s.
#[derive(Clone, Debug, PartialEq)]
pub enum Effect {
    /// A line: `amplitude·sin(2π·frequency·t + phase)`, sampled where the part samples, so that it may alias.
    Sinusoid {
        /// Where it shows.
        channel: OutputRegister,
        /// Hz.
        frequency_hz: f64,
        /// U.
        amplitude: f64,
        /// At time 0, rad.
        phase_rad: f64,
    },
    /// Noise in a narrow band, as of a structure that rings: covariance `deviation²·exp(−π·bandwidth·τ)·cos(2π·frequency·τ)`.
    Resonance {
        /// Where it shows.
        channel: OutputRegister,
        /// Middle of the band, Hz.
        frequency_hz: f64,
        /// Width at half the density, Hz.
        bandwidth_hz: f64,
        /// Standard deviation, U.
        deviation: f64,
    },
    /// Correlated noise of covariance `deviation²·exp(−τ/time_constant)`.
    Markov {
        /// Where it shows.
        channel: OutputRegister,
        /// s.
        time_constant_s: f64,
        /// Standard deviation, U.
        deviation: f64,
    },
    /// Jumps between two levels, equally likely, at random times: covariance `(amplitude/2)²·exp(−τ/time_constant)`.
    Telegraph {
        /// Where it shows.
        channel: OutputRegister,
        /// Correlation time, s; half the mean time between jumps.
        time_constant_s: f64,
        /// Distance of the levels, U.
        amplitude: f64,
    },
    /// The rate is the difference of an angle that is kept in steps of `√12·coefficient`; IEEE 952 quantization noise.
    Quantization {
        /// Where it shows.
        channel: OutputRegister,
        /// Q, U·s.
        coefficient: f64,
    },
    /// A value that grows for ever.
    RateRamp {
        /// Where it shows.
        channel: OutputRegister,
        /// U/s.
        slope: f64,
    },
    /// The part's digital filter, all channels: two averages of 2^`taps_log2` samples.
    FilterBandwidth {
        /// M, 1 to 6.
        taps_log2: u8,
    },
    /// Sensitivity to the temperature of the [`Surroundings`].
    Temperature {
        /// Where it shows.
        channel: OutputRegister,
        /// U/°C.
        sensitivity: f64,
    },
    /// Sensitivity to the supply of the [`Surroundings`].
    Supply {
        /// Where it shows.
        channel: OutputRegister,
        /// U/V.
        sensitivity: f64,
    },
    /// Sensitivity to the specific force of the [`Surroundings`].
    Acceleration {
        /// Where it shows.
        channel: OutputRegister,
        /// To the force along x, y and z, U/g.
        sensitivity: [f64; 3],
    },
    /// A Gauss-Markov process that channels share and nothing measures.
    CommonMode {
        /// The channels that have it, each in full.
        channels: Vec<OutputRegister>,
        /// s.
        time_constant_s: f64,
        /// Standard deviation, U.
        deviation: f64,
    },
    /// Single samples that are off by `size`, up or down, at random times.
    Spikes {
        /// Where they show.
        channel: OutputRegister,
        /// Mean number in an hour.
        rate_per_hour: f64,
        /// U.
        size: f64,
    },
    /// The bias changes at once and for good.
    BiasStep {
        /// Where it shows.
        channel: OutputRegister,
        /// When, s from time 0.
        time_s: f64,
        /// U.
        size: f64,
    },
    /// The host misses samples at random.
    DroppedSamples {
        /// Of all samples, 0 to 1.
        fraction: f64,
    },
    /// The part shows the last sample once more as if it were new, at random.
    RepeatedSamples {
        /// Of all samples, 0 to 1.
        fraction: f64,
    },
    /// The part's clock runs at another frequency than the data sheet's.
    SampleClock {
        /// True rate over nominal rate; ½ to 2.
        ratio: f64,
    },
}

impl Effect {
    /// Name in reports.
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

    /// The channels in which it shows; none for what concerns the samples of all alike.
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

/// What goes on around the part and in it, besides noise. Nothing at all by default.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Hidden {
    /// What the part's other outputs show: it hides nothing by itself.
    pub surroundings: Surroundings,
    /// What nobody declares.
    pub effects: Vec<Effect>,
}

impl Hidden {
    /// The filter setting M; 0 without [`Effect::FilterBandwidth`].
    pub fn taps_log2(&self) -> u8 {
        let taps = |effect: &Effect| match effect {
            Effect::FilterBandwidth { taps_log2 } => Some(*taps_log2),
            _ => None,
        };
        self.effects.iter().find_map(taps).unwrap_or(0)
    }

    /// Part of the samples that the host misses; 0 without [`Effect::DroppedSamples`].
    pub fn missed_fraction(&self) -> f64 {
        let fraction = |effect: &Effect| match effect {
            Effect::DroppedSamples { fraction } => Some(*fraction),
            _ => None,
        };
        self.effects.iter().find_map(fraction).unwrap_or(0.0)
    }

    /// True over nominal sample rate; 1 without [`Effect::SampleClock`].
    pub fn clock_ratio(&self) -> f64 {
        let ratio = |effect: &Effect| match effect {
            Effect::SampleClock { ratio } => Some(*ratio),
            _ => None,
        };
        self.effects.iter().find_map(ratio).unwrap_or(1.0)
    }
}

/// Brings a number into 0 to 1; one that is none counts as 0.
pub fn probability(fraction: f64) -> f64 {
    if fraction > 0.0 { fraction.min(1.0) } else { 0.0 }
}
