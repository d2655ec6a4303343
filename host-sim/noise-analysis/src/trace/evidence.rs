//! How large a shape is in the means of blocks, and how sure that is, in noise whose mixture nobody knows.
//!
//! In a given mixture that is least squares with a free scale: Student's distribution. Over mixtures it is their mean,
//! each weighed by the likelihood of what the shapes leave (REML; D. Harville, "Maximum likelihood approaches to variance
//! component estimation", 1977). Where the mixtures are as frequent as the grid takes them to be, so much is exceeded by
//! chance exactly as often as said (E. Pitman, "The estimation of the location and scale parameters", 1939), however few
//! degrees of freedom tell the slowest noise.

use super::block::Blocks;
use super::noises::{Noise, Noises};
use crate::distributions::upper_tail;
use nalgebra::{DMatrix, DVector};

/// Part of a shape's information below which it is made of those that are known.
const NEW: f64 = 1e-6;

/// A shape beside others.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Estimate {
    /// Of the shape, in the unit of the means.
    pub size: f64,
    /// Standard deviation.
    pub error: f64,
    /// Probability of a size as far from 0 by chance.
    pub p_value: f64,
    /// −2 ln likelihood of its best size over all mixtures.
    pub deviance: f64,
}

/// Block means beside shapes that are known to be in them, under every mixture.
pub struct Evidence<'a> {
    blocks: &'a Blocks,
    known: DMatrix<f64>,
    under: Vec<Under<'a>>,
}

/// The same under one mixture.
struct Under<'a> {
    noise: &'a Noise,
    data: DVector<f64>,
    known: DMatrix<f64>,
    /// Inverse of the information on the known shapes, and what the data say of them.
    inverse: DMatrix<f64>,
    told: DVector<f64>,
    /// Sum of squares that is left, whitened.
    rest: f64,
    log_determinant: f64,
}

/// A size and its information under one mixture.
#[derive(Clone, Copy)]
struct Sized {
    size: f64,
    information: f64,
}

impl<'a> Evidence<'a> {
    /// `known` shapes need not be independent of each other.
    pub fn of(blocks: &'a Blocks, noises: &'a Noises, known: &[DVector<f64>]) -> Self {
        let known = if known.is_empty() { DMatrix::zeros(blocks.means.len(), 0) } else { DMatrix::from_columns(known) };
        let under = noises.iter().filter_map(|noise| Under::of(noise, &blocks.means, &known)).collect();
        Self { blocks, known, under }
    }

    /// What the data say of `shape`; `None` if it is nothing new.
    pub fn shape(&self, shape: &DVector<f64>) -> Option<Estimate> {
        let sized: Option<Vec<Sized>> = self.under.iter().map(|under| under.shape(shape, &self.known)).collect();
        self.estimate(&sized?)
    }

    /// The same of a step at the beginning of every block; `None` where it is nothing new.
    pub fn steps(&self) -> Vec<Option<Estimate>> {
        let each: Vec<Vec<Option<Sized>>> = self.under.iter().map(Under::steps).collect();
        let at = |at: usize| {
            let sized: Option<Vec<Sized>> = each.iter().map(|steps| steps[at]).collect();
            self.estimate(&sized?)
        };
        (0..self.blocks.means.len()).map(at).collect()
    }

    /// How many independent looks the steps at all blocks are.
    pub fn looks(&self) -> f64 {
        let (_, weights) = mean_likelihood(&self.deviances());
        self.under.iter().zip(weights).map(|(under, weight)| weight * under.noise.looks_of_steps()).sum()
    }

    /// −2 ln likelihood of the known shapes alone, over all mixtures.
    pub fn deviance(&self) -> f64 {
        mean_likelihood(&self.deviances()).0
    }

    fn deviances(&self) -> Vec<f64> {
        let freedom = self.freedom() + 1.0;
        self.under.iter().map(|under| freedom * under.rest.ln() + under.log_determinant).collect()
    }

    /// Beside the level, the known shapes and one more.
    fn freedom(&self) -> f64 {
        self.blocks.means.len() as f64 - 2.0 - self.known.ncols() as f64
    }

    fn estimate(&self, sized: &[Sized]) -> Option<Estimate> {
        let freedom = self.freedom();
        if sized.is_empty() || freedom < 1.0 {
            return None;
        }
        let rest = |(under, sized): (&Under<'_>, &Sized)| {
            (under.rest - sized.size * sized.size * sized.information).max(1e-12 * under.rest)
        };
        let rests: Vec<f64> = self.under.iter().zip(sized).map(rest).collect();
        let of = |(under, rest): (&Under<'_>, &f64)| (freedom + 1.0) * rest.ln() + under.log_determinant;
        let profiled: Vec<f64> = self.under.iter().zip(&rests).map(of).collect();
        let restricted =
            profiled.iter().zip(&rests).zip(sized).map(|((d, rest), s)| d - rest.ln() + s.information.ln());
        let (_, weights) = mean_likelihood(&restricted.collect::<Vec<_>>());
        let errors: Vec<f64> =
            rests.iter().zip(sized).map(|(rest, sized)| (rest / freedom / sized.information).sqrt()).collect();
        let mean =
            |of: &dyn Fn(usize) -> f64| weights.iter().enumerate().map(|(at, weight)| weight * of(at)).sum::<f64>();
        let size = mean(&|at| sized[at].size);
        let below = mean(&|at| upper_tail(normal(sized[at].size / errors[at], freedom)));
        let above = mean(&|at| upper_tail(normal(-sized[at].size / errors[at], freedom)));
        Some(Estimate {
            size,
            error: mean(&|at| errors[at].powi(2) + (sized[at].size - size).powi(2)).sqrt(),
            p_value: 2.0 * below.min(above),
            deviance: mean_likelihood(&profiled).0,
        })
    }
}

impl<'a> Under<'a> {
    fn of(noise: &'a Noise, means: &DVector<f64>, shapes: &DMatrix<f64>) -> Option<Self> {
        let data = noise.whitened(means);
        let known = noise.whitened_all(shapes);
        let (inverse, log_information) = if shapes.ncols() == 0 {
            (DMatrix::zeros(0, 0), 0.0)
        } else {
            let factor = (shapes.transpose() * &known).cholesky()?;
            (factor.inverse(), 2.0 * factor.l_dirty().diagonal().iter().map(|entry| entry.ln()).sum::<f64>())
        };
        let told = shapes.transpose() * &data;
        let all = means.dot(&data);
        let rest = (all - told.dot(&(&inverse * &told))).max(f64::MIN_POSITIVE);
        Some(Self { noise, data, known, inverse, told, rest, log_determinant: noise.log_determinant + log_information })
    }

    fn shape(&self, shape: &DVector<f64>, known: &DMatrix<f64>) -> Option<Sized> {
        let whitened = self.noise.whitened(shape);
        self.beside(shape.dot(&whitened), shape.dot(&self.data), &(known.transpose() * whitened))
    }

    fn steps(&self) -> Vec<Option<Sized>> {
        let information = self.noise.of_steps();
        let mut steps = vec![None; information.len()];
        let (mut data, mut shared) = (0.0, DVector::zeros(self.known.ncols()));
        // Before the first block it would be the level.
        for at in (1..information.len()).rev() {
            data += self.data[at];
            shared += self.known.row(at).transpose();
            steps[at] = self.beside(information[at], data, &shared);
        }
        steps
    }

    /// Of a shape with this information, product with the data, and products with the known shapes.
    fn beside(&self, information: f64, data: f64, shared: &DVector<f64>) -> Option<Sized> {
        let along = &self.inverse * shared;
        let left = information - shared.dot(&along);
        (left > NEW * information).then(|| Sized { size: (data - self.told.dot(&along)) / left, information: left })
    }
}

/// −2 ln of the mean of likelihoods with these deviances, and the weight of each.
fn mean_likelihood(deviances: &[f64]) -> (f64, Vec<f64>) {
    let least = deviances.iter().copied().fold(f64::INFINITY, f64::min);
    let weights: Vec<f64> = deviances.iter().map(|deviance| (0.5 * (least - deviance)).exp()).collect();
    let total: f64 = weights.iter().sum();
    (least - 2.0 * (total / weights.len() as f64).ln(), weights.iter().map(|weight| weight / total).collect())
}

/// The normal deviate that is as rarely exceeded as Student's `t`, by Wallace's approximation (Ann. Math. Statist. 30,
/// 1959).
fn normal(t: f64, freedom: f64) -> f64 {
    let size = (freedom * (t * t / freedom).ln_1p()).sqrt() * (8.0 * freedom + 1.0) / (8.0 * freedom + 3.0);
    size.copysign(t)
}

#[cfg(test)]
mod tests {
    use super::super::Series;
    use super::super::noises::NoiseTable;
    use super::*;
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::StandardNormal;

    /// White noise of deviation 1 and a walk of steps `walk`, 32 samples a block.
    fn series(random: &mut ChaCha8Rng, walk: f64) -> Series {
        let mut level = 0.0;
        let mut next = || {
            level += walk * random.sample::<f64, _>(StandardNormal);
            level + random.sample::<f64, _>(StandardNormal)
        };
        let values: Vec<f64> = (0..128 * 32).map(|_| next()).collect();
        Series { slots: (0..values.len() as u64).collect(), values, period_s: 1.0, resolution: 0.0, unit: "g" }
    }

    /// However much of the noise walks, and however few periods of it the record has.
    #[test]
    fn chance_does_as_much_as_often_as_it_is_said_to() {
        let (table, runs) = (NoiseTable::default(), 1_000);
        let mut random = ChaCha8Rng::seed_from_u64(1);
        let (mut below, mut covered) = ([0u32; 2], 0u32);
        for _ in 0..runs {
            let walk = 10f64.powf(random.random_range(-4.5..0.0));
            let blocks = Blocks::of(&series(&mut random, walk)).unwrap();
            let noises = table.of(&blocks);
            let estimate = Evidence::of(&blocks, &noises, &[]).shape(&blocks.ramp()).unwrap();
            for (below, level) in below.iter_mut().zip([0.1, 0.01]) {
                *below += u32::from(estimate.p_value < level);
            }
            covered += u32::from(estimate.size.abs() < 1.96 * estimate.error);
        }
        // Expected 100 ± 9.5 and 10 ± 3.2; the walks are not spread as the grid is, nor is there any flicker noise.
        assert!((70..150).contains(&below[0]) && below[1] < 25, "{below:?}");
        assert!(covered > 900, "{covered}");
    }

    /// By least squares on the samples, in white noise; the mixtures can only widen it.
    #[test]
    fn sizes_are_those_of_least_squares_beside_what_is_known() {
        let mut random = ChaCha8Rng::seed_from_u64(2);
        let mut series = series(&mut random, 0.0);
        let count = series.values.len() as f64;
        for (at, value) in series.values.iter_mut().enumerate() {
            *value += 0.5 * at as f64 / count + if at >= 2_048 { 1.0 } else { 0.0 };
        }
        let blocks = Blocks::of(&series).unwrap();
        let (table, ramp, step) = (NoiseTable::default(), blocks.ramp(), blocks.step_at(2_048));
        let noises = table.of(&blocks);
        let alone = Evidence::of(&blocks, &noises, std::slice::from_ref(&ramp));
        let beside = alone.shape(&step).unwrap();
        // 2/√n for a step in the middle, twice that beside a ramp.
        let error = 2.0 * 2.0 / count.sqrt();
        assert!((beside.size - 1.0).abs() < 4.0 * error && beside.error > 0.9 * error, "{beside:?}");
        let scanned = alone.steps()[64].unwrap();
        assert!((scanned.size - beside.size).abs() < 1e-9 && (scanned.p_value - beside.p_value).abs() < 1e-12);
        assert!((scanned.deviance - beside.deviance).abs() < 1e-6);
        assert!(alone.shape(&ramp).is_none(), "a ramp beside itself is nothing new");
    }
}
