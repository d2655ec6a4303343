//! Values that are multiples of several counts: they were rounded before they were recorded.

use super::kind::{AddedVariance, AveragingTime, Kind, Occurrence, no_course};
use crate::bounds::{BoundedEstimate, ChannelEstimate, Parameter};
use crate::distributions::ROUNDING;
use serde::Serialize;

/// A resolution of several counts.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct EffectiveLsb {
    /// Smallest distance of two values; it is exact.
    #[serde(skip)]
    pub step: ChannelEstimate,
    /// The same in counts.
    pub counts: u32,
    /// Number of values.
    pub values: usize,
    /// Number of times that the value changes.
    pub changes: usize,
}

impl Kind for EffectiveLsb {
    const NAME: &'static str = "quantization";

    fn parameters(&self) -> Vec<(&'static str, Parameter)> {
        vec![("step", self.step.parameter())]
    }

    fn sizes(&self) -> Vec<BoundedEstimate> {
        vec![self.step.estimate()]
    }

    fn lasting(&self) -> Vec<Option<BoundedEstimate>> {
        vec![Some(self.step.estimate())]
    }

    fn occurrence(&self) -> Occurrence {
        Occurrence::InChannel
    }

    fn avar(&self, at: &AveragingTime) -> AddedVariance {
        // Rounding error is uniform within a step, and white where noise reaches over several steps.
        AddedVariance::modelled(ROUNDING * self.step.value.powi(2) / at.n as f64)
    }

    no_course!();
}
