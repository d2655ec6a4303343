//! Generalised least squares of block means on regressors, in noise whose mixture is unknown.
//!
//! For one mixture, size over error has Student's distribution. The mixtures are weighted by the restricted likelihood
//! of the residuals (REML; D. Harville, JASA 72, 1977). p-values are exact if mixtures are as frequent as the noise
//! grid assumes (E. Pitman, Biometrika 30, 1939).

use super::block_means::BlockMeans;
use super::noise_grid::{NoiseGrid, NoiseMixture, Regressors, orthonormal};
use crate::distributions::upper_tail;
use nalgebra::{DMatrix, DVector, DVectorView};

/// A regressor that keeps less than this fraction of its information beside the others is a combination of them.
const COLLINEAR: f64 = 1e-6;

const HALVINGS: usize = 16;

/// Coefficient of a regressor that is fitted together with others.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RegressionEstimate {
    /// In the unit of the means over that of the regressor.
    pub size: f64,
    pub error: f64,
    /// Two-sided, against a size of 0.
    pub p_value: f64,
    /// −2 ln likelihood with the best size, averaged over all mixtures.
    pub deviance: f64,
}

/// Regression of block means on known regressors, under every mixture of noises.
pub struct GlsRegression<'a> {
    grid: &'a NoiseGrid,
    known: usize,
    degrees_of_freedom: f64,
    fits: Vec<GlsFit>,
    /// Per fit: the weighted means beside the known regressors, and these, weighted and orthonormal.
    vectors: DMatrix<f64>,
}

struct GlsFit {
    mixture: usize,
    residual: f64,
    log_determinant: f64,
}

/// Size of a regressor under every mixture.
pub(super) struct Sizes(Vec<SizeAndInformation>);

#[derive(Clone, Copy)]
struct SizeAndInformation {
    size: f64,
    information: f64,
}

impl<'a> GlsRegression<'a> {
    /// Fits the `known` regressors, one value per block each, and a constant.
    pub fn new(blocks: &BlockMeans, grid: &'a NoiseGrid, known: &[DVector<f64>]) -> Self {
        let means = grid.coordinates(std::slice::from_ref(&blocks.means));
        let columns = grid.coordinates(known);
        let fit = |(mixture, noise): (usize, &NoiseMixture)| GlsFit::new(mixture, noise, &means, &columns);
        let (fits, vectors): (Vec<GlsFit>, Vec<DMatrix<f64>>) =
            grid.mixtures.iter().enumerate().filter_map(fit).unzip();
        let columns: Vec<_> = vectors.iter().flat_map(|of| of.column_iter()).collect();
        let vectors =
            if columns.is_empty() { DMatrix::zeros(means.nrows(), 0) } else { DMatrix::from_columns(&columns) };
        let degrees_of_freedom = blocks.means.len() as f64 - 2.0 - known.len() as f64;
        Self { grid, known: known.len(), degrees_of_freedom, fits, vectors }
    }

    /// Size of one more regressor; `None` if it is a combination of the known ones.
    pub fn estimate(&self, regressor: &DVector<f64>) -> Option<RegressionEstimate> {
        self.estimates(std::slice::from_ref(regressor)).pop()?
    }

    pub(super) fn estimates(&self, regressors: &[DVector<f64>]) -> Vec<Option<RegressionEstimate>> {
        self.estimates_below(f64::INFINITY, regressors)
    }

    pub(super) fn estimate_below(&self, limit: f64, regressor: &DVector<f64>) -> Option<RegressionEstimate> {
        self.estimates_below(limit, std::slice::from_ref(regressor)).pop()?
    }

    pub(super) fn estimates_below(&self, limit: f64, regressors: &[DVector<f64>]) -> Vec<Option<RegressionEstimate>> {
        let least_part = self.least_part(limit);
        let estimate = |sizes: Option<Sizes>| {
            let sizes = sizes.filter(|sizes| self.reaches(least_part, sizes))?;
            self.average(&sizes).filter(|estimate| estimate.p_value < limit)
        };
        self.sizes(&self.grid.regressors(regressors)).into_iter().map(estimate).collect()
    }

    /// Sizes of a step at each block alone; `None` at the first, and for a combination of the known regressors.
    pub(super) fn steps(&self) -> Vec<Option<Sizes>> {
        std::iter::once(None).chain(self.sizes(self.grid.steps())).collect()
    }

    fn sizes(&self, regressors: &Regressors) -> Vec<Option<Sizes>> {
        // One matrix product is faster than many products with vectors.
        let products = self.vectors.transpose() * &regressors.coordinates;
        let size = |at: usize, place: usize| {
            let vectors = products.view((place * (1 + self.known), at), (1 + self.known, 1));
            let alone = regressors.information[(at, self.fits[place].mixture)];
            let information = alone - vectors.rows(1, self.known).norm_squared();
            let size = || SizeAndInformation { size: vectors[0] / information, information };
            (information > COLLINEAR * alone).then(size)
        };
        let sizes = |at: usize| (0..self.fits.len()).map(|place| size(at, place)).collect::<Option<_>>().map(Sizes);
        (0..products.ncols()).map(sizes).collect()
    }

    pub(super) fn any_may_be_below(&self, limit: f64, sizes: &[Option<Sizes>]) -> bool {
        let least_part = self.least_part(limit);
        sizes.iter().flatten().any(|sizes| self.reaches(least_part, sizes))
    }

    /// True if a regressor explains more than this part of the weighted sum of squares under any mixture.
    fn reaches(&self, part: f64, Sizes(sizes): &Sizes) -> bool {
        self.fits.iter().zip(sizes).any(|(fit, at)| at.size * at.size * at.information > part * fit.residual)
    }

    /// Least part of the weighted sum of squares to explain, under one mixture, for a p-value below `limit`.
    fn least_part(&self, limit: f64) -> f64 {
        let freedom = self.degrees_of_freedom;
        let p_value = |part: f64| 2.0 * upper_tail(normal_equivalent((freedom * part / (1.0 - part)).sqrt(), freedom));
        let (mut least, mut most) = (0.0, 1.0);
        for _ in 0..HALVINGS {
            let middle = 0.5 * (least + most);
            if p_value(middle) > limit { least = middle } else { most = middle }
        }
        least
    }

    pub(super) fn deviance_with(&self, sizes: &Sizes) -> Option<f64> {
        Some(mean_likelihood(&self.deviances(&self.residuals(sizes)?, 1.0)).0)
    }

    pub(super) fn deviance(&self) -> f64 {
        self.mean_likelihood().0
    }

    /// Effective number of independent tests in [`steps`](Self::steps).
    pub(super) fn independent_steps(&self) -> f64 {
        let (tests, (_, weights)) = (self.grid.independent_steps().collect::<Vec<f64>>(), self.mean_likelihood());
        self.fits.iter().zip(weights).map(|(fit, weight)| weight * tests[fit.mixture]).sum()
    }

    fn mean_likelihood(&self) -> (f64, Vec<f64>) {
        mean_likelihood(&self.deviances(&self.fits.iter().map(|fit| fit.residual).collect::<Vec<f64>>(), 1.0))
    }

    /// Weighted sums of squares of the residuals beside one more regressor; `None` if too few blocks are left.
    fn residuals(&self, Sizes(sizes): &Sizes) -> Option<Vec<f64>> {
        let residual = |(fit, at): (&GlsFit, &SizeAndInformation)| {
            (fit.residual - at.size * at.size * at.information).max(1e-12 * fit.residual)
        };
        let is_enough = !sizes.is_empty() && self.degrees_of_freedom >= 1.0;
        is_enough.then(|| self.fits.iter().zip(sizes).map(residual).collect())
    }

    /// −2 ln likelihood of each mixture with these sums of squares of the residuals; `more` blocks than degrees of freedom.
    fn deviances(&self, residuals: &[f64], more: f64) -> Vec<f64> {
        let freedom = self.degrees_of_freedom + more;
        self.fits.iter().zip(residuals).map(|(fit, residual)| freedom * residual.ln() + fit.log_determinant).collect()
    }

    /// Average over the mixtures, each weighted by its restricted likelihood.
    pub(super) fn average(&self, of: &Sizes) -> Option<RegressionEstimate> {
        let freedom = self.degrees_of_freedom;
        let residuals = self.residuals(of)?;
        let Sizes(sizes) = of;
        let restricted = self.deviances(&residuals, 0.0).into_iter().zip(sizes);
        let restricted: Vec<f64> = restricted.map(|(deviance, at)| deviance + at.information.ln()).collect();
        let (_, weights) = mean_likelihood(&restricted);
        let errors: Vec<f64> =
            residuals.iter().zip(sizes).map(|(residual, at)| (residual / freedom / at.information).sqrt()).collect();
        let mean =
            |of: &dyn Fn(usize) -> f64| weights.iter().enumerate().map(|(at, weight)| weight * of(at)).sum::<f64>();
        let size = mean(&|at| sizes[at].size);
        let below = mean(&|at| upper_tail(normal_equivalent(sizes[at].size / errors[at], freedom)));
        let above = mean(&|at| upper_tail(normal_equivalent(-sizes[at].size / errors[at], freedom)));
        Some(RegressionEstimate {
            size,
            error: mean(&|at| errors[at].powi(2) + (sizes[at].size - size).powi(2)).sqrt(),
            p_value: 2.0 * below.min(above),
            deviance: mean_likelihood(&self.deviances(&residuals, 1.0)).0,
        })
    }
}

impl GlsFit {
    /// With the columns of [`GlsRegression::vectors`].
    fn new(
        mixture: usize,
        noise: &NoiseMixture,
        means: &DMatrix<f64>,
        known: &DMatrix<f64>,
    ) -> Option<(Self, DMatrix<f64>)> {
        let (mut weighted, weighted_known) = (noise.weighted(means), noise.weighted(known));
        let (along_known, log_information) = orthonormal(known, &weighted_known, &[])?;
        let (total, products) = (means.dot(&weighted), along_known.transpose() * means);
        weighted -= &along_known * &products;
        let residual = (total - products.norm_squared()).max(f64::MIN_POSITIVE);
        let fit = Self { mixture, residual, log_determinant: noise.log_determinant + log_information };
        let columns: Vec<DVectorView<'_, f64>> = weighted.column_iter().chain(along_known.column_iter()).collect();
        Some((fit, DMatrix::from_columns(&columns)))
    }
}

/// −2 ln of the mean of likelihoods with these deviances, and the weight of each.
fn mean_likelihood(deviances: &[f64]) -> (f64, Vec<f64>) {
    let least = deviances.iter().copied().fold(f64::INFINITY, f64::min);
    let weights: Vec<f64> = deviances.iter().map(|deviance| (0.5 * (least - deviance)).exp()).collect();
    let total: f64 = weights.iter().sum();
    (least - 2.0 * (total / weights.len() as f64).ln(), weights.iter().map(|weight| weight / total).collect())
}

/// Normal deviate with the tail probability of Student's `t` (D. Wallace, Ann. Math. Statist. 30, 1959).
fn normal_equivalent(t: f64, freedom: f64) -> f64 {
    let size = (freedom * (t * t / freedom).ln_1p()).sqrt() * (8.0 * freedom + 1.0) / (8.0 * freedom + 3.0);
    size.copysign(t)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::samples::series::Series;
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::StandardNormal;
    use std::f64::consts::{LN_2, PI};

    /// White noise of deviation 1 and a random walk with increments of deviation `walk`, 32 samples a block.
    fn series(random: &mut ChaCha8Rng, walk: f64) -> Series {
        let mut level = 0.0;
        let mut next = || {
            level += walk * random.sample::<f64, _>(StandardNormal);
            level + random.sample::<f64, _>(StandardNormal)
        };
        let values: Vec<f64> = (0..128 * 32).map(|_| next()).collect();
        let slots = 0..values.len() as u64;
        Series {
            slots: slots.clone().collect(),
            span: slots,
            values: values.into(),
            period_s: 1.0,
            resolution: 0.0,
            unit: "g",
        }
    }

    #[test]
    fn p_values_are_as_frequent_as_they_say() {
        let runs = 1_000;
        let mut random = ChaCha8Rng::seed_from_u64(1);
        let (mut below, mut covered) = ([0u32; 2], 0u32);
        for _ in 0..runs {
            let walk = 10f64.powf(random.random_range(-4.5..0.0));
            let blocks = BlockMeans::from_series(&series(&mut random, walk)).unwrap();
            let grid = NoiseGrid::from_blocks(&blocks);
            let estimate = GlsRegression::new(&blocks, &grid, &[]).estimate(&blocks.ramp()).unwrap();
            for (below, level) in below.iter_mut().zip([0.1, 0.01]) {
                *below += u32::from(estimate.p_value < level);
            }
            covered += u32::from(estimate.size.abs() < 1.96 * estimate.error);
        }
        // Expected 100 ± 9.5 and 10 ± 3.2; wider, because the walks are not distributed as in the grid.
        assert!((70..150).contains(&below[0]) && below[1] < 25, "{below:?}");
        assert!(covered > 900, "{covered}");
    }

    /// Mixtures as frequent as in the grid; flicker noise as a sum of Gauss-Markov processes an octave apart. Ten blocks are empty,
    /// two have half of their samples.
    #[test]
    fn p_values_hold_beside_gaps() {
        let lost = |slot: u64| matches!(slot / 32, 20..25 | 90..95) || matches!(slot / 16, 80 | 140);
        let mut random = ChaCha8Rng::seed_from_u64(11);
        let mut below = [[0u32; 2]; 2];
        for _ in 0..400 {
            // In units of a mean's white variance of 1/32.
            let mut drawn = |least: f64, count: i32| match random.random_range(0..=count) {
                0 => 0.0,
                number => least * 10f64.powf(0.5 * f64::from(number - 1)),
            };
            let (flicker, walk) = (drawn(1e-2, 8), drawn(1e-5, 16));
            let mut series = series(&mut random, walk.sqrt() / 32.0);
            let deviation = (flicker / 32.0 * LN_2 / PI).sqrt();
            for octave in 0..18 {
                let kept = (-0.5f64.powi(octave)).exp();
                let mut process = random.sample::<f64, _>(StandardNormal);
                for value in series.values_mut() {
                    *value += deviation * process;
                    process = kept * process + (1.0 - kept * kept).sqrt() * random.sample::<f64, _>(StandardNormal);
                }
            }
            let blocks = BlockMeans::from_series(&series.filtered(|slot| !lost(slot))).unwrap();
            let grid = NoiseGrid::from_blocks(&blocks);
            let regressors = [blocks.ramp(), blocks.step_at(1_400)];
            let estimates = GlsRegression::new(&blocks, &grid, &[]).estimates(&regressors);
            for (below, of) in below.iter_mut().zip(estimates) {
                let p_value = of.unwrap().p_value;
                below.iter_mut().zip([0.1, 0.01]).for_each(|(below, level)| *below += u32::from(p_value < level));
            }
        }
        // Expected 40 ± 6 and 4 ± 2, within four standard deviations.
        let are_held = |[tenth, hundredth]: [u32; 2]| (16..=64).contains(&tenth) && hundredth <= 12;
        assert!(below.into_iter().all(are_held), "{below:?}");
    }

    #[test]
    fn a_regressor_is_left_out_by_its_p_value_alone() {
        let mut random = ChaCha8Rng::seed_from_u64(3);
        for run in 0..40 {
            let walk = 10f64.powf(random.random_range(-4.5..0.0));
            let mut series = series(&mut random, walk);
            let size = 0.25 * f64::from(run % 4) / 3.0;
            series.values_mut().iter_mut().skip(2_048).for_each(|value| *value += size);
            let blocks = BlockMeans::from_series(&series).unwrap();
            let grid = NoiseGrid::from_blocks(&blocks);
            let regression = GlsRegression::new(&blocks, &grid, &[]);
            let regressor = if run % 2 == 0 { blocks.ramp() } else { blocks.step_at(2_048) };
            let estimate = regression.estimate(&regressor).unwrap();
            assert_eq!(regression.estimate_below(1.001 * estimate.p_value, &regressor), Some(estimate));
            assert_eq!(regression.estimate_below(0.999 * estimate.p_value, &regressor), None);
            let steps = regression.steps();
            let p_values = steps.iter().flatten().filter_map(|step| Some(regression.average(step)?.p_value));
            let least = p_values.fold(1.0, f64::min);
            assert!(regression.any_may_be_below(1.001 * least, &steps), "{run}: {least}");
        }
    }

    #[test]
    fn sizes_beside_a_known_regressor_are_those_of_least_squares() {
        let mut random = ChaCha8Rng::seed_from_u64(2);
        let mut series = series(&mut random, 0.0);
        let count = series.values.len() as f64;
        for (at, value) in series.values_mut().iter_mut().enumerate() {
            *value += 0.5 * at as f64 / count + if at >= 2_048 { 1.0 } else { 0.0 };
        }
        let blocks = BlockMeans::from_series(&series).unwrap();
        let (grid, ramp, step) = (NoiseGrid::from_blocks(&blocks), blocks.ramp(), blocks.step_at(2_048));
        let regression = GlsRegression::new(&blocks, &grid, std::slice::from_ref(&ramp));
        let beside = regression.estimate(&step).unwrap();
        // 2/√n for a step in the middle of n samples, twice that beside a ramp.
        let error = 2.0 * 2.0 / count.sqrt();
        assert!((beside.size - 1.0).abs() < 4.0 * error && beside.error > 0.9 * error, "{beside:?}");
        let scanned = regression.average(regression.steps()[64].as_ref().unwrap()).unwrap();
        assert!((scanned.size - beside.size).abs() < 1e-9 && (scanned.p_value - beside.p_value).abs() < 1e-12);
        assert!((scanned.deviance - beside.deviance).abs() < 1e-6);
        assert!(regression.estimate(&ramp).is_none(), "a regressor beside itself has no information");
    }
}
