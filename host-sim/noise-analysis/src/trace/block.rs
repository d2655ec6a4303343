//! Means of equal stretches of a record.

use super::Series;
use nalgebra::DVector;

/// Stretches of a record.
pub const BLOCKS: usize = 128;
/// A block with fewer than this part of its samples is left out.
const FILLED: f64 = 0.25;
/// Fewest samples that a whole block holds.
const FEWEST: u64 = 16;
/// Filled blocks without which nothing is said.
const FEWEST_BLOCKS: usize = BLOCKS / 4;

/// Blocks of a record.
pub struct Blocks {
    /// Slots in a block.
    pub width: u64,
    /// The blocks that are filled, by number.
    pub numbers: Vec<usize>,
    /// Mean of each.
    pub means: DVector<f64>,
    /// Filled part of each.
    pub fills: Vec<f64>,
}

impl Blocks {
    /// `None` if the record is too short, has too many gaps, or never changes.
    pub fn of(series: &Series) -> Option<Self> {
        let width = (series.slots.last()? + 1) / BLOCKS as u64;
        if width < FEWEST {
            return None;
        }
        let (mut sums, mut counts) = (vec![0.0; BLOCKS], vec![0u64; BLOCKS]);
        for (&slot, value) in series.slots.iter().zip(&series.values) {
            // The few samples after the last whole block are left out.
            if let Some(sum) = sums.get_mut((slot / width) as usize) {
                *sum += value;
                counts[(slot / width) as usize] += 1;
            }
        }
        let fill = |number: usize| counts[number] as f64 / width as f64;
        let numbers: Vec<usize> = (0..BLOCKS).filter(|&number| fill(number) >= FILLED).collect();
        let means =
            DVector::from_iterator(numbers.len(), numbers.iter().map(|&number| sums[number] / counts[number] as f64));
        let changes = means.iter().any(|mean| *mean != means[0]);
        (numbers.len() >= FEWEST_BLOCKS && changes).then(|| Self {
            width,
            means,
            fills: numbers.iter().map(|&number| fill(number)).collect(),
            numbers,
        })
    }

    /// A level that moves by 1 from one block to the next.
    pub fn ramp(&self) -> DVector<f64> {
        DVector::from_iterator(self.numbers.len(), self.numbers.iter().map(|&number| number as f64))
    }

    /// The part of each block that lies at or after `slot`.
    pub fn step_at(&self, slot: u64) -> DVector<f64> {
        let after = |&number: &usize| {
            let start = number as u64 * self.width;
            1.0 - (slot.saturating_sub(start)).min(self.width) as f64 / self.width as f64
        };
        DVector::from_iterator(self.numbers.len(), self.numbers.iter().map(after))
    }
}
