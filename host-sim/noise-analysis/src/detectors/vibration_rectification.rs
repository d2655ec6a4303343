//! The bias that vibration makes: a transducer that is not quite linear turns a part of an alternating acceleration into a
//! constant, which grows with the square of the amplitude. The bias follows the variance of the acceleration.

use super::bias_response::{BiasResponse, Course, FRACTIONS, interval};
use super::block_means::BlockMeans;
use super::gls_regression::RegressionEstimate;
use crate::effects::VibrationRectification;
use crate::samples::series::Series;
use nalgebra::DVector;

/// Fewest samples of which a variance is taken: it then scatters by a third of itself, √(2/16).
const FEWEST: u64 = 16;
/// By which factor the variance has to change between blocks at least. In a smaller range it is no better a clock of the record
/// than any drift.
const LEAST_CHANGE: f64 = 2.0;
/// Number of equally shaken blocks that the vibration has to be worth: what is shorter is a knock.
const FEWEST_BLOCKS: f64 = 4.0;

/// An acceleration that may shake a channel.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Acceleration<'a> {
    pub name: &'static str,
    /// With its knocks, which may be vibration.
    pub series: &'a Series,
    /// Largest sensitivity that a transducer can have, in the unit of the shaken channel over g²; `None` where it is not known.
    pub largest: Option<f64>,
}

/// The largest sensitivity of a channel with `range` to the variance of an acceleration with the range `of_acceleration`: at
/// full scale what is not linear stays below what is linear.
pub(crate) fn largest_sensitivity(range: Option<f64>, of_acceleration: Option<f64>) -> Option<f64> {
    Some(range? / of_acceleration?.powi(2))
}

/// The variance of an acceleration over the record.
pub(super) struct Vibration<'a> {
    acceleration: Acceleration<'a>,
    course: Course,
}

impl<'a> Vibration<'a> {
    /// `None` where it does not change, or only for a moment.
    pub(super) fn new(acceleration: Acceleration<'a>, blocks: &BlockMeans) -> Option<Self> {
        let width = (blocks.width / FRACTIONS).max(FEWEST).min(blocks.width);
        let course = Course { width, values: variances(acceleration.series, width)? };
        let in_blocks = course.in_blocks(blocks);
        let above: Vec<f64> = in_blocks.iter().map(|value| value - in_blocks.min()).collect();
        let (sum, squares) = above.iter().fold((0.0, 0.0), |(sum, squares), of| (sum + of, squares + of * of));
        let is_changing = in_blocks.max() > LEAST_CHANGE * in_blocks.min() && sum * sum > FEWEST_BLOCKS * squares;
        is_changing.then_some(Self { acceleration, course })
    }

    /// Block means of the variance.
    pub(super) fn regressor(&self, blocks: &BlockMeans) -> DVector<f64> {
        self.course.in_blocks(blocks)
    }

    /// Whether a transducer can have this sensitivity.
    pub(super) fn is_possible(&self, sensitivity: f64) -> bool {
        self.acceleration.largest.is_none_or(|largest| sensitivity.abs() <= largest)
    }

    /// The response of a bias in `unit`.
    pub(super) fn response(&self, estimate: &RegressionEstimate, unit: &'static str) -> BiasResponse {
        let Acceleration { name, series, .. } = self.acceleration;
        let effect = VibrationRectification {
            sensitivity: interval(estimate, unit),
            per: series.unit,
            accelerometer: name,
            strongest: self.course.values.iter().copied().fold(0.0, f64::max).sqrt(),
            p_value: estimate.p_value,
            response: self.course.variance(estimate.size),
        };
        self.course.response(estimate.size, effect.into())
    }
}

/// Variance of the samples of each stretch of `width` sample periods around their mean; that of the stretch before where one
/// has fewer than half of its samples. `None` if all have.
fn variances(series: &Series, width: u64) -> Option<Vec<f64>> {
    let count = usize::try_from(series.slots.last()? / width + 1).ok()?;
    // Sums of the values and of their squares about a value near all of them, and their number.
    let origin = *series.values.first()?;
    let mut sums = vec![(0.0, 0.0, 0.0); count];
    for (&slot, value) in series.slots.iter().zip(series.values.iter()) {
        let (sum, squares, count) = &mut sums[(slot / width) as usize];
        let value = value - origin;
        (*sum, *squares, *count) = (*sum + value, *squares + value * value, *count + 1.0);
    }
    let variance = |&(sum, squares, count): &(f64, f64, f64)| {
        (2.0 * count >= width as f64).then(|| ((squares - sum * sum / count) / (count - 1.0)).max(0.0))
    };
    let known: Vec<Option<f64>> = sums.iter().map(variance).collect();
    let mut last = known.iter().flatten().next().copied()?;
    let filled = known.into_iter().map(|variance| {
        last = variance.unwrap_or(last);
        last
    });
    Some(filled.collect())
}
