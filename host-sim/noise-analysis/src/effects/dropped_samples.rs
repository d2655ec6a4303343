//! Samples that never arrived: the sample indices or time stamps have room for them.

use super::kind::{Kind, Occurrence, no_variance};
use crate::bounds::{BoundedEstimate, Parameter};
use serde::Serialize;

/// Lost samples.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct DroppedSamples {
    /// Part of all samples.
    #[serde(skip)]
    pub fraction: BoundedEstimate,
    /// Their number.
    pub missing: f64,
    /// Number of all samples, those that were used and those that were dropped.
    pub samples: f64,
    /// Number of gaps.
    pub gaps: usize,
}

impl Kind for DroppedSamples {
    const NAME: &'static str = "dropped_samples";

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
