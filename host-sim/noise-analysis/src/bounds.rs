//! Estimates with their errors or bounds.

use crate::distributions::NORMAL_975;
use serde::{Deserialize, Deserializer, Serialize};

/// An estimate with its standard deviation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MeasuredValue {
    /// Likeliest value.
    pub value: f64,
    /// Standard deviation, in the unit of the value.
    pub error: f64,
}

impl MeasuredValue {
    /// The 95 % bounds of a normal distribution, for a quantity that is not negative.
    pub(crate) fn bounds(self) -> BoundedEstimate {
        let half = NORMAL_975 * self.error;
        BoundedEstimate::new(self.value, (self.value - half).max(0.0), self.value + half)
    }
}

/// An estimate with its 95 % bounds.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct BoundedEstimate {
    /// Likeliest value.
    pub value: f64,
    pub low: f64,
    pub high: f64,
}

/// An estimate with its 95 % bounds, in the unit of a channel, or in that over another unit, which the name of the field says.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ChannelEstimate {
    pub value: f64,
    pub low: f64,
    pub high: f64,
    /// Unit of the channel, such as `deg/s`.
    pub unit: &'static str,
}

/// An estimated number with its 95 % bounds, as a report lists it. A term that the data does not show has the value and the lower bound 0.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Parameter {
    pub value: f64,
    pub low: f64,
    /// Upper 95 % bound; infinite if unknown.
    #[serde(deserialize_with = "unbounded")]
    pub high: f64,
    pub unit: String,
}

/// JSON has `null` for infinity.
pub(crate) fn unbounded<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
    Ok(Option::deserialize(deserializer)?.unwrap_or(f64::INFINITY))
}

impl BoundedEstimate {
    #[must_use]
    pub const fn new(value: f64, low: f64, high: f64) -> Self {
        Self { value, low, high }
    }

    /// A value that is known.
    #[must_use]
    pub const fn exact(value: f64) -> Self {
        Self::new(value, value, value)
    }

    #[must_use]
    pub fn parameter(self, unit: impl Into<String>) -> Parameter {
        Parameter::new(self.value, self.low, self.high, unit)
    }

    #[must_use]
    pub const fn in_unit(self, unit: &'static str) -> ChannelEstimate {
        ChannelEstimate { value: self.value, low: self.low, high: self.high, unit }
    }

    /// One over it; nothing bounds it from above where it may be 0.
    #[must_use]
    pub fn inverse(self) -> Self {
        Self::new(1.0 / self.value, 1.0 / self.high, 1.0 / self.low)
    }

    /// The standard deviation of a normal distribution with these bounds.
    pub(crate) fn error(self) -> f64 {
        (self.high - self.low) / (2.0 * NORMAL_975)
    }

    /// All three times `factor`, which is positive.
    #[must_use]
    pub fn scaled(self, factor: f64) -> Self {
        Self::new(factor * self.value, factor * self.low, factor * self.high)
    }
}

impl ChannelEstimate {
    /// Without the unit.
    #[must_use]
    pub const fn estimate(self) -> BoundedEstimate {
        BoundedEstimate::new(self.value, self.low, self.high)
    }

    /// The standard deviation of a normal distribution with these bounds.
    pub(crate) fn error(self) -> f64 {
        self.estimate().error()
    }

    #[must_use]
    pub fn parameter(self) -> Parameter {
        self.estimate().parameter(self.unit)
    }

    #[must_use]
    pub fn parameter_per(self, per: &str) -> Parameter {
        self.estimate().parameter(format!("{}/{per}", self.unit))
    }

    /// All three times `factor`, which is positive.
    #[must_use]
    pub fn scaled(self, factor: f64) -> Self {
        self.estimate().scaled(factor).in_unit(self.unit)
    }
}

impl Parameter {
    pub fn new(value: f64, low: f64, high: f64, unit: impl Into<String>) -> Self {
        Self { value, low, high, unit: unit.into() }
    }

    #[must_use]
    pub const fn estimate(&self) -> BoundedEstimate {
        BoundedEstimate::new(self.value, self.low, self.high)
    }
}
