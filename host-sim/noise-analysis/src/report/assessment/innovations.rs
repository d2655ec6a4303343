//! Test of a model by the innovations of a Kalman filter that is built from it.
//!
//! The innovations of a filter with the true model are white and have the variance that the filter expects. The measurements
//! are means over [`BLOCK_S`]; half an hour has 7200 of them.

use crate::distributions::{chi_squared_quantile, chi_squared_tail, mean_ratio_tail};
use crate::samples::uniform_series::UniformSeries;
use allan_core::{Model, NoiseTerm};
use nalgebra::{DMatrix, DVector};
use serde::Serialize;
use std::f64::consts::{LN_2, PI, TAU};

/// Time over which samples are averaged to one measurement of the filter, s.
pub const BLOCK_S: f64 = 0.25;
/// Lags at which the innovations are tested for correlation.
pub const LAGS: usize = 20;

/// One part in so many of the blocks is left out at the start, until the filter's state has settled.
const SETTLING: usize = 8;
/// Fewest innovations that are tested.
const MIN_INNOVATIONS: usize = 10 * LAGS;

/// Consistency and whiteness of the innovations.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Innovations {
    pub count: usize,
    /// Mean of the squares over the expected variance: 1 for a true model.
    pub normalised: f64,
    /// Lower 95 % bound of `normalised` for a true model.
    pub low: f64,
    /// Upper 95 % bound of `normalised` for a true model.
    pub high: f64,
    /// Correlation of each innovation with the one before.
    pub correlation: f64,
    /// Probability that white innovations show as much correlation over [`LAGS`] lags (G. Ljung and G. Box, 1978).
    pub whiteness_p: f64,
}

impl Innovations {
    /// Probability that a true model, fitted to as long a stretch, claims as small an error: the mean squares of both scatter.
    #[must_use]
    pub fn chance_of_small_claim(&self) -> f64 {
        // A square of a normal number is worth half an exponential one.
        let half = self.count as f64 / 2.0;
        mean_ratio_tail(self.normalised, half, half)
    }
}

/// Runs the filter of `model` over `unseen` samples; `None` for a record of fewer than 228 blocks or a model without noise.
#[must_use]
pub fn filter_innovations(model: &Model, unseen: &UniformSeries) -> Option<Innovations> {
    let size = (BLOCK_S / model.sample_period()).round().max(1.0) as usize;
    let blocks = blocks(unseen, size);
    let settling = blocks.len() / SETTLING;
    let mut filter = KalmanFilter::from_model(model, size, unseen.duration())?;
    let normalised: Vec<f64> = blocks.iter().filter_map(|&block| filter.step(block)).skip(settling).collect();
    test(&normalised)
}

/// Means of whole blocks; `None` where half of the samples or more are missing.
fn blocks(grid: &UniformSeries, size: usize) -> Vec<Option<f64>> {
    let mean = grid.mean();
    let of = |chunk: &[f64]| {
        let present: Vec<f64> = chunk.iter().filter(|value| value.is_finite()).map(|value| value - mean).collect();
        (2 * present.len() > size).then(|| present.iter().sum::<f64>() / present.len() as f64)
    };
    grid.values().chunks_exact(size).map(of).collect()
}

/// Tests innovations that are divided by their expected standard deviation.
fn test(innovations: &[f64]) -> Option<Innovations> {
    let count = innovations.len();
    if count < MIN_INNOVATIONS {
        return None;
    }
    let n = count as f64;
    let square: f64 = innovations.iter().map(|value| value * value).sum();
    let correlation =
        |lag: usize| innovations.iter().zip(&innovations[lag..]).map(|(a, b)| a * b).sum::<f64>() / square;
    let ljung_box = n * (n + 2.0) * (1..=LAGS).map(|lag| correlation(lag).powi(2) / (n - lag as f64)).sum::<f64>();
    Some(Innovations {
        count,
        normalised: square / n,
        low: chi_squared_quantile(0.025, n) / n,
        high: chi_squared_quantile(0.975, n) / n,
        correlation: correlation(1),
        whiteness_p: chi_squared_tail(ljung_box, LAGS as f64),
    })
}

/// One or two numbers of the filter's state, which rotate and decay from block to block.
#[derive(Debug, Clone, Copy)]
struct Mode {
    /// Factor of the amplitude in one block.
    decay: f64,
    /// Rotation in one block, rad; a mode that rotates has two numbers.
    rotation: Option<f64>,
    /// Process noise: variance that one block adds to each number.
    process_noise: f64,
    /// Variance of each number at the start.
    variance: f64,
}

impl Mode {
    fn markov(variance: f64, time_constant: f64, block: f64) -> Self {
        let decay = (-block / time_constant).exp();
        Self { decay, rotation: None, process_noise: variance * (1.0 - decay * decay), variance }
    }

    fn size(&self) -> usize {
        if self.rotation.is_some() { 2 } else { 1 }
    }

    /// Allan variance of the mode at the length of a block.
    fn avar(&self) -> f64 {
        // A random walk.
        if self.decay == 1.0 && self.rotation.is_none() {
            return self.process_noise / 2.0;
        }
        self.variance * (1.0 - self.decay * self.rotation.unwrap_or(0.0).cos())
    }
}

struct KalmanFilter {
    /// Each with the place of its first number in the state.
    modes: Vec<(usize, Mode)>,
    /// Observation vector: 1 for each number of the state that is a part of the measurement.
    observation: DVector<f64>,
    /// Variance of the white noise of a measurement.
    measurement_noise: f64,
    state: DVector<f64>,
    covariance: DMatrix<f64>,
}

impl KalmanFilter {
    /// The filter of `model` for blocks of `size` samples.
    ///
    /// Its states are a random walk for K, a Markov process for each octave of B up to four times `duration` (the sum of their densities
    /// approximates flicker noise), one for each Markov term, and a rotating pair for each resonance or sinusoid below a quarter of the
    /// block rate. The rest of the Allan variance at the length of a block is white measurement noise, at least a thousandth of it.
    fn from_model(model: &Model, size: usize, duration: f64) -> Option<Self> {
        let block = size as f64 * model.sample_period();
        let variance = model.avar(size as u64);
        let mut modes = vec![];
        // Variance that the random walk of the bias adds in a block.
        let mut walk = 0.0;
        for term in model.terms() {
            let square = term.value * term.value;
            match term.kind {
                NoiseTerm::RateRandomWalk => walk += square * block,
                NoiseTerm::BiasInstability => {
                    let octaves =
                        (0..).map(|octave| block * 2f64.powi(octave)).take_while(|time| *time < 4.0 * duration);
                    modes.extend(octaves.map(|time| Mode::markov(square * LN_2 / PI, time, block)));
                }
                NoiseTerm::Markov(markov) if markov.time_constant > block => {
                    modes.push(Mode::markov(square, markov.time_constant, block));
                }
                NoiseTerm::Resonance(resonance) if 4.0 * resonance.frequency * block < 1.0 => {
                    let decay = (-PI * resonance.bandwidth * block).exp();
                    let rotation = Some(TAU * resonance.frequency * block);
                    modes.push(Mode {
                        decay,
                        rotation,
                        process_noise: square * (1.0 - decay * decay),
                        variance: square,
                    });
                }
                NoiseTerm::Sinusoid(sinusoid) if 4.0 * sinusoid.frequency * block < 1.0 => {
                    let rotation = Some(TAU * sinusoid.frequency * block);
                    modes.push(Mode { decay: 1.0, rotation, process_noise: 0.0, variance: square / 2.0 });
                }
                _ => {}
            }
        }
        // The bias at the start is unknown: its variance is far larger than that of the record.
        let spread = 100.0 * (variance + walk * duration / block);
        modes.push(Mode { decay: 1.0, rotation: None, process_noise: walk, variance: spread });
        let measurement_noise = (variance - modes.iter().map(Mode::avar).sum::<f64>()).max(1e-3 * variance);
        (variance > 0.0).then(|| Self::new(&modes, measurement_noise))
    }

    fn new(modes: &[Mode], measurement_noise: f64) -> Self {
        let size = modes.iter().map(Mode::size).sum();
        let (mut covariance, mut observation) = (DMatrix::zeros(size, size), DVector::zeros(size));
        let mut at = 0;
        let placed = modes.iter().map(|&mode| {
            let place = at;
            observation[place] = 1.0;
            at += mode.size();
            (place..at).for_each(|number| covariance[(number, number)] = mode.variance);
            (place, mode)
        });
        let modes = placed.collect();
        Self { modes, observation, measurement_noise, state: DVector::zeros(size), covariance }
    }

    /// Updates the state with a block, if it is measured, and predicts the next one. Returns the innovation over its expected deviation.
    fn step(&mut self, measured: Option<f64>) -> Option<f64> {
        let innovation = measured.map(|measured| {
            let gain = &self.covariance * &self.observation;
            let variance = self.observation.dot(&gain) + self.measurement_noise;
            let innovation = measured - self.observation.dot(&self.state);
            self.state += &gain * (innovation / variance);
            self.covariance.ger(-1.0 / variance, &gain, &gain, 1.0);
            innovation / variance.sqrt()
        });
        self.predict();
        innovation
    }

    /// Predicts the state at the next block: each mode decays, rotates and takes up its noise.
    fn predict(&mut self) {
        let Self { modes, state, covariance, .. } = self;
        for &(at, mode) in modes.iter() {
            if let Some(rotation) = mode.rotation {
                let (sin, cos) = rotation.sin_cos();
                let turned = |a: f64, b: f64| (mode.decay * (cos * a - sin * b), mode.decay * (sin * a + cos * b));
                (state[at], state[at + 1]) = turned(state[at], state[at + 1]);
                for other in 0..covariance.nrows() {
                    let (a, b) = turned(covariance[(other, at)], covariance[(other, at + 1)]);
                    (covariance[(other, at)], covariance[(other, at + 1)]) = (a, b);
                }
                for other in 0..covariance.ncols() {
                    let (a, b) = turned(covariance[(at, other)], covariance[(at + 1, other)]);
                    (covariance[(at, other)], covariance[(at + 1, other)]) = (a, b);
                }
            } else if mode.decay != 1.0 {
                state[at] *= mode.decay;
                covariance.column_mut(at).scale_mut(mode.decay);
                covariance.row_mut(at).scale_mut(mode.decay);
            }
            (at..at + mode.size()).for_each(|number| covariance[(number, number)] += mode.process_noise);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::Innovations;

    /// From tables of Fisher's distribution: with 120 and 120 degrees of freedom 1.53 is exceeded with a probability of 1 %.
    #[test]
    fn the_chance_of_a_small_claim_is_that_of_two_mean_squares() {
        let of = |normalised| {
            Innovations { count: 120, normalised, low: 0.0, high: 0.0, correlation: 0.0, whiteness_p: 1.0 }
                .chance_of_small_claim()
        };
        assert!((of(1.533) - 0.01).abs() < 2e-4, "{}", of(1.533));
        assert!((of(1.0) - 0.5).abs() < 1e-9);
    }
}
