//! Every term: its Allan variance against the integral of its spectrum, its autocovariance and simulation.

use crate::simulation::{
    LOW_PASS, MARKOV, Noise, PERIOD, RESONANCE, autocovariance, curve, impulse_response, noises, stationary,
};
use allan_core::term::{MovingAverageFilter, NoiseTerm, Resonance, Sinusoid};
use allan_core::{Model, model::FittedTerm};
use std::f64::consts::PI;

const FACTORS: [u64; 8] = [1, 2, 3, 4, 8, 33, 128, 1024];

/// `4∫S(f) sin⁴(πfτ)/(πfτ)² df`, for sampled data: over all frequencies up to half the sample rate, with the sum of
/// `n` samples in the place of the integral over τ. Midpoints, on a scale that is fine near 0.
fn integral(density: impl Fn(f64) -> f64, n: u64, shortest_s: f64) -> f64 {
    const STEPS: u32 = 200_000;
    let nyquist = 0.5 / shortest_s;
    let sum: f64 = (0..STEPS)
        .map(|k| (f64::from(k) + 0.5) / f64::from(STEPS))
        .map(|u| {
            let (f, df) = (nyquist * u.powi(3), nyquist * 3.0 * u * u / f64::from(STEPS));
            let (whole, one) = ((PI * f * PERIOD * n as f64).sin(), (PI * f * PERIOD).sin());
            density(f) * 2.0 * whole.powi(4) / (n as f64 * one).powi(2) * df
        })
        .sum();
    2.0 * sum
}

#[test]
fn the_allan_variance_is_the_integral_of_the_spectrum() {
    for kind in noises() {
        for n in FACTORS {
            let (closed, integral) = (kind.avar(n, PERIOD), integral(|f| kind.process().density(f, PERIOD), n, PERIOD));
            assert!((closed / integral - 1.0).abs() < 2e-5, "{kind:?}, n = {n}: {closed} and {integral}");
        }
    }
}

#[test]
fn the_allan_variance_is_that_of_the_autocovariance() {
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

/// Flicker noise, random walks and Gauss–Markov processes arise before the filter whose white noise the model has.
#[test]
fn what_passes_the_filter_of_a_model_has_the_allan_variance_of_its_spectrum() {
    for (stages, taps) in [(1, 5), (2, 2), (2, 4), (2, 16), (2, 64)] {
        let filter = NoiseTerm::Filtered(MovingAverageFilter { stages, taps, decimation: 1.0 });
        let slow = [NoiseTerm::BiasInstability, NoiseTerm::RateRandomWalk];
        for kind in slow.into_iter().chain(MARKOV.map(NoiseTerm::Markov)) {
            let model = Model::new(PERIOD, [filter, kind].map(|kind| FittedTerm::exact(kind, 1.0)));
            let gain = |f: f64| {
                let box_gain = |f: f64| {
                    ((PI * f * PERIOD * f64::from(taps)).sin() / (PI * f * PERIOD).sin() / f64::from(taps)).powi(2)
                };
                box_gain(f).powi(stages.into())
            };
            for n in FACTORS {
                let passed = model.part(&model.terms()[1], n);
                let integral = integral(|f| gain(f) * kind.process().density(f, PERIOD), n, PERIOD);
                // Averages that are long against the filter are not changed; of a long filter some lags stand for all.
                let tolerance = if n > 32 * u64::from(taps) { 1.5e-3 } else { 3e-4 };
                assert!(
                    (passed / integral - 1.0).abs() < tolerance,
                    "{kind:?} behind {filter:?}, n = {n}: {passed} and {integral}"
                );
            }
        }
    }
}

/// The walk by its covariances, sample by sample; the others by the spectrum of the filter's values, of which some are read.
#[test]
fn what_passes_a_filter_that_is_read_slowly_has_the_allan_variance_of_its_samples() {
    for (taps, decimation) in [(4_u16, 2_u16), (8, 4), (16, 9), (64, 9)] {
        let of = MovingAverageFilter { decimation: decimation.into(), ..MovingAverageFilter::bartlett(taps) };
        let slow = [NoiseTerm::RateRandomWalk, NoiseTerm::BiasInstability];
        let passing: Vec<NoiseTerm> = slow.into_iter().chain(MARKOV.map(NoiseTerm::Markov)).collect();
        let terms = [NoiseTerm::Filtered(of)].into_iter().chain(passing.iter().copied());
        let model = Model::new(PERIOD, terms.map(|kind| FittedTerm::exact(kind, 1.0)));
        let response = impulse_response(&of);
        // Mean square of the difference of two filtered values of a walk with steps of 1, a lag apart.
        let structure = |lag: usize| -> f64 {
            let weight = |at: usize| {
                let before: f64 = response.iter().take(at + 1).sum();
                let after: f64 = if at >= lag { response.iter().take(at - lag + 1).sum() } else { 0.0 };
                before - after
            };
            (0..response.len() + lag).map(|at| weight(at).powi(2)).sum()
        };
        let walk = 0.5 * structure(decimation.into()) * PERIOD / f64::from(decimation);
        let found = model.part(&model.terms()[1], 1);
        assert!((found / walk - 1.0).abs() < 0.005, "{of:?}: {found} and {walk}");
        let value_s = PERIOD / f64::from(decimation);
        for term in &model.terms()[2..] {
            let passed = |f: f64| of.gain(f, PERIOD) * term.kind.process().density(f, value_s);
            for n in FACTORS {
                let (found, integral) = (model.part(term, n), integral(passed, n, value_s));
                // For a filter of that length the closed form leaves out what reading at intervals folds beyond the first order.
                let tolerance = if n < 4 { 0.031 } else { 2e-3 };
                assert!(
                    (found / integral - 1.0).abs() < tolerance,
                    "{:?} behind {of:?}, n = {n}: {found} and {integral}",
                    term.kind
                );
            }
        }
    }
}

#[test]
fn squared_covariances_beyond_two_averaging_times_are_summed_completely() {
    let filtered = LOW_PASS.map(NoiseTerm::LowPass);
    for kind in MARKOV.map(NoiseTerm::Markov).into_iter().chain(RESONANCE.map(NoiseTerm::Resonance)).chain(filtered) {
        let (n, stride) = (16, 2.0);
        let width = n as f64;
        let v = |m: f64| kind.process().sum_variance(m.abs(), PERIOD);
        let covariance = |lag: f64| {
            let fourth =
                6.0 * v(lag) - 4.0 * (v(lag - width) + v(lag + width)) + v(lag - 2.0 * width) + v(lag + 2.0 * width);
            -fourth / (4.0 * width * width)
        };
        // Up to twelve time constants of the slowest process: those of 40 are 10⁻⁶ of rounding errors.
        let summed: f64 = (1..30_000)
            .map(|j| covariance(2.0 * width + f64::from(j) * stride))
            .map(|covariance| covariance * covariance)
            .sum();
        let closed = kind.process().squared_covariance_tail(n, stride, PERIOD);
        assert!((closed - summed).abs() < 1e-6 * summed, "{kind:?}: {closed} and {summed}");
    }
}

#[test]
fn the_allan_variance_is_that_of_simulated_samples() {
    const SAMPLES: usize = 1 << 16;
    let others = [NoiseTerm::RateRamp, NoiseTerm::Sinusoid(Sinusoid { frequency: 21.7 })];
    for (seed, kind) in noises().into_iter().chain(others).enumerate() {
        let curve = curve(&Noise::new(seed as u64).series(&kind, SAMPLES));
        let model = Model::new(PERIOD, [FittedTerm::exact(kind, 1.0)]);
        for point in curve.points().iter().filter(|point| point.n <= 1024) {
            let (modelled, edf) = (model.avar(point.n), model.edf(point));
            // Half-integrated noise is flicker only below the sample rate, and 4096 weights reach no further.
            let flicker = kind == NoiseTerm::BiasInstability;
            if flicker && !(16..=256).contains(&point.n) {
                continue;
            }
            // S(f) = 1/(2π|f|) for B = 1, and white noise of variance 1 integrated half a time has dt/(2πf·dt).
            // A line's phases are not all met equally often: 1/(π·beats), with 28 beats and more in every octave.
            let line = matches!(kind, NoiseTerm::Sinusoid(_));
            let tolerance = 5.0 * (2.0 / edf).sqrt() + if flicker || line { 0.012 } else { 1e-3 };
            let ratio = point.avar / modelled;
            assert!((ratio - 1.0).abs() < tolerance, "{kind:?}, n = {}: {ratio} ± {tolerance}, edf {edf}", point.n);
        }
    }
}

#[test]
fn degrees_of_freedom_are_those_of_the_scatter_of_estimates() {
    const RECORDS: u64 = 400;
    const SAMPLES: usize = 1 << 14;
    // A resonance that stays correlated for 640 samples, a Markov process for 70, and a line in white noise.
    let models = [
        vec![FittedTerm::exact(NoiseTerm::Resonance(Resonance { frequency: 20.3, bandwidth: 0.05 }), 1.0)],
        vec![FittedTerm::exact(NoiseTerm::Markov(MARKOV[1]), 1.0)],
        vec![
            FittedTerm::exact(NoiseTerm::Sinusoid(Sinusoid { frequency: 5.1 }), 10.0),
            FittedTerm::exact(NoiseTerm::AngleRandomWalk, 1.0),
        ],
    ];
    for terms in models {
        let model = Model::new(PERIOD, terms.iter().copied());
        let curves: Vec<_> = (0..RECORDS)
            .map(|seed| {
                let sum: Vec<(NoiseTerm, f64)> = terms.iter().map(|term| (term.kind, term.value)).collect();
                curve(&Noise::new(seed).sum(SAMPLES, &sum))
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
