//! Drift that a channel shares with another one, too large to be caused by what that one measures.

use super::kind::{Kind, Occurrence, no_variance};
use crate::bounds::{BoundedEstimate, ChannelEstimate, Parameter};
use serde::Serialize;

/// A drift that looks like a sensitivity.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct SharedDrift {
    /// Drift of the channel over that of the other one, in the unit over `per`.
    #[serde(skip)]
    pub ratio: ChannelEstimate,
    /// Unit of the other channel.
    pub per: &'static str,
    /// Name of the other channel.
    pub with: &'static str,
    /// Significance, standard deviations.
    pub sigmas: f64,
    /// How many times the data sheet's sensitivity is the largest that is plausible.
    pub largest_multiple: f64,
}

impl Kind for SharedDrift {
    const NAME: &'static str = "shared_drift";

    fn parameters(&self) -> Vec<(&'static str, Parameter)> {
        vec![("ratio", self.ratio.parameter_per(self.per))]
    }

    fn sizes(&self) -> Vec<BoundedEstimate> {
        vec![self.ratio.estimate()]
    }

    fn lasting(&self) -> Vec<Option<BoundedEstimate>> {
        vec![Some(self.ratio.estimate())]
    }

    fn occurrence(&self) -> Occurrence {
        Occurrence::OnceAUnit
    }

    no_variance!();
}
