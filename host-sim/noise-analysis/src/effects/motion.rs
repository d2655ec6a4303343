//! A motion of the platform, by which a channel goes farther than the biases of parts differ.

use super::kind::{Kind, Occurrence, no_variance};
use crate::bounds::{BoundedEstimate, ChannelEstimate, Parameter};

/// A motion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MotionInterval {
    /// Beginning of the first stretch, s from the first sample.
    pub from_s: BoundedEstimate,
    /// End of the last one, s.
    pub to_s: BoundedEstimate,
    /// Largest distance of the mean of a second from the median.
    pub size: ChannelEstimate,
    /// By which the biases of parts differ, in the unit of the channel.
    pub bias_error: f64,
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
