//! The kinds of effects beyond the baseline noise model, by theme: each as numbers, with its share of the Allan variance, its course over
//! time, and what makes the effects of two channels one cause.
//!
//! [Names](Effect::name) of effects and of their [parameters](Effect::parameters) are for tables and files; the analysis uses none.
//!
//! In every kind a name ends with its unit (`_s`, `_hz`, `_percent`), times are counted from the first sample, `sigmas` is a significance in
//! standard deviations, and `p_value` the probability by chance anywhere in the record, in white, flicker and walking noise of any mixture
//! where it is of a bias.

mod bias;
mod disturbances;
mod evidence;
mod faults;
mod filters;
pub mod findings;
mod kind;
mod lines;
mod processes;
mod response;
mod rounding;
mod sensitivities;
mod signals;
mod unexplained;

pub use bias::{LevelStep, LinearDrift, LinearDriftEvidence, TurnOnTransient};
pub use disturbances::{LevelChange, MotionInterval, MotionScale, NoisyInterval, Spikes, WanderingLevel};
pub use evidence::{CurveEvidence, LineEvidence, LineSource, Multiples, SpectrumEvidence};
pub use faults::{ClockDeviation, DroppedSamples, RateChange, RepeatedSamples, Saturation, StuckOutput};
pub use filters::{LowPassDesign, LowPassFilter, OutputFilter};
pub(crate) use kind::{AddedVariance, AveragingTime, BiasBlocks, Kind, Occurrence};
pub use lines::{ResonantLine, SinusoidalLine, SquareWave};
pub use processes::{CommonMode, MarkovEvidence, MarkovProcess, ShotNoise, TelegraphEvidence, TelegraphNoise};
pub use response::ResponseVariance;
pub use rounding::{AngleQuantization, EffectiveLsb, MissingCodes, NoiseBelowCount};
pub use sensitivities::{
    AccelerationSensitivity, SharedDrift, SupplySensitivity, TemperatureCurvature, TemperatureSensitivity, ThermalLag,
    VibrationRectification,
};
pub use signals::{Chirp, ModulatedLine, ModulationEvidence, Periodic};
pub(crate) use signals::{avar_of_harmonics, avar_of_run};
pub use unexplained::{BandMismatch, Observation, Refutation, Unexplained, UnexplainedPlace};

use crate::bounds::{BoundedEstimate, Parameter};
use serde::Serialize;
use std::collections::BTreeMap;

/// Declares [`Effect`]: each [`Kind`] with its name in tables and files. Two kinds may share one.
macro_rules! kinds {
    ($(#[$attribute:meta])* pub enum Effect { $($kind:ident = $name:literal,)* }) => {
        $(#[$attribute])*
        pub enum Effect {
            $(#[doc = concat!("See [`", stringify!($kind), "`].")] $kind($kind),)*
        }

        $(
            impl From<$kind> for Effect {
                fn from(effect: $kind) -> Self {
                    Self::$kind(effect)
                }
            }
        )*

        impl Effect {
            pub const NAMES: &[&str] = &[$($name),*];

            /// Name of the kind in tables and files, such as `sinusoid`.
            #[must_use]
            pub const fn name(&self) -> &'static str {
                match self { $(Self::$kind(_) => $name),* }
            }

            pub(crate) const fn kind(&self) -> &dyn Kind {
                match self { $(Self::$kind(effect) => effect),* }
            }
        }
    };
}

kinds! {
    /// An effect beyond the baseline noise model, as a channel shows it. What is serialized of it is its evidence: the figures beside
    /// its [parameters](Effect::parameters).
    #[derive(Debug, Clone, PartialEq, Serialize)]
    #[serde(untagged)]
    pub enum Effect {
        OutputFilter = "filter_bandwidth",
        LowPassFilter = "filter_bandwidth",
        SinusoidalLine = "sinusoid",
        ResonantLine = "resonance",
        ModulatedLine = "modulated_line",
        Chirp = "chirp",
        Periodic = "periodic",
        SquareWave = "square_wave",
        TelegraphNoise = "telegraph",
        ShotNoise = "shot_noise",
        MarkovProcess = "markov",
        CommonMode = "common_mode",
        SharedDrift = "shared_drift",
        LinearDrift = "rate_ramp",
        LevelStep = "bias_step",
        TurnOnTransient = "turn_on_transient",
        TemperatureSensitivity = "temperature",
        TemperatureCurvature = "temperature_squared",
        ThermalLag = "thermal_lag",
        SupplySensitivity = "supply",
        AccelerationSensitivity = "acceleration",
        VibrationRectification = "vibration_rectification",
        AngleQuantization = "quantization",
        EffectiveLsb = "quantization",
        NoiseBelowCount = "noise_below_count",
        MissingCodes = "missing_codes",
        Spikes = "spikes",
        NoisyInterval = "knock",
        LevelChange = "level_change",
        WanderingLevel = "wandering_level",
        MotionInterval = "motion",
        Saturation = "saturated",
        StuckOutput = "stuck",
        DroppedSamples = "dropped_samples",
        RepeatedSamples = "repeated_samples",
        ClockDeviation = "sample_clock",
        Unexplained = "unexplained",
    }
}

impl Effect {
    /// Its parameters by their names in tables and files.
    #[must_use]
    pub fn parameters(&self) -> BTreeMap<&'static str, Parameter> {
        self.kind().parameters().into_iter().map(|named| (named.name, named.parameter)).collect()
    }

    /// The parameters that say how large it is: the channel with the narrowest interval of one of these for its value shows it best.
    pub(crate) fn sizes(&self) -> impl Iterator<Item = BoundedEstimate> {
        self.kind().parameters().into_iter().filter(|named| named.is_size).map(|named| named.parameter.estimate())
    }

    /// The parameters that any two stretches of a record have alike where the effect lasts, by name.
    pub(crate) fn lasting(&self) -> BTreeMap<&'static str, BoundedEstimate> {
        let lasting = self.kind().parameters().into_iter().filter(|named| named.lasts);
        lasting.map(|named| (named.name, named.parameter.estimate())).collect()
    }

    pub(crate) fn is_of_kind(&self, other: &Self) -> bool {
        std::mem::discriminant(self) == std::mem::discriminant(other)
    }

    /// True if it is a periodic signal that has lines in the spectrum.
    #[must_use]
    pub const fn is_line(&self) -> bool {
        matches!(self, Self::SinusoidalLine(_) | Self::ResonantLine(_) | Self::SquareWave(_))
    }

    #[must_use]
    pub fn frequency_hz(&self) -> Option<BoundedEstimate> {
        match self.kind().occurrence() {
            Occurrence::AtFrequency(frequency_hz) => Some(frequency_hz),
            _ => None,
        }
    }

    /// True if both are one cause, in channels of the same unit or not.
    pub(crate) fn is_one_cause(&self, other: &Self, is_same_unit: bool) -> bool {
        self.is_of_kind(other) && self.kind().occurrence().is_one_cause(other.kind().occurrence(), is_same_unit)
    }
}
