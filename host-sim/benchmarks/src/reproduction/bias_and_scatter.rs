//! Bias and scatter of the slope method and the fit over simulated hours.

use super::four_methods::FourMethods;
use super::published_gyro::{
    INTERVALS, OCTAVES, RATE_HZ, SAMPLES, TRUTH, allan_curve, deviations, fitted_terms, simulate_counts,
    slope_coefficients, true_model,
};
use crate::arguments::MOST_RECORDINGS;
use allan_core::{AllanPoint, Cascade, Model, NoiseTerm, fit::fit};
use clap::{Args, value_parser};
use serde::Serialize;
use std::ops::RangeInclusive;

/// Repeat the published characterisation on simulated hours: slope method beside the fit.
#[derive(Debug, Clone, Copy, PartialEq, Args)]
pub struct Reproduction {
    /// Hours to simulate; a scatter needs two.
    #[arg(long, default_value_t = 100, value_parser = value_parser!(u64).range(2..=MOST_RECORDINGS))]
    pub seeds: u64,
    /// Seed of the first.
    #[arg(long, default_value_t = 1)]
    pub first_seed: u64,
}

/// Error over the seeds, as fractions of the truth.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct RelativeError {
    /// Mean over truth, less 1.
    pub bias: f64,
    /// Standard deviation over truth.
    pub scatter: f64,
}

/// Relative standard deviation of the Allan deviation at one octave.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct OctaveScatter {
    pub tau_s: f64,
    /// Predicted by equation (6) of the paper, `1/√(2(N/n − 1))`.
    pub formula: f64,
    /// Predicted for the overlapped estimate, `1/√(2·edf)`.
    pub confidence: f64,
    /// Measured over the seeds, without overlap.
    pub plain: f64,
    /// Measured over the seeds, with 8-fold overlap.
    pub overlapped: f64,
    /// Fractions of N, B and K in the true Allan variance before the filter.
    pub shares: [f64; 3],
}

/// Errors over all hours, and the four methods on the first hour.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ReproductionResult {
    pub seeds: u64,
    /// N, °/√s, B, °/s, and K, °/s^1.5.
    pub truth: [f64; 3],
    /// Averaging times from which the slope method takes each of them, s.
    pub intervals_s: [RangeInclusive<f64>; 3],
    /// Bias of the slope method on the true curve: its inherent error.
    pub inherent: [f64; 3],
    /// Error of the slope method without overlap, as in the paper.
    pub plain: [RelativeError; 3],
    /// Error of the slope method with 8-fold overlap.
    pub overlapped: [RelativeError; 3],
    /// Error of the fit with 8-fold overlap.
    pub fitted: [RelativeError; 3],
    /// Fraction of seeds for which the 95 % bounds of the fit contain the truth.
    pub covered: [f64; 3],
    pub scatter: Vec<OctaveScatter>,
    pub four_methods: FourMethods,
}

struct Hour {
    plain: Vec<f64>,
    overlapped: Vec<f64>,
    slopes: [[f64; 3]; 2],
    fitted: [f64; 3],
    covered: [bool; 3],
}

impl Reproduction {
    /// Simulates and analyses the hours; `progress` gets the number of finished ones.
    #[must_use]
    pub fn run(&self, mut progress: impl FnMut(u64)) -> ReproductionResult {
        let hours: Vec<Hour> = (0..self.seeds)
            .map(|index| {
                let hour = Hour::estimate(&simulate_counts(self.first_seed.wrapping_add(index)));
                progress(index + 1);
                hour
            })
            .collect();
        let truth = true_model();
        let octaves = (0..hours.iter().map(|hour| hour.plain.len()).min().unwrap_or(0)).map(|octave| 1_u64 << octave);
        let tau = |n: u64| n as f64 / RATE_HZ;
        let inherent = slope_coefficients(octaves.clone().map(|n| (tau(n), truth.avar(n).sqrt())));
        ReproductionResult {
            seeds: self.seeds,
            truth: TRUTH,
            intervals_s: INTERVALS,
            inherent: relative_errors(inherent),
            plain: each(|term| error_over(&hours, |hour| hour.slopes[0][term] / TRUTH[term])),
            overlapped: each(|term| error_over(&hours, |hour| hour.slopes[1][term] / TRUTH[term])),
            fitted: each(|term| error_over(&hours, |hour| hour.fitted[term] / TRUTH[term])),
            covered: each(|term| hours.iter().filter(|hour| hour.covered[term]).count() as f64 / hours.len() as f64),
            scatter: octaves
                .enumerate()
                .map(|(octave, n)| OctaveScatter {
                    tau_s: tau(n),
                    formula: allan_core::slope_method::percentage_accuracy(SAMPLES, n) / 100.0,
                    confidence: confidence(&truth, octave),
                    plain: relative(error_over(&hours, |hour| hour.plain[octave])),
                    overlapped: relative(error_over(&hours, |hour| hour.overlapped[octave])),
                    shares: each(|term| {
                        let kind = NoiseTerm::BASELINE[term];
                        TRUTH[term] * TRUTH[term] * kind.avar(n, 1.0 / RATE_HZ) / unfiltered(n)
                    }),
                })
                .collect(),
            four_methods: FourMethods::analyze(self.first_seed),
        }
    }
}

/// True Allan variance before the filter at averaging factor `n`.
fn unfiltered(n: u64) -> f64 {
    NoiseTerm::BASELINE.iter().zip(TRUTH).map(|(kind, value)| value * value * kind.avar(n, 1.0 / RATE_HZ)).sum()
}

/// Relative standard deviation `1/√(2·edf)` at an octave, by the degrees of freedom of the true model.
fn confidence(truth: &Model, octave: usize) -> f64 {
    let mut cascade = Cascade::<OCTAVES, 8>::new();
    cascade.push_slice(&vec![0; SAMPLES as usize]);
    let curve = cascade.curve(1.0 / RATE_HZ);
    curve.points().get(octave).map_or(f64::NAN, |point| 1.0 / (2.0 * truth.edf(point)).sqrt())
}

impl Hour {
    fn estimate(counts: &[i32]) -> Self {
        let (plain, overlapped) = (allan_curve::<1>(counts), allan_curve::<8>(counts));
        let model = fit(&overlapped, &fitted_terms());
        let term = |index: usize| &model.terms()[index];
        let slopes =
            |points: &[AllanPoint]| slope_coefficients(deviations(points)).map(|value| value.unwrap_or(f64::NAN));
        Self {
            slopes: [slopes(plain.points()), slopes(overlapped.points())],
            plain: deviations(plain.points()).map(|(_, deviation)| deviation).collect(),
            overlapped: deviations(overlapped.points()).map(|(_, deviation)| deviation).collect(),
            fitted: each(|index| term(index).value),
            covered: each(|index| (term(index).low..=term(index).high).contains(&TRUTH[index])),
        }
    }
}

fn each<T>(value: impl Fn(usize) -> T) -> [T; 3] {
    std::array::from_fn(value)
}

fn relative_errors(found: [Option<f64>; 3]) -> [f64; 3] {
    each(|term| found[term].map_or(f64::NAN, |value| value / TRUTH[term] - 1.0))
}

/// Bias and standard deviation of an estimate over its true value.
fn error_over(hours: &[Hour], ratio: impl Fn(&Hour) -> f64) -> RelativeError {
    let count = hours.len() as f64;
    let mean = hours.iter().map(&ratio).sum::<f64>() / count;
    let square = hours.iter().map(|hour| (ratio(hour) - mean).powi(2)).sum::<f64>();
    RelativeError { bias: mean - 1.0, scatter: (square / (count - 1.0)).sqrt() }
}

fn relative(error: RelativeError) -> f64 {
    error.scatter / (1.0 + error.bias)
}
