//! Noises whose Allan variance is known exactly.

use allan_core::confidence::Shares;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

/// Counts to a standard deviation of 1: rounding adds 10⁻⁷ of the white variance.
const SCALE: f64 = 1_000.0;

/// White, flicker and random-walk noise in these amounts.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Noise {
    pub(crate) white: f64,
    pub(crate) flicker: f64,
    pub(crate) walk: f64,
}

pub(crate) const WHITE: Noise = Noise { white: 1.0, flicker: 0.0, walk: 0.0 };
pub(crate) const FLICKER: Noise = Noise { white: 0.0, flicker: 1.0, walk: 0.0 };
pub(crate) const WALK: Noise = Noise { white: 0.0, flicker: 0.0, walk: 1.0 };
/// White noise up to n = 16, flicker noise around 64, random walk from 256.
pub(crate) const MIXTURE: Noise = Noise { white: 1.0, flicker: 0.15, walk: 0.012 };

/// Flicker noise is a sum of Markov processes of equal variance whose relaxation times are a factor of 4 apart, from
/// two thirds of a sample, below which it would be white, to 40 times the record.
const MARKOV: usize = 10;

/// What a process keeps of its state from one sample to the next.
fn kept(process: usize) -> f64 {
    (-1.5 / 4_f64.powi(process as i32)).exp()
}

impl Noise {
    pub(crate) fn record(self, samples: usize, seed: u64) -> Vec<i32> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
        let (mut markov, mut walk) = ([0.0; MARKOV], 0.0);
        markov.iter_mut().for_each(|state| *state = normal());
        let sample = |_| {
            let mut value = 0.0;
            if self.white > 0.0 {
                value += self.white * normal();
            }
            if self.flicker > 0.0 {
                for (process, state) in markov.iter_mut().enumerate() {
                    let kept = kept(process);
                    *state = kept * *state + (1.0 - kept * kept).sqrt() * normal();
                    value += self.flicker * *state;
                }
            }
            if self.walk > 0.0 {
                walk += self.walk * normal();
                value += walk;
            }
            (value * SCALE).round() as i32
        };
        (0..samples).map(sample).collect()
    }

    /// The three parts of the Allan variance, in counts²: white, flicker, walk.
    fn parts(self, n: u64) -> [f64; 3] {
        let real = n as f64;
        let markov = |process: usize| {
            // The variance of a sum of m values, from the autocovariance.
            let sum =
                |m: u64| m as f64 + 2.0 * (1..m).map(|j| (m - j) as f64 * kept(process).powf(j as f64)).sum::<f64>();
            (4.0 * sum(n) - sum(2 * n)) / (2.0 * real * real)
        };
        let flicker = if self.flicker > 0.0 { (0..MARKOV).map(markov).sum() } else { 0.0 };
        let parts = [1.0 / real, flicker, (2.0 * real * real + 1.0) / (6.0 * real)];
        let amounts = [self.white, self.flicker, self.walk];
        [0, 1, 2].map(|k| parts[k] * amounts[k] * amounts[k] * SCALE * SCALE)
    }

    pub(crate) fn avar(self, n: u64) -> f64 {
        self.parts(n).iter().sum()
    }

    pub(crate) fn shares(self, n: u64) -> Shares {
        let [white, flicker, random_walk] = self.parts(n).map(|part| part / self.avar(n));
        Shares { quantization: 0.0, white, flicker, random_walk }
    }
}
