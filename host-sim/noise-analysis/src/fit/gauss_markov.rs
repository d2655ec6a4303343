//! A Gauss-Markov process in the place of bias instability and rate random walk, for filters and simulators that know no other slow noise.
//!
//! With the Allan variance `v` of the whole fitted model and `d` of its slow part, the substitute of variance `s` and
//! correlation time `T` gives `m = v − d + s·g(T)`, `g` the Allan variance of a process of variance 1. The best one has the
//! least deviance `Σ edf·(ln(m/v) + v/m − 1)`, the measure of every other fit here, so it is close where the record
//! determines the curve and not where white noise hides the slow part.

use crate::minimum::least_within;
use allan_core::term::Markov;
use allan_core::{Model, NoiseTerm, model::FittedTerm};

/// The slow part of a channel's fitted model at the averaging factors of its curve.
#[derive(Debug, Clone, PartialEq)]
pub struct SlowNoise {
    pub octaves: Vec<SlowOctave>,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SlowOctave {
    /// Averaging factor, samples.
    pub n: u64,
    /// Allan variance of the whole model.
    pub model: f64,
    /// Part of it that the Gauss-Markov process is to replace.
    pub slow: f64,
    /// Degrees of freedom of the measured Allan variance.
    pub edf: f64,
}

/// First-order Gauss-Markov noise of several channels with one correlation time.
#[derive(Debug, Clone, PartialEq)]
pub struct GaussMarkovFit {
    /// Correlation time, s.
    pub time_constant: f64,
    /// Standard deviation of each channel, in its unit.
    pub deviations: Vec<f64>,
    /// Largest ratio of the Allan deviation with the process to that of the model, or its inverse, over all channels and octaves.
    pub worst_ratio: f64,
}

/// Correlation times that are tried, for every octave between the sample period and ten times the longest averaging time.
const PER_OCTAVE: usize = 4;
/// Octaves to which the likeliest correlation time is sought.
const ACCURACY: f64 = 1e-6;
/// Steps of Fisher scoring for the variance at a fixed correlation time.
const STEPS: usize = 40;

/// The process that replaces the slow part of each of `channels`, sampled every `sample_period` s; `None` where none has a slow part.
#[must_use]
pub fn fit(channels: &[SlowNoise], sample_period: f64) -> Option<GaussMarkovFit> {
    if !channels.iter().any(|channel| channel.octaves.iter().any(|octave| octave.slow > 0.0)) {
        return None;
    }
    let longest = channels.iter().flat_map(|channel| &channel.octaves).map(|octave| octave.n).max()?;
    let deviance = |log_time: f64| -> f64 {
        let of = |channel: &SlowNoise| variance(channel, log_time.exp2(), sample_period).1;
        channels.iter().map(of).sum()
    };
    let (from, to) = (sample_period.log2(), (10.0 * longest as f64 * sample_period).log2());
    let grid = ((to - from) * PER_OCTAVE as f64).ceil() as usize;
    let step = (to - from) / grid as f64;
    let best = (0..=grid).map(|at| from + at as f64 * step).min_by(|a, b| deviance(*a).total_cmp(&deviance(*b)))?;
    let time_constant = least_within((best - step, best + step), ACCURACY, deviance).exp2();
    let fits = channels.iter().map(|channel| (channel, variance(channel, time_constant, sample_period).0));
    let ratio = |channel: &SlowNoise, variance: f64| {
        let of = |octave: &SlowOctave| {
            let with = octave.model - octave.slow + variance * unit_variance(octave.n, time_constant, sample_period);
            (0.5 * (with / octave.model).ln().abs()).exp()
        };
        channel.octaves.iter().filter(|octave| octave.model > 0.0).map(of).fold(1.0, f64::max)
    };
    Some(GaussMarkovFit {
        time_constant,
        worst_ratio: fits.clone().map(|(channel, variance)| ratio(channel, variance)).fold(1.0, f64::max),
        deviations: fits.map(|(_, variance)| variance.sqrt()).collect(),
    })
}

/// Allan variance of a process of variance 1.
fn unit_variance(n: u64, time_constant: f64, sample_period: f64) -> f64 {
    let term = FittedTerm::exact(NoiseTerm::Markov(Markov { time_constant }), 1.0);
    Model::new(sample_period, [term]).avar(n)
}

/// The variance of the process with the least deviance at a correlation time, and that deviance.
fn variance(channel: &SlowNoise, time_constant: f64, sample_period: f64) -> (f64, f64) {
    let points: Vec<(f64, f64, f64, f64)> = channel
        .octaves
        .iter()
        .filter(|octave| octave.model > 0.0 && octave.edf > 0.0)
        .map(|octave| {
            let rest = (octave.model - octave.slow).max(1e-9 * octave.model);
            (octave.edf, octave.model, rest, unit_variance(octave.n, time_constant, sample_period))
        })
        .collect();
    // Weighted least squares of `v − rest` against `g` with the weights edf/m² of the model of the step before.
    let mut variance = 0.0;
    for _ in 0..STEPS {
        let (mut above, mut below) = (0.0, 0.0);
        for &(edf, model, rest, unit) in &points {
            let modelled = if variance > 0.0 { rest + variance * unit } else { model };
            let weight = edf / (modelled * modelled);
            above += weight * unit * (model - rest);
            below += weight * unit * unit;
        }
        variance = if below > 0.0 { f64::max(above / below, 0.0) } else { 0.0 };
    }
    let deviance = |&(edf, model, rest, unit): &(f64, f64, f64, f64)| {
        let modelled = rest + variance * unit;
        edf * ((modelled / model).ln() + model / modelled - 1.0)
    };
    (variance, points.iter().map(deviance).sum())
}

#[cfg(test)]
mod tests {
    use super::{SlowNoise, SlowOctave, fit};
    use std::f64::consts::{LN_2, PI};

    /// IEEE Std 952, the Gauss-Markov process of variance s²: `2s²T/τ·(1 − T/(2τ)·(3 − 4e^(−τ/T) + e^(−2τ/T)))`.
    fn gauss_markov(s: f64, time: f64, tau: f64) -> f64 {
        let x = tau / time;
        2.0 * s * s / x * (1.0 - (3.0 - 4.0 * (-x).exp() + (-2.0 * x).exp()) / (2.0 * x))
    }

    fn octaves(slow: impl Fn(f64) -> f64) -> SlowNoise {
        let octave = |k: u32| {
            let n = 1u64 << k;
            let tau = n as f64 * 0.01;
            SlowOctave {
                n,
                model: 0.04 * 0.04 / tau + slow(tau),
                slow: slow(tau),
                edf: 1.5 * (1 << 20) as f64 / n as f64,
            }
        };
        SlowNoise { octaves: (0..17).map(octave).collect() }
    }

    #[test]
    fn a_gauss_markov_process_is_its_own_substitute() {
        for (s, time) in [(0.01, 100.0), (0.004, 20.0)] {
            let found = fit(&[octaves(|tau| gauss_markov(s, time, tau))], 0.01).expect("slow noise");
            // The closed form is that of continuous time: at 2000 and more samples a correlation time it is off by less than 1e-3.
            assert!((found.time_constant / time - 1.0).abs() < 2e-3, "{found:?}");
            assert!((found.deviations[0] / s - 1.0).abs() < 2e-3 && found.worst_ratio < 1.001, "{found:?}");
        }
    }

    fn deviance(channel: &SlowNoise, s: f64, time: f64) -> f64 {
        let of = |octave: &SlowOctave| {
            let with = octave.model - octave.slow + gauss_markov(s, time, octave.n as f64 * 0.01);
            octave.edf * ((with / octave.model).ln() + octave.model / with - 1.0)
        };
        channel.octaves.iter().map(of).sum()
    }

    /// Flicker noise is flat over all octaves, unlike any process: the substitute is the best of a grid, 1 % apart in both parameters.
    #[test]
    fn bias_instability_has_the_best_substitute() {
        let b = 0.01_f64;
        let flat = octaves(|_| 2.0 * LN_2 / PI * b * b);
        let found = fit(std::slice::from_ref(&flat), 0.01).expect("slow noise");
        let grid = |low: f64, high: f64| (0..).map(move |k| low * 1.01_f64.powi(k)).take_while(move |&at| at < high);
        let least = grid(1.0, 1000.0)
            .flat_map(|time| grid(0.005, 0.05).map(move |s| (s, time)))
            .map(|(s, time)| deviance(&flat, s, time))
            .fold(f64::INFINITY, f64::min);
        let ours = deviance(&flat, found.deviations[0], found.time_constant);
        assert!(ours < least + 0.01, "{ours}, not {least}: {found:?}");
    }

    #[test]
    fn channels_share_the_correlation_time_and_white_noise_has_none() {
        let pair = [octaves(|tau| gauss_markov(0.01, 50.0, tau)), octaves(|tau| gauss_markov(0.02, 50.0, tau))];
        let found = fit(&pair, 0.01).expect("slow noise");
        assert!((found.deviations[1] / found.deviations[0] - 2.0).abs() < 0.01, "{found:?}");
        assert_eq!(fit(&[octaves(|_| 0.0)], 0.01), None);
        assert_eq!(fit(&[], 0.01), None);
    }
}
