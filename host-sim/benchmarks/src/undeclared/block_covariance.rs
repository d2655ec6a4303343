//! Covariance of block means, and tests of a waveform of the bias: expected log likelihood ratio and p-value.

use super::channel_under_test::{Densities, fit_baseline};
use super::environment::EnvironmentCourse;
use crate::spectral_noise::flicker_density;
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};
use statrs::distribution::{ChiSquared, ContinuousCDF};
use std::f64::consts::{PI, TAU};

/// Blocks per record; faster waveforms are not tested here.
pub(super) const BLOCKS: usize = 128;
/// Highest frequency in the sum of flicker noise, periods per record.
const HIGHEST: usize = 8 * BLOCKS;
/// Lowest frequency is 1/2 period per record, since the generator's record is longer.
const SUBDIVISION: usize = 2;

/// Covariances of block means per unit of the squared coefficients.
pub(super) struct BlockNoises {
    block_s: f64,
    flicker: DMatrix<f64>,
}

pub(super) struct BlockNoise<'a> {
    /// Two-sided density of all white noise, unit²/Hz.
    pub(super) white: f64,
    /// B, unit.
    pub(super) flicker: f64,
    /// K, unit/√s.
    pub(super) walk: f64,
    /// Time constant in s and variance of each Gauss-Markov process.
    pub(super) processes: &'a [(f64, f64)],
}

impl BlockNoises {
    pub(super) fn new(seconds: f64) -> Self {
        let block_s = seconds / BLOCKS as f64;
        let spacing = 1.0 / (SUBDIVISION as f64 * seconds);
        let of_lag = |lag: usize| {
            let of_line = |k: usize| {
                let frequency = k as f64 * spacing;
                let phase = PI * frequency * block_s;
                let gain = (phase.sin() / phase).powi(2);
                flicker_density(1.0, frequency) * spacing * gain * (TAU * frequency * lag as f64 * block_s).cos()
            };
            (1..=SUBDIVISION * HIGHEST).map(of_line).sum::<f64>()
        };
        let lags: Vec<f64> = (0..BLOCKS).map(of_lag).collect();
        Self { block_s, flicker: DMatrix::from_fn(BLOCKS, BLOCKS, |i, j| lags[i.abs_diff(j)]) }
    }

    pub(super) fn covariance(&self, noise: &BlockNoise) -> DMatrix<f64> {
        let block_s = self.block_s;
        let entry = |i: usize, j: usize| {
            let white = if i == j { noise.white / block_s } else { 0.0 };
            // The variance is that in the middle of the earlier block.
            let walk = match i == j {
                true => i as f64 + 1.0 / 3.0,
                false => i.min(j) as f64 + 0.5,
            };
            let processes = noise
                .processes
                .iter()
                .map(|&(time_s, variance)| variance * exponential(block_s / time_s, i.abs_diff(j)));
            white + noise.walk.powi(2) * block_s * walk + processes.sum::<f64>()
        };
        DMatrix::from_fn(BLOCKS, BLOCKS, entry) + noise.flicker.powi(2) * &self.flicker
    }
}

/// Covariance of means over two blocks `lag` blocks apart, each `length` correlation times long, in a process of
/// variance 1.
fn exponential(length: f64, lag: usize) -> f64 {
    let decay = (-length).exp();
    match lag {
        0 => 2.0 * (length - 1.0 + decay) / (length * length),
        lag => (1.0 - decay).powi(2) / (length * length) * (-length * (lag as f64 - 1.0)).exp(),
    }
}

/// Expected log likelihood ratio of a waveform in N, B and K against a constant with the best N, B and K.
///
/// Each cosine of the blocks contributes `½·((c + s²)/m − 1 + ln(m/c))` (Whittle), with the variance `c`, the
/// waveform's part `s`, and the variance `m` of the model without it.
pub(super) struct WaveformTest {
    cosines: DMatrix<f64>,
    densities: Vec<Densities>,
    squares: [f64; 3],
}

impl WaveformTest {
    /// A test for `noise`. `squares` are its N², B² and K²; its other white noise and its processes are known.
    pub(super) fn new(noise: &BlockNoise, squares: [f64; 3], noises: &BlockNoises) -> Self {
        let cosines = cosines();
        let variances = |noise: &BlockNoise| cosine_variances(&cosines, &noises.covariance(noise));
        let unit = |white: f64, flicker: f64, walk: f64| BlockNoise { white, flicker, walk, processes: &[] };
        let [white, flicker, walk] =
            [unit(1.0, 0.0, 0.0), unit(0.0, 1.0, 0.0), unit(0.0, 0.0, 1.0)].map(|of| variances(&of));
        let truth = variances(noise);
        let known = variances(&BlockNoise { white: noise.white - squares[0], flicker: 0.0, walk: 0.0, ..*noise });
        let of_cosine =
            |k: usize| Densities { baseline: [white[k], flicker[k], walk[k]], known: known[k], truth: truth[k] };
        let densities = (0..cosines.ncols()).map(of_cosine).collect();
        Self { cosines, densities, squares }
    }

    pub(super) fn ratio(&self, values: &[f64]) -> f64 {
        let shares = self.cosines.tr_mul(&DVector::from_column_slice(values));
        let with = |(of, share): (&Densities, &f64)| Densities { truth: of.truth + share * share, ..*of };
        let shown: Vec<Densities> = self.densities.iter().zip(&shares).map(with).collect();
        let squares = fit_baseline(&shown, &vec![1.0; shown.len()], self.squares);
        let ratio = |(with, without): (&Densities, &Densities)| {
            let modelled = with.modelled(&squares);
            0.5 * (with.truth / modelled - 1.0 + (modelled / without.truth).ln())
        };
        shown.iter().zip(&self.densities).map(ratio).sum()
    }
}

/// Normalised cosines of 1, 2, … half periods, in columns.
fn cosines() -> DMatrix<f64> {
    let length = (2.0 / BLOCKS as f64).sqrt();
    DMatrix::from_fn(BLOCKS, BLOCKS - 1, |block, k| {
        length * (PI * (block as f64 + 0.5) * (k + 1) as f64 / BLOCKS as f64).cos()
    })
}

fn cosine_variances(cosines: &DMatrix<f64>, covariance: &DMatrix<f64>) -> Vec<f64> {
    let weighted = covariance * cosines;
    (0..cosines.ncols()).map(|k| cosines.column(k).dot(&weighted.column(k))).collect()
}

/// `sᵀC⁻¹s` of a waveform `s` beside a free constant.
fn energy(factor: &Cholesky<f64, Dyn>, values: &DVector<f64>) -> f64 {
    let ones = DVector::from_element(values.len(), 1.0);
    let weighted = factor.solve(&ones);
    let along = weighted.dot(values);
    values.dot(&factor.solve(values)) - along * along / weighted.dot(&ones)
}

/// p-value of `shape` in the block `means` by the likelihood ratio with free noises (χ²); `white` is known.
pub(super) fn p_value(means: &[f64], shape: &[f64], noises: &BlockNoises, white: f64) -> f64 {
    let (means, shape) = (DVector::from_column_slice(means), DVector::from_column_slice(shape));
    let ones = DVector::from_element(means.len(), 1.0);
    // The ratios are relative to the white variance.
    let ratios = || (-2..=12).map(|power| if power == -2 { 0.0 } else { 4f64.powi(power - 4) });
    let mut best = [f64::INFINITY; 2];
    for flicker in ratios() {
        for walk in ratios() {
            let white_s = white / noises.block_s;
            let noise = BlockNoise {
                white,
                flicker: (flicker * white_s).sqrt(),
                walk: (walk * white_s / noises.block_s).sqrt(),
                processes: &[],
            };
            let Some(factor) = noises.covariance(&noise).cholesky() else { continue };
            let logarithm = 2.0 * factor.l_dirty().diagonal().iter().map(|entry| entry.ln()).sum::<f64>();
            // The models are a constant alone, and a constant with the waveform.
            let (a, b) = (factor.solve(&ones), factor.solve(&shape));
            let rest = means.dot(&factor.solve(&means)) - a.dot(&means).powi(2) / a.dot(&ones);
            let (along, length) =
                (b.dot(&means) - b.dot(&ones) * a.dot(&means) / a.dot(&ones), energy(&factor, &shape));
            for (best, rest) in best.iter_mut().zip([rest, rest - along * along / length.max(f64::MIN_POSITIVE)]) {
                *best = best.min(logarithm + rest);
            }
        }
    }
    let fall = (best[0] - best[1]).max(0.0);
    ChiSquared::new(1.0).map_or(1.0, |distribution| distribution.sf(fall))
}

pub(super) fn block_means(course: &[f64]) -> Vec<f64> {
    let at = |block: usize| course.len() * block / BLOCKS;
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len().max(1) as f64;
    (0..BLOCKS).map(|block| mean(&course[at(block)..at(block + 1)])).collect()
}

pub(super) fn environment_means(course: &EnvironmentCourse) -> [Vec<f64>; 2] {
    [block_means(&course.temperature_c), block_means(&course.supply_v)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spectral_noise::gaussian_noise;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    /// Half the sum of squared differences of neighbouring block means of flicker noise is its Allan variance, (2 ln 2/π)·B².
    #[test]
    fn the_flicker_covariance_has_the_allan_variance_of_the_standard() {
        let noises = BlockNoises::new(1280.0);
        let covariance = &noises.flicker;
        let allan = covariance[(0, 0)] - covariance[(0, 1)];
        let expected = 2.0 * std::f64::consts::LN_2 / PI;
        // Frequencies beyond 8 periods per block contribute a few thousandths.
        assert!((allan / expected - 1.0).abs() < 0.01, "{allan}, {expected}");
    }

    /// A walk has K²·τ/3; the Gauss-Markov process has a long correlation time.
    #[test]
    fn walk_and_process_have_their_allan_variances() {
        let noises = BlockNoises::new(1280.0);
        let noise =
            |walk: f64, processes: &'static [(f64, f64)]| BlockNoise { white: 0.0, flicker: 0.0, walk, processes };
        let allan = |noise: BlockNoise| {
            let c = noises.covariance(&noise);
            0.5 * (c[(4, 4)] + c[(5, 5)] - 2.0 * c[(4, 5)])
        };
        assert!((allan(noise(0.3, &[])) / (0.09 * 10.0 / 3.0) - 1.0).abs() < 1e-9);
        // The process has 2σ²τ/(3T) in first order of τ/T.
        assert!((allan(noise(0.0, &[(1e5, 2.0)])) / (2.0 * 2.0 / 3.0 * 1e-4) - 1.0).abs() < 1e-3);
    }

    /// The mean of 40 p-values is ½ ± 0.046.
    #[test]
    fn the_test_of_a_waveform_keeps_its_level() {
        let noises = BlockNoises::new(BLOCKS as f64);
        let ramp: Vec<f64> = (0..BLOCKS).map(|block| block as f64).collect();
        let p_of_seed = |seed: u64, slope: f64| {
            let mut random = ChaCha8Rng::seed_from_u64(seed);
            let white = gaussian_noise(|_| 2.0, 1.0, BLOCKS, &mut random);
            let means: Vec<f64> = white.iter().zip(&ramp).map(|(noise, ramp)| noise + slope * ramp).collect();
            p_value(&means, &ramp, &noises, 1.0)
        };
        let mean = (0..40).map(|seed| p_of_seed(seed, 0.0)).sum::<f64>() / 40.0;
        assert!((mean - 0.5).abs() < 4.0 * 0.046, "{mean}");
        // The ramp has 128³/12·slope² = 29² standard deviations.
        assert!(p_of_seed(1, 0.07) < 2e-4, "{}", p_of_seed(1, 0.07));
    }
}
