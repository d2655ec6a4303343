//! Vibration rectification: a bias that follows the variance of an acceleration.

use super::bias_response::{BiasResponse, Course, FRACTIONS, interval};
use super::block_means::BlockMeans;
use super::gls_regression::RegressionEstimate;
use crate::effects::VibrationRectification;
use crate::samples::series::Series;
use nalgebra::DVector;

/// Fewest samples of a variance; it scatters by √(2/16).
const FEWEST: u64 = 16;
/// Least ratio of the variance between blocks; a smaller range resembles any drift.
const LEAST_CHANGE: f64 = 2.0;
/// Least vibration in equally shaken blocks; a shorter one is a knock.
const FEWEST_BLOCKS: f64 = 4.0;

#[derive(Debug, Clone, Copy)]
pub(crate) struct Acceleration<'a> {
    pub name: &'static str,
    pub series: &'a Series,
    /// Variance within each value of the series, by its sample period; empty if it has samples.
    pub variances: &'a [f64],
    /// Largest possible sensitivity, in the shaken channel's unit over g²; `None` if unknown.
    pub largest: Option<f64>,
}

/// The sensitivity at which the nonlinear part equals the linear one at full scale of both ranges.
pub(crate) fn largest_sensitivity(range: Option<f64>, of_acceleration: Option<f64>) -> Option<f64> {
    Some(range? / of_acceleration?.powi(2))
}

/// The variance of an acceleration over the record.
pub(super) struct Vibration<'a> {
    acceleration: Acceleration<'a>,
    course: Course,
}

impl<'a> Vibration<'a> {
    /// `None` if it does not change, or only for a moment.
    pub(super) fn new(acceleration: Acceleration<'a>, blocks: &BlockMeans) -> Option<Self> {
        let width = (blocks.width / FRACTIONS).max(FEWEST).min(blocks.width);
        let course = Course { width, values: variances(acceleration, width)? };
        let in_blocks = course.in_blocks(blocks);
        let above: Vec<f64> = in_blocks.iter().map(|value| value - in_blocks.min()).collect();
        let (sum, squares) = above.iter().fold((0.0, 0.0), |(sum, squares), of| (sum + of, squares + of * of));
        let is_changing = in_blocks.max() > LEAST_CHANGE * in_blocks.min() && sum * sum > FEWEST_BLOCKS * squares;
        is_changing.then_some(Self { acceleration, course })
    }

    pub(super) fn regressor(&self, blocks: &BlockMeans) -> DVector<f64> {
        self.course.in_blocks(blocks)
    }

    pub(super) fn is_possible(&self, sensitivity: f64) -> bool {
        self.acceleration.largest.is_none_or(|largest| sensitivity.abs() <= largest)
    }

    pub(super) fn response(&self, estimate: &RegressionEstimate, unit: &'static str) -> BiasResponse {
        let Acceleration { name, series, .. } = self.acceleration;
        let effect = VibrationRectification {
            sensitivity: interval(estimate, unit),
            per: series.unit,
            accelerometer: name,
            strongest: self.course.values.iter().copied().fold(0.0, f64::max).sqrt(),
            p_value: estimate.p_value,
            response: self.course.variance(estimate.size, series.period_s),
        };
        self.course.response(estimate.size, effect.into())
    }
}

/// Variance per `width` sample periods; the one before if fewer than half of the samples are there.
fn variances(Acceleration { series, variances, .. }: Acceleration, width: u64) -> Option<Vec<f64>> {
    let count = usize::try_from(series.slots.last()? / width + 1).ok()?;
    // Sums about a near value, against cancellation.
    let origin = *series.values.first()?;
    let mut sums = vec![(0.0, 0.0, 0.0, 0.0); count];
    for (&slot, value) in series.slots.iter().zip(series.values.iter()) {
        let (sum, squares, within, count) = &mut sums[(slot / width) as usize];
        let value = value - origin;
        (*sum, *squares, *count) = (*sum + value, *squares + value * value, *count + 1.0);
        *within += variances.get(slot as usize).copied().unwrap_or(0.0);
    }
    let variance = |&(sum, squares, within, count): &(f64, f64, f64, f64)| {
        (2.0 * count >= width as f64).then(|| ((squares - sum * sum / count) / (count - 1.0)).max(0.0) + within / count)
    };
    let known: Vec<Option<f64>> = sums.iter().map(variance).collect();
    let mut last = known.iter().flatten().next().copied()?;
    let filled = known.into_iter().map(|variance| {
        last = variance.unwrap_or(last);
        last
    });
    Some(filled.collect())
}
