//! Plain data that every later stage passes on: estimates with their bounds, an effect that was found, and the correction
//! that removes an effect from the samples.

use serde::Serialize;
use std::collections::BTreeMap;

/// Highest probability that chance alone produces a [`Detection`] anywhere in the record of one channel.
pub const SIGNIFICANCE: f64 = 2e-4;

/// An estimate with its standard deviation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MeasuredValue {
    /// Likeliest value.
    pub value: f64,
    /// Standard deviation, in the unit of the value.
    pub error: f64,
}

/// An estimate with its 95 % bounds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BoundedEstimate {
    /// Likeliest value.
    pub value: f64,
    /// Lower 95 % bound.
    pub low: f64,
    /// Upper 95 % bound.
    pub high: f64,
}

/// An estimated number with its 95 % bounds. A term that the data does not show has the value and the lower bound 0.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Parameter {
    /// Estimate.
    pub value: f64,
    /// Lower 95 % bound.
    pub low: f64,
    /// Upper 95 % bound.
    pub high: f64,
    /// Unit of all three.
    pub unit: String,
}

impl Parameter {
    /// `value` between `low` and `high`, all three in `unit`.
    pub fn new(value: f64, low: f64, high: f64, unit: impl Into<String>) -> Self {
        Self { value, low, high, unit: unit.into() }
    }
}

/// An effect beyond the baseline noise model, as it is reported.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Effect {
    /// Such as `sinusoid`.
    pub kind: String,
    /// By name, with intervals.
    pub parameters: BTreeMap<String, Parameter>,
    /// One sentence for the reader: what was measured, against which threshold, and the usual causes.
    pub evidence: String,
}

impl Effect {
    /// An effect of this kind with its parameters by name.
    pub fn new<'a>(kind: &str, parameters: impl IntoIterator<Item = (&'a str, Parameter)>, evidence: String) -> Self {
        let parameters = parameters.into_iter().map(|(name, parameter)| (name.to_owned(), parameter)).collect();
        Self { kind: kind.to_owned(), parameters, evidence }
    }
}

/// An effect that a detector found in the samples of one channel or in their time base.
#[derive(Debug, Clone, PartialEq)]
pub struct Detection {
    /// As reported.
    pub effect: Effect,
    /// What removes the effect from the samples; `None` where nothing can, or where the noise model has a term for it.
    pub correction: Option<Correction>,
}

/// What removes an effect from a channel's samples.
#[derive(Debug, Clone, PartialEq)]
pub enum Correction {
    /// The samples of these sample periods, in ascending order, become gaps.
    Exclude(Vec<u64>),
    /// `size` is subtracted from the sample of the sample period `from` and from all after it.
    Offset {
        /// Sample period, counted as in the series.
        from: u64,
        /// In the unit of the series.
        size: f64,
    },
}
