//! Values that are cut off: at an end of the range, or at another limit.

use super::kind::{Kind, Occurrence, no_variance};
use crate::bounds::{BoundedEstimate, ChannelEstimate, Parameter};
use serde::Serialize;

/// Values at a limit.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Saturation {
    /// Part of the samples that lie at a limit.
    #[serde(skip)]
    pub fraction: BoundedEstimate,
    /// The limit with the most samples; it is exact.
    #[serde(skip)]
    pub level: ChannelEstimate,
    /// Whether that is an end of the range.
    pub is_end_of_range: bool,
    /// Number of samples at a limit.
    pub cut_off: f64,
    /// Number of all samples.
    pub samples: f64,
    /// Most samples that have another value in common.
    pub most_of_others: u64,
}

impl Kind for Saturation {
    const NAME: &'static str = "saturated";

    fn parameters(&self) -> Vec<(&'static str, Parameter)> {
        vec![("share", self.fraction.parameter("")), ("level", self.level.parameter())]
    }

    fn sizes(&self) -> Vec<BoundedEstimate> {
        vec![self.level.estimate()]
    }

    fn lasting(&self) -> Vec<Option<BoundedEstimate>> {
        Vec::new()
    }

    fn occurrence(&self) -> Occurrence {
        Occurrence::InChannel
    }

    no_variance!();
}
