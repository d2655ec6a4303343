//! The noises of the benchmark, generated from their definitions: white noise and a walk sample by sample, flicker noise
//! by its spectrum.

use super::RATE_HZ;
use allan_core::NoiseTerm;
use allan_core::term::MovingAverageFilter;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use realfft::RealFftPlanner;
use realfft::num_complex::Complex;
use std::f64::consts::PI;
use std::fmt;

/// Moving averages of the filtered noises: two over eight values each, as in the part with SENS_AVG = 3.
const TAPS: u16 = 8;

/// Counts per 0.05 °/s: so many that rounding is far below every noise, behind the filter too.
const COUNTS: f64 = 64.0;

/// A noise of the benchmark, in counts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TestNoise {
    mixture: Mixture,
    /// Whether the white noise passes through the filter of the part.
    filtered: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Mixture {
    White,
    /// N, B and K of the paper's gyro 0.0368 °/√s, 0.0093 °/s, 0.0013 °/s^1.5.
    Paper,
    /// White noise below, a random walk above 32 samples.
    Walk,
}

/// Coefficients in counts and seconds.
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
            // N²/τ = K²τ/3 at 32 samples.
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

    /// The true coefficients, each with its symbol, in counts and seconds.
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
        let deviation = n * RATE_HZ.sqrt();
        let extra = if self.filtered { 2 * usize::from(TAPS) } else { 0 };
        let mut white: Vec<f64> = (0..samples + extra).map(|_| deviation * normal(&mut random)).collect();
        if self.filtered {
            for _ in 0..2 {
                white = white.windows(TAPS.into()).map(|values| values.iter().sum::<f64>() / f64::from(TAPS)).collect();
            }
        }
        let flicker = if b > 0.0 { flicker_noise(b, samples, &mut random) } else { vec![0.0; samples] };
        let step = k / RATE_HZ.sqrt();
        let mut walk = 0.0;
        let mut sample = |(white, flicker): (&f64, f64)| {
            walk += step * normal(&mut random);
            // A walk of hours stays far within 32 bits.
            (white + flicker + walk).round() as i32
        };
        white.iter().zip(flicker).map(&mut sample).collect()
    }
}

fn normal(random: &mut impl Rng) -> f64 {
    StandardNormal.sample(random)
}

/// Flicker noise with the one-sided density `B²/(πf)`: half of a periodic record of twice the length.
fn flicker_noise(b: f64, samples: usize, random: &mut impl Rng) -> Vec<f64> {
    let length = 2 * samples;
    let transform = RealFftPlanner::<f64>::new().plan_fft_inverse(length);
    let mut spectrum = transform.make_input_vec();
    // The inverse transform sums without a factor: a density S at frequency f takes the amplitude √(S·Δf/2)/√2 in each of
    // the real and the imaginary part, Δf being the distance of the frequencies.
    let spacing = RATE_HZ / length as f64;
    for (k, value) in spectrum.iter_mut().enumerate().skip(1) {
        let density = b * b / (PI * k as f64 * spacing);
        let amplitude = (density * spacing / 4.0).sqrt();
        *value = Complex::new(amplitude * normal(random), amplitude * normal(random));
    }
    if let Some(highest) = spectrum.last_mut() {
        highest.im = 0.0;
    }
    let mut record = transform.make_output_vec();
    transform
        .process(&mut spectrum, &mut record)
        .unwrap_or_else(|error| panic!("a transform of its own length: {error}"));
    record.truncate(samples);
    record
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
