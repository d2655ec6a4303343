//! The test noises, by their definitions: white noise and walk sample by sample, flicker noise by its spectrum.

use crate::reproduction::TRUTH;
use crate::spectral_noise::{baseline, moving_average};
use allan_core::NoiseTerm;
use allan_core::term::MovingAverageFilter;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use std::fmt;
use virtual_sensor::ChannelNoise;

/// Samples per second of the simulated records.
pub const RATE_HZ: f64 = 204.8;
/// Taps of the filter: two moving averages of eight values, as with SENS_AVG = 3.
const TAPS: u16 = 8;
/// Size of a count, °/s, so small that rounding is negligible.
const LSB: f64 = 0.05 / 64.0;

#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TestNoise {
    name: &'static str,
    /// N, B and K in counts and seconds; 0 for what it lacks.
    coefficients: [f64; 3],
    filtered: bool,
}

impl TestNoise {
    /// White noise, the noise of the published characterisation, and white noise that dominates below 32 samples with a walk that does
    /// above; each without and with the filter.
    pub fn all() -> Vec<Self> {
        let [n, b, k] = TRUTH.map(|coefficient| coefficient / LSB);
        // N²/τ equals K²τ/3 at 32 samples.
        let walk = 3.0_f64.sqrt() * n * RATE_HZ / 32.0;
        let mixtures =
            [("white", [n, 0.0, 0.0]), ("N, B, K of the paper", [n, b, k]), ("white and walk", [n, 0.0, walk])];
        let noises = |filtered| mixtures.map(|(name, coefficients)| Self { name, coefficients, filtered });
        [false, true].into_iter().flat_map(noises).collect()
    }

    /// The terms of the noise, in the order of [`truth`](Self::truth).
    pub fn terms(self) -> Vec<NoiseTerm> {
        let filtered = NoiseTerm::Filtered(MovingAverageFilter::bartlett(TAPS));
        let white = if self.filtered { filtered } else { NoiseTerm::AngleRandomWalk };
        let all = [white, NoiseTerm::BiasInstability, NoiseTerm::RateRandomWalk].into_iter().zip(self.coefficients);
        all.filter(|(_, value)| *value > 0.0).map(|(term, _)| term).collect()
    }

    /// Shortest averaging factor of the fit: four filter lengths, since flicker noise and walk do not pass the filter
    /// here.
    pub fn shortest_fitted(self) -> u64 {
        if self.filtered { 8 * u64::from(TAPS) } else { 1 }
    }

    /// The true coefficients with their symbols, in counts and seconds.
    pub fn truth(self) -> Vec<(&'static str, f64)> {
        ["N", "B", "K"].into_iter().zip(self.coefficients).filter(|(_, value)| *value > 0.0).collect()
    }

    pub fn record(self, samples: usize, seed: u64) -> Vec<i32> {
        let [angle_random_walk, bias_instability, rate_random_walk] = self.coefficients;
        let noise = ChannelNoise { angle_random_walk, bias_instability, rate_random_walk, ..ChannelNoise::default() };
        let stages = if self.filtered { 2 } else { 0 };
        let length = samples + stages * usize::from(TAPS - 1);
        let signal = baseline(&noise, RATE_HZ, length, &mut ChaCha8Rng::seed_from_u64(seed));
        let signal = (0..stages).fold(signal, |signal, _| moving_average(&signal, TAPS.into()));
        signal.into_iter().map(|value| value.round() as i32).collect()
    }
}

impl fmt::Display for TestNoise {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(f, "{}{}", self.name, if self.filtered { ", filtered" } else { "" })
    }
}
