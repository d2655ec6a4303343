//! The four methods of section 2.2 of the paper on one simulated record.

use super::published_gyro::{
    LSB, OCTAVES, RATE_HZ, TAPS, allan_curve, deviations, fitted_terms, simulate_counts, slope_coefficients, true_model,
};
use allan_core::fit::fit;
use allan_core::{Curve, Model, NoiseTerm};
use noise_analysis::report::assessment::Innovations;
use noise_analysis::report::assessment::innovations::filter_innovations;
use noise_analysis::samples::uniform_series::UniformSeries;
use noise_analysis::spectra::Welch;
use serde::Serialize;
use statrs::distribution::{ContinuousCDF, StudentsT};
use std::f64::consts::{E, PI};

/// Samples of a segment of the spectrum: 640 s, so that ten overlapping segments fit the record.
const SEGMENT: usize = 1 << 17;
/// Segment length over the largest averaging time. The peak of the integrand, 0.37/τ, is then at the sixth point.
const SEGMENT_PER_TAU: f64 = 16.0;
/// Lags in samples beyond the filtered white noise.
const SLOW_LAGS: std::ops::Range<usize> = 8..64;
/// Number of parts that give the bounds of the autocorrelation method.
const PARTS: usize = 16;

/// N, B and K by one method, in deg/√s, deg/s and deg/s^1.5, if it gives them.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct MethodCoefficients {
    pub method: &'static str,
    pub values: [Option<f64>; 3],
    pub bounds: [Option<(f64, f64)>; 3],
}

#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Autocorrelation {
    /// Variance of the samples, (deg/s)².
    pub variance: f64,
    /// Variance of the white part, (deg/s)²: the variance less the autocovariance at lags 8 to 63.
    pub white_variance: f64,
    /// Lag, s, at which the autocovariance of 1 s means is 1/e of that at 1 s.
    pub decay_s: Option<f64>,
    pub decay_in_quarters_s: Option<f64>,
}

/// One octave of the measured Allan deviation and of equation (5).
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SpectrumOctave {
    pub tau_s: f64,
    /// Measured Allan deviation with 8-fold overlap, deg/s.
    pub measured: f64,
    /// Allan deviation by equation (5), deg/s.
    pub by_spectrum: f64,
    /// Relative standard error, by the degrees of freedom of the true model.
    pub measured_error: f64,
    /// Relative standard error, by the degrees of freedom of the spectrum.
    pub by_spectrum_error: f64,
    /// True if the segments are long enough for this averaging time.
    pub resolved: bool,
}

/// Test of the Kalman filter's innovations on the second half.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct InnovationTest {
    pub model: &'static str,
    #[serde(flatten)]
    pub innovations: Innovations,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FourMethods {
    pub seed: u64,
    pub coefficients: Vec<MethodCoefficients>,
    pub autocorrelation: Autocorrelation,
    pub segment_s: f64,
    /// Largest resolved averaging time, s.
    pub resolved_s: f64,
    pub spectrum: Vec<SpectrumOctave>,
    pub innovations: Vec<InnovationTest>,
}

impl FourMethods {
    /// Simulates the record of `seed` and applies the four methods.
    pub fn analyze(seed: u64) -> Self {
        let counts = simulate_counts(seed);
        let samples: Vec<f64> = counts.iter().map(|&count| LSB * f64::from(count)).collect();
        let grid = UniformSeries::new(1.0 / RATE_HZ, samples.clone());
        let (plain, overlapped) = (allan_curve::<1>(&counts), allan_curve::<8>(&counts));
        let welch = Welch::estimate(&grid, SEGMENT);
        let mut coefficients = vec![
            MethodCoefficients {
                method: "Allan, slopes",
                values: slope_coefficients(deviations(plain.points())),
                bounds: [None; 3],
            },
            fitted_coefficients(&fit(&overlapped, &fitted_terms())),
            correlation_coefficients(&samples),
        ];
        coefficients.extend(welch.as_ref().map(spectral_coefficients));
        let half = counts.len() / 2;
        let unseen = UniformSeries::new(1.0 / RATE_HZ, samples[half..].to_vec());
        Self {
            seed,
            coefficients,
            autocorrelation: autocorrelation(&samples),
            segment_s: SEGMENT as f64 / RATE_HZ,
            resolved_s: SEGMENT as f64 / RATE_HZ / SEGMENT_PER_TAU,
            spectrum: welch.map_or_else(Vec::new, |welch| spectrum_octaves(&welch, &overlapped)),
            innovations: innovation_tests(&fit(&allan_curve::<8>(&counts[..half]), &fitted_terms()), &unseen),
        }
    }
}

fn fitted_coefficients(model: &Model) -> MethodCoefficients {
    let term = |index: usize| &model.terms()[index];
    MethodCoefficients {
        method: "Allan, fit",
        values: [0, 1, 2].map(|index| Some(term(index).value)),
        bounds: [0, 1, 2].map(|index| Some((term(index).low, term(index).high))),
    }
}

/// Mean product of two values `lag` apart, less the squared mean.
fn autocovariance(values: &[f64], lag: usize) -> f64 {
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    let products = values.iter().zip(&values[lag..]).map(|(a, b)| (a - mean) * (b - mean));
    products.sum::<f64>() / (values.len() - lag) as f64
}

/// Autocovariances from lag 0 on, less their mean in [`SLOW_LAGS`]: slow noise changes by less than 0.1 % within 64
/// samples.
fn white_autocovariances(samples: &[f64]) -> Vec<f64> {
    let slow = SLOW_LAGS.map(|lag| autocovariance(samples, lag)).sum::<f64>() / SLOW_LAGS.len() as f64;
    (0..2 * usize::from(TAPS) - 1).map(|lag| autocovariance(samples, lag) - slow).collect()
}

/// N by the autocorrelation. The autocovariances of filtered white noise below lag `2·TAPS − 1` sum to `N²·RATE_HZ`,
/// and rounding adds `LSB²/12` at lag 0. The bounds are by Student's distribution over [`PARTS`].
fn correlation_coefficients(samples: &[f64]) -> MethodCoefficients {
    let coefficient = |part: &[f64]| {
        let covariances = white_autocovariances(part);
        let sum = covariances[0] + 2.0 * covariances[1..].iter().sum::<f64>();
        ((sum - LSB * LSB / 12.0) / RATE_HZ).max(0.0).sqrt()
    };
    let parts: Vec<f64> = samples.chunks_exact(samples.len() / PARTS).map(coefficient).collect();
    let count = parts.len() as f64;
    let mean = parts.iter().sum::<f64>() / count;
    let variance = parts.iter().map(|part| (part - mean).powi(2)).sum::<f64>() / (count - 1.0);
    let quantile = StudentsT::new(0.0, 1.0, count - 1.0).map_or(f64::NAN, |student| student.inverse_cdf(0.975));
    let half_width = quantile * (variance / count).sqrt();
    MethodCoefficients {
        method: "autocorrelation",
        values: [Some(mean), None, None],
        bounds: [Some((mean - half_width, mean + half_width)), None, None],
    }
}

fn autocorrelation(samples: &[f64]) -> Autocorrelation {
    let second = RATE_HZ as usize;
    let means: Vec<f64> = samples.chunks_exact(second).map(|part| part.iter().sum::<f64>() / second as f64).collect();
    let decay = |means: &[f64]| {
        let lag = (1..means.len()).find(|&lag| autocovariance(means, lag) < autocovariance(means, 1) / E)?;
        Some((lag * second) as f64 / RATE_HZ)
    };
    let quarters: Option<Vec<f64>> = means.chunks_exact(means.len() / 4).map(decay).collect();
    Autocorrelation {
        variance: autocovariance(samples, 0),
        white_variance: white_autocovariances(samples)[0],
        decay_s: decay(&means),
        decay_in_quarters_s: quarters.map(|lags| lags.iter().sum::<f64>() / lags.len() as f64),
    }
}

/// N, B and K by the fitted shape of the spectrum. B and K are `None` if they have less than 1 % at one cycle per
/// segment.
fn spectral_coefficients(welch: &Welch) -> MethodCoefficients {
    let (shape, bands) = welch.shape(|_| false);
    let n = shape.angle_random_walk();
    let bounds =
        shape.angle_random_walk_error(&bands).map(|error| (n * (1.0 - 1.96 * error), n * (1.0 + 1.96 * error)));
    let lowest = RATE_HZ / SEGMENT as f64;
    let [_, flicker, walk, _] = shape.densities;
    let significant = |density: f64| density > 0.01 * shape.density(lowest);
    let b = significant(flicker / lowest).then(|| (PI * flicker).sqrt());
    let k = significant(walk / lowest.powi(2)).then(|| (2.0 * PI * PI * walk).sqrt());
    MethodCoefficients { method: "spectrum", values: [Some(n), b, k], bounds: [bounds, None, None] }
}

/// Weight of the one-sided density at `frequency` in the Allan variance at the averaging factor `n`.
///
/// The factor is 2, since equation (5) has the two-sided density. A mean of `n` samples has
/// sin(πfτ)/(n·sin(πf/RATE_HZ)), and the density of the samples includes aliases.
pub fn allan_weight(frequency: f64, n: u64) -> f64 {
    let phase = PI * frequency / RATE_HZ;
    let n = n as f64;
    if phase == 0.0 { 0.0 } else { 2.0 * (n * phase).sin().powi(4) / (n * phase.sin()).powi(2) }
}

fn spectrum_octaves(welch: &Welch, curve: &Curve<OCTAVES>) -> Vec<SpectrumOctave> {
    // The correlations of neighbouring ordinates under a Hann window are (2/3)² and (1/6)².
    const NEIGHBOURS: f64 = 1.0 + 2.0 * (4.0 / 9.0 + 1.0 / 36.0);
    let (segment_s, truth) = (SEGMENT as f64 / RATE_HZ, true_model());
    let octave = |point: &allan_core::AllanPoint| {
        let terms: Vec<f64> =
            welch.points().map(|(f, density)| allan_weight(f, point.n) * density / segment_s).collect();
        let avar: f64 = terms.iter().sum();
        let squares: f64 = terms.iter().map(|term| term * term).sum();
        SpectrumOctave {
            tau_s: point.tau,
            measured: point.avar.sqrt(),
            by_spectrum: avar.sqrt(),
            measured_error: 1.0 / (2.0 * truth.edf(point)).sqrt(),
            by_spectrum_error: 0.5 * (NEIGHBOURS * squares / welch.ordinates()).sqrt() / avar,
            resolved: SEGMENT_PER_TAU * point.tau <= segment_s,
        }
    };
    curve.points().iter().filter(|point| point.tau < segment_s).map(octave).collect()
}

fn innovation_tests(fitted: &Model, unseen: &UniformSeries) -> Vec<InnovationTest> {
    let white =
        fitted.terms().iter().filter(|term| matches!(term.kind, NoiseTerm::Filtered(_) | NoiseTerm::AngleRandomWalk));
    let only_n = Model::new(1.0 / RATE_HZ, white.copied());
    let test = |(name, model): (&'static str, &Model)| {
        Some(InnovationTest { model: name, innovations: filter_innovations(model, unseen)? })
    };
    [("N, B, K", fitted), ("N only", &only_n)].into_iter().filter_map(test).collect()
}
