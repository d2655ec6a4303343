//! Noise of block means whose mixture nobody knows: white, flicker and random walk, in any ratio.
//!
//! The ratios are a logarithmic grid, each as likely as any other before the data are seen; a record of few periods of
//! the slowest noise leaves many of them possible, and what is said of a shape in it is said over all of these.

use super::block::{BLOCKS, Blocks};
use nalgebra::{DMatrix, DVector};
use std::f64::consts::{LN_2, PI};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

/// Variance of flicker noise (B²) and of a walk's step over a block, relative to the white variance of a block's mean: 0,
/// and so many values from the least on, two to a decade.
const FLICKER: (f64, usize) = (1e-2, 8);
const WALK: (f64, usize) = (1e-5, 16);
/// Filled parts of blocks are told apart to this.
const FILL: f64 = 1.0 / 64.0;

/// One mixture, as what it makes of the means of blocks.
pub struct Noise {
    /// Inverse covariance, less what the level takes that nobody knows: for a white variance of 1.
    precision: DMatrix<f64>,
    /// Logarithm of the determinant of the covariance and of the information on the level.
    pub log_determinant: f64,
}

impl Noise {
    /// For blocks of these numbers and fills, in noise of white variance 1 for the mean of a whole block, of flicker with
    /// `flicker` = B², and of a walk that grows by the variance `walk` over a block.
    pub fn of(numbers: &[usize], fills: &[f64], flicker: f64, walk: f64) -> Option<Self> {
        let coloured: Vec<f64> = flicker_covariance().iter().map(|covariance| flicker * covariance).collect();
        Self::of_covariance(numbers, fills, &coloured, walk)
    }

    /// The same with noise of any covariance, `coloured` by the distance of two blocks, in the place of flicker.
    pub fn of_covariance(numbers: &[usize], fills: &[f64], coloured: &[f64], walk: f64) -> Option<Self> {
        let entry = |row: usize, column: usize| {
            let (first, second) = (numbers[row.min(column)], numbers[row.max(column)]);
            // Means over a block of a walk from the beginning: the middle of the earlier one, a third into a shared one.
            let walked = if row == column { first as f64 + 1.0 / 3.0 } else { first as f64 + 0.5 };
            let white = if row == column { 1.0 / fills[row] } else { 0.0 };
            white + coloured[second - first] + walk * walked
        };
        let factor = DMatrix::from_fn(numbers.len(), numbers.len(), entry).cholesky()?;
        let log_covariance = 2.0 * factor.l_dirty().diagonal().iter().map(|entry| entry.ln()).sum::<f64>();
        let mut precision = factor.inverse();
        let along = precision.column_sum();
        let level = along.sum();
        precision.ger(-1.0 / level, &along, &along, 1.0);
        Some(Self { precision, log_determinant: log_covariance + level.ln() })
    }

    /// What the products with other values begin with.
    pub fn whitened(&self, values: &DVector<f64>) -> DVector<f64> {
        &self.precision * values
    }

    /// The same for every column.
    pub fn whitened_all(&self, columns: &DMatrix<f64>) -> DMatrix<f64> {
        &self.precision * columns
    }

    /// The information on the size of a step before each block, were it the only shape.
    pub fn of_steps(&self) -> Vec<f64> {
        let size = self.precision.nrows();
        let mut information = vec![0.0; size];
        let mut sum = 0.0;
        for at in (0..size).rev() {
            // The step one block earlier has one block more.
            let column = self.precision.column(at);
            sum += column[at] + 2.0 * column.iter().skip(at + 1).sum::<f64>();
            information[at] = sum;
        }
        information
    }

    /// How many independent looks the steps at all blocks are: Σ acos of the correlation of neighbours, over π.
    pub fn looks_of_steps(&self) -> f64 {
        let information = self.of_steps();
        let between = |at: usize| {
            // Two neighbours differ by a block.
            let shared = 0.5 * (information[at] + information[at + 1] - self.precision[(at, at)]);
            let correlation = shared / (information[at] * information[at + 1]).sqrt();
            if correlation.is_finite() { correlation.clamp(-1.0, 1.0).acos() / PI } else { 0.0 }
        };
        (1..information.len() - 1).map(between).sum()
    }
}

/// Every mixture, for blocks of one layout.
pub type Noises = Arc<Vec<Noise>>;

/// Every mixture for the layouts of a recording's channels, each made once.
#[derive(Default)]
pub struct NoiseTable {
    known: Mutex<Vec<(Layout, Noises)>>,
}

/// Numbers and fills of blocks.
type Layout = (Vec<usize>, Vec<u32>);

impl NoiseTable {
    /// The mixtures for such blocks.
    pub fn of(&self, blocks: &Blocks) -> Noises {
        static WHOLE: OnceLock<Noises> = OnceLock::new();
        let fills: Vec<u32> = blocks.fills.iter().map(|fill| (fill / FILL).round() as u32).collect();
        let layout = (blocks.numbers.clone(), fills);
        if layout.0.len() == BLOCKS && layout.1.iter().all(|&fill| f64::from(fill) * FILL == 1.0) {
            return WHOLE.get_or_init(|| mixtures(&layout)).clone();
        }
        // A thread that panicked took nothing half-done into the list.
        let mut known = self.known.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, noises)) = known.iter().find(|(other, _)| *other == layout) {
            return noises.clone();
        }
        let noises = mixtures(&layout);
        known.push((layout, noises.clone()));
        noises
    }
}

fn mixtures((numbers, fills): &Layout) -> Noises {
    let fills: Vec<f64> = fills.iter().map(|&fill| f64::from(fill) * FILL).collect();
    let values = |(least, count): (f64, usize)| {
        std::iter::once(0.0).chain((0..count).map(move |at| least * 10f64.powf(0.5 * at as f64)))
    };
    let mixtures = values(FLICKER).flat_map(|flicker| values(WALK).map(move |walk| (flicker, walk)));
    Arc::new(mixtures.filter_map(|(flicker, walk)| Noise::of(numbers, &fills, flicker, walk)).collect())
}

/// Covariance of the means of two blocks of flicker noise with B = 1, by their distance.
///
/// Flicker noise is a sum of Gauss-Markov processes an octave of correlation time apart, each of variance B²·ln 2/π. A
/// block is 1 here; processes much faster than a block only add to the white noise.
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

/// The same of a Gauss-Markov process of variance 1 whose correlation time is `time` blocks.
pub fn markov_covariance(time: f64) -> impl Iterator<Item = f64> {
    let decay = move |blocks: f64| (-blocks / time).exp();
    (0..BLOCKS).map(move |distance| {
        if distance == 0 {
            2.0 * time * (1.0 - time * (1.0 - decay(1.0)))
        } else {
            let distance = distance as f64;
            time * time * (decay(distance - 1.0) - 2.0 * decay(distance) + decay(distance + 1.0))
        }
    })
}
