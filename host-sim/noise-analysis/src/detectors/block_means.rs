//! Means of equal blocks of a record.

use crate::samples::series::Series;
use nalgebra::DVector;

pub const BLOCKS: usize = 128;
const LEAST_FILL: f64 = 0.25;
const FEWEST_SLOTS: u64 = 16;
const FEWEST_BLOCKS: usize = BLOCKS / 4;

/// Least change of a mean, in steps of the resolution: smaller ones are rounding errors of floats.
const LEAST_CHANGE: f64 = 1e-6;

pub struct BlockMeans {
    pub width: u64,
    pub numbers: Vec<usize>,
    pub means: DVector<f64>,
    pub fills: Vec<f64>,
}

impl BlockMeans {
    /// `None` with fewer than 16 sample periods a block, with too many gaps, or if the means never change.
    pub fn from_series(series: &Series) -> Option<Self> {
        let width = (series.slots.last()? + 1) / BLOCKS as u64;
        if width < FEWEST_SLOTS {
            return None;
        }
        // The few samples after the last whole block are left out.
        let sums = series.sums_of_blocks(0, width);
        let fill = |number: usize| sums[number].1 as f64 / width as f64;
        let numbers: Vec<usize> = (0..BLOCKS).filter(|&number| fill(number) >= LEAST_FILL).collect();
        let means =
            DVector::from_iterator(numbers.len(), numbers.iter().map(|&number| sums[number].0 / sums[number].1 as f64));
        let least = LEAST_CHANGE * series.resolution;
        let changes = means.iter().any(|mean| (mean - means[0]).abs() > least);
        (numbers.len() >= FEWEST_BLOCKS && changes).then(|| Self {
            width,
            means,
            fills: numbers.iter().map(|&number| fill(number)).collect(),
            numbers,
        })
    }

    /// Regressor of a ramp: means of a bias that rises by 1 from one block to the next.
    pub fn ramp(&self) -> DVector<f64> {
        DVector::from_iterator(self.numbers.len(), self.numbers.iter().map(|&number| number as f64))
    }

    /// Regressor of a step of 1 at `slot`: the fraction of each block that lies at or after it.
    pub fn step_at(&self, slot: u64) -> DVector<f64> {
        let after = |&number: &usize| {
            let start = number as u64 * self.width;
            1.0 - (slot.saturating_sub(start)).min(self.width) as f64 / self.width as f64
        };
        DVector::from_iterator(self.numbers.len(), self.numbers.iter().map(after))
    }
}
