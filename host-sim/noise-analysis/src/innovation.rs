//! Whether a model is enough for navigation: the innovations of a Kalman filter that is built from it.
//!
//! A filter that knows the noise predicts each measurement as well as can be: what it did not predict is white, and as
//! large as it expects. The measurements are means over [`BLOCK_S`], so that half an hour is some thousand steps.

use crate::uniform_series::UniformSeries;
use allan_core::{Model, NoiseTerm};
use nalgebra::{DMatrix, DVector};
use statrs::distribution::{ChiSquared, ContinuousCDF};
use std::f64::consts::{LN_2, PI, TAU};

/// Time over which samples are averaged before the filter takes them, s.
pub const BLOCK_S: f64 = 0.25;
/// Lags at which the innovations are tested for correlation.
pub const LAGS: usize = 20;

/// Blocks over which the filter finds its state before it is judged, as a share of all.
const SETTLING: usize = 8;
/// Fewest innovations that are judged.
const FEWEST: usize = 10 * LAGS;

/// What the innovations say.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Innovations {
    /// Innovations that were judged.
    pub count: usize,
    /// Mean of their squares over their expected variance: 1 for a true model.
    pub normalised: f64,
    /// Bounds between which 95 % of true models have it.
    pub consistent: (f64, f64),
    /// Correlation of each with the one before.
    pub correlation: f64,
    /// Chance that white innovations show as much correlation over [`LAGS`] lags (G. Ljung and G. Box, 1978).
    pub whiteness: f64,
}

/// Runs the filter of `model` over `unseen` samples; `None` for a record of fewer than some hundred blocks or a model
/// without noise.
#[must_use]
pub fn innovations(model: &Model, unseen: &UniformSeries) -> Option<Innovations> {
    let size = (BLOCK_S / model.sample_period()).round().max(1.0) as usize;
    let blocks = blocks(unseen, size);
    let settling = blocks.len() / SETTLING;
    let mut filter = Filter::of(model, size, unseen.duration())?;
    let normalised: Vec<f64> = blocks.iter().filter_map(|&block| filter.step(block)).skip(settling).collect();
    judged(&normalised)
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

fn judged(innovations: &[f64]) -> Option<Innovations> {
    let count = innovations.len();
    if count < FEWEST {
        return None;
    }
    let n = count as f64;
    let square: f64 = innovations.iter().map(|value| value * value).sum();
    let correlation =
        |lag: usize| innovations.iter().zip(&innovations[lag..]).map(|(a, b)| a * b).sum::<f64>() / square;
    let ljung_box = n * (n + 2.0) * (1..=LAGS).map(|lag| correlation(lag).powi(2) / (n - lag as f64)).sum::<f64>();
    let of_sum = ChiSquared::new(n).ok()?;
    let of_lags = ChiSquared::new(LAGS as f64).ok()?;
    Some(Innovations {
        count,
        normalised: square / n,
        consistent: (of_sum.inverse_cdf(0.025) / n, of_sum.inverse_cdf(0.975) / n),
        correlation: correlation(1),
        whiteness: of_lags.sf(ljung_box),
    })
}

/// A state of one or two numbers that turns and decays from block to block.
#[derive(Debug, Clone, Copy)]
struct Mode {
    /// Share that is left after a block.
    decay: f64,
    /// Turn in a block, rad; a mode that turns has two numbers.
    turn: Option<f64>,
    /// Variance that a block adds to each number.
    drive: f64,
    /// Variance at the start.
    variance: f64,
}

impl Mode {
    fn markov(variance: f64, time_constant: f64, block: f64) -> Self {
        let decay = (-block / time_constant).exp();
        Self { decay, turn: None, drive: variance * (1.0 - decay * decay), variance }
    }

    fn size(&self) -> usize {
        if self.turn.is_some() { 2 } else { 1 }
    }

    /// Allan variance of neighbouring blocks.
    fn avar(&self) -> f64 {
        // A walk has no variance of its own.
        if self.decay == 1.0 && self.turn.is_none() {
            return self.drive / 2.0;
        }
        self.variance * (1.0 - self.decay * self.turn.unwrap_or(0.0).cos())
    }
}

struct Filter {
    transition: DMatrix<f64>,
    drive: DMatrix<f64>,
    /// Which numbers of the state add up to the measurement.
    sum: DVector<f64>,
    measurement: f64,
    state: DVector<f64>,
    covariance: DMatrix<f64>,
}

impl Filter {
    /// The states of `model`: a random walk for K, a Markov process for each octave of B up to four times `duration`
    /// (the sum of their densities is flicker noise), one for each Markov term, a turning pair for a resonance or
    /// a sinusoid that blocks do not average out. All that is left of the variance of neighbouring blocks is white.
    fn of(model: &Model, size: usize, duration: f64) -> Option<Self> {
        let block = size as f64 * model.sample_period();
        let variance = model.avar(size as u64);
        let mut modes = vec![];
        // The bias: what a record's mean leaves of it is not known at the start.
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
                    let turn = Some(TAU * resonance.frequency * block);
                    modes.push(Mode { decay, turn, drive: square * (1.0 - decay * decay), variance: square });
                }
                NoiseTerm::Sinusoid(sinusoid) if 4.0 * sinusoid.frequency * block < 1.0 => {
                    let turn = Some(TAU * sinusoid.frequency * block);
                    modes.push(Mode { decay: 1.0, turn, drive: 0.0, variance: square / 2.0 });
                }
                _ => {}
            }
        }
        let spread = 100.0 * (variance + walk * duration / block);
        modes.push(Mode { decay: 1.0, turn: None, drive: walk, variance: spread });
        let measurement = (variance - modes.iter().map(Mode::avar).sum::<f64>()).max(1e-3 * variance);
        (variance > 0.0).then(|| Self::new(&modes, measurement))
    }

    fn new(modes: &[Mode], measurement: f64) -> Self {
        let size = modes.iter().map(Mode::size).sum();
        let (mut transition, mut drive) = (DMatrix::zeros(size, size), DMatrix::zeros(size, size));
        let (mut covariance, mut sum) = (DMatrix::zeros(size, size), DVector::zeros(size));
        let mut at = 0;
        for mode in modes {
            let (sin, cos) = mode.turn.unwrap_or(0.0).sin_cos();
            sum[at] = 1.0;
            for offset in 0..mode.size() {
                transition[(at + offset, at + offset)] = mode.decay * cos;
                drive[(at + offset, at + offset)] = mode.drive;
                covariance[(at + offset, at + offset)] = mode.variance;
            }
            if mode.size() == 2 {
                transition[(at, at + 1)] = -mode.decay * sin;
                transition[(at + 1, at)] = mode.decay * sin;
            }
            at += mode.size();
        }
        Self { transition, drive, sum, measurement, state: DVector::zeros(size), covariance }
    }

    /// Predicts, and takes a measurement if there is one: its innovation over the expected standard deviation.
    fn step(&mut self, measured: Option<f64>) -> Option<f64> {
        let innovation = measured.map(|measured| {
            let gain = &self.covariance * &self.sum;
            let variance = self.sum.dot(&gain) + self.measurement;
            let innovation = measured - self.sum.dot(&self.state);
            self.state += &gain * (innovation / variance);
            self.covariance -= &gain * gain.transpose() / variance;
            innovation / variance.sqrt()
        });
        self.state = &self.transition * &self.state;
        self.covariance = &self.transition * &self.covariance * self.transition.transpose() + &self.drive;
        innovation
    }
}
