//! Departures from every model that the analysis knows: place, size and observation.

use super::evidence::CurveEvidence;
use super::kind::{Kind, NamedParameter, Occurrence, named};
use crate::bounds::BoundedEstimate;
use serde::Serialize;

/// Something that no kind describes.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Unexplained {
    #[serde(skip)]
    pub place: UnexplainedPlace,
    /// Excess of the deviation there over that of the model, %; `None` if it is not known to better than itself.
    #[serde(skip)]
    pub excess_percent: Option<BoundedEstimate>,
    pub observation: Observation,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub enum UnexplainedPlace {
    /// At an averaging time, s.
    AveragingTime(BoundedEstimate),
    /// At an averaging time of the curve, as by a line.
    LineOfCurve { tau_s: BoundedEstimate, frequency_hz: BoundedEstimate },
    /// Around a frequency of the spectrum, Hz.
    Frequency(BoundedEstimate),
}

#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Observation {
    /// A point of the curve that the model does not reach, with the probability anywhere in the curve by chance.
    PointOfCurve { p_value: f64 },
    /// A term that fits an octave of the curve, and that something else contradicts.
    RefutedTerm { curve: CurveEvidence, by: Refutation },
    /// A band of the spectrum that is no resonance, by its full width at half maximum.
    Band { width_hz: f64, sigmas: f64, mismatch: BandMismatch },
    /// A level of the noise that follows the temperature.
    LevelByTemperature {
        range_degc: [f64; 2],
        /// Part of the changes of the level that follow the temperature.
        explained: f64,
    },
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Refutation {
    /// A line of a few periods in the record, which its curve does not tell from a drift.
    FewPeriods,
    NotInSpectrum {
        frequency_hz: f64,
    },
    /// The spectrum has another shape where the term is, with the probability by chance.
    ShapeOfSpectrum {
        p_value: f64,
    },
    Irreversible {
        time_constant_s: f64,
    },
    /// The kurtosis is that of rare disturbances: its excess over that of two equally frequent levels, and the standard deviation.
    RareDisturbances {
        time_constant_s: f64,
        kurtosis: [f64; 2],
    },
    /// The kurtosis, by the same figures, does not tell whether the process has two levels.
    UndecidedLevels {
        time_constant_s: f64,
        kurtosis: [f64; 2],
    },
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum BandMismatch {
    /// The form of its spectrum, with the probability by chance.
    Shape {
        p_value: f64,
    },
    Curve,
}

impl Kind for Unexplained {
    fn parameters(&self) -> Vec<NamedParameter> {
        let tau = self.tau_s().map(|tau_s| named("tau", tau_s.parameter("s")));
        let frequency = self.frequency_hz().map(|frequency_hz| named("frequency", frequency_hz.parameter("Hz")));
        let excess = self.excess_percent.map(|percent| named("excess_percent", percent.parameter("%")).size());
        [tau, frequency, excess].into_iter().flatten().collect()
    }

    fn occurrence(&self) -> Occurrence {
        self.frequency_hz().map_or(Occurrence::InChannel, Occurrence::AtFrequency)
    }
}

impl Unexplained {
    /// The averaging time around which it is, s; `None` if it is in the spectrum alone.
    #[must_use]
    pub const fn tau_s(&self) -> Option<BoundedEstimate> {
        match self.place {
            UnexplainedPlace::AveragingTime(tau_s) | UnexplainedPlace::LineOfCurve { tau_s, .. } => Some(tau_s),
            UnexplainedPlace::Frequency(_) => None,
        }
    }

    /// The frequency around which it is, Hz; `None` if it is at none.
    #[must_use]
    pub const fn frequency_hz(&self) -> Option<BoundedEstimate> {
        match self.place {
            UnexplainedPlace::AveragingTime(_) => None,
            UnexplainedPlace::LineOfCurve { frequency_hz, .. } | UnexplainedPlace::Frequency(frequency_hz) => {
                Some(frequency_hz)
            }
        }
    }
}
