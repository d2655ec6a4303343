//! Quantization noise: steps of the angle, as of a counter or an integrator before the output.

use super::evidence::CurveEvidence;
use super::kind::{AddedVariance, AveragingTime, Kind, Occurrence, no_course};
use crate::bounds::{BoundedEstimate, ChannelEstimate, Parameter};
use crate::units::coefficient_unit;
use allan_core::NoiseTerm;
use serde::Serialize;

/// White noise of the angle.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct AngleQuantization {
    /// Q, in the unit times s.
    #[serde(skip)]
    pub coefficient: ChannelEstimate,
    /// What the curve shows of it.
    pub evidence: CurveEvidence,
}

impl Kind for AngleQuantization {
    const NAME: &'static str = "quantization";

    fn parameters(&self) -> Vec<(&'static str, Parameter)> {
        vec![("value", self.coefficient_parameter())]
    }

    fn sizes(&self) -> Vec<BoundedEstimate> {
        vec![self.coefficient.estimate()]
    }

    fn lasting(&self) -> Vec<Option<BoundedEstimate>> {
        vec![Some(self.coefficient.estimate())]
    }

    fn occurrence(&self) -> Occurrence {
        Occurrence::InChannel
    }

    fn avar(&self, at: &AveragingTime) -> AddedVariance {
        at.of_term(&NoiseTerm::Quantization, self.coefficient.value)
    }

    no_course!();
}

impl AngleQuantization {
    /// Q with its unit.
    #[must_use]
    pub fn coefficient_parameter(&self) -> Parameter {
        self.coefficient.estimate().parameter(coefficient_unit(&NoiseTerm::Quantization, self.coefficient.unit))
    }
}
