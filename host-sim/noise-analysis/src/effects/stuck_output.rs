//! An output that stays at one value.

use super::kind::{Kind, Occurrence, no_variance};
use crate::bounds::{BoundedEstimate, Parameter};
use serde::Serialize;

/// Runs of equal samples.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct StuckOutput {
    /// Part of the samples that are in such runs.
    #[serde(skip)]
    pub fraction: BoundedEstimate,
    /// Beginning of the longest run, s from the first sample.
    #[serde(skip)]
    pub from_s: BoundedEstimate,
    /// Its end, s.
    #[serde(skip)]
    pub to_s: BoundedEstimate,
    /// Number of the runs.
    pub runs: u64,
    /// Number of their samples.
    pub stuck: u64,
    /// Number of all samples.
    pub samples: u64,
}

impl Kind for StuckOutput {
    const NAME: &'static str = "stuck";

    fn parameters(&self) -> Vec<(&'static str, Parameter)> {
        vec![
            ("share", self.fraction.parameter("")),
            ("from", self.from_s.parameter("s")),
            ("to", self.to_s.parameter("s")),
        ]
    }

    fn sizes(&self) -> Vec<BoundedEstimate> {
        Vec::new()
    }

    fn lasting(&self) -> Vec<Option<BoundedEstimate>> {
        Vec::new()
    }

    fn occurrence(&self) -> Occurrence {
        Occurrence::AtTime { from_s: self.from_s.low, to_s: self.to_s.high }
    }

    no_variance!();
}
