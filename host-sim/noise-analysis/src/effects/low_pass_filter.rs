//! A low-pass filter of the first or the second order: an analog one, or a digital one that is fast against the samples.

use super::evidence::CurveEvidence;
use super::kind::{Kind, Occurrence, no_variance};
use crate::bounds::{BoundedEstimate, Parameter};
use serde::Serialize;

/// A low-pass filter.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct LowPassFilter {
    /// Frequency at which half of the power is left.
    #[serde(skip)]
    pub bandwidth_hz: BoundedEstimate,
    /// Its design.
    pub design: LowPassDesign,
    /// What the curve shows of it.
    pub evidence: CurveEvidence,
}

/// What a low-pass filter is made of.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum LowPassDesign {
    /// One stage of the first order, of one channel: a Markov process in the place of its white noise.
    OneStage {
        /// Correlation time of the noise, s.
        time_constant_s: f64,
    },
    /// Two equal stages of the first order, of all channels.
    TwoStages,
    /// A Butterworth filter of the second order, of all channels.
    Butterworth,
}

impl LowPassDesign {
    /// Whether it is of the second order.
    pub(crate) fn is_second_order(self) -> bool {
        matches!(self, Self::TwoStages | Self::Butterworth)
    }
}

impl Kind for LowPassFilter {
    const NAME: &'static str = "filter_bandwidth";

    fn parameters(&self) -> Vec<(&'static str, Parameter)> {
        vec![("bandwidth", self.bandwidth_hz.parameter("Hz"))]
    }

    fn sizes(&self) -> Vec<BoundedEstimate> {
        Vec::new()
    }

    fn lasting(&self) -> Vec<Option<BoundedEstimate>> {
        vec![Some(self.bandwidth_hz)]
    }

    fn occurrence(&self) -> Occurrence {
        Occurrence::Once
    }

    no_variance!();
}
