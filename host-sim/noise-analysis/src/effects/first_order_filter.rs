//! A low-pass filter of the first order in one channel: a Markov process in the place of the white noise.

use super::evidence::CurveEvidence;
use super::kind::{Kind, Occurrence, no_variance};
use crate::bounds::{BoundedEstimate, Parameter};

/// A filter of the first order.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FirstOrderFilter {
    /// Frequency at which half of the power is left.
    pub bandwidth_hz: BoundedEstimate,
    /// Correlation time of the noise, s.
    pub time_constant_s: f64,
    /// What the curve shows of it.
    pub evidence: CurveEvidence,
}

impl Kind for FirstOrderFilter {
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
