//! The noise of block means on a grid of mixtures of white, flicker and random-walk noise with equal prior probability.
//!
//! A mixture is one weight per order of the cosine transform. An unknown constant is order 0, which is left out. A block with
//! fewer samples than the others has an additional error of its own, of unknown size where it has none.

use super::block_cosines::{flicker_squares, walk_squares};
use super::block_means::{BLOCKS, BlockMeans};
use nalgebra::{DMatrix, DVector};
use std::f64::consts::PI;
use std::sync::{Arc, LazyLock, OnceLock};

/// Least value and number of values of B² and of a walk's variance per block, over a mean's white variance, beside 0.
const FLICKER: (f64, usize) = (1e-2, 8);
const WALK: (f64, usize) = (1e-5, 16);
/// Blocks with at least this part of the usual samples have the usual white variance: it differs by less than a quarter.
const USUAL_FILL: f64 = 0.8;

/// Variances of the orders of each mixture, in units of the white variance of a mean.
static VARIANCES: LazyLock<Vec<DVector<f64>>> = LazyLock::new(|| {
    let values = |(least, count): (f64, usize)| {
        std::iter::once(0.0).chain((0..count).map(move |at| least * 10f64.powf(0.5 * at as f64)))
    };
    let [flicker, walk] = [flicker_squares(BLOCKS), walk_squares(BLOCKS)].map(DVector::from_vec);
    let mixtures = values(FLICKER).flat_map(|b2| values(WALK).map(move |k2| (b2, k2)));
    mixtures.map(|(b2, k2)| (b2 * &flicker + k2 * &walk).add_scalar(1.0)).collect()
});

/// Row: an order from 1 on. Column: a 1 in one block.
static BASIS: LazyLock<DMatrix<f64>> = LazyLock::new(|| {
    DMatrix::from_fn(BLOCKS - 1, BLOCKS, |order, block| {
        let phase = PI * ((order + 1) * (2 * block + 1)) as f64 / (2 * BLOCKS) as f64;
        (2.0 / BLOCKS as f64).sqrt() * phase.cos()
    })
});

/// The weights of all mixtures for one set of blocks.
pub struct NoiseGrid {
    /// The blocks that have a mean.
    basis: DMatrix<f64>,
    pub(super) mixtures: Vec<NoiseMixture>,
    steps: OnceLock<Regressors>,
}

pub(super) struct NoiseMixture {
    weights: DVector<f64>,
    /// The weighted orders of each block with fewer samples, orthonormal.
    along_gaps: DMatrix<f64>,
    /// ln determinant of the covariance times the information on what is projected out (REML).
    pub log_determinant: f64,
}

pub(super) struct Regressors {
    pub coordinates: DMatrix<f64>,
    /// On the size of each regressor (row) in each mixture (column).
    pub information: DMatrix<f64>,
}

impl NoiseGrid {
    /// For the blocks of these means.
    #[must_use]
    pub fn from_blocks(blocks: &BlockMeans) -> Arc<Self> {
        static WITHOUT_GAPS: LazyLock<Arc<NoiseGrid>> = LazyLock::new(|| NoiseGrid::new(&[1.0; BLOCKS], &[]).into());
        let mut fills = [0.0; BLOCKS];
        blocks.numbers.iter().zip(&blocks.fills).for_each(|(number, fill)| fills[*number] = *fill);
        let mut ascending = blocks.fills.clone();
        ascending.sort_by(f64::total_cmp);
        let usual = ascending[ascending.len() * 3 / 4];
        fills.iter_mut().for_each(|fill| *fill /= usual);
        let gaps: Vec<usize> = (0..BLOCKS).filter(|number| fills[*number] < USUAL_FILL).collect();
        if gaps.is_empty() { Arc::clone(&WITHOUT_GAPS) } else { Self::new(&fills, &gaps).into() }
    }

    /// With these parts of the usual samples in each block, of which the `gaps` have fewer.
    fn new(fills: &[f64; BLOCKS], gaps: &[usize]) -> Self {
        let columns = BASIS.select_columns(gaps);
        // The inverse variance of the additional error.
        let known: Vec<f64> = gaps.iter().map(|number| fills[*number] / (1.0 - fills[*number])).collect();
        let with_mean: Vec<usize> = (0..BLOCKS).filter(|number| fills[*number] > 0.0).collect();
        let mixture = |variances: &DVector<f64>| {
            let weights = variances.map(f64::recip);
            let weighted = weighted_by(&weights, &columns);
            let (along_gaps, log_information) = orthonormal(&columns, &weighted, &known)?;
            let log_determinant = variances.iter().map(|variance| variance.ln()).sum::<f64>() + log_information;
            Some(NoiseMixture { weights, along_gaps, log_determinant })
        };
        Self {
            basis: BASIS.select_columns(&with_mean),
            mixtures: VARIANCES.iter().filter_map(mixture).collect(),
            steps: OnceLock::new(),
        }
    }

    /// Orders of the cosine transforms of `columns` with one value per mean.
    pub(super) fn coordinates(&self, columns: &[DVector<f64>]) -> DMatrix<f64> {
        // A constant is in the empty blocks alone; without it, nothing is lost to rounding.
        let centred: Vec<DVector<f64>> = columns.iter().map(|of| of.add_scalar(-of.mean())).collect();
        if centred.is_empty() { DMatrix::zeros(BLOCKS - 1, 0) } else { &self.basis * DMatrix::from_columns(&centred) }
    }

    pub(super) fn regressors(&self, columns: &[DVector<f64>]) -> Regressors {
        let coordinates = self.coordinates(columns);
        Regressors { information: self.information(&coordinates), coordinates }
    }

    fn information(&self, coordinates: &DMatrix<f64>) -> DMatrix<f64> {
        let squares = coordinates.component_mul(coordinates);
        let mut information = DMatrix::zeros(coordinates.ncols(), self.mixtures.len());
        for (mixture, mut of_mixture) in self.mixtures.iter().zip(information.column_iter_mut()) {
            of_mixture.gemv_tr(1.0, &squares, &mixture.weights, 0.0);
            if mixture.along_gaps.ncols() > 0 {
                let along_gaps = mixture.along_gaps.transpose() * coordinates;
                of_mixture.iter_mut().zip(along_gaps.column_iter()).for_each(|(of, along)| *of -= along.norm_squared());
            }
        }
        information
    }

    /// Steps before each block with a mean but the first.
    pub(super) fn steps(&self) -> &Regressors {
        self.steps.get_or_init(|| {
            let count = self.basis.ncols();
            let step = |first: usize| DVector::from_fn(count, |at, _| f64::from(u8::from(at >= first)));
            self.regressors(&(1..count).map(step).collect::<Vec<_>>())
        })
    }

    /// Effective number of independent tests of a step in each mixture: Σ acos ρ/π with the correlation ρ of neighbouring steps.
    pub(super) fn independent_steps(&self) -> impl Iterator<Item = f64> {
        let blocks = self.information(&self.basis);
        let steps = &self.steps().information;
        (0..self.mixtures.len()).map(move |mixture| {
            let between = |at: usize| {
                // Two neighbouring steps differ in one block.
                let (one, other) = (steps[(at, mixture)], steps[(at + 1, mixture)]);
                let correlation = 0.5 * (one + other - blocks[(at + 1, mixture)]) / (one * other).sqrt();
                if correlation.is_finite() { correlation.clamp(-1.0, 1.0).acos() / PI } else { 0.0 }
            };
            (0..steps.nrows() - 1).map(between).sum()
        })
    }
}

impl NoiseMixture {
    /// Coordinates times the inverse covariance, without the constant.
    pub(super) fn weighted(&self, coordinates: &DMatrix<f64>) -> DMatrix<f64> {
        let weighted = weighted_by(&self.weights, coordinates);
        if self.along_gaps.ncols() == 0 {
            return weighted;
        }
        weighted - &self.along_gaps * (self.along_gaps.transpose() * coordinates)
    }
}

fn weighted_by(weights: &DVector<f64>, coordinates: &DMatrix<f64>) -> DMatrix<f64> {
    let mut weighted = coordinates.clone();
    weighted.column_iter_mut().for_each(|mut column| column.component_mul_assign(weights));
    weighted
}

/// Combinations of the `weighted` columns whose products with `columns` are those with orthonormal ones, and the ln determinant of
/// their information. `known` is added to the information on each; `None` if a column is a combination of the others.
pub(super) fn orthonormal(
    columns: &DMatrix<f64>,
    weighted: &DMatrix<f64>,
    known: &[f64],
) -> Option<(DMatrix<f64>, f64)> {
    if columns.ncols() == 0 {
        return Some((weighted.clone(), 0.0));
    }
    let mut information = columns.transpose() * weighted;
    known.iter().enumerate().for_each(|(at, known)| information[(at, at)] += known);
    let factor = information.cholesky()?;
    let along = factor.l_dirty().solve_lower_triangular(&weighted.transpose())?.transpose();
    Some((along, 2.0 * factor.l_dirty().diagonal().iter().map(|entry| entry.ln()).sum::<f64>()))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// In white noise and a random walk the weights are the inverse of the covariance of the means, exactly.
    #[test]
    fn mixtures_weigh_as_the_inverse_of_their_covariance() {
        let numbers: Vec<usize> = (0..BLOCKS).filter(|number| ![5, 70, 71].contains(number)).collect();
        let count = numbers.len();
        let fills: Vec<f64> = (0..count).map(|at| if at == 30 { 0.5 } else { 1.0 }).collect();
        let blocks = BlockMeans { width: 16, means: DVector::zeros(count), fills, numbers };
        let grid = NoiseGrid::from_blocks(&blocks);
        // No flicker noise; the tenth walk.
        let (mixture, walk) = (&grid.mixtures[9], 1e-5 * 10f64.powf(4.0));

        let covariance = DMatrix::from_fn(count, count, |row, column| {
            let first = blocks.numbers[row.min(column)] as f64;
            let (white, middle) = if row == column { (1.0 / blocks.fills[row], 1.0 / 3.0) } else { (0.0, 0.5) };
            white + walk * (first + middle)
        });
        let inverse = covariance.clone().try_inverse().expect("positive definite");
        let ones = DVector::from_element(count, 1.0);
        let information = (ones.transpose() * &inverse * &ones)[0];
        let along = &inverse * &ones;
        let precision = &inverse - &along * along.transpose() / information;

        let values = DVector::from_fn(count, |at, _| (at as f64 * 0.7).sin() + 0.01 * at as f64);
        let weighted = grid.basis.transpose() * mixture.weighted(&grid.coordinates(std::slice::from_ref(&values)));
        assert!((&weighted - &precision * &values).amax() < 1e-9 * (&precision * &values).amax());
        let step = DVector::from_fn(count, |at, _| if at >= 40 { 1.0 } else { 0.0 });
        let of_step = (step.transpose() * &precision * &step)[0];
        assert!((grid.steps().information[(39, 9)] / of_step - 1.0).abs() < 1e-9);

        // Determinants of two mixtures, whose common factor is that of the additional errors.
        let log_determinant = |walk: f64| {
            let covariance = &covariance
                + DMatrix::from_fn(count, count, |row, column| {
                    let middle = if row == column { 1.0 / 3.0 } else { 0.5 };
                    (walk - 0.1) * (blocks.numbers[row.min(column)] as f64 + middle)
                });
            let factor = covariance.cholesky().expect("positive definite");
            factor.determinant().ln() + ones.dot(&factor.solve(&ones)).ln()
        };
        let expected = log_determinant(0.1) - log_determinant(0.0);
        assert!((mixture.log_determinant - grid.mixtures[0].log_determinant - expected).abs() < 1e-8);
    }
}
