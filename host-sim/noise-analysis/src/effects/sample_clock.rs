//! A sample rate other than the nominal one: the tolerance of the part's oscillator.

use super::kind::{Kind, Occurrence, no_variance};
use crate::bounds::{BoundedEstimate, Parameter};

/// A clock that is off.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ClockDeviation {
    /// By the time stamps.
    pub rate_hz: BoundedEstimate,
    /// As stated, or the nearest usual one.
    pub nominal_hz: f64,
    /// How far they are apart, in standard deviations of an ordinary host's clock.
    pub sigmas: f64,
}

impl Kind for ClockDeviation {
    const NAME: &'static str = "sample_clock";

    fn parameters(&self) -> Vec<(&'static str, Parameter)> {
        vec![("rate_hz", self.rate_hz.parameter("Hz"))]
    }

    fn sizes(&self) -> Vec<BoundedEstimate> {
        Vec::new()
    }

    fn lasting(&self) -> Vec<Option<BoundedEstimate>> {
        vec![Some(self.rate_hz)]
    }

    fn occurrence(&self) -> Occurrence {
        Occurrence::Once
    }

    no_variance!();
}
