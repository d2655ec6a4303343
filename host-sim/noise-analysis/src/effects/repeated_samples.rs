//! Samples that equal the one before in all channels: a register that is read before it is renewed.

use super::kind::{Kind, Occurrence, no_variance};
use crate::bounds::{BoundedEstimate, Parameter};
use serde::Serialize;

/// Samples that were read twice.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct RepeatedSamples {
    /// Part of all samples.
    #[serde(skip)]
    pub fraction: BoundedEstimate,
    /// Number of those that equal the one before.
    pub equal: u64,
    /// Number of all samples.
    pub samples: f64,
    /// How many chance makes equal, at most.
    pub by_chance: f64,
    /// Number of channels.
    pub channels: usize,
}

impl Kind for RepeatedSamples {
    const NAME: &'static str = "repeated_samples";

    fn parameters(&self) -> Vec<(&'static str, Parameter)> {
        vec![("fraction", self.fraction.parameter(""))]
    }

    fn sizes(&self) -> Vec<BoundedEstimate> {
        Vec::new()
    }

    fn lasting(&self) -> Vec<Option<BoundedEstimate>> {
        vec![Some(self.fraction)]
    }

    fn occurrence(&self) -> Occurrence {
        Occurrence::Once
    }

    no_variance!();
}
