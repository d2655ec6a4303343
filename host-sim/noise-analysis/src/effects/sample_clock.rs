//! A sample rate other than the nominal one, the tolerance of the part's oscillator, or one that becomes another one.

use super::kind::{Kind, Occurrence, no_variance};
use crate::bounds::{BoundedEstimate, Parameter};
use serde::Serialize;

/// A clock that is off, or that changes its rate.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ClockDeviation {
    /// By the time stamps of the whole record.
    #[serde(skip)]
    pub rate_hz: BoundedEstimate,
    /// As stated, or the nearest usual one.
    pub nominal_hz: f64,
    /// How far they are apart, in standard deviations of an ordinary host's clock.
    pub sigmas: f64,
    /// A rate that becomes another one.
    pub change: Option<RateChange>,
}

/// A change of the sample rate at one time.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct RateChange {
    /// When, s from the first sample.
    #[serde(skip)]
    pub time_s: BoundedEstimate,
    /// The rate before it.
    #[serde(skip)]
    pub before_hz: BoundedEstimate,
    /// The rate after it.
    #[serde(skip)]
    pub after_hz: BoundedEstimate,
    /// Their difference in standard deviations.
    pub sigmas: f64,
}

impl Kind for ClockDeviation {
    const NAME: &'static str = "sample_clock";

    fn parameters(&self) -> Vec<(&'static str, Parameter)> {
        let mut parameters = vec![("rate_hz", self.rate_hz.parameter("Hz"))];
        if let Some(RateChange { time_s, before_hz, after_hz, .. }) = self.change {
            parameters.push(("change_time", time_s.parameter("s")));
            parameters.push(("rate_before_hz", before_hz.parameter("Hz")));
            parameters.push(("rate_after_hz", after_hz.parameter("Hz")));
        }
        parameters
    }

    fn sizes(&self) -> Vec<BoundedEstimate> {
        Vec::new()
    }

    fn lasting(&self) -> Vec<Option<BoundedEstimate>> {
        // A change of the rate happens once.
        if self.change.is_some() { Vec::new() } else { vec![Some(self.rate_hz)] }
    }

    fn occurrence(&self) -> Occurrence {
        Occurrence::Once
    }

    no_variance!();
}
