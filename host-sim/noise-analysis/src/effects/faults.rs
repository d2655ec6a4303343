//! Faults of sampling and of the output: lost and repeated samples, the clock, values at a limit or stuck.

use super::kind::{Kind, NamedParameter, Occurrence, named};
use crate::bounds::{BoundedEstimate, ChannelEstimate};
use serde::Serialize;

/// Samples that never arrived: the sample indices or time stamps have room for them.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct DroppedSamples {
    /// Part of all samples.
    #[serde(skip)]
    pub fraction: BoundedEstimate,
    pub missing: f64,
    /// Number of all samples, those that were used and those that were dropped.
    pub samples: f64,
    pub gaps: usize,
}

impl Kind for DroppedSamples {
    fn parameters(&self) -> Vec<NamedParameter> {
        vec![named("fraction", self.fraction.parameter("")).lasting()]
    }

    fn occurrence(&self) -> Occurrence {
        Occurrence::Once
    }
}

/// Samples that equal the one before in all channels: a register that is read before it is renewed.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct RepeatedSamples {
    /// Part of all samples.
    #[serde(skip)]
    pub fraction: BoundedEstimate,
    pub equal: u64,
    pub samples: f64,
    /// Most samples that chance makes equal.
    pub by_chance: f64,
    pub channels: usize,
}

impl Kind for RepeatedSamples {
    fn parameters(&self) -> Vec<NamedParameter> {
        vec![named("fraction", self.fraction.parameter("")).lasting()]
    }

    fn occurrence(&self) -> Occurrence {
        Occurrence::Once
    }
}

/// A sample rate other than the nominal one, the tolerance of the part's oscillator, or one that becomes another one.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ClockDeviation {
    /// By the time stamps of the whole record.
    #[serde(skip)]
    pub rate_hz: BoundedEstimate,
    /// As stated, or the nearest usual one.
    pub nominal_hz: f64,
    /// Distance of both rates in standard deviations of an ordinary host's clock.
    pub sigmas: f64,
    pub change: Option<RateChange>,
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct RateChange {
    #[serde(skip)]
    pub time_s: BoundedEstimate,
    #[serde(skip)]
    pub before_hz: BoundedEstimate,
    #[serde(skip)]
    pub after_hz: BoundedEstimate,
    /// Their difference in standard deviations.
    pub sigmas: f64,
}

impl Kind for ClockDeviation {
    fn parameters(&self) -> Vec<NamedParameter> {
        let rate = named("rate_hz", self.rate_hz.parameter("Hz"));
        // A change of the rate happens once.
        let Some(change) = self.change else { return vec![rate.lasting()] };
        vec![
            rate,
            named("change_time", change.time_s.parameter("s")),
            named("rate_before_hz", change.before_hz.parameter("Hz")),
            named("rate_after_hz", change.after_hz.parameter("Hz")),
        ]
    }

    fn occurrence(&self) -> Occurrence {
        Occurrence::Once
    }
}

/// Values that are cut off: at an end of the range, or at another limit.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Saturation {
    /// Part of the samples that lie at a limit.
    #[serde(skip)]
    pub fraction: BoundedEstimate,
    /// The limit with the most samples; it is exact.
    #[serde(skip)]
    pub level: ChannelEstimate,
    pub is_end_of_range: bool,
    pub cut_off: f64,
    pub samples: f64,
    /// Most samples that have another value in common.
    pub most_of_others: u64,
}

impl Kind for Saturation {
    fn parameters(&self) -> Vec<NamedParameter> {
        vec![named("share", self.fraction.parameter("")), named("level", self.level.parameter()).size()]
    }
}

/// An output that stays at one value.
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
    pub runs: u64,
    pub stuck: u64,
    pub samples: u64,
}

impl Kind for StuckOutput {
    fn parameters(&self) -> Vec<NamedParameter> {
        vec![
            named("share", self.fraction.parameter("")),
            named("from", self.from_s.parameter("s")),
            named("to", self.to_s.parameter("s")),
        ]
    }

    fn occurrence(&self) -> Occurrence {
        Occurrence::AtTime { from_s: self.from_s.low, to_s: self.to_s.high }
    }
}
