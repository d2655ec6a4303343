//! A level of the noise that becomes another one.

use super::kind::{AddedVariance, AveragingTime, Kind, Occurrence, no_course};
use crate::bounds::{BoundedEstimate, Parameter};
use serde::Serialize;

/// A change of the level of the noise.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct LevelChange {
    /// When, s from the first sample.
    #[serde(skip)]
    pub time_s: BoundedEstimate,
    /// Deviation of the noise after it over that before.
    #[serde(skip)]
    pub ratio: BoundedEstimate,
    /// Part of the changes of the level from block to block that this one explains.
    pub explained: f64,
    /// Probability of such a change anywhere by chance.
    pub p_value: f64,
}

impl Kind for LevelChange {
    const NAME: &'static str = "level_change";

    fn parameters(&self) -> Vec<(&'static str, Parameter)> {
        vec![("time", self.time_s.parameter("s")), ("ratio", self.ratio.parameter(""))]
    }

    fn sizes(&self) -> Vec<BoundedEstimate> {
        Vec::new()
    }

    fn lasting(&self) -> Vec<Option<BoundedEstimate>> {
        Vec::new()
    }

    fn occurrence(&self) -> Occurrence {
        Occurrence::AtTime { from_s: self.time_s.low, to_s: self.time_s.high }
    }

    /// What the louder part has more than the quieter one: the model has the mean of both.
    fn avar(&self, at: &AveragingTime) -> AddedVariance {
        let before = (self.time_s.value / (at.samples as f64 * at.period_s)).clamp(0.0, 1.0);
        let ratio = self.ratio.value.powi(2);
        let mean = before + (1.0 - before) * ratio;
        AddedVariance::modelled((1.0 - ratio.min(1.0) / mean) * at.model_avar)
    }

    no_course!();
}
