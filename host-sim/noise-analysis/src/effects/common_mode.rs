//! Slow drift that channels have in common, without a measured cause.

use super::kind::{AddedVariance, AveragingTime, Kind, Occurrence, no_course};
use crate::bounds::{BoundedEstimate, ChannelEstimate, Parameter};
use serde::Serialize;

/// A drift in common.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CommonMode {
    /// Standard deviation.
    #[serde(skip)]
    pub deviation: ChannelEstimate,
    /// Correlation time, s.
    #[serde(skip)]
    pub time_constant_s: BoundedEstimate,
    /// Names of the other channels that have it.
    pub others: Vec<&'static str>,
    /// Gain in ln likelihood over channels with nothing in common.
    pub gain: f64,
}

impl Kind for CommonMode {
    const NAME: &'static str = "common_mode";

    fn parameters(&self) -> Vec<(&'static str, Parameter)> {
        vec![("deviation", self.deviation.parameter()), ("time_constant", self.time_constant_s.parameter("s"))]
    }

    fn sizes(&self) -> Vec<BoundedEstimate> {
        vec![self.deviation.estimate()]
    }

    fn lasting(&self) -> Vec<Option<BoundedEstimate>> {
        vec![Some(self.deviation.estimate()), Some(self.time_constant_s)]
    }

    fn occurrence(&self) -> Occurrence {
        Occurrence::OnceAUnit
    }

    fn avar(&self, at: &AveragingTime) -> AddedVariance {
        at.of_markov(self.time_constant_s.value, self.deviation.value)
    }

    no_course!();
}
