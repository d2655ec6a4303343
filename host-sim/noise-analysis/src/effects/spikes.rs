//! Single samples that are farther from what their neighbours tell than chance explains.

use super::kind::{AddedVariance, AveragingTime, Kind, Occurrence, no_course};
use crate::bounds::{BoundedEstimate, ChannelEstimate, Parameter};
use serde::Serialize;

/// Samples that stand out.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Spikes {
    /// 1/h
    #[serde(skip)]
    pub rate_per_hour: BoundedEstimate,
    /// Distance from what the neighbours tell; in front of a filter, of the first sample that it changes from what those before it tell.
    #[serde(skip)]
    pub size: ChannelEstimate,
    /// Number that was found.
    pub count: usize,
    /// Distance from which on a sample is one, in standard deviations of the interpolation.
    pub threshold_sigmas: f64,
    /// The largest distance, in the same.
    pub largest_sigmas: f64,
}

/// Seconds in an hour.
const HOUR_S: f64 = 3600.0;

impl Kind for Spikes {
    const NAME: &'static str = "spikes";

    fn parameters(&self) -> Vec<(&'static str, Parameter)> {
        vec![("rate", self.rate_per_hour.parameter("1/h")), ("size", self.size.parameter())]
    }

    fn sizes(&self) -> Vec<BoundedEstimate> {
        vec![self.rate_per_hour, self.size.estimate()]
    }

    fn lasting(&self) -> Vec<Option<BoundedEstimate>> {
        vec![Some(self.rate_per_hour), Some(self.size.estimate())]
    }

    fn occurrence(&self) -> Occurrence {
        Occurrence::InChannel
    }

    fn avar(&self, at: &AveragingTime) -> AddedVariance {
        // White noise.
        let rate = self.rate_per_hour.value / HOUR_S;
        AddedVariance::corrected(rate * at.period_s * self.size.value.powi(2) / at.n as f64)
    }

    no_course!();
}
