//! A bias that settles exponentially after the start of the record, as of a part that warms itself after it was turned on.

use super::kind::{AddedVariance, AveragingTime, BiasBlocks, Kind, Occurrence};
use super::response::ResponseVariance;
use crate::bounds::{BoundedEstimate, ChannelEstimate, Parameter};
use serde::Serialize;

/// A transient of the bias after the start.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TurnOnTransient {
    /// Bias at the start less the bias that it settles to.
    #[serde(skip)]
    pub size: ChannelEstimate,
    /// Time constant, s.
    #[serde(skip)]
    pub time_constant_s: BoundedEstimate,
    /// Probability of such a transient by chance in white, flicker and walking noise of any mixture.
    pub p_value: f64,
    /// Allan variance of the transient.
    #[serde(skip)]
    pub response: ResponseVariance,
}

impl Kind for TurnOnTransient {
    const NAME: &'static str = "turn_on_transient";

    fn parameters(&self) -> Vec<(&'static str, Parameter)> {
        vec![("size", self.size.parameter()), ("time_constant", self.time_constant_s.parameter("s"))]
    }

    fn sizes(&self) -> Vec<BoundedEstimate> {
        vec![self.size.estimate()]
    }

    fn lasting(&self) -> Vec<Option<BoundedEstimate>> {
        Vec::new()
    }

    fn occurrence(&self) -> Occurrence {
        Occurrence::OnceAUnit
    }

    fn avar(&self, at: &AveragingTime) -> AddedVariance {
        AddedVariance::corrected(self.response.at(at.n))
    }

    fn course(&self, blocks: &BiasBlocks) -> Vec<(f64, Vec<f64>)> {
        let settling = |time: &f64| (-time / self.time_constant_s.value).exp();
        vec![(self.size.value, blocks.time_s.iter().map(settling).collect())]
    }
}
