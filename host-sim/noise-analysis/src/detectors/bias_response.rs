//! A bias that follows a measured course, and its correction of the samples.

use super::block_means::BlockMeans;
use super::gls_regression::RegressionEstimate;
use crate::bounds::{BoundedEstimate, ChannelEstimate};
use crate::distributions::NORMAL_975;
use crate::effects::{Effect, ResponseVariance};
use nalgebra::DVector;

pub(super) const FRACTIONS: u64 = 32;

/// A quantity over the record: one value per `width` sample periods.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Course {
    pub width: u64,
    pub values: Vec<f64>,
}

#[derive(Debug, Clone, PartialEq)]
pub(crate) struct BiasResponse {
    pub effect: Effect,
    bias: Course,
}

impl Course {
    pub(super) fn in_blocks(&self, blocks: &BlockMeans) -> DVector<f64> {
        let size = (blocks.width as f64 / self.width as f64).max(1.0);
        let mean = |&number: &usize| {
            let end = |block: usize| ((block as f64 * size).round() as usize).min(self.values.len());
            let within = &self.values[end(number).min(self.values.len() - 1)..end(number + 1)];
            if within.is_empty() {
                self.values[self.values.len() - 1]
            } else {
                within.iter().sum::<f64>() / within.len() as f64
            }
        };
        DVector::from_iterator(blocks.numbers.len(), blocks.numbers.iter().map(mean))
    }

    /// Interpolated in the sample period `slot`.
    pub(super) fn at(&self, slot: u64) -> f64 {
        let Self { width, values } = self;
        let place = (slot as f64 / *width as f64 - 0.5).clamp(0.0, (values.len() - 1) as f64);
        let before = place.floor() as usize;
        let after = (before + 1).min(values.len() - 1);
        let part = place - before as f64;
        values[before] * (1.0 - part) + values[after] * part
    }

    pub(super) fn mean(&self) -> f64 {
        self.values.iter().sum::<f64>() / self.values.len() as f64
    }

    /// Allan variance of the bias that follows the course with `sensitivity`, of which a sample period takes `period_s`.
    pub(super) fn variance(&self, sensitivity: f64, period_s: f64) -> ResponseVariance {
        let values: Vec<f64> = self.values.iter().map(|value| sensitivity * value).collect();
        ResponseVariance::from_means(&values, self.width, period_s)
    }

    /// Bias that follows the course with `sensitivity`; 0 at the course's mean.
    pub(super) fn response(&self, sensitivity: f64, effect: Effect) -> BiasResponse {
        let mean = self.mean();
        let values = self.values.iter().map(|value| sensitivity * (value - mean)).collect();
        BiasResponse { effect, bias: Course { width: self.width, values } }
    }
}

impl BiasResponse {
    /// The bias in the sample period `slot`, in the channel's unit; 0 at the mean of what it follows.
    pub(crate) fn bias(&self, slot: u64) -> f64 {
        self.bias.at(slot)
    }
}

pub(super) fn interval(of: &RegressionEstimate, unit: &'static str) -> ChannelEstimate {
    let half = NORMAL_975 * of.error;
    BoundedEstimate::new(of.size, of.size - half, of.size + half).in_unit(unit)
}
