//! The test noises, by their definitions: white noise and walk sample by sample, flicker noise by its spectrum.

use crate::spectral_noise::{flicker_density, gaussian_noise, normal};
use allan_core::NoiseTerm;
use allan_core::term::MovingAverageFilter;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use std::fmt;

/// Samples per second of the simulated records.
pub const RATE_HZ: f64 = 204.8;
/// Taps of the filter: two moving averages of eight values, as with SENS_AVG = 3.
const TAPS: u16 = 8;

/// Counts per 0.05 °/s, so many that rounding is negligible.
const COUNTS: f64 = 64.0;

/// A noise of the benchmark, in counts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TestNoise {
    mixture: Mixture,
    /// True if the noise has passed the part's filter.
    filtered: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Mixture {
    White,
    /// N, B and K of the published characterisation: 0.0368 °/√s, 0.0093 °/s, 0.0013 °/s^1.5.
    Paper,
    /// White noise dominates below 32 samples, a walk above.
    Walk,
}

#[derive(Debug, Clone, Copy, PartialEq)]
struct Coefficients {
    n: f64,
    b: f64,
    k: f64,
}

impl TestNoise {
    /// The noises of the benchmark.
    pub const ALL: [Self; 6] = [
        Self { mixture: Mixture::White, filtered: false },
        Self { mixture: Mixture::Paper, filtered: false },
        Self { mixture: Mixture::Walk, filtered: false },
        Self { mixture: Mixture::White, filtered: true },
        Self { mixture: Mixture::Paper, filtered: true },
        Self { mixture: Mixture::Walk, filtered: true },
    ];

    fn coefficients(self) -> Coefficients {
        let lsb = 0.05 / COUNTS;
        let n = 0.0368 / lsb;
        match self.mixture {
            Mixture::White => Coefficients { n, b: 0.0, k: 0.0 },
            Mixture::Paper => Coefficients { n, b: 0.0093 / lsb, k: 0.0013 / lsb },
            // N²/τ equals K²τ/3 at 32 samples.
            Mixture::Walk => Coefficients { n, b: 0.0, k: 3.0_f64.sqrt() * n * RATE_HZ / 32.0 },
        }
    }

    /// The terms of the noise, in the order of [`truth`](Self::truth).
    #[must_use]
    pub fn terms(self) -> &'static [NoiseTerm] {
        const FILTERED: NoiseTerm = NoiseTerm::Filtered(MovingAverageFilter::bartlett(TAPS));
        use NoiseTerm::{AngleRandomWalk, BiasInstability, RateRandomWalk};
        match (self.mixture, self.filtered) {
            (Mixture::White, false) => &[AngleRandomWalk],
            (Mixture::Paper, false) => &[AngleRandomWalk, BiasInstability, RateRandomWalk],
            (Mixture::Walk, false) => &[AngleRandomWalk, RateRandomWalk],
            (Mixture::White, true) => &[FILTERED],
            (Mixture::Paper, true) => &[FILTERED, BiasInstability, RateRandomWalk],
            (Mixture::Walk, true) => &[FILTERED, RateRandomWalk],
        }
    }

    /// Shortest averaging factor of the fit: four filter lengths, since flicker noise and walk do not pass the filter
    /// here.
    #[must_use]
    pub fn shortest_fitted(self) -> u64 {
        if self.filtered { 8 * u64::from(TAPS) } else { 1 }
    }

    /// The true coefficients with their symbols, in counts and seconds.
    #[must_use]
    pub fn truth(self) -> Vec<(&'static str, f64)> {
        let Coefficients { n, b, k } = self.coefficients();
        [("N", n), ("B", b), ("K", k)].into_iter().filter(|(_, value)| *value > 0.0).collect()
    }

    /// A record of `samples` counts.
    #[must_use]
    pub fn record(self, samples: usize, seed: u64) -> Vec<i32> {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let Coefficients { n, b, k } = self.coefficients();
        let (deviation, step) = (n * RATE_HZ.sqrt(), k / RATE_HZ.sqrt());
        let stages = if self.filtered { 2 } else { 0 };
        let length = samples + stages * usize::from(TAPS - 1);
        let flicker = if b > 0.0 {
            gaussian_noise(|frequency| flicker_density(b, frequency), RATE_HZ, length, &mut random)
        } else {
            vec![0.0; length]
        };
        let mut walk = 0.0;
        let sum = |flicker: f64| {
            walk += step * normal(&mut random);
            deviation * normal(&mut random) + flicker + walk
        };
        let mut signal: Vec<f64> = flicker.into_iter().map(sum).collect();
        for _ in 0..stages {
            signal = signal.windows(TAPS.into()).map(|values| values.iter().sum::<f64>() / f64::from(TAPS)).collect();
        }
        signal.into_iter().map(|value| value.round() as i32).collect()
    }
}

impl fmt::Display for TestNoise {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let mixture = match self.mixture {
            Mixture::White => "white",
            Mixture::Paper => "N, B, K of the paper",
            Mixture::Walk => "white and walk",
        };
        write!(f, "{mixture}{}", if self.filtered { ", filtered" } else { "" })
    }
}
