//! Noise that does not reach from one count to the next.

use super::kind::{Kind, Occurrence, no_variance};
use crate::bounds::{BoundedEstimate, ChannelEstimate, Parameter};
use serde::Serialize;

/// Noise below a count.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct NoiseBelowCount {
    /// Allan deviation at the shortest averaging times, where it is nearest to what dithers; 0 if the value never changes. Before the
    /// rounding it may be anything up to the upper bound.
    #[serde(skip)]
    pub deviation: ChannelEstimate,
    /// The same in counts.
    pub counts: f64,
    /// From which on rounding adds white noise alone, counts.
    pub dithered_counts: f64,
}

impl Kind for NoiseBelowCount {
    const NAME: &'static str = "noise_below_count";

    fn parameters(&self) -> Vec<(&'static str, Parameter)> {
        vec![("deviation", self.deviation.parameter())]
    }

    fn sizes(&self) -> Vec<BoundedEstimate> {
        vec![self.deviation.estimate()]
    }

    fn lasting(&self) -> Vec<Option<BoundedEstimate>> {
        vec![Some(self.deviation.estimate())]
    }

    fn occurrence(&self) -> Occurrence {
        Occurrence::InChannel
    }

    no_variance!();
}
