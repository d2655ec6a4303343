//! The kinds of effects that are hidden.

use clap::ValueEnum;
use serde::Serialize;

/// A kind of [`InjectedEffect`](virtual_sensor::InjectedEffect).
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, ValueEnum, Serialize)]
#[value(rename_all = "snake_case")]
#[serde(rename_all = "snake_case")]
#[allow(missing_docs, reason = "each is described at the effect of the same name")]
pub enum Kind {
    Sinusoid,
    Resonance,
    Markov,
    Telegraph,
    Quantization,
    RateRamp,
    FilterBandwidth,
    Temperature,
    Supply,
    Acceleration,
    CommonMode,
    Spikes,
    BiasStep,
    DroppedSamples,
    RepeatedSamples,
    SampleClock,
}

impl Kind {
    /// All of them.
    pub const ALL: [Self; 16] = [
        Self::Sinusoid,
        Self::Resonance,
        Self::Markov,
        Self::Telegraph,
        Self::Quantization,
        Self::RateRamp,
        Self::FilterBandwidth,
        Self::Temperature,
        Self::Supply,
        Self::Acceleration,
        Self::CommonMode,
        Self::Spikes,
        Self::BiasStep,
        Self::DroppedSamples,
        Self::RepeatedSamples,
        Self::SampleClock,
    ];

    /// Name in reports.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Sinusoid => "sinusoid",
            Self::Resonance => "resonance",
            Self::Markov => "markov",
            Self::Telegraph => "telegraph",
            Self::Quantization => "quantization",
            Self::RateRamp => "rate_ramp",
            Self::FilterBandwidth => "filter_bandwidth",
            Self::Temperature => "temperature",
            Self::Supply => "supply",
            Self::Acceleration => "acceleration",
            Self::CommonMode => "common_mode",
            Self::Spikes => "spikes",
            Self::BiasStep => "bias_step",
            Self::DroppedSamples => "dropped_samples",
            Self::RepeatedSamples => "repeated_samples",
            Self::SampleClock => "sample_clock",
        }
    }
}
