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
    /// Position in the report's list of findings of the cause that this effect belongs to.
    pub finding: usize,
}

impl Effect {
    /// An effect of this kind with its parameters by name.
    pub fn new<'a>(kind: &str, parameters: impl IntoIterator<Item = (&'a str, Parameter)>, evidence: String) -> Self {
        let parameters = parameters.into_iter().map(|(name, parameter)| (name.to_owned(), parameter)).collect();
        Self { kind: kind.to_owned(), parameters, evidence, finding: 0 }
    }
}

/// One cause of what the baseline noise model lacks, with every channel that shows it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Finding {
    /// Such as `sinusoid`, as in [`Effect::kind`].
    pub kind: String,
    /// Names of the channels that show it, in the order of the report.
    pub channels: Vec<String>,
    /// By name, with intervals: those of the channel that shows the cause most clearly.
    pub parameters: BTreeMap<String, Parameter>,
    /// One sentence for the reader: what was measured, against which threshold.
    pub evidence: String,
    /// Whether the model with this cause holds on data that it was not fitted to.
    pub validated: Validation,
    /// By channel: the part of the channel's Allan variance that is due to this cause, in percent, at the averaging time where
    /// it is largest.
    pub share_percent: BTreeMap<String, f64>,
}

/// Whether a finding holds on data that its model was not fitted to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Validation {
    /// The first half shows it, and the second half agrees.
    Yes,
    /// The first half shows it, and the second half contradicts it.
    No,
    /// The first half does not show it, or it cannot show in both halves.
    Untestable,
}

/// An effect that a detector found in the samples of one channel or in their time base.
#[derive(Debug, Clone, PartialEq)]
pub struct Detection {
    /// As reported.
    pub effect: Effect,
    /// What removes the effect from the samples; `None` where nothing can, or where the noise model has a term for it.
    pub correction: Option<Correction>,
}

impl Detection {
    /// The sample periods whose samples become gaps.
    pub(crate) fn excluded(&self) -> &[u64] {
        match &self.correction {
            Some(Correction::Exclude(slots)) => slots,
            _ => &[],
        }
    }
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
