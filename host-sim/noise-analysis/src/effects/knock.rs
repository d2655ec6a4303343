//! A time in which the noise is larger than before and after: a knock.

use super::kind::{AddedVariance, AveragingTime, Kind, Occurrence, no_course};
use crate::bounds::{BoundedEstimate, Parameter};
use serde::Serialize;

/// A time of larger noise.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct NoisyInterval {
    /// Beginning, s from the first sample.
    #[serde(skip)]
    pub from_s: BoundedEstimate,
    /// End, s.
    #[serde(skip)]
    pub to_s: BoundedEstimate,
    /// Deviation of the noise over that of the stretches around it.
    #[serde(skip)]
    pub level: BoundedEstimate,
    /// Averaging time at which the levels are compared, s.
    pub tau_s: f64,
    /// Probability of such a level by chance.
    pub p_value: f64,
    /// Names of the channels that show it at the same time, this one included.
    pub channels: Vec<&'static str>,
}

impl NoisyInterval {
    /// Whether it follows or precedes another one at less than the length of the shorter.
    pub(crate) fn is_near(&self, other: &Self) -> bool {
        let length = |of: &Self| of.to_s.value - of.from_s.value;
        let reach = length(self).min(length(other));
        self.from_s.value <= other.to_s.value + reach && other.from_s.value <= self.to_s.value + reach
    }

    /// This one, with its level, from the earlier start to the later end of both.
    pub(crate) fn extended_by(mut self, other: &Self) -> Self {
        if other.from_s.value < self.from_s.value {
            self.from_s = other.from_s;
        }
        if other.to_s.value > self.to_s.value {
            self.to_s = other.to_s;
        }
        let others = other.channels.iter().filter(|name| !self.channels.contains(name));
        self.channels = self.channels.iter().chain(others).copied().collect();
        self
    }
}

impl Kind for NoisyInterval {
    const NAME: &'static str = "knock";

    fn parameters(&self) -> Vec<(&'static str, Parameter)> {
        vec![
            ("from", self.from_s.parameter("s")),
            ("to", self.to_s.parameter("s")),
            ("level", self.level.parameter("")),
        ]
    }

    fn sizes(&self) -> Vec<BoundedEstimate> {
        Vec::new()
    }

    fn lasting(&self) -> Vec<Option<BoundedEstimate>> {
        Vec::new()
    }

    fn occurrence(&self) -> Occurrence {
        Occurrence::AtTime { from_s: self.from_s.value, to_s: self.to_s.value }
    }

    fn avar(&self, at: &AveragingTime) -> AddedVariance {
        let part = (self.to_s.value - self.from_s.value) / (at.samples as f64 * at.period_s);
        AddedVariance::corrected((self.level.value.powi(2) - 1.0).max(0.0) * part * at.model_avar)
    }

    no_course!();
}
