//! Times and samples at which the noise differs: spikes, louder intervals, changes of the level, motions; and a level that wanders.

use super::kind::{AddedVariance, AveragingTime, Kind, NamedParameter, Occurrence, named};
use crate::bounds::{BoundedEstimate, ChannelEstimate};
use serde::Serialize;

/// Single samples that are farther from what their neighbours tell than chance explains.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Spikes {
    #[serde(skip)]
    pub rate_per_hour: BoundedEstimate,
    /// Distance from what the neighbours tell; in front of a filter, of the first sample that it changes from what those before it tell.
    #[serde(skip)]
    pub size: ChannelEstimate,
    pub count: usize,
    /// Distance from which on a sample is one, in standard deviations of the interpolation.
    pub threshold_sigmas: f64,
    /// The largest distance, in the same.
    pub largest_sigmas: f64,
}

impl Kind for Spikes {
    fn parameters(&self) -> Vec<NamedParameter> {
        vec![
            named("rate", self.rate_per_hour.parameter("1/h")).size().lasting(),
            named("size", self.size.parameter()).size().lasting(),
        ]
    }

    fn avar(&self, at: &AveragingTime) -> AddedVariance {
        const HOUR_S: f64 = 3600.0;
        // White noise.
        let rate = self.rate_per_hour.value / HOUR_S;
        AddedVariance::corrected(rate * at.period_s * self.size.value.powi(2) / at.n as f64)
    }
}

/// A time in which the noise is larger than before and after: a knock.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct NoisyInterval {
    #[serde(skip)]
    pub from_s: BoundedEstimate,
    #[serde(skip)]
    pub to_s: BoundedEstimate,
    /// Deviation of the noise over that of the stretches around it.
    #[serde(skip)]
    pub level: BoundedEstimate,
    /// Averaging time at which the levels are compared, s.
    pub tau_s: f64,
    pub p_value: f64,
    /// Names of the channels that show it at the same time, this one included.
    pub channels: Vec<&'static str>,
}

impl NoisyInterval {
    /// True if it follows or precedes another one at less than the length of the shorter.
    pub(crate) fn is_near(&self, other: &Self) -> bool {
        let length = |of: &Self| of.to_s.value - of.from_s.value;
        let reach = length(self).min(length(other));
        self.from_s.value <= other.to_s.value + reach && other.from_s.value <= self.to_s.value + reach
    }

    /// This one, with its level, from the earlier start to the later end of both.
    pub(crate) fn extended_by(mut self, other: &Self) -> Self {
        if other.from_s.value < self.from_s.value {
            self.from_s = other.from_s;
        }
        if other.to_s.value > self.to_s.value {
            self.to_s = other.to_s;
        }
        let others = other.channels.iter().filter(|name| !self.channels.contains(name));
        self.channels = self.channels.iter().chain(others).copied().collect();
        self
    }
}

impl Kind for NoisyInterval {
    fn parameters(&self) -> Vec<NamedParameter> {
        vec![
            named("from", self.from_s.parameter("s")),
            named("to", self.to_s.parameter("s")),
            named("level", self.level.parameter("")),
        ]
    }

    fn occurrence(&self) -> Occurrence {
        Occurrence::AtTime { from_s: self.from_s.value, to_s: self.to_s.value }
    }

    fn avar(&self, at: &AveragingTime) -> AddedVariance {
        let part = (self.to_s.value - self.from_s.value) / (at.samples as f64 * at.period_s);
        AddedVariance::corrected((self.level.value.powi(2) - 1.0).max(0.0) * part * at.model_avar)
    }
}

/// A level of the noise that becomes another one.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct LevelChange {
    #[serde(skip)]
    pub time_s: BoundedEstimate,
    /// Deviation of the noise after it over that before.
    #[serde(skip)]
    pub ratio: BoundedEstimate,
    /// Part of the changes of the level from block to block that this one explains.
    pub explained: f64,
    pub p_value: f64,
}

impl Kind for LevelChange {
    fn parameters(&self) -> Vec<NamedParameter> {
        vec![named("time", self.time_s.parameter("s")), named("ratio", self.ratio.parameter(""))]
    }

    fn occurrence(&self) -> Occurrence {
        Occurrence::AtTime { from_s: self.time_s.low, to_s: self.time_s.high }
    }

    fn avar(&self, at: &AveragingTime) -> AddedVariance {
        // The excess of the louder part over the quieter one; the model has the mean of both.
        let before = (self.time_s.value / (at.samples as f64 * at.period_s)).clamp(0.0, 1.0);
        let ratio = self.ratio.value.powi(2);
        let mean = before + (1.0 - before) * ratio;
        AddedVariance::modelled((1.0 - ratio.min(1.0) / mean) * at.model_avar)
    }
}

/// A level of the noise that grows and falls all the time: its logarithm is a Gauss-Markov process.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct WanderingLevel {
    /// Standard deviation of the logarithm of the noise's deviation.
    #[serde(skip)]
    pub deviation: BoundedEstimate,
    /// Time in which the correlation of the level falls to 1/e, s; at most the length of the record.
    #[serde(skip)]
    pub time_constant_s: BoundedEstimate,
    /// Probability of as high a correlation of the levels of blocks with later ones by chance.
    pub p_value: f64,
}

impl Kind for WanderingLevel {
    fn parameters(&self) -> Vec<NamedParameter> {
        vec![
            named("deviation", self.deviation.scaled(100.0).parameter("%")).size().lasting(),
            named("time_constant", self.time_constant_s.parameter("s")).lasting(),
        ]
    }

    fn avar(&self, at: &AveragingTime) -> AddedVariance {
        // The mean of a log-normal variance over its median: the model has the mean.
        let over_median = -(-2.0 * self.deviation.value.powi(2)).exp_m1();
        AddedVariance::modelled(over_median * at.model_avar)
    }
}

/// A motion of the platform, by which a channel goes farther than the biases of parts differ.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct MotionInterval {
    /// Beginning of the first stretch, s from the first sample.
    #[serde(skip)]
    pub from_s: BoundedEstimate,
    /// End of the last one, s.
    #[serde(skip)]
    pub to_s: BoundedEstimate,
    /// Largest distance of the mean of a second from the median.
    #[serde(skip)]
    pub size: ChannelEstimate,
    pub scale: MotionScale,
    pub stretches: usize,
    /// Their length together, s.
    pub moved_s: usize,
}

/// The distance that the mean of a second of a channel at rest may have from the median.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum MotionScale {
    /// Scatter of the biases of parts (1 σ) by the data sheet, in the unit of the channel.
    BiasError(f64),
    /// The scatter of the channel's own means of a second (1 σ), where no data sheet is known, in the unit of the channel.
    Scatter(f64),
}

impl Kind for MotionInterval {
    fn parameters(&self) -> Vec<NamedParameter> {
        vec![
            named("from", self.from_s.parameter("s")),
            named("to", self.to_s.parameter("s")),
            named("size", self.size.parameter()).size(),
        ]
    }

    fn occurrence(&self) -> Occurrence {
        Occurrence::AtTime { from_s: self.from_s.value, to_s: self.to_s.value }
    }
}
