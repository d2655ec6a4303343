//! Two-sided spectral densities of the channel under test, and Whittle's likelihood ratio of an effect.

use super::generator::TrueRecording;
use nalgebra::{Matrix3, Vector3};
use std::f64::consts::PI;
use virtual_sensor::{ChannelNoise, InjectedEffect, OutputRegister};

/// Limits of the fit: iterations, halvings, and the longest step in ln of the squares.
const ITERATIONS: usize = 100;
const HALVINGS: i32 = 12;
const STEP: f64 = 3.0;
const CONVERGED: f64 = 1e-3;
const START: f64 = 0.01;
/// Regularisation, as a fraction of the total information.
const LEAST_INFORMATION: f64 = 1e-9;
const GRID: usize = 1500;
const LONGEST_FILTER_LOG2: u32 = 6;
/// Least gain for divisions. At the nulls the gain would be 0; elsewhere it is at least 10⁻⁷.
const LEAST_GAIN: f64 = 1e-9;

#[derive(Debug, Clone, Copy)]
pub(super) struct RecordLength {
    pub(super) seconds: f64,
    pub(super) period_s: f64,
}

impl RecordLength {
    pub(super) fn new(recording: &TrueRecording) -> Self {
        Self { seconds: recording.seconds, period_s: recording.sampling.period_s() }
    }
}

/// Two-sided density of sampled N, B and K, unit²/Hz; `white_gain` is the power gain of the white noise's filter.
pub(super) fn baseline_density(noise: &ChannelNoise, white_gain: f64, period_s: f64, frequency: f64) -> f64 {
    let [white, flicker, walk] = baseline_densities(period_s, frequency);
    noise.angle_random_walk.powi(2) * white_gain * white
        + noise.bias_instability.powi(2) * flicker
        + noise.rate_random_walk.powi(2) * walk
}

/// Two-sided densities of N, B and K for coefficients of 1.
pub(super) fn baseline_densities(period_s: f64, frequency: f64) -> [f64; 3] {
    // The flicker density is half of the one-sided B²/(πf).
    [1.0, 0.5 / (PI * frequency), (period_s / (2.0 * (PI * frequency * period_s).sin())).powi(2)]
}

/// Two-sided density of a sampled Gauss-Markov process of standard deviation 1, 1/Hz.
pub(super) fn markov_density(time_constant_s: f64, period_s: f64, frequency: f64) -> f64 {
    let decay = (-period_s / time_constant_s).exp();
    let angle = 2.0 * PI * frequency * period_s;
    period_s * (1.0 - decay * decay) / (1.0 - 2.0 * decay * angle.cos() + decay * decay)
}

/// Two-sided density of a sampled resonance of deviation 1; `bandwidth_hz` is the full width at half maximum, 1/Hz.
pub(super) fn resonance_density(centre_hz: f64, bandwidth_hz: f64, period_s: f64, frequency: f64) -> f64 {
    let side = |offset: f64| markov_density(1.0 / (PI * bandwidth_hz), period_s, offset);
    0.5 * (side(frequency - centre_hz) + side(frequency + centre_hz))
}

/// Two-sided density of the rate that is the difference of an angle with a white error of deviation 1.
pub(super) fn quantization_density(period_s: f64, frequency: f64) -> f64 {
    4.0 * (PI * frequency * period_s).sin().powi(2) / period_s
}

/// Power gain of two averages over 2^`taps_log2` samples.
pub(super) fn filter_gain(taps_log2: u8, period_s: f64, frequency: f64) -> f64 {
    let taps = f64::from(1u32 << taps_log2);
    let half = PI * frequency * period_s;
    ((taps * half).sin() / (taps * half.sin())).powi(4)
}

/// Power gain of a first-order low-pass with half power at `corner_hz`.
pub(super) fn low_pass_gain(corner_hz: f64, frequency: f64) -> f64 {
    1.0 / (1.0 + (frequency / corner_hz).powi(2))
}

/// Densities at one frequency, or variances of one cosine.
#[derive(Clone, Copy)]
pub(super) struct Densities {
    /// Densities per unit of N², B² and K², behind the filter.
    pub(super) baseline: [f64; 3],
    pub(super) known: f64,
    pub(super) truth: f64,
}

impl Densities {
    pub(super) fn modelled(&self, squares: &[f64; 3]) -> f64 {
        self.known + squares.iter().zip(&self.baseline).map(|(square, density)| square * density).sum::<f64>()
    }
}

/// N², B² and K² of the best fit to `densities` (Whittle, weights `counts`) by Fisher scoring, starting at `squares`.
pub(super) fn fit_baseline(densities: &[Densities], counts: &[f64], squares: [f64; 3]) -> [f64; 3] {
    let deviance = |squares: &[f64; 3]| -> f64 {
        let of = |(densities, count): (&Densities, &f64)| {
            let modelled = densities.modelled(squares);
            count * (modelled.ln() + densities.truth / modelled)
        };
        densities.iter().zip(counts).map(of).sum()
    };
    let visible = |at: usize| {
        let ratio = |densities: &Densities| START * densities.truth / densities.baseline[at];
        densities.iter().map(ratio).fold(f64::INFINITY, f64::min)
    };
    let mut best: [f64; 3] = std::array::from_fn(|at| squares[at].max(visible(at)));
    let mut least = deviance(&best);
    for _ in 0..ITERATIONS {
        let (mut information, mut score) = (Matrix3::zeros(), Vector3::zeros());
        for (densities, count) in densities.iter().zip(counts) {
            let modelled = densities.modelled(&best);
            let shares = Vector3::from_fn(|at, _| best[at] * densities.baseline[at] / modelled);
            information += *count * shares * shares.transpose();
            score += *count * (densities.truth / modelled - 1.0) * shares;
        }
        // This keeps the matrix invertible without information.
        information += Matrix3::identity() * (LEAST_INFORMATION * information.trace());
        let Some(step) = information.cholesky().map(|factor| factor.solve(&score)) else { break };
        let lengths = (0..HALVINGS).map(|halvings| 0.5f64.powi(halvings));
        let tried = lengths.map(|length| {
            let moved: [f64; 3] = std::array::from_fn(|at| best[at] * (length * step[at]).clamp(-STEP, STEP).exp());
            (deviance(&moved), moved)
        });
        let Some((deviance, moved)) = tried.into_iter().find(|(deviance, _)| *deviance < least) else { break };
        let fall = least - deviance;
        (best, least) = (moved, deviance);
        if fall < CONVERGED {
            break;
        }
    }
    best
}

pub(super) fn squares(noise: &ChannelNoise) -> [f64; 3] {
    [noise.angle_random_walk, noise.bias_instability, noise.rate_random_walk].map(|coefficient| coefficient.powi(2))
}

impl RecordLength {
    /// Frequencies in Hz, each with the number of Fourier frequencies that it represents. They are denser around a
    /// `peak` (centre, width).
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

    /// Expected log likelihood ratio of `truth` against the best N, B and K behind `gains`, with the density `known`
    /// added.
    pub(super) fn ratio_against_baseline(
        self,
        noise: &ChannelNoise,
        (gains, known): (impl Fn(f64) -> [f64; 3], impl Fn(f64) -> f64),
        peak: Option<(f64, f64)>,
        truth: impl Fn(f64) -> f64,
    ) -> f64 {
        let grid = self.grid(peak);
        let at = |&(frequency, _): &(f64, f64)| {
            let (gains, unfiltered) = (gains(frequency), baseline_densities(self.period_s, frequency));
            let baseline = std::array::from_fn(|at| gains[at] * unfiltered[at]);
            Densities { baseline, known: known(frequency), truth: truth(frequency) }
        };
        let densities: Vec<Densities> = grid.iter().map(at).collect();
        let counts: Vec<f64> = grid.iter().map(|(_, count)| *count).collect();
        let squares = fit_baseline(&densities, &counts, squares(noise));
        let deviance = |(densities, (_, count)): (&Densities, &(f64, f64))| {
            let ratio = densities.truth / densities.modelled(&squares);
            count * (ratio - 1.0 - ratio.ln())
        };
        densities.iter().zip(&grid).map(deviance).sum()
    }

    /// Expected log likelihood ratio of one process `shared` by all channels against independent ones.
    pub(super) fn ratio_of_common_mode(self, shared: impl Fn(f64) -> f64, separate: &[&dyn Fn(f64) -> f64]) -> f64 {
        let at = |(frequency, count): &(f64, f64)| {
            let ratios = separate.iter().map(|own| shared(*frequency) / own(*frequency));
            let (sum, logs) = ratios.fold((0.0, 0.0), |(sum, logs), ratio: f64| (sum + ratio, logs + ratio.ln_1p()));
            count * (logs - sum.ln_1p())
        };
        self.grid(None).iter().map(at).sum()
    }

    /// Expected log likelihood ratio of a waveform known up to its size (matched filter).
    pub(super) fn ratio_of_waveform(self, waveform: impl Fn(f64) -> f64, noise: impl Fn(f64) -> f64) -> f64 {
        self.grid(None).iter().map(|&(frequency, count)| count * waveform(frequency) / noise(frequency)).sum()
    }

    /// Mean of `function` over the frequencies up to half the sample rate.
    pub(super) fn mean(self, function: impl Fn(f64) -> f64) -> f64 {
        let (sum, counts) = self
            .grid(None)
            .iter()
            .fold((0.0, 0.0), |(sum, counts), &(frequency, count)| (sum + count * function(frequency), counts + count));
        sum / counts
    }

    /// Expected log likelihood ratio of amplitude 1 in two-sided `noise`: `T/(4S)`.
    pub(super) fn ratio_of_sinusoid(self, noise: f64) -> f64 {
        self.seconds / (4.0 * noise)
    }
}

/// A channel with its noise and the other hidden effects, whose parameters are known to the test.
pub(super) struct ChannelUnderTest<'a> {
    channel: OutputRegister,
    resolution: f64,
    corner_hz: f64,
    pub(super) noise: &'a ChannelNoise,
    pub(super) record: RecordLength,
    others: &'a [InjectedEffect],
}

impl<'a> ChannelUnderTest<'a> {
    pub(super) fn new(recording: &'a TrueRecording, channel: OutputRegister, others: &'a [InjectedEffect]) -> Self {
        let at = simulation::channel(channel) as usize;
        let (resolution, corner_hz) = (recording.sampling.resolutions[at], recording.sampling.corners_hz[at]);
        let (noise, record) = (recording.noise.channel(channel), RecordLength::new(recording));
        Self { channel, resolution, corner_hz, noise, record, others }
    }

    pub(super) fn resolution(&self) -> f64 {
        self.resolution
    }

    fn others(&self) -> impl Iterator<Item = &InjectedEffect> {
        self.others.iter().filter(|effect| effect.channels().contains(&self.channel))
    }

    pub(super) fn gain(&self, frequency: f64) -> f64 {
        let filter = |effect: &InjectedEffect| match *effect {
            InjectedEffect::FilterBandwidth { taps_log2 } => filter_gain(taps_log2, self.record.period_s, frequency),
            _ => 1.0,
        };
        self.others.iter().map(filter).product()
    }

    /// Power gains of the filters of N, B and K; the white noise has another filter before the sensor's.
    pub(super) fn noise_gains(&self, frequency: f64) -> [f64; 3] {
        let gain = self.gain(frequency);
        [gain * low_pass_gain(self.corner_hz, frequency), gain, gain]
    }

    /// Time constant in s and variance of the other Markov, common-mode and telegraph processes.
    pub(super) fn processes(&self) -> impl Iterator<Item = (f64, f64)> {
        self.others().filter_map(|effect| match *effect {
            InjectedEffect::Markov { time_constant_s, deviation, .. }
            | InjectedEffect::CommonMode { time_constant_s, deviation, .. } => {
                Some((time_constant_s, deviation * deviation))
            }
            InjectedEffect::Telegraph { time_constant_s, amplitude, .. } => {
                Some((time_constant_s, 0.25 * amplitude * amplitude))
            }
            _ => None,
        })
    }

    fn spike_density(&self) -> f64 {
        let period_s = self.record.period_s;
        let spikes = |effect: &InjectedEffect| match *effect {
            InjectedEffect::Spikes { rate_per_hour, size, .. } => {
                size * size * rate_per_hour * period_s / 3600.0 * period_s
            }
            _ => 0.0,
        };
        self.others().map(spikes).sum()
    }

    pub(super) fn white_density(&self) -> f64 {
        self.noise.angle_random_walk.powi(2) + self.spike_density()
    }

    fn added_density(&self, frequency: f64) -> f64 {
        let period_s = self.record.period_s;
        let slow: f64 =
            self.processes().map(|(time_s, variance)| variance * markov_density(time_s, period_s, frequency)).sum();
        let resonances = self.others().map(|effect| match *effect {
            InjectedEffect::Resonance { frequency_hz, bandwidth_hz, deviation, .. } => {
                deviation * deviation * resonance_density(frequency_hz, bandwidth_hz, period_s, frequency)
            }
            _ => 0.0,
        });
        slow + resonances.sum::<f64>() + self.spike_density()
    }

    /// Density of the noise that arises behind the filter: rounding and quantization.
    pub(super) fn rounding_density(&self, frequency: f64) -> f64 {
        let period_s = self.record.period_s;
        let angle = |effect: &InjectedEffect| match *effect {
            InjectedEffect::Quantization { coefficient, .. } => {
                coefficient * coefficient * quantization_density(period_s, frequency)
            }
            _ => 0.0,
        };
        self.resolution().powi(2) / 12.0 * period_s + self.others().map(angle).sum::<f64>()
    }

    pub(super) fn known_density(&self, frequency: f64) -> f64 {
        self.gain(frequency) * self.added_density(frequency) + self.rounding_density(frequency)
    }

    pub(super) fn density(&self, frequency: f64) -> f64 {
        let white_gain = low_pass_gain(self.corner_hz, frequency);
        let baseline = baseline_density(self.noise, white_gain, self.record.period_s, frequency);
        self.gain(frequency) * baseline + self.known_density(frequency)
    }

    /// True if the filtered white noise is below half a count or quantum, so that rounding is not white.
    pub(super) fn is_below_a_count(&self) -> bool {
        let quantum = |effect: &InjectedEffect| match *effect {
            // The steps of the angle are √12 times the coefficient.
            InjectedEffect::Quantization { coefficient, .. } => 12f64.sqrt() * coefficient / self.record.period_s,
            _ => 0.0,
        };
        let step = self.others().map(quantum).fold(self.resolution(), f64::max);
        let largest = (0..=LONGEST_FILTER_LOG2).map(|log2| self.white_avar(1 << log2)).fold(0.0, f64::max);
        largest < (0.5 * step).powi(2)
    }

    /// Allan variance of the filtered white noise at `n` samples: the integral of the density times
    /// `2·sin⁴(πfnT)/(n·sin(πfT))²`.
    fn white_avar(&self, n: u32) -> f64 {
        let (n, period_s) = (f64::from(n), self.record.period_s);
        self.record.mean(|frequency| {
            let half = PI * frequency * period_s;
            let transfer = 2.0 * (n * half).sin().powi(4) / (n * half.sin()).powi(2);
            self.noise_gains(frequency)[0] * self.white_density() / period_s * transfer
        })
    }

    /// Density of the noise referred to the input of the filter, where effects are added.
    pub(super) fn density_before_filter(&self, frequency: f64) -> f64 {
        self.density(frequency) / self.gain(frequency).max(LEAST_GAIN)
    }

    /// Probability of equal neighbouring counts: `q/(√(2π)·σ)` for σ ≫ q.
    pub(super) fn equal_probability(&self) -> f64 {
        let period_s = self.record.period_s;
        let rounding = self.resolution().powi(2) / 12.0 * period_s;
        let of_difference = |frequency: f64| {
            (self.density(frequency) - rounding) / period_s * 4.0 * (PI * frequency * period_s).sin().powi(2)
        };
        (self.resolution() / (2.0 * PI * self.record.mean(of_difference)).sqrt()).min(1.0)
    }
}
