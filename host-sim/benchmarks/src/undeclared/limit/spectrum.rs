//! Two-sided power spectral densities of sampled noise, and Whittle's likelihood.

use std::f64::consts::PI;
use virtual_sensor::ChannelNoise;

/// Rounds of the fit of N, B and K; each divides what is left of the excess by about two.
const ROUNDS: usize = 60;
/// Frequencies of the grid.
const GRID: usize = 1500;

/// A record of `seconds` seconds at one sample every `period_s`.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Record {
    pub(crate) seconds: f64,
    pub(crate) period_s: f64,
}

/// Density of the declared noise.
pub(crate) fn declared(noise: &ChannelNoise, period_s: f64, frequency: f64) -> f64 {
    let [white, flicker, walk] = shapes(period_s, frequency);
    noise.angle_random_walk.powi(2) * white
        + noise.bias_instability.powi(2) * flicker
        + noise.rate_random_walk.powi(2) * walk
}

fn shapes(period_s: f64, frequency: f64) -> [f64; 3] {
    // A one-sided density of B²/(πf) is half that on either side.
    [1.0, 0.5 / (PI * frequency), (period_s / (2.0 * (PI * frequency * period_s).sin())).powi(2)]
}

/// Density of a Gauss-Markov process of standard deviation 1, sampled.
pub(crate) fn markov(time_constant_s: f64, period_s: f64, frequency: f64) -> f64 {
    let decay = (-period_s / time_constant_s).exp();
    let angle = 2.0 * PI * frequency * period_s;
    period_s * (1.0 - decay * decay) / (1.0 - 2.0 * decay * angle.cos() + decay * decay)
}

/// Density of noise in a band of full width `bandwidth_hz` around `centre_hz`, of standard deviation 1, sampled.
pub(crate) fn resonance(centre_hz: f64, bandwidth_hz: f64, period_s: f64, frequency: f64) -> f64 {
    let side = |offset: f64| markov(1.0 / (PI * bandwidth_hz), period_s, offset);
    0.5 * (side(frequency - centre_hz) + side(frequency + centre_hz))
}

/// Density of the differences of an angle with a white error of standard deviation 1, over the sample period.
pub(crate) fn quantization(period_s: f64, frequency: f64) -> f64 {
    4.0 * (PI * frequency * period_s).sin().powi(2) / period_s
}

/// Power that two averages of 2^`taps_log2` samples let through.
pub(crate) fn filter(taps_log2: u8, period_s: f64, frequency: f64) -> f64 {
    let taps = f64::from(1u32 << taps_log2);
    let half = PI * frequency * period_s;
    ((taps * half).sin() / (taps * half.sin())).powi(4)
}

/// At one frequency.
struct Densities {
    /// Of N, B and K of 1.
    shapes: [f64; 3],
    known: f64,
    truth: f64,
}

impl Densities {
    fn modelled(&self, squares: &[f64; 3]) -> f64 {
        self.known + squares.iter().zip(&self.shapes).map(|(square, shape)| square * shape).sum::<f64>()
    }
}

impl Record {
    /// Frequencies with the number of Fourier frequencies that each stands for: logarithmic over all, and finer around
    /// `centre_hz` where the density has a peak `width_hz` wide.
    fn grid(self, peak: Option<(f64, f64)>) -> Vec<(f64, f64)> {
        let (lowest, highest) = (1.0 / self.seconds, 0.5 / self.period_s);
        let step = (highest / lowest).ln() / GRID as f64;
        let mut edges: Vec<f64> = (0..=GRID).map(|at| lowest * (step * at as f64).exp()).collect();
        if let Some((centre_hz, width_hz)) = peak {
            edges.extend((-400..=400).map(|at| centre_hz + 0.05 * width_hz * f64::from(at)));
            edges.retain(|edge| (lowest..=highest).contains(edge));
            edges.sort_by(f64::total_cmp);
        }
        let interval = |pair: &[f64]| (0.5 * (pair[0] + pair[1]), (pair[1] - pair[0]) * self.seconds);
        edges.windows(2).map(interval).filter(|(_, count)| *count > 0.0).collect()
    }

    /// Expected log likelihood ratio of noise of density `truth` against the best N, B and K, which start at those of
    /// `noise`. They pass a filter that lets the power `gain` through, and noise of density `known` is added.
    pub(crate) fn against_declared(
        self,
        noise: &ChannelNoise,
        (gain, known): (impl Fn(f64) -> f64, impl Fn(f64) -> f64),
        peak: Option<(f64, f64)>,
        truth: impl Fn(f64) -> f64,
    ) -> f64 {
        let grid = self.grid(peak);
        let at = |&(frequency, _): &(f64, f64)| {
            let gain = gain(frequency);
            let shapes = shapes(self.period_s, frequency).map(|shape| gain * shape);
            Densities { shapes, known: known(frequency), truth: truth(frequency) }
        };
        let densities: Vec<Densities> = grid.iter().map(at).collect();
        let mut squares = [
            noise.angle_random_walk.powi(2),
            noise.bias_instability.powi(2).max(1e-12),
            noise.rate_random_walk.powi(2).max(1e-15),
        ];
        for _ in 0..ROUNDS {
            // The multiplicative step that never raises the deviance and never leaves the positive numbers.
            let (mut over, mut under) = ([0.0; 3], [0.0; 3]);
            for (densities, (_, count)) in densities.iter().zip(&grid) {
                let modelled = densities.modelled(&squares);
                for ((over, under), shape) in over.iter_mut().zip(&mut under).zip(&densities.shapes) {
                    *over += count * shape * densities.truth / (modelled * modelled);
                    *under += count * shape / modelled;
                }
            }
            for ((square, over), under) in squares.iter_mut().zip(over).zip(under) {
                *square *= (over / under).sqrt();
            }
        }
        let deviance = |(densities, (_, count)): (&Densities, &(f64, f64))| {
            let ratio = densities.truth / densities.modelled(&squares);
            count * (ratio - 1.0 - ratio.ln())
        };
        densities.iter().zip(&grid).map(deviance).sum()
    }

    /// Expected log likelihood ratio of processes of density `shared` that channels with the densities `alone` have in
    /// common, against processes of the same densities that are independent.
    pub(crate) fn coherent(self, shared: impl Fn(f64) -> f64, alone: &[&dyn Fn(f64) -> f64]) -> f64 {
        let at = |(frequency, count): &(f64, f64)| {
            let ratios = alone.iter().map(|alone| shared(*frequency) / alone(*frequency));
            let (sum, separate) =
                ratios.fold((0.0, 0.0), |(sum, logs), ratio: f64| (sum + ratio, logs + ratio.ln_1p()));
            count * (separate - sum.ln_1p())
        };
        self.grid(None).iter().map(at).sum()
    }

    /// The same for a waveform that is known up to its size: half its energy over the density of the noise.
    pub(crate) fn matched(self, waveform: impl Fn(f64) -> f64, noise: impl Fn(f64) -> f64) -> f64 {
        self.grid(None).iter().map(|&(frequency, count)| count * waveform(frequency) / noise(frequency)).sum()
    }

    /// Mean over all frequencies up to half the sample rate.
    pub(crate) fn mean(self, of: impl Fn(f64) -> f64) -> f64 {
        let (sum, counts) = self
            .grid(None)
            .iter()
            .fold((0.0, 0.0), |(sum, counts), &(frequency, count)| (sum + count * of(frequency), counts + count));
        sum / counts
    }

    /// A sinusoid of amplitude 1 in noise of density `noise` at its frequency: `T/(4S)`.
    pub(crate) fn line(self, noise: f64) -> f64 {
        self.seconds / (4.0 * noise)
    }
}
