//! A bias that becomes another one from one sample to the next.

use super::kind::{AddedVariance, AveragingTime, BiasBlocks, Kind, Occurrence};
use crate::bounds::{BoundedEstimate, ChannelEstimate, Parameter};
use serde::Serialize;

/// A step of the bias.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct LevelStep {
    /// When, s from the first sample.
    #[serde(skip)]
    pub time_s: BoundedEstimate,
    /// New level less the old one.
    #[serde(skip)]
    pub size: ChannelEstimate,
    /// Probability of such a step anywhere by chance in white, flicker and walking noise of any mixture.
    pub p_value: f64,
}

impl Kind for LevelStep {
    const NAME: &'static str = "bias_step";

    fn parameters(&self) -> Vec<(&'static str, Parameter)> {
        vec![("time", self.time_s.parameter("s")), ("size", self.size.parameter())]
    }

    fn sizes(&self) -> Vec<BoundedEstimate> {
        vec![self.size.estimate()]
    }

    fn lasting(&self) -> Vec<Option<BoundedEstimate>> {
        Vec::new()
    }

    fn occurrence(&self) -> Occurrence {
        Occurrence::AtTime { from_s: self.time_s.low, to_s: self.time_s.high }
    }

    fn avar(&self, at: &AveragingTime) -> AddedVariance {
        // The squared second differences that it touches, averaged over all of them.
        match (at.samples + 1).checked_sub(2 * at.n) {
            None | Some(0) => AddedVariance::NONE,
            Some(count) => AddedVariance::corrected(self.size.value.powi(2) * at.n as f64 / (3.0 * count as f64)),
        }
    }

    fn course(&self, blocks: &BiasBlocks) -> Vec<(f64, Vec<f64>)> {
        vec![(self.size.value, blocks.time_s.iter().map(|time| f64::from(*time >= self.time_s.value)).collect())]
    }
}
