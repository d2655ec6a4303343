//! Findings: an effect with the correction that removes it from the samples, and the causes that a report lists.

use crate::effects::Effect;
use serde::ser::SerializeStruct;
use serde::{Serialize, Serializer};
use std::collections::BTreeMap;

/// Highest probability that chance alone gives a name anywhere in the record of a channel: of six channels and a dozen kinds of effects it
/// gives one in 1 of 700 recordings.
pub const SIGNIFICANCE: f64 = 2e-5;
/// Highest probability that chance alone refutes a model or a shape that is true.
pub const REFUTED: f64 = 2e-4;
/// Likelihood ratio of two classes from which one of them is named: 95 % if they are as frequent.
pub const TOLD_APART: f64 = 19.0;

#[derive(Debug, Clone, PartialEq)]
pub struct ChannelEffect {
    pub effect: Effect,
    /// Position of the cause in the report's list of findings.
    pub finding: usize,
}

impl Serialize for ChannelEffect {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut written = serializer.serialize_struct("ChannelEffect", 4)?;
        written.serialize_field("kind", self.effect.name())?;
        written.serialize_field("parameters", &self.effect.parameters())?;
        written.serialize_field("evidence", &self.effect)?;
        written.serialize_field("finding", &self.finding)?;
        written.end()
    }
}

/// One cause of what the baseline noise model lacks, with every channel that shows it.
#[derive(Debug, Clone, PartialEq)]
pub struct Finding {
    /// The effect in the channel that shows it most clearly.
    pub effect: Effect,
    /// Names of the channels that show it, in the order of the report.
    pub channels: Vec<String>,
    /// Position in `channels` of the one that shows it most clearly.
    pub clearest: usize,
    pub validated: Validation,
    /// By channel: the part of its Allan variance that is due to this cause, in percent, at the averaging time where it is largest.
    pub share_percent: BTreeMap<String, f64>,
    /// By channel: that part at the octave next to a minute, the part of the variance of an angle or a velocity that was integrated for so
    /// long. Without the channels of records below some eight minutes.
    pub minute_percent: BTreeMap<String, f64>,
}

/// The test of a finding on data that its model was not fitted to.
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
    pub effect: Effect,
    /// Removes the effect from the samples; `None` if nothing can, or if the noise model has a term for it.
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
