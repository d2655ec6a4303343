//! The kinds of effects beyond the baseline noise model, one file each: what it is, the share of the Allan variance, the course over
//! time, and what makes the effects of two channels one cause.
//!
//! An effect is numbers alone. Its [name](Effect::name) and those of its [parameters](Effect::parameters) are for tables and files;
//! nothing in the analysis depends on them.

mod acceleration;
mod angle_quantization;
mod bias_step;
mod chirp;
mod common_mode;
mod dropped_samples;
mod effective_lsb;
mod environment;
mod evidence;
pub mod findings;
mod kind;
mod knock;
mod level_change;
mod low_pass_filter;
mod markov_process;
mod missing_codes;
mod modulated_line;
mod motion;
mod noise_below_count;
mod output_filter;
mod periodic;
mod rate_ramp;
mod repeated_samples;
mod resonance;
mod response;
mod sample_clock;
mod saturation;
mod shared_drift;
mod shot_noise;
mod sinusoid;
mod spikes;
mod square_wave;
mod stuck_output;
mod telegraph;
mod temperature_curvature;
mod thermal_lag;
mod turn_on_transient;
mod unexplained;
mod vibration_rectification;

pub use acceleration::AccelerationSensitivity;
pub use angle_quantization::AngleQuantization;
pub use bias_step::LevelStep;
pub use chirp::Chirp;
pub(crate) use chirp::avar_of_run;
pub use common_mode::CommonMode;
pub use dropped_samples::DroppedSamples;
pub use effective_lsb::EffectiveLsb;
pub use environment::{SupplySensitivity, TemperatureSensitivity};
pub use evidence::{CurveEvidence, LineEvidence, LineSource, Multiples, SpectrumEvidence};
pub(crate) use kind::{AddedVariance, AveragingTime, BiasBlocks, Kind, Occurrence};
pub use knock::NoisyInterval;
pub use level_change::LevelChange;
pub use low_pass_filter::{LowPassDesign, LowPassFilter};
pub use markov_process::{MarkovEvidence, MarkovProcess};
pub use missing_codes::MissingCodes;
pub use modulated_line::{ModulatedLine, ModulationEvidence};
pub use motion::{MotionInterval, MotionScale};
pub use noise_below_count::NoiseBelowCount;
pub use output_filter::OutputFilter;
pub use periodic::Periodic;
pub(crate) use periodic::avar_of_harmonics;
pub use rate_ramp::{LinearDrift, LinearDriftEvidence};
pub use repeated_samples::RepeatedSamples;
pub use resonance::ResonantLine;
pub use response::ResponseVariance;
pub use sample_clock::{ClockDeviation, RateChange};
pub use saturation::Saturation;
pub use shared_drift::SharedDrift;
pub use shot_noise::ShotNoise;
pub use sinusoid::SinusoidalLine;
pub use spikes::Spikes;
pub use square_wave::SquareWave;
pub use stuck_output::StuckOutput;
pub use telegraph::{TelegraphEvidence, TelegraphNoise};
pub use temperature_curvature::TemperatureCurvature;
pub use thermal_lag::ThermalLag;
pub use turn_on_transient::TurnOnTransient;
pub use unexplained::{BandMismatch, Observation, Refutation, Unexplained, UnexplainedPlace};
pub use vibration_rectification::VibrationRectification;

use crate::bounds::{BoundedEstimate, Parameter};
use serde::Serialize;
use std::collections::BTreeMap;

/// An effect beyond the baseline noise model, as a channel shows it. What is serialized of it is its evidence: the figures beside its
/// [parameters](Effect::parameters).
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(untagged)]
pub enum Effect {
    /// The low-pass filter of the part.
    OutputFilter(OutputFilter),
    /// A low-pass filter of the first order in one channel.
    LowPassFilter(LowPassFilter),
    /// A line no wider than the record resolves.
    SinusoidalLine(SinusoidalLine),
    /// A line with a width.
    ResonantLine(ResonantLine),
    /// A line whose amplitude or phase goes to and fro.
    ModulatedLine(ModulatedLine),
    /// A line whose frequency runs.
    Chirp(Chirp),
    /// A slow signal that repeats and is no sinusoid.
    Periodic(Periodic),
    /// Odd harmonics of one fundamental.
    SquareWave(SquareWave),
    /// Jumps to and fro between two levels.
    TelegraphNoise(TelegraphNoise),
    /// Disturbances that begin at once and decay, at random times.
    ShotNoise(ShotNoise),
    /// Exponentially correlated noise.
    MarkovProcess(MarkovProcess),
    /// Drift that channels have in common.
    CommonMode(CommonMode),
    /// Drift in common with a channel on which none depends as much.
    SharedDrift(SharedDrift),
    /// A bias that changes in proportion to time.
    LinearDrift(LinearDrift),
    /// A bias that becomes another one.
    LevelStep(LevelStep),
    /// A bias that settles after the start.
    TurnOnTransient(TurnOnTransient),
    /// A bias in proportion to the temperature.
    TemperatureSensitivity(TemperatureSensitivity),
    /// A bias that follows a parabola of the temperature.
    TemperatureCurvature(TemperatureCurvature),
    /// A bias that follows the temperature behind a low-pass filter.
    ThermalLag(ThermalLag),
    /// A bias in proportion to the supply voltage.
    SupplySensitivity(SupplySensitivity),
    /// A rate in proportion to the specific force.
    AccelerationSensitivity(AccelerationSensitivity),
    /// A bias in proportion to the variance of an acceleration.
    VibrationRectification(VibrationRectification),
    /// White noise of the angle.
    AngleQuantization(AngleQuantization),
    /// Values that are multiples of several counts.
    EffectiveLsb(EffectiveLsb),
    /// Noise that does not reach from one count to the next.
    NoiseBelowCount(NoiseBelowCount),
    /// Values that a converter never gives.
    MissingCodes(MissingCodes),
    /// Single samples that stand out.
    Spikes(Spikes),
    /// A time in which the noise is larger.
    NoisyInterval(NoisyInterval),
    /// A level of the noise that becomes another one.
    LevelChange(LevelChange),
    /// A motion of the platform.
    MotionInterval(MotionInterval),
    /// Values that are cut off.
    Saturation(Saturation),
    /// An output that stays at one value.
    StuckOutput(StuckOutput),
    /// Samples that never arrived.
    DroppedSamples(DroppedSamples),
    /// Samples that were read twice.
    RepeatedSamples(RepeatedSamples),
    /// A sample rate other than the nominal one.
    ClockDeviation(ClockDeviation),
    /// What departs from every model that the analysis knows.
    Unexplained(Unexplained),
}

/// Gives every variant of [`Effect`] what its [`Kind`] says.
macro_rules! kinds {
    ($($kind:ident),* $(,)?) => {
        $(
            impl From<$kind> for Effect {
                fn from(of: $kind) -> Self {
                    Self::$kind(of)
                }
            }
        )*

        impl Effect {
            /// The name of every kind; two kinds may share one.
            pub const NAMES: &[&str] = &[$($kind::NAME),*];

            /// Name of the kind in tables and files, such as `sinusoid`.
            #[must_use]
            pub fn name(&self) -> &'static str {
                match self { $(Self::$kind(_) => $kind::NAME),* }
            }

            /// Its parameters by their names in tables and files.
            #[must_use]
            pub fn parameters(&self) -> BTreeMap<&'static str, Parameter> {
                match self { $(Self::$kind(of) => of.parameters()),* }.into_iter().collect()
            }

            /// [`Kind::sizes`].
            pub(crate) fn sizes(&self) -> Vec<BoundedEstimate> {
                match self { $(Self::$kind(of) => of.sizes()),* }
            }

            /// [`Kind::lasting`].
            pub(crate) fn lasting(&self) -> Vec<Option<BoundedEstimate>> {
                match self { $(Self::$kind(of) => of.lasting()),* }
            }

            /// [`Kind::occurrence`].
            pub(crate) fn occurrence(&self) -> Occurrence {
                match self { $(Self::$kind(of) => of.occurrence()),* }
            }

            /// [`Kind::avar`].
            pub(crate) fn avar(&self, at: &AveragingTime) -> AddedVariance {
                match self { $(Self::$kind(of) => of.avar(at)),* }
            }

            /// [`Kind::course`].
            pub(crate) fn course(&self, means: &BiasBlocks) -> Vec<(f64, Vec<f64>)> {
                match self { $(Self::$kind(of) => of.course(means)),* }
            }
        }
    };
}

kinds!(
    OutputFilter,
    LowPassFilter,
    SinusoidalLine,
    ResonantLine,
    ModulatedLine,
    Chirp,
    Periodic,
    SquareWave,
    TelegraphNoise,
    ShotNoise,
    MarkovProcess,
    CommonMode,
    SharedDrift,
    LinearDrift,
    LevelStep,
    TurnOnTransient,
    TemperatureSensitivity,
    TemperatureCurvature,
    ThermalLag,
    SupplySensitivity,
    AccelerationSensitivity,
    VibrationRectification,
    AngleQuantization,
    EffectiveLsb,
    NoiseBelowCount,
    MissingCodes,
    Spikes,
    NoisyInterval,
    LevelChange,
    MotionInterval,
    Saturation,
    StuckOutput,
    DroppedSamples,
    RepeatedSamples,
    ClockDeviation,
    Unexplained,
);

impl Effect {
    /// Whether both are of one kind.
    pub(crate) fn is_of_kind(&self, other: &Self) -> bool {
        std::mem::discriminant(self) == std::mem::discriminant(other)
    }

    /// Whether it is a periodic signal that has lines in the spectrum.
    #[must_use]
    pub const fn is_line(&self) -> bool {
        matches!(self, Self::SinusoidalLine(_) | Self::ResonantLine(_) | Self::SquareWave(_))
    }

    /// Its frequency, Hz; `None` if it is not at one.
    #[must_use]
    pub fn frequency_hz(&self) -> Option<BoundedEstimate> {
        match self.occurrence() {
            Occurrence::AtFrequency(frequency_hz) => Some(frequency_hz),
            _ => None,
        }
    }

    /// Whether both are one cause, in channels of the same unit or not.
    pub(crate) fn is_one_cause(&self, other: &Self, is_same_unit: bool) -> bool {
        self.is_of_kind(other) && self.occurrence().is_one_cause(other.occurrence(), is_same_unit)
    }
}
