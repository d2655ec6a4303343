//! Low-pass filters before the samples.

use super::evidence::CurveEvidence;
use super::kind::{Kind, NamedParameter, Occurrence, named};
use crate::bounds::{BoundedEstimate, ChannelEstimate};
use crate::units::coefficient_unit;
use allan_core::NoiseTerm;
use serde::Serialize;

/// The low-pass filter of the part, as one channel shows it: moving averages before its output, of which every so many values are read.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct OutputFilter {
    /// Taps of each moving average.
    #[serde(skip)]
    pub taps: BoundedEstimate,
    /// Samples of the part's own clock from one recorded sample to the next.
    #[serde(skip)]
    pub decimation: BoundedEstimate,
    /// N of the white noise before the filter, in the unit times √s.
    #[serde(skip)]
    pub white_noise: ChannelEstimate,
    /// Number of moving averages behind each other.
    pub stages: u8,
    pub internal_rate_hz: f64,
    pub evidence: CurveEvidence,
}

impl Kind for OutputFilter {
    fn parameters(&self) -> Vec<NamedParameter> {
        let white_noise = self.white_noise.estimate();
        let unit = coefficient_unit(&NoiseTerm::AngleRandomWalk, self.white_noise.unit);
        vec![
            named("taps", self.taps.parameter("")),
            // The white noise may change over the record while the filter does not.
            named("decimation", self.decimation.parameter("")).lasting(),
            named("value", white_noise.parameter(unit)).size(),
        ]
    }

    fn occurrence(&self) -> Occurrence {
        Occurrence::Once
    }
}

/// A low-pass filter of the first or the second order: an analog one, or a digital one that is fast against the samples.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct LowPassFilter {
    /// Frequency at which half of the power is left.
    #[serde(skip)]
    pub bandwidth_hz: BoundedEstimate,
    pub design: LowPassDesign,
    pub evidence: CurveEvidence,
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum LowPassDesign {
    /// One stage of the first order, of one channel: a Markov process in the place of its white noise.
    OneStage { time_constant_s: f64 },
    /// Two equal stages of the first order, of all channels.
    TwoStages,
    /// A Butterworth filter of the second order, of all channels.
    Butterworth,
}

impl LowPassDesign {
    pub(crate) fn is_second_order(self) -> bool {
        matches!(self, Self::TwoStages | Self::Butterworth)
    }
}

impl Kind for LowPassFilter {
    fn parameters(&self) -> Vec<NamedParameter> {
        vec![named("bandwidth", self.bandwidth_hz.parameter("Hz")).lasting()]
    }

    fn occurrence(&self) -> Occurrence {
        Occurrence::Once
    }
}
