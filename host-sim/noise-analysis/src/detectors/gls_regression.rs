//! Generalised least squares of block means on regressors, in noise whose mixture is unknown.
//!
//! For one mixture, size over error has Student's distribution. The mixtures are weighted by the restricted likelihood
//! of the residuals (REML; D. Harville, JASA 72, 1977). p-values are exact if mixtures are as frequent as the noise
//! grid assumes (E. Pitman, Biometrika 30, 1939).

use super::block_means::BlockMeans;
use super::noise_grid::{NoiseCovariance, NoiseFamily, NoiseGrid};
use crate::distributions::upper_tail;
use nalgebra::{DMatrix, DMatrixView, DVector, DVectorView};

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
    blocks: &'a BlockMeans,
    known: usize,
    families: Vec<FamilyFits<'a>>,
}

struct FamilyFits<'a> {
    family: &'a NoiseFamily,
    fits: Vec<GlsFit<'a>>,
}

struct GlsFit<'a> {
    noise: &'a NoiseCovariance,
    weighted_means: DVector<f64>,
    weighted_known: DMatrix<f64>,
    /// Inverse of the information on the known regressors.
    inverse: DMatrix<f64>,
    products: DVector<f64>,
    known_sizes: DVector<f64>,
    residual: f64,
    log_determinant: f64,
}

pub(super) struct StepSizes(Vec<SizeAndInformation>);

#[derive(Clone, Copy)]
struct SizeAndInformation {
    size: f64,
    information: f64,
}

impl<'a> GlsRegression<'a> {
    /// Fits the `known` regressors, one value per block each, and a constant.
    pub fn new(blocks: &'a BlockMeans, grid: &'a NoiseGrid, known: &[DVector<f64>]) -> Self {
        let columns =
            if known.is_empty() { DMatrix::zeros(blocks.means.len(), 0) } else { DMatrix::from_columns(known) };
        let of_family = |family: &'a NoiseFamily| {
            let (means, known) = (family.coordinates(&blocks.means), family.coordinates_of_columns(&columns));
            let fits = family.mixtures.iter().filter_map(|noise| GlsFit::new(noise, &means, &known)).collect();
            FamilyFits { family, fits }
        };
        Self { blocks, known: known.len(), families: grid.iter().map(of_family).collect() }
    }

    fn fits(&self) -> impl Iterator<Item = &GlsFit<'a>> {
        self.families.iter().flat_map(|family| &family.fits)
    }

    /// Size of one more regressor; `None` if it is a combination of the known ones.
    pub fn estimate(&self, regressor: &DVector<f64>) -> Option<RegressionEstimate> {
        self.estimates(std::slice::from_ref(regressor)).pop()?
    }

    pub(super) fn estimates(&self, regressors: &[DVector<f64>]) -> Vec<Option<RegressionEstimate>> {
        self.sizes(regressors).into_iter().map(|sizes| self.average(&sizes?)).collect()
    }

    /// Sizes of each of `regressors` alone, under every mixture; `None` for a combination of the known ones.
    fn sizes(&self, regressors: &[DVector<f64>]) -> Vec<Option<Vec<SizeAndInformation>>> {
        if regressors.is_empty() {
            return Vec::new();
        }
        // One matrix product is faster than many products with vectors.
        let columns = DMatrix::from_columns(regressors);
        let coordinates: Vec<DMatrix<f64>> =
            self.families.iter().map(|of| of.family.coordinates_of_columns(&columns)).collect();
        let of_regressor = |at: usize| {
            let families = self.families.iter().zip(&coordinates);
            let fits = families.flat_map(|(of, coordinates)| of.fits.iter().map(|fit| (fit, coordinates.column(at))));
            fits.map(|(fit, regressor)| fit.estimate(regressor)).collect()
        };
        (0..regressors.len()).map(of_regressor).collect()
    }

    /// Sizes of a step at each block alone, under every mixture; `None` for a combination of the known regressors.
    pub(super) fn steps(&self) -> Vec<Option<StepSizes>> {
        let by_mixture: Vec<Vec<Option<SizeAndInformation>>> =
            self.families.iter().flat_map(FamilyFits::estimate_steps).collect();
        let step = |at: usize| by_mixture.iter().map(|steps| steps[at]).collect::<Option<_>>().map(StepSizes);
        (0..self.blocks.means.len()).map(step).collect()
    }

    /// True if any of these may have a p-value below `limit`.
    pub(super) fn any_step_may_be_below(&self, limit: f64) -> bool {
        let least_part = self.least_part(limit);
        self.families.iter().any(|family| family.any_step_explains(least_part))
    }

    /// [`estimate`](Self::estimate) if the p-value is below `limit`.
    pub(super) fn estimate_below(&self, limit: f64, regressor: &DVector<f64>) -> Option<RegressionEstimate> {
        self.estimates_below(limit, std::slice::from_ref(regressor)).pop()?
    }

    pub(super) fn estimates_below(&self, limit: f64, regressors: &[DVector<f64>]) -> Vec<Option<RegressionEstimate>> {
        let least_part = self.least_part(limit);
        let estimate = |sizes: Option<Vec<SizeAndInformation>>| {
            let sizes = sizes.filter(|sizes| self.reaches(least_part, sizes))?;
            self.average(&sizes).filter(|estimate| estimate.p_value < limit)
        };
        self.sizes(regressors).into_iter().map(estimate).collect()
    }

    /// True if a regressor explains more than this part of the weighted sum of squares under any mixture.
    fn reaches(&self, part: f64, sizes: &[SizeAndInformation]) -> bool {
        self.fits().zip(sizes).any(|(fit, at)| fit.is_explained(part, *at))
    }

    /// Least part of the weighted sum of squares to explain, under one mixture, for a p-value below `limit`.
    fn least_part(&self, limit: f64) -> f64 {
        let freedom = self.degrees_of_freedom();
        let p_value = |part: f64| 2.0 * upper_tail(normal_equivalent((freedom * part / (1.0 - part)).sqrt(), freedom));
        let (mut least, mut most) = (0.0, 1.0);
        for _ in 0..HALVINGS {
            let middle = 0.5 * (least + most);
            if p_value(middle) > limit { least = middle } else { most = middle }
        }
        least
    }

    pub(super) fn deviance_with(&self, StepSizes(sizes): &StepSizes) -> Option<f64> {
        let residuals = self.residuals(sizes)?;
        Some(mean_likelihood(&self.profiled(&residuals)).0)
    }

    pub(super) fn estimate_step(&self, StepSizes(sizes): &StepSizes) -> Option<RegressionEstimate> {
        self.average(sizes)
    }

    /// Effective number of independent tests in [`steps`](Self::steps).
    pub(super) fn independent_steps(&self) -> f64 {
        let (_, weights) = mean_likelihood(&self.deviances());
        let independent = |of: &FamilyFits<'a>| {
            of.fits.iter().map(|fit| of.family.independent_steps(fit.noise)).collect::<Vec<f64>>()
        };
        self.families.iter().flat_map(independent).zip(weights).map(|(tests, weight)| weight * tests).sum()
    }

    pub(super) fn deviance(&self) -> f64 {
        mean_likelihood(&self.deviances()).0
    }

    fn deviances(&self) -> Vec<f64> {
        let freedom = self.degrees_of_freedom() + 1.0;
        self.fits().map(|fit| freedom * fit.residual.ln() + fit.log_determinant).collect()
    }

    fn degrees_of_freedom(&self) -> f64 {
        self.blocks.means.len() as f64 - 2.0 - self.known as f64
    }

    /// Weighted sums of squares of the residuals beside one more regressor; `None` if too few blocks are left.
    fn residuals(&self, sizes: &[SizeAndInformation]) -> Option<Vec<f64>> {
        let residual = |(fit, at): (&GlsFit<'_>, &SizeAndInformation)| {
            (fit.residual - at.size * at.size * at.information).max(1e-12 * fit.residual)
        };
        let is_enough = !sizes.is_empty() && self.degrees_of_freedom() >= 1.0;
        is_enough.then(|| self.fits().zip(sizes).map(residual).collect())
    }

    fn profiled(&self, residuals: &[f64]) -> Vec<f64> {
        let freedom = self.degrees_of_freedom();
        let deviance = |(fit, residual): (&GlsFit<'_>, &f64)| (freedom + 1.0) * residual.ln() + fit.log_determinant;
        self.fits().zip(residuals).map(deviance).collect()
    }

    /// Average over the mixtures, each weighted by its restricted likelihood.
    fn average(&self, sizes: &[SizeAndInformation]) -> Option<RegressionEstimate> {
        let freedom = self.degrees_of_freedom();
        let residuals = self.residuals(sizes)?;
        let profiled = self.profiled(&residuals);
        let restricted = profiled
            .iter()
            .zip(&residuals)
            .zip(sizes)
            .map(|((deviance, residual), at)| deviance - residual.ln() + at.information.ln());
        let (_, weights) = mean_likelihood(&restricted.collect::<Vec<_>>());
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
            deviance: mean_likelihood(&profiled).0,
        })
    }
}

impl FamilyFits<'_> {
    fn estimate_steps(&self) -> Vec<Vec<Option<SizeAndInformation>>> {
        let products = self.products_with_blocks();
        let estimate = |(fit, products): (&GlsFit<'_>, &DMatrixView<'_, f64>)| {
            let information = self.family.step_information(fit.noise);
            let mut steps = vec![None; information.len()];
            fit.estimate_steps(information, products).for_each(|(at, step)| steps[at] = step);
            steps
        };
        self.fits.iter().zip(&self.of_fits(&products)).map(estimate).collect()
    }

    fn any_step_explains(&self, part: f64) -> bool {
        let products = self.products_with_blocks();
        let explains = |(fit, products): (&GlsFit<'_>, &DMatrixView<'_, f64>)| {
            let mut steps = fit.estimate_steps(self.family.step_information(fit.noise), products);
            steps.any(|(_, step)| step.is_some_and(|step| fit.is_explained(part, step)))
        };
        self.fits.iter().zip(&self.of_fits(&products)).any(explains)
    }

    /// Rows per mixture: the products of each block with the weighted means and known regressors.
    fn products_with_blocks(&self) -> DMatrix<f64> {
        let columns = self
            .fits
            .iter()
            .flat_map(|fit| std::iter::once(fit.weighted_means.column(0)).chain(fit.weighted_known.column_iter()));
        let columns: Vec<_> = columns.collect();
        if columns.is_empty() {
            return DMatrix::zeros(0, 0);
        }
        self.family.products_with_blocks(&DMatrix::from_columns(&columns))
    }

    fn of_fits<'p>(&self, products: &'p DMatrix<f64>) -> Vec<DMatrixView<'p, f64>> {
        let vectors = |fit: &GlsFit<'_>| 1 + fit.weighted_known.ncols();
        self.fits.iter().zip(0..).map(|(fit, at)| products.rows(at * vectors(fit), vectors(fit))).collect()
    }
}

impl<'a> GlsFit<'a> {
    fn new(noise: &'a NoiseCovariance, means: &DVector<f64>, known: &DMatrix<f64>) -> Option<Self> {
        let weighted_means = noise.weighted(means);
        let weighted_known = noise.weighted_columns(known);
        let (inverse, log_information) = if known.ncols() == 0 {
            (DMatrix::zeros(0, 0), 0.0)
        } else {
            let factor = (known.transpose() * &weighted_known).cholesky()?;
            (factor.inverse(), 2.0 * factor.l_dirty().diagonal().iter().map(|entry| entry.ln()).sum::<f64>())
        };
        let products = known.transpose() * &weighted_means;
        let total = means.dot(&weighted_means);
        let known_sizes = &inverse * &products;
        let residual = (total - products.dot(&known_sizes)).max(f64::MIN_POSITIVE);
        let log_determinant = noise.log_determinant + log_information;
        Some(Self { noise, weighted_means, weighted_known, inverse, products, known_sizes, residual, log_determinant })
    }

    fn estimate(&self, regressor: DVectorView<'_, f64>) -> Option<SizeAndInformation> {
        let with_known = |known: usize| self.weighted_known.column(known).dot(&regressor);
        self.beside_known(self.noise.square(regressor), regressor.dot(&self.weighted_means), &with_known)
    }

    /// Sizes of the steps before each block but the first, the last one first.
    fn estimate_steps(
        &self,
        information: &[f64],
        products: &DMatrixView<'_, f64>,
    ) -> impl Iterator<Item = (usize, Option<SizeAndInformation>)> {
        let mut sums = vec![0.0; products.nrows()];
        (1..information.len()).rev().map(move |at| {
            sums.iter_mut().zip(&products.column(at)).for_each(|(sum, product)| *sum += product);
            (at, self.beside_known(information[at], sums[0], &|known| sums[1 + known]))
        })
    }

    fn beside_known(
        &self,
        information: f64,
        with_means: f64,
        with_known: &dyn Fn(usize) -> f64,
    ) -> Option<SizeAndInformation> {
        let (mut left, mut along) = (information, with_means);
        for (row, size) in self.known_sizes.iter().enumerate() {
            let of_row = with_known(row);
            along -= of_row * size;
            left -= (0..self.products.len()).map(|at| of_row * self.inverse[(row, at)] * with_known(at)).sum::<f64>();
        }
        (left > COLLINEAR * information).then(|| SizeAndInformation { size: along / left, information: left })
    }

    fn is_explained(&self, part: f64, SizeAndInformation { size, information }: SizeAndInformation) -> bool {
        size * size * information > part * self.residual
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
    use super::super::noise_grid::NoiseGrids;
    use super::*;
    use crate::samples::series::Series;
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::StandardNormal;

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
        let (grids, runs) = (NoiseGrids::default(), 1_000);
        let mut random = ChaCha8Rng::seed_from_u64(1);
        let (mut below, mut covered) = ([0u32; 2], 0u32);
        for _ in 0..runs {
            let walk = 10f64.powf(random.random_range(-4.5..0.0));
            let blocks = BlockMeans::from_series(&series(&mut random, walk)).unwrap();
            let grid = grids.get(&blocks);
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

    #[test]
    fn a_regressor_is_left_out_by_its_p_value_alone() {
        let grids = NoiseGrids::default();
        let mut random = ChaCha8Rng::seed_from_u64(3);
        for run in 0..40 {
            let walk = 10f64.powf(random.random_range(-4.5..0.0));
            let mut series = series(&mut random, walk);
            let size = 0.25 * f64::from(run % 4) / 3.0;
            series.values_mut().iter_mut().skip(2_048).for_each(|value| *value += size);
            let blocks = BlockMeans::from_series(&series).unwrap();
            let grid = grids.get(&blocks);
            let regression = GlsRegression::new(&blocks, &grid, &[]);
            let regressor = if run % 2 == 0 { blocks.ramp() } else { blocks.step_at(2_048) };
            let estimate = regression.estimate(&regressor).unwrap();
            assert_eq!(regression.estimate_below(1.001 * estimate.p_value, &regressor), Some(estimate));
            assert_eq!(regression.estimate_below(0.999 * estimate.p_value, &regressor), None);
            let steps = regression.steps();
            let p_values = steps.iter().flatten().filter_map(|step| Some(regression.estimate_step(step)?.p_value));
            let least = p_values.fold(1.0, f64::min);
            assert!(regression.any_step_may_be_below(1.001 * least), "{run}: {least}");
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
        let (grids, ramp, step) = (NoiseGrids::default(), blocks.ramp(), blocks.step_at(2_048));
        let grid = grids.get(&blocks);
        let regression = GlsRegression::new(&blocks, &grid, std::slice::from_ref(&ramp));
        let beside = regression.estimate(&step).unwrap();
        // 2/√n for a step in the middle of n samples, twice that beside a ramp.
        let error = 2.0 * 2.0 / count.sqrt();
        assert!((beside.size - 1.0).abs() < 4.0 * error && beside.error > 0.9 * error, "{beside:?}");
        let scanned = regression.estimate_step(regression.steps()[64].as_ref().unwrap()).unwrap();
        assert!((scanned.size - beside.size).abs() < 1e-9 && (scanned.p_value - beside.p_value).abs() < 1e-12);
        assert!((scanned.deviance - beside.deviance).abs() < 1e-6);
        assert!(regression.estimate(&ramp).is_none(), "a regressor beside itself has no information");
    }
}
