//! Means of equal blocks of a record, and the covariance that white, flicker and random-walk noise give them.
//!
//! The mixture of the three noises is unknown, so the covariances form a grid over the ratios of flicker noise and random
//! walk to white noise. All points of the grid have the same prior probability: a record that holds few periods of the
//! slowest noise leaves many of them possible.

use crate::series::Series;
use nalgebra::{DMatrix, DVector};
use std::f64::consts::{LN_2, PI};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

/// Number of blocks in a record.
pub const BLOCKS: usize = 128;
/// A block with less than this fraction of its samples is left out.
const LEAST_FILL: f64 = 0.25;
/// Fewest slots in a block.
const FEWEST_SLOTS: u64 = 16;
/// Fewest blocks for a regression.
const FEWEST_BLOCKS: usize = BLOCKS / 4;

/// Means of the blocks of a record.
pub struct BlockMeans {
    /// Sample periods in a block.
    pub width: u64,
    /// Numbers of the blocks that are not left out, from 0 on.
    pub numbers: Vec<usize>,
    /// Mean of each of these blocks, in the unit of the series.
    pub means: DVector<f64>,
    /// Fraction of the samples of each that are present.
    pub fills: Vec<f64>,
}

impl BlockMeans {
    /// Averages the series over [`BLOCKS`] blocks; `None` if it has fewer than 16 sample periods a block, too many gaps, or
    /// if its means never change.
    pub fn from_series(series: &Series) -> Option<Self> {
        let width = (series.slots.last()? + 1) / BLOCKS as u64;
        if width < FEWEST_SLOTS {
            return None;
        }
        let (mut sums, mut counts) = (vec![0.0; BLOCKS], vec![0u64; BLOCKS]);
        for (&slot, value) in series.slots.iter().zip(series.values.iter()) {
            // The few samples after the last whole block are left out.
            if let Some(sum) = sums.get_mut((slot / width) as usize) {
                *sum += value;
                counts[(slot / width) as usize] += 1;
            }
        }
        let fill = |number: usize| counts[number] as f64 / width as f64;
        let numbers: Vec<usize> = (0..BLOCKS).filter(|&number| fill(number) >= LEAST_FILL).collect();
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

/// Variances of flicker noise (B²) and of a walk's increment over a block, relative to the white variance of a block's
/// mean: 0, and this number of values from the least on, two to a decade.
const FLICKER: (f64, usize) = (1e-2, 8);
const WALK: (f64, usize) = (1e-5, 16);
/// Fills of blocks are rounded to a multiple of this.
const FILL_STEP: f64 = 1.0 / 64.0;

/// Covariance of block means for one mixture of noises, in units of the white variance, with the mean of the record as an
/// unknown constant.
pub struct NoiseCovariance {
    /// Inverse covariance, projected so that it does not see a constant.
    precision: DMatrix<f64>,
    /// Logarithm of the determinant of the covariance times the information on the constant, as REML has it.
    pub log_determinant: f64,
    /// What it says of a step before each block: the same for every channel with these blocks.
    steps: OnceLock<StepInformation>,
}

/// What a covariance says of a step.
struct StepInformation {
    /// On the size of a step before each block, were it the only regressor.
    of_size: Vec<f64>,
    /// Effective number of independent tests when a step is tried before every block.
    independent: f64,
}

impl NoiseCovariance {
    /// For blocks of these numbers and fills. Noise has the white variance 1 in the mean of a whole block, flicker noise
    /// with B² = `flicker`, and a random walk that grows by the variance `walk` over a block.
    fn power_law(numbers: &[usize], fills: &[f64], flicker: f64, walk: f64) -> Option<Self> {
        let coloured: Vec<f64> = flicker_covariance().iter().map(|covariance| flicker * covariance).collect();
        Self::with_coloured(numbers, fills, &coloured, walk)
    }

    /// As white noise and a random walk with, instead of flicker noise, noise of any covariance: `coloured`, by the distance
    /// of two blocks. `None` if the sum is not positive definite.
    pub fn with_coloured(numbers: &[usize], fills: &[f64], coloured: &[f64], walk: f64) -> Option<Self> {
        let entry = |row: usize, column: usize| {
            let (first, second) = (numbers[row.min(column)], numbers[row.max(column)]);
            // Covariance of the means of a walk over two blocks: its variance in the middle of the earlier block; of a block
            // with itself, at a third of it.
            let walked = if row == column { first as f64 + 1.0 / 3.0 } else { first as f64 + 0.5 };
            let white = if row == column { 1.0 / fills[row] } else { 0.0 };
            white + coloured[second - first] + walk * walked
        };
        let factor = DMatrix::from_fn(numbers.len(), numbers.len(), entry).cholesky()?;
        let log_covariance = 2.0 * factor.l_dirty().diagonal().iter().map(|entry| entry.ln()).sum::<f64>();
        let mut precision = factor.inverse();
        let along = precision.column_sum();
        let constant = along.sum();
        precision.ger(-1.0 / constant, &along, &along, 1.0);
        Some(Self { precision, log_determinant: log_covariance + constant.ln(), steps: OnceLock::new() })
    }

    /// Product of the precision matrix with `values`.
    pub fn weighted(&self, values: &DVector<f64>) -> DVector<f64> {
        &self.precision * values
    }

    /// Product of the precision matrix with every column.
    pub(super) fn weighted_columns(&self, columns: &DMatrix<f64>) -> DMatrix<f64> {
        &self.precision * columns
    }

    /// Information on the size of a step before each block, were it the only regressor.
    pub(super) fn step_information(&self) -> &[f64] {
        &self.steps.get_or_init(|| StepInformation::new(&self.precision)).of_size
    }

    /// Effective number of independent tests when a step is tried before every block: the sum of acos of the correlation
    /// of neighbouring steps, over π.
    pub(super) fn independent_steps(&self) -> f64 {
        self.steps.get_or_init(|| StepInformation::new(&self.precision)).independent
    }
}

impl StepInformation {
    fn new(precision: &DMatrix<f64>) -> Self {
        let size = precision.nrows();
        let mut of_size = vec![0.0; size];
        let mut sum = 0.0;
        for at in (0..size).rev() {
            // The step before block `at` is that before the next block, and block `at` in addition.
            let column = precision.column(at);
            sum += column[at] + 2.0 * column.iter().skip(at + 1).sum::<f64>();
            of_size[at] = sum;
        }
        let between = |at: usize| {
            // Two neighbouring steps differ in one block.
            let shared = 0.5 * (of_size[at] + of_size[at + 1] - precision[(at, at)]);
            let correlation = shared / (of_size[at] * of_size[at + 1]).sqrt();
            if correlation.is_finite() { correlation.clamp(-1.0, 1.0).acos() / PI } else { 0.0 }
        };
        let independent = (1..size - 1).map(between).sum();
        Self { of_size, independent }
    }
}

/// The covariances of all mixtures, for one set of blocks.
pub type NoiseGrid = Arc<Vec<NoiseCovariance>>;

/// The grids of a recording's channels: one for each set of blocks, computed once.
#[derive(Default)]
pub struct NoiseGrids {
    known: Mutex<Vec<(Layout, NoiseGrid)>>,
}

/// Numbers of blocks, and their fills in units of [`FILL_STEP`].
type Layout = (Vec<usize>, Vec<u32>);

impl NoiseGrids {
    /// The grid for these blocks.
    pub fn get(&self, blocks: &BlockMeans) -> NoiseGrid {
        static WITHOUT_GAPS: OnceLock<NoiseGrid> = OnceLock::new();
        let fills: Vec<u32> = blocks.fills.iter().map(|fill| (fill / FILL_STEP).round() as u32).collect();
        let layout = (blocks.numbers.clone(), fills);
        if layout.0.len() == BLOCKS && layout.1.iter().all(|&fill| f64::from(fill) * FILL_STEP == 1.0) {
            return WITHOUT_GAPS.get_or_init(|| noise_grid(&layout)).clone();
        }
        // After a panic elsewhere the list is still valid: entries are added whole.
        let mut known = self.known.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, grid)) = known.iter().find(|(other, _)| *other == layout) {
            return grid.clone();
        }
        let grid = noise_grid(&layout);
        known.push((layout, grid.clone()));
        grid
    }
}

fn noise_grid((numbers, fills): &Layout) -> NoiseGrid {
    let fills: Vec<f64> = fills.iter().map(|&fill| f64::from(fill) * FILL_STEP).collect();
    let values = |(least, count): (f64, usize)| {
        std::iter::once(0.0).chain((0..count).map(move |at| least * 10f64.powf(0.5 * at as f64)))
    };
    let mixtures = values(FLICKER).flat_map(|flicker| values(WALK).map(move |walk| (flicker, walk)));
    let covariance = |(flicker, walk)| NoiseCovariance::power_law(numbers, &fills, flicker, walk);
    Arc::new(mixtures.filter_map(covariance).collect())
}

/// Covariance of the means of two blocks in flicker noise with B = 1, by the distance of the blocks.
///
/// Flicker noise is approximated by Gauss-Markov processes with correlation times an octave apart, each of the variance
/// B²·ln 2/π, from an eighth of a block to four records. Faster ones only add to the white noise.
pub fn flicker_covariance() -> Vec<f64> {
    let mut covariance = vec![0.0; BLOCKS];
    let mut time = 0.125;
    while time <= 4.0 * BLOCKS as f64 {
        for (entry, mean) in covariance.iter_mut().zip(markov_covariance(time)) {
            *entry += LN_2 / PI * mean;
        }
        time *= 2.0;
    }
    covariance
}

/// Covariance of the means of two blocks in a Gauss-Markov process of variance 1 whose correlation time is `time` blocks,
/// by the distance of the blocks.
pub fn markov_covariance(time: f64) -> impl Iterator<Item = f64> {
    let decay = move |blocks: f64| (-blocks / time).exp();
    (0..).map(move |distance: usize| {
        if distance == 0 {
            2.0 * time * (1.0 - time * (1.0 - decay(1.0)))
        } else {
            let distance = distance as f64;
            time * time * (decay(distance - 1.0) - 2.0 * decay(distance) + decay(distance + 1.0))
        }
    })
}
