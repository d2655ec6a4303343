//! The low-pass filter of the part: moving averages before its output, of which every so many values are read.

use super::evidence::CurveEvidence;
use super::kind::{Kind, Occurrence, no_variance};
use crate::bounds::{BoundedEstimate, ChannelEstimate, Parameter};
use crate::units::coefficient_unit;
use allan_core::NoiseTerm;
use serde::Serialize;

/// The part's filter, as one channel shows it.
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
    /// The part's own sample rate, Hz.
    pub internal_rate_hz: f64,
    /// What the curve shows of it.
    pub evidence: CurveEvidence,
}

impl Kind for OutputFilter {
    const NAME: &'static str = "filter_bandwidth";

    fn parameters(&self) -> Vec<(&'static str, Parameter)> {
        let white_noise = self.white_noise.estimate();
        let unit = coefficient_unit(&NoiseTerm::AngleRandomWalk, self.white_noise.unit);
        vec![
            ("taps", self.taps.parameter("")),
            ("decimation", self.decimation.parameter("")),
            ("value", white_noise.parameter(unit)),
        ]
    }

    fn sizes(&self) -> Vec<BoundedEstimate> {
        vec![self.white_noise.estimate()]
    }

    fn lasting(&self) -> Vec<Option<BoundedEstimate>> {
        // The white noise may change over the record while the filter does not.
        vec![Some(self.decimation)]
    }

    fn occurrence(&self) -> Occurrence {
        Occurrence::Once
    }

    no_variance!();
}
