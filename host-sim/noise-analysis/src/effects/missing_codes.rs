//! Values that a converter never gives between others that it gives often: a differential non-linearity of −1 LSB (IEEE Std 1241).

use super::kind::{Kind, Occurrence, no_variance};
use crate::bounds::{BoundedEstimate, ChannelEstimate, Parameter};
use serde::Serialize;

/// Missing codes of a converter.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct MissingCodes {
    /// How many of the codes that the record covers never occur.
    pub codes: u32,
    /// The largest distance of which all distances between missing codes are multiples; it is exact.
    #[serde(skip)]
    pub spacing: ChannelEstimate,
    /// Samples that the missing codes would have if each had as many as the rarer of its neighbours.
    pub expected: f64,
}

impl Kind for MissingCodes {
    const NAME: &'static str = "missing_codes";

    fn parameters(&self) -> Vec<(&'static str, Parameter)> {
        vec![("codes", BoundedEstimate::exact(self.codes.into()).parameter("")), ("spacing", self.spacing.parameter())]
    }

    fn sizes(&self) -> Vec<BoundedEstimate> {
        vec![self.spacing.estimate()]
    }

    fn lasting(&self) -> Vec<Option<BoundedEstimate>> {
        vec![Some(self.spacing.estimate())]
    }

    fn occurrence(&self) -> Occurrence {
        Occurrence::InChannel
    }

    no_variance!();
}
