//! Simulated samples of each process from its recursion, and autocovariances from their definition: independent of the
//! closed forms.
#![allow(dead_code, reason = "each test file uses a part of it")]

use allan_core::term::{LowPass, Markov, MovingAverageFilter, NoiseTerm, Resonance, Sinusoid};
use allan_core::{Cascade, Curve};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use std::f64::consts::PI;
use std::{panic, vec, vec::Vec};

/// Seconds between samples.
pub(crate) const PERIOD: f64 = 0.01;
/// Units per count, so small that rounding is far below every noise.
pub(crate) const LSB: f64 = 2e-6;

pub(crate) struct Noise(ChaCha8Rng);

impl Noise {
    pub(crate) fn new(seed: u64) -> Self {
        Self(ChaCha8Rng::seed_from_u64(seed))
    }

    pub(crate) fn normal(&mut self) -> f64 {
        StandardNormal.sample(&mut self.0)
    }

    /// The sum of processes with their coefficients.
    pub(crate) fn sum<'a>(
        &mut self,
        samples: usize,
        terms: impl IntoIterator<Item = &'a (NoiseTerm, f64)>,
    ) -> Vec<f64> {
        let mut sum = vec![0.0; samples];
        for (kind, value) in terms {
            let series = self.series(kind, samples);
            sum.iter_mut().zip(series).for_each(|(sum, of_one)| *sum += value * of_one);
        }
        sum
    }

    /// A process with a coefficient of 1.
    pub(crate) fn series(&mut self, kind: &NoiseTerm, samples: usize) -> Vec<f64> {
        match kind {
            NoiseTerm::AngleRandomWalk => (0..samples).map(|_| self.normal() / PERIOD.sqrt()).collect(),
            NoiseTerm::Quantization => {
                let angles: Vec<f64> = (0..=samples).map(|_| self.normal()).collect();
                angles.windows(2).map(|pair| (pair[1] - pair[0]) / PERIOD).collect()
            }
            NoiseTerm::RateRandomWalk => {
                let mut rate = 0.0;
                let mut step = || {
                    rate += self.normal() * PERIOD.sqrt();
                    rate
                };
                (0..samples).map(|_| step()).collect()
            }
            NoiseTerm::RateRamp => (0..samples).map(|k| k as f64 * PERIOD).collect(),
            NoiseTerm::Sinusoid(line) => {
                (0..samples).map(|k| (2.0 * PI * line.frequency * k as f64 * PERIOD).sin()).collect()
            }
            NoiseTerm::Markov(markov) => self.rotating((-PERIOD / markov.time_constant).exp(), 0.0, samples),
            NoiseTerm::Resonance(line) => {
                let keep = (-PI * line.bandwidth * PERIOD).exp();
                self.rotating(keep, 2.0 * PI * line.frequency * PERIOD, samples)
            }
            NoiseTerm::Filtered(filter) => self.filtered(filter, samples),
            NoiseTerm::LowPass(filter) => self.behind_low_pass(filter, samples),
            NoiseTerm::BiasInstability => self.half_integrated(samples),
        }
    }

    /// Real part of a complex Markov process of variance 1 that rotates by `angle` per sample.
    fn rotating(&mut self, keep: f64, angle: f64, samples: usize) -> Vec<f64> {
        let (sin, cos) = angle.sin_cos();
        let drive = (1.0 - keep * keep).sqrt();
        let (mut re, mut im) = (self.normal(), self.normal());
        let mut step = || {
            let turned = (keep * (re * cos - im * sin), keep * (re * sin + im * cos));
            (re, im) = (turned.0 + drive * self.normal(), turned.1 + drive * self.normal());
            re
        };
        (0..samples).map(|_| step()).collect()
    }

    fn filtered(&mut self, filter: &MovingAverageFilter, samples: usize) -> Vec<f64> {
        let response = impulse_response(filter);
        let step = filter.decimation as usize;
        let gain =
            (autocovariance(&NoiseTerm::Filtered(*filter), 0) / response.iter().map(|a| a * a).sum::<f64>()).sqrt();
        let white: Vec<f64> = (0..samples * step + response.len()).map(|_| gain * self.normal()).collect();
        let output = white.windows(response.len()).step_by(step);
        output.map(|window| window.iter().zip(&response).map(|(a, b)| a * b).sum()).take(samples).collect()
    }

    /// The state of the filter's differential equation `y″ = −2ζω₀y′ − ω₀²y + ω₀²·noise`, in steps of a hundredth of a sample by the
    /// leapfrog method, from rest.
    fn behind_low_pass(&mut self, filter: &LowPass, samples: usize) -> Vec<f64> {
        const STEPS: usize = 100;
        let (step, turn) = (PERIOD / STEPS as f64, 2.0 * PI * filter.frequency);
        let settled = (20.0 / (filter.damping * turn * PERIOD)) as usize;
        let (mut value, mut slope) = (0.0, 0.0);
        let mut next = || {
            for _ in 0..STEPS {
                let noise = self.normal() / step.sqrt();
                slope += step * (turn * turn * (noise - value) - 2.0 * filter.damping * turn * slope);
                value += step * slope;
            }
            value
        };
        (0..samples + settled).map(|_| next()).skip(settled).collect()
    }

    /// White noise integrated of order ½, which is flicker noise: J. Hosking, Biometrika 68 (1981).
    fn half_integrated(&mut self, samples: usize) -> Vec<f64> {
        let mut response = vec![1.0];
        (1..4096).for_each(|k| response.push(response[k - 1] * (k as f64 - 0.5) / k as f64));
        let white: Vec<f64> = (0..samples + response.len()).map(|_| self.normal()).collect();
        let output = white.windows(response.len()).take(samples);
        output.map(|window| window.iter().rev().zip(&response).map(|(a, b)| a * b).sum()).collect()
    }
}

/// A symmetric random telegraph signal: levels `distance` apart, with the autocovariance of a Markov process.
pub(crate) fn telegraph_signal(noise: &mut Noise, samples: usize, time_constant: f64, distance: f64) -> Vec<f64> {
    // The correlation time is 1/(λ01 + λ10).
    let change = 0.5 * (1.0 - (-PERIOD / time_constant).exp());
    let mut level = distance / 2.0;
    let mut step = || {
        if noise.0.random_bool(change) {
            level = -level;
        }
        level
    };
    (0..samples).map(|_| step()).collect()
}

/// The curve of a series, in its unit.
pub(crate) fn curve(series: &[f64]) -> Curve<20> {
    let mut cascade = Cascade::<20, 8>::new();
    series.iter().for_each(|value| cascade.push((value / LSB).round() as i32));
    cascade.curve(PERIOD).scaled(LSB)
}

/// Autocovariance of a stationary process at a lag of `j` samples, written down from its definition.
pub(crate) fn autocovariance(kind: &NoiseTerm, j: usize) -> f64 {
    let t = j as f64 * PERIOD;
    match kind {
        NoiseTerm::AngleRandomWalk => f64::from(u8::from(j == 0)) / PERIOD,
        NoiseTerm::Quantization => [2.0, -1.0].get(j).copied().unwrap_or(0.0) / (PERIOD * PERIOD),
        NoiseTerm::Markov(markov) => (-t / markov.time_constant).exp(),
        NoiseTerm::Resonance(line) => (-PI * line.bandwidth * t).exp() * (2.0 * PI * line.frequency * t).cos(),
        NoiseTerm::Sinusoid(line) => 0.5 * (2.0 * PI * line.frequency * t).cos(),
        NoiseTerm::LowPass(filter) => {
            let turn = 2.0 * PI * filter.frequency;
            let (decay, damped) = (filter.damping * turn, turn * (1.0 - filter.damping.powi(2)).sqrt());
            let oscillation = (damped * t).cos() + decay / damped * (damped * t).sin();
            turn / (4.0 * filter.damping) * (-decay * t).exp() * oscillation
        }
        NoiseTerm::Filtered(filter) => {
            let response = impulse_response(filter);
            let at = |values: usize| response.iter().zip(response.iter().skip(values)).map(|(a, b)| a * b).sum::<f64>();
            let step = filter.decimation as usize;
            let sum = at(0) + 2.0 * (1..=response.len()).map(|j| at(j * step)).sum::<f64>();
            at(j * step) / (sum * PERIOD)
        }
        other => panic!("{other:?} is not stationary"),
    }
}

pub(crate) fn impulse_response(filter: &MovingAverageFilter) -> Vec<f64> {
    let average = vec![1.0 / f64::from(filter.taps); usize::from(filter.taps)];
    if filter.stages == 1 { average } else { convolve(&average, &average) }
}

fn convolve(a: &[f64], b: &[f64]) -> Vec<f64> {
    let mut product = vec![0.0; a.len() + b.len() - 1];
    for (i, a) in a.iter().enumerate() {
        b.iter().enumerate().for_each(|(j, b)| product[i + j] += a * b);
    }
    product
}

pub(crate) const MARKOV: [Markov; 3] =
    [Markov { time_constant: 0.02 }, Markov { time_constant: 0.7 }, Markov { time_constant: 50.0 }];
pub(crate) const RESONANCE: [Resonance; 3] = [
    Resonance { frequency: 20.3, bandwidth: 0.5 },
    Resonance { frequency: 1.1, bandwidth: 0.2 },
    Resonance { frequency: 37.0, bandwidth: 6.0 },
];
/// A slow one, one about as fast as the samples, and two equal stages.
pub(crate) const LOW_PASS: [LowPass; 3] =
    [LowPass::butterworth(2.0), LowPass { frequency: 60.0, damping: 0.4 }, LowPass::two_stages(23.0)];
const FILTER: [MovingAverageFilter; 7] = [
    MovingAverageFilter { stages: 1, taps: 1, decimation: 1.0 },
    MovingAverageFilter { stages: 1, taps: 5, decimation: 1.0 },
    MovingAverageFilter::bartlett(2),
    MovingAverageFilter::bartlett(4),
    MovingAverageFilter::bartlett(16),
    // Integer decimations have an exact recursion too.
    MovingAverageFilter { stages: 2, taps: 4, decimation: 3.0 },
    MovingAverageFilter { stages: 1, taps: 8, decimation: 5.0 },
];

/// Every random term, with several shapes.
pub(crate) fn noises() -> Vec<NoiseTerm> {
    let power_laws =
        [NoiseTerm::Quantization, NoiseTerm::AngleRandomWalk, NoiseTerm::BiasInstability, NoiseTerm::RateRandomWalk];
    let shaped = MARKOV.map(NoiseTerm::Markov).into_iter().chain(RESONANCE.map(NoiseTerm::Resonance));
    power_laws
        .into_iter()
        .chain(shaped)
        .chain(LOW_PASS.map(NoiseTerm::LowPass))
        .chain(FILTER.map(NoiseTerm::Filtered))
        .collect()
}

/// Every stationary term, with several shapes.
pub(crate) fn stationary() -> Vec<NoiseTerm> {
    let lines = [0.3, 20.3, 49.0].map(|frequency| NoiseTerm::Sinusoid(Sinusoid { frequency }));
    let is_stationary = |kind: &NoiseTerm| !matches!(kind, NoiseTerm::BiasInstability | NoiseTerm::RateRandomWalk);
    noises().into_iter().filter(is_stationary).chain(lines).collect()
}
