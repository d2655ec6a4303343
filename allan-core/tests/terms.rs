//! Every term three ways: against the integral of its spectrum, against its autocovariance, against simulation.

use allan_core::term::{Filter, Kind, Markov, Resonance, Sinusoid};
use allan_core::{Cascade, Model, model::Term};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use std::f64::consts::PI;

const PERIOD: f64 = 0.01;
const FACTORS: [u64; 8] = [1, 2, 3, 4, 8, 33, 128, 1024];

const MARKOV: [Markov; 3] =
    [Markov { time_constant: 0.02 }, Markov { time_constant: 0.7 }, Markov { time_constant: 50.0 }];
const RESONANCE: [Resonance; 3] = [
    Resonance { frequency: 20.3, bandwidth: 0.5 },
    Resonance { frequency: 1.1, bandwidth: 0.2 },
    Resonance { frequency: 37.0, bandwidth: 6.0 },
];
const FILTER: [Filter; 7] = [
    Filter::boxcar(1),
    Filter::boxcar(5),
    Filter::bartlett(2),
    Filter::bartlett(4),
    Filter::bartlett(16),
    // Every third value is read: an integer decimation has an exact recursion too.
    Filter { stages: 2, taps: 4, decimation: 3.0 },
    Filter { stages: 1, taps: 8, decimation: 5.0 },
];

fn noises() -> Vec<Kind> {
    let classical = [Kind::Quantization, Kind::AngleRandomWalk, Kind::BiasInstability, Kind::RateRandomWalk];
    let shaped = MARKOV.map(Kind::Markov).into_iter().chain(RESONANCE.map(Kind::Resonance));
    classical.into_iter().chain(shaped).chain(FILTER.map(Kind::Filtered)).collect()
}

/// `4∫S(f) sin⁴(πfτ)/(πfτ)² df`, for sampled data: over all frequencies up to half the sample rate, with the sum of
/// `n` samples in the place of the integral over τ. Midpoints, on a scale that is fine near 0.
fn integral(kind: &Kind, n: u64) -> f64 {
    const STEPS: u32 = 200_000;
    let nyquist = 0.5 / PERIOD;
    let sum: f64 = (0..STEPS)
        .map(|k| (f64::from(k) + 0.5) / f64::from(STEPS))
        .map(|u| {
            let (f, df) = (nyquist * u.powi(3), nyquist * 3.0 * u * u / f64::from(STEPS));
            let (whole, one) = ((PI * f * PERIOD * n as f64).sin(), (PI * f * PERIOD).sin());
            kind.process().density(f, PERIOD) * 2.0 * whole.powi(4) / (n as f64 * one).powi(2) * df
        })
        .sum();
    2.0 * sum
}

#[test]
fn the_closed_form_is_the_integral_of_the_spectrum() {
    for kind in noises() {
        for n in FACTORS {
            let (closed, integral) = (kind.avar(n, PERIOD), integral(&kind, n));
            assert!((closed / integral - 1.0).abs() < 2e-5, "{kind:?}, n = {n}: {closed} and {integral}");
        }
    }
}

/// Autocovariance at a lag of `j` samples, written down from the definition of the process.
fn autocovariance(kind: &Kind, j: usize) -> f64 {
    let t = j as f64 * PERIOD;
    match kind {
        Kind::AngleRandomWalk => f64::from(u8::from(j == 0)) / PERIOD,
        Kind::Quantization => [2.0, -1.0].get(j).copied().unwrap_or(0.0) / (PERIOD * PERIOD),
        Kind::Markov(markov) => (-t / markov.time_constant).exp(),
        Kind::Resonance(line) => (-PI * line.bandwidth * t).exp() * (2.0 * PI * line.frequency * t).cos(),
        Kind::Sinusoid(line) => 0.5 * (2.0 * PI * line.frequency * t).cos(),
        Kind::Filtered(filter) => {
            let response = impulse_response(filter);
            let at = |values: usize| response.iter().zip(response.iter().skip(values)).map(|(a, b)| a * b).sum::<f64>();
            let step = filter.decimation as usize;
            let sum = at(0) + 2.0 * (1..=response.len()).map(|j| at(j * step)).sum::<f64>();
            at(j * step) / (sum * PERIOD)
        }
        other => panic!("{other:?} is not stationary"),
    }
}

fn impulse_response(filter: &Filter) -> Vec<f64> {
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

fn stationary() -> Vec<Kind> {
    let lines = [0.3, 20.3, 49.0].map(|frequency| Kind::Sinusoid(Sinusoid { frequency }));
    let noises = noises().into_iter().filter(|kind| !matches!(kind, Kind::BiasInstability | Kind::RateRandomWalk));
    noises.chain(lines).collect()
}

#[test]
fn the_closed_form_is_that_of_the_autocovariance() {
    for kind in stationary() {
        let r: Vec<f64> = (0..2 * 1024).map(|j| autocovariance(&kind, j)).collect();
        // Variance of the sum of m samples.
        let v = |m: u64| {
            let pairs: f64 = (1..m as usize).map(|j| (m as usize - j) as f64 * r[j]).sum();
            m as f64 * r[0] + 2.0 * pairs
        };
        for n in FACTORS {
            let (closed, identity) = (kind.avar(n, PERIOD), (4.0 * v(n) - v(2 * n)) / (2.0 * (n * n) as f64));
            // The sums of 2048 terms round at 10⁻¹³ of V, of which the identity leaves little for slow processes.
            let rounding = 1e-12 * v(2 * n).abs() / (n * n) as f64;
            assert!((closed - identity).abs() < 1e-6 * closed + rounding, "{kind:?}, n = {n}: {closed}, {identity}");
        }
    }
}

#[test]
fn second_differences_hang_together_as_the_autocovariance_says() {
    for kind in stationary() {
        let n = 6_usize;
        // The second difference of averages is a filter of 2n weights; at n = 6, lags on both sides of 2n.
        let weights: Vec<f64> = (0..2 * n).map(|i| if i < n { 1.0 } else { -1.0 } / n as f64).collect();
        for lag in [0_usize, 1, 5, 6, 11, 12, 13, 30] {
            let mut covariance = 0.0;
            for (i, a) in weights.iter().enumerate() {
                for (j, b) in weights.iter().enumerate() {
                    covariance += a * b * autocovariance(&kind, (lag + i).abs_diff(j)) / 2.0;
                }
            }
            let found = kind.process().covariance(lag as f64, n as u64, PERIOD);
            let tolerance = 1e-6 * kind.avar(n as u64, PERIOD);
            assert!((found - covariance).abs() < tolerance, "{kind:?}, lag {lag}: {found} and {covariance}");
        }
    }
}

#[test]
fn the_memory_of_a_resonance_is_summed_to_its_end() {
    for kind in MARKOV.map(Kind::Markov).into_iter().chain(RESONANCE.map(Kind::Resonance)) {
        let (n, stride) = (16, 2.0);
        let summed: f64 = (1..100_000)
            .map(|j| kind.process().covariance(32.0 + f64::from(j) * stride, n, PERIOD))
            .map(|covariance| covariance * covariance)
            .sum();
        let closed = kind.process().memory_beyond(n, stride, PERIOD);
        assert!((closed - summed).abs() < 1e-6 * summed, "{kind:?}: {closed} and {summed}");
    }
}

/// One sample after the other of a process with a coefficient of 1, each from its own recursion.
fn simulate(kind: &Kind, samples: usize, seed: u64) -> Vec<f64> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut normal = move || -> f64 { StandardNormal.sample(&mut rng) };
    match kind {
        Kind::AngleRandomWalk => (0..samples).map(|_| normal() / PERIOD.sqrt()).collect(),
        Kind::Quantization => {
            let angles: Vec<f64> = (0..=samples).map(|_| normal()).collect();
            angles.windows(2).map(|pair| (pair[1] - pair[0]) / PERIOD).collect()
        }
        Kind::RateRandomWalk => {
            let mut rate = 0.0;
            (0..samples)
                .map(|_| {
                    rate += normal() * PERIOD.sqrt();
                    rate
                })
                .collect()
        }
        Kind::RateRamp => (0..samples).map(|k| k as f64 * PERIOD).collect(),
        Kind::Sinusoid(line) => (0..samples).map(|k| (2.0 * PI * line.frequency * k as f64 * PERIOD).sin()).collect(),
        Kind::Markov(markov) => {
            let keep = (-PERIOD / markov.time_constant).exp();
            let mut state = normal();
            (0..samples)
                .map(|_| {
                    state = keep * state + (1.0 - keep * keep).sqrt() * normal();
                    state
                })
                .collect()
        }
        Kind::Resonance(line) => {
            // A complex Markov process turns with the frequency; its real part is the oscillation.
            let keep = (-PI * line.bandwidth * PERIOD).exp();
            let (sin, cos) = (2.0 * PI * line.frequency * PERIOD).sin_cos();
            let drive = (1.0 - keep * keep).sqrt();
            let mut state = (normal(), normal());
            (0..samples)
                .map(|_| {
                    let (re, im) = state;
                    state = (
                        keep * (re * cos - im * sin) + drive * normal(),
                        keep * (re * sin + im * cos) + drive * normal(),
                    );
                    state.0
                })
                .collect()
        }
        Kind::Filtered(filter) => {
            let response = impulse_response(filter);
            let step = filter.decimation as usize;
            let gain = (autocovariance(kind, 0) / response.iter().map(|a| a * a).sum::<f64>()).sqrt();
            let white: Vec<f64> = (0..samples * step + response.len()).map(|_| gain * normal()).collect();
            let filtered = white.windows(response.len()).map(|w| w.iter().zip(&response).map(|(a, b)| a * b).sum());
            filtered.step_by(step).take(samples).collect()
        }
        // By its definition as white noise integrated half a time: J. Hosking, Biometrika 68 (1981).
        Kind::BiasInstability => {
            let mut response = vec![1.0];
            (1..4096).for_each(|k| response.push(response[k - 1] * (k as f64 - 0.5) / k as f64));
            let white: Vec<f64> = (0..samples + response.len()).map(|_| normal()).collect();
            white
                .windows(response.len())
                .take(samples)
                .map(|w| w.iter().rev().zip(&response).map(|(a, b)| a * b).sum())
                .collect()
        }
    }
}

#[test]
fn the_closed_form_is_what_simulation_shows() {
    const SAMPLES: usize = 1 << 16;
    const LSB: f64 = 2e-6;
    let others = [Kind::RateRamp, Kind::Sinusoid(Sinusoid { frequency: 21.7 })];
    for (seed, kind) in noises().into_iter().chain(others).enumerate() {
        let mut cascade = Cascade::<16, 8>::new();
        simulate(&kind, SAMPLES, seed as u64).iter().for_each(|value| cascade.push((value / LSB).round() as i32));
        let curve = cascade.curve(PERIOD).scaled(LSB);
        let model = Model::new(PERIOD, [Term::exact(kind, 1.0)]);
        for point in curve.points().iter().filter(|point| point.n <= 1024) {
            let (modelled, edf) = (model.avar(point.n), model.edf(point));
            // Half-integrated noise is flicker only below the sample rate, and 4096 weights reach no further.
            let flicker = kind == Kind::BiasInstability;
            if flicker && !(16..=256).contains(&point.n) {
                continue;
            }
            // S(f) = 1/(2π|f|) for B = 1, and white noise of variance 1 integrated half a time has dt/(2πf·dt).
            // A line's phases are not all met equally often: 1/(π·beats), with 28 beats and more in every octave.
            let line = matches!(kind, Kind::Sinusoid(_));
            let tolerance = 5.0 * (2.0 / edf).sqrt() + if flicker || line { 0.012 } else { 1e-3 };
            let ratio = point.avar / modelled;
            assert!((ratio - 1.0).abs() < tolerance, "{kind:?}, n = {}: {ratio} ± {tolerance}, edf {edf}", point.n);
        }
    }
}

#[test]
fn degrees_of_freedom_tell_the_scatter_of_estimates() {
    const RECORDS: u64 = 400;
    const SAMPLES: usize = 1 << 14;
    // A resonance that remembers 640 samples, a Markov process that remembers 70, and a line in white noise.
    let models = [
        vec![Term::exact(Kind::Resonance(Resonance { frequency: 20.3, bandwidth: 0.05 }), 1.0)],
        vec![Term::exact(Kind::Markov(MARKOV[1]), 1.0)],
        vec![Term::exact(Kind::Sinusoid(Sinusoid { frequency: 5.1 }), 10.0), Term::exact(Kind::AngleRandomWalk, 1.0)],
    ];
    for terms in models {
        let model = Model::new(PERIOD, terms.iter().copied());
        let curves: Vec<_> = (0..RECORDS)
            .map(|seed| {
                let mut sum = vec![0.0; SAMPLES];
                for (index, term) in terms.iter().enumerate() {
                    let series = simulate(&term.kind, SAMPLES, 31 * seed + index as u64);
                    sum.iter_mut().zip(series).for_each(|(sum, value)| *sum += term.value * value);
                }
                let mut cascade = Cascade::<16, 8>::new();
                sum.iter().for_each(|value| cascade.push((value * 1e4).round() as i32));
                cascade.curve(PERIOD).scaled(1e-4)
            })
            .collect();
        for octave in 0..9 {
            let avars = || curves.iter().map(|curve| curve.points()[octave].avar);
            let mean = avars().sum::<f64>() / RECORDS as f64;
            let variance = avars().map(|avar| (avar - mean).powi(2)).sum::<f64>() / (RECORDS - 1) as f64;
            let point = curves[0].points()[octave];
            let (edf, seen) = (model.edf(&point), 2.0 * mean * mean / variance);
            // A variance from 400 records scatters by √(2/400) = 7 %, more for few degrees of freedom.
            let tolerance = 4.0 * (2.0 / RECORDS as f64 + 12.0 / RECORDS as f64 / edf).sqrt();
            assert!((seen / edf - 1.0).abs() < tolerance, "{terms:?}, n = {}: {seen} seen, {edf} modelled", point.n);
        }
    }
}
