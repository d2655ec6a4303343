//! The covariance of the means of equal blocks in white, flicker and random-walk noise, on a grid of mixtures with
//! equal prior probability.
//!
//! All mixtures with one ratio of flicker to white noise are diagonal in the basis of the walk's generalised
//! eigenvectors, so 153 mixtures need nine matrices.

use super::block_means::{BLOCKS, BlockMeans};
use crate::parallel::in_parallel;
use nalgebra::{DMatrix, DVector, DVectorView};
use std::f64::consts::{LN_2, PI};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

/// Least value and number of values of B² and of a walk's variance per block, over a mean's white variance, beside 0.
const FLICKER: (f64, usize) = (1e-2, 8);
const WALK: (f64, usize) = (1e-5, 16);
const FILL_STEP: f64 = 1.0 / 64.0;

/// The covariances of all mixtures for one set of blocks.
pub type NoiseGrid = Arc<Vec<NoiseFamily>>;

/// The mixtures with one ratio of flicker to white noise.
pub struct NoiseFamily {
    /// Column `b`: coordinates of a 1 in block `b`.
    basis: DMatrix<f64>,
    constant: DVector<f64>,
    pub mixtures: Vec<NoiseCovariance>,
}

/// Covariance of block means for one mixture, in units of the white variance, with an unknown constant.
pub struct NoiseCovariance {
    precisions: DVector<f64>,
    /// `precisions` times the coordinates of the constant, over the root of its information.
    along_constant: DVector<f64>,
    /// ln determinant of the covariance times the information on the constant (REML).
    pub log_determinant: f64,
    steps: OnceLock<StepInformation>,
}

struct StepInformation {
    of_size: Vec<f64>,
    independent: f64,
}

impl NoiseFamily {
    /// White variance 1 in a whole block, B² = `flicker`, a walk of variance `walks` per block; `None` if not definite.
    fn new(numbers: &[usize], fills: &[f64], flicker: f64, walks: impl Iterator<Item = f64>) -> Option<Self> {
        let coloured = flicker_covariance();
        let count = numbers.len();
        let stationary = DMatrix::from_fn(count, count, |row, column| {
            let white = if row == column { 1.0 / fills[row] } else { 0.0 };
            white + flicker * coloured[numbers[row].abs_diff(numbers[column])]
        });
        // Variance of the walk in the middle of the earlier block; a third of a block for the same block.
        let walk = DMatrix::from_fn(count, count, |row, column| {
            numbers[row.min(column)] as f64 + if row == column { 1.0 / 3.0 } else { 0.5 }
        });
        let factor = stationary.cholesky()?;
        let log_stationary = 2.0 * factor.l_dirty().diagonal().iter().map(|entry| entry.ln()).sum::<f64>();
        let whitening = factor.l().solve_lower_triangular(&DMatrix::identity(count, count))?;
        let eigen = (&whitening * walk * whitening.transpose()).symmetric_eigen();
        let basis = eigen.eigenvectors.transpose() * whitening;
        let constant = basis.column_sum();
        let mixture = |walk: f64| {
            let variances = eigen.eigenvalues.map(|of_walk| 1.0 + walk * of_walk.max(0.0));
            let precisions = variances.map(f64::recip);
            let along = precisions.component_mul(&constant);
            let information = along.dot(&constant);
            let log_covariance = log_stationary + variances.iter().map(|variance| variance.ln()).sum::<f64>();
            NoiseCovariance {
                precisions,
                along_constant: along / information.sqrt(),
                log_determinant: log_covariance + information.ln(),
                steps: OnceLock::new(),
            }
        };
        let mixtures = walks.map(mixture).collect();
        Some(Self { basis, constant, mixtures })
    }

    pub(super) fn coordinates(&self, values: &DVector<f64>) -> DVector<f64> {
        &self.basis * values
    }

    pub(super) fn coordinates_of_columns(&self, columns: &DMatrix<f64>) -> DMatrix<f64> {
        &self.basis * columns
    }

    /// Products of the columns' coordinates with a 1 in each block, in rows.
    pub(super) fn products_with_blocks(&self, weighted: &DMatrix<f64>) -> DMatrix<f64> {
        weighted.transpose() * &self.basis
    }

    pub(super) fn step_information<'a>(&self, mixture: &'a NoiseCovariance) -> &'a [f64] {
        &self.steps(mixture).of_size
    }

    /// Effective number of independent tests of a step: Σ acos ρ/π with the correlation ρ of neighbouring steps.
    pub(super) fn independent_steps(&self, mixture: &NoiseCovariance) -> f64 {
        self.steps(mixture).independent
    }

    fn steps<'a>(&self, mixture: &'a NoiseCovariance) -> &'a StepInformation {
        mixture.steps.get_or_init(|| StepInformation::new(self, mixture))
    }
}

impl NoiseCovariance {
    /// Coordinates times the inverse covariance, without the constant.
    pub(super) fn weighted(&self, coordinates: &DVector<f64>) -> DVector<f64> {
        let mut weighted = self.precisions.component_mul(coordinates);
        weighted.axpy(-self.along_constant.dot(coordinates), &self.along_constant, 1.0);
        weighted
    }

    pub(super) fn weighted_columns(&self, coordinates: &DMatrix<f64>) -> DMatrix<f64> {
        let mut weighted = coordinates.clone();
        for mut column in weighted.column_iter_mut() {
            let along = self.along_constant.dot(&column);
            column.component_mul_assign(&self.precisions);
            column.axpy(-along, &self.along_constant, 1.0);
        }
        weighted
    }

    /// Weighted sum of squares of the values with these coordinates, without the constant.
    pub(super) fn square(&self, coordinates: DVectorView<'_, f64>) -> f64 {
        let weighted = self.precisions.component_mul(&coordinates);
        weighted.dot(&coordinates) - self.along_constant.dot(&coordinates).powi(2)
    }
}

impl StepInformation {
    fn new(family: &NoiseFamily, mixture: &NoiseCovariance) -> Self {
        let size = family.basis.ncols();
        // The step before the first block is the constant.
        let mut step = family.constant.clone();
        let later = family.basis.column_iter().take(size - 1).map(|block| {
            step -= block;
            mixture.square(step.column(0))
        });
        let of_size: Vec<f64> = std::iter::once(0.0).chain(later).collect();
        let between = |at: usize| {
            // Two neighbouring steps differ in one block.
            let of_block = mixture.square(family.basis.column(at));
            let shared = 0.5 * (of_size[at] + of_size[at + 1] - of_block);
            let correlation = shared / (of_size[at] * of_size[at + 1]).sqrt();
            if correlation.is_finite() { correlation.clamp(-1.0, 1.0).acos() / PI } else { 0.0 }
        };
        let independent = (1..size - 1).map(between).sum();
        Self { of_size, independent }
    }
}

/// The grids of a recording's channels: one per set of blocks, computed once.
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
        // Valid after a panic elsewhere: entries are added whole.
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
    let flickers: Vec<f64> = values(FLICKER).collect();
    let families = in_parallel(&flickers, |&flicker| NoiseFamily::new(numbers, &fills, flicker, values(WALK)));
    Arc::new(families.into_iter().flatten().collect())
}

/// Covariance of the means of two blocks in flicker noise with B = 1, a sum of Gauss-Markov processes, by distance.
fn flicker_covariance() -> Vec<f64> {
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

/// Covariance of block means in a Gauss-Markov process of variance 1, time constant in blocks, by their distance.
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

#[cfg(test)]
mod tests {
    use super::{BLOCKS, NoiseFamily, flicker_covariance};
    use nalgebra::{DMatrix, DVector};

    #[test]
    fn mixtures_weigh_as_the_inverse_of_their_covariance() {
        let numbers: Vec<usize> = (0..BLOCKS).filter(|number| ![5, 70].contains(number)).collect();
        let count = numbers.len();
        let fills: Vec<f64> = (0..count).map(|at| if at == 30 { 0.5 } else { 1.0 }).collect();
        let (flicker, walk) = (0.3, 0.02);
        let family = NoiseFamily::new(&numbers, &fills, flicker, [walk].into_iter()).expect("positive definite");
        let mixture = &family.mixtures[0];

        let coloured = flicker_covariance();
        let covariance = DMatrix::from_fn(count, count, |row, column| {
            let (first, second) = (numbers[row.min(column)], numbers[row.max(column)]);
            let (white, middle) = if row == column { (1.0 / fills[row], 1.0 / 3.0) } else { (0.0, 0.5) };
            white + flicker * coloured[second - first] + walk * (first as f64 + middle)
        });
        let inverse = covariance.clone().try_inverse().expect("positive definite");
        let ones = DVector::from_element(count, 1.0);
        let information = (ones.transpose() * &inverse * &ones)[0];
        let along = &inverse * &ones;
        let precision = &inverse - &along * along.transpose() / information;

        let values = DVector::from_fn(count, |at, _| (at as f64 * 0.7).sin() + 0.01 * at as f64);
        let weighted = DMatrix::from_columns(&[mixture.weighted(&family.coordinates(&values))]);
        let weighted = family.products_with_blocks(&weighted).transpose();
        assert!((&weighted - &precision * &values).amax() < 1e-9 * (&precision * &values).amax());
        let log_determinant = covariance.cholesky().expect("positive definite").determinant().ln() + information.ln();
        assert!((mixture.log_determinant - log_determinant).abs() < 1e-8);
        let step = DVector::from_fn(count, |at, _| if at >= 40 { 1.0 } else { 0.0 });
        let of_step = (step.transpose() * &precision * &step)[0];
        assert!((family.step_information(mixture)[40] / of_step - 1.0).abs() < 1e-9);
    }
}
