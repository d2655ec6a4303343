//! A motion of the platform, by which a channel goes farther than the biases of parts differ.

use super::kind::{Kind, Occurrence, no_variance};
use crate::bounds::{BoundedEstimate, ChannelEstimate, Parameter};
use serde::Serialize;

/// By how much the mean of a second of a channel at rest may leave the median.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum MotionScale {
    /// By how much the biases of parts differ (1 σ), by the data sheet, in the unit of the channel.
    BiasError(f64),
    /// The scatter of the channel's own means of a second (1 σ), where no data sheet is known, in the unit of the channel.
    Scatter(f64),
}

/// A motion.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct MotionInterval {
    /// Beginning of the first stretch, s from the first sample.
    #[serde(skip)]
    pub from_s: BoundedEstimate,
    /// End of the last one, s.
    #[serde(skip)]
    pub to_s: BoundedEstimate,
    /// Largest distance of the mean of a second from the median.
    #[serde(skip)]
    pub size: ChannelEstimate,
    /// What the distance is compared with.
    pub scale: MotionScale,
    /// Number of stretches.
    pub stretches: usize,
    /// Their length together, s.
    pub moved_s: usize,
}

impl Kind for MotionInterval {
    const NAME: &'static str = "motion";

    fn parameters(&self) -> Vec<(&'static str, Parameter)> {
        vec![("from", self.from_s.parameter("s")), ("to", self.to_s.parameter("s")), ("size", self.size.parameter())]
    }

    fn sizes(&self) -> Vec<BoundedEstimate> {
        vec![self.size.estimate()]
    }

    fn lasting(&self) -> Vec<Option<BoundedEstimate>> {
        Vec::new()
    }

    fn occurrence(&self) -> Occurrence {
        Occurrence::AtTime { from_s: self.from_s.value, to_s: self.to_s.value }
    }

    no_variance!();
}
