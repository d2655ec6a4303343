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

/// An octave of the curve: relative standard deviations of the Allan deviation by theory.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PredictedScatter {
    pub tau_s: f64,
    /// By equation (6) of the paper, `1/√(2(N/n − 1))`.
    pub formula: f64,
    /// By the degrees of freedom of the overlapped estimate, `1/√(2·edf)`.
    pub confidence: f64,
    /// Fractions of N, B and K in the true Allan variance before the filter.
    pub shares: [f64; 3],
}

/// The estimates of all hours, and the four methods on the first hour.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ReproductionResult {
    /// N, °/√s, B, °/s, and K, °/s^1.5.
    pub truth: [f64; 3],
    /// Averaging times from which the slope method takes each of them, s.
    pub intervals_s: [RangeInclusive<f64>; 3],
    /// Bias of the slope method on the true curve: its inherent error.
    pub inherent: [f64; 3],
    pub hours: Vec<Hour>,
    pub octaves: Vec<PredictedScatter>,
    pub four_methods: FourMethods,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Hour {
    /// Coefficients by the slope method, without overlap as in the paper and with 8-fold overlap.
    pub slopes: [[f64; 3]; 2],
    /// Coefficients by the fit with 8-fold overlap.
    pub fitted: [f64; 3],
    /// True where the 95 % bounds of the fit contain the truth.
    pub covered: [bool; 3],
    /// Allan deviations by octave, without overlap and with 8-fold overlap.
    pub deviations: [Vec<f64>; 2],
}

impl Reproduction {
    /// Simulates and analyses the hours; `progress` gets the number of finished ones.
    pub fn run(&self, mut progress: impl FnMut(u64)) -> ReproductionResult {
        let hours: Vec<Hour> = (0..self.seeds)
            .map(|index| {
                let hour = Hour::estimate(&simulate_counts(self.first_seed.wrapping_add(index)));
                progress(index + 1);
                hour
            })
            .collect();
        let truth = true_model();
        let octaves = hours.iter().map(|hour| hour.deviations[0].len()).min().unwrap_or(0);
        let octaves = (0..octaves).map(|octave| 1_u64 << octave);
        let tau = |n: u64| n as f64 / RATE_HZ;
        let inherent = slope_coefficients(octaves.clone().map(|n| (tau(n), truth.avar(n).sqrt())));
        ReproductionResult {
            truth: TRUTH,
            intervals_s: INTERVALS,
            inherent: each(|term| inherent[term].map_or(f64::NAN, |value| value / TRUTH[term] - 1.0)),
            hours,
            octaves: octaves
                .enumerate()
                .map(|(octave, n)| PredictedScatter {
                    tau_s: tau(n),
                    formula: allan_core::slope_method::percentage_accuracy(SAMPLES, n) / 100.0,
                    confidence: confidence(&truth, octave),
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
            fitted: each(|index| term(index).value),
            covered: each(|index| (term(index).low..=term(index).high).contains(&TRUTH[index])),
            deviations: [plain.points(), overlapped.points()]
                .map(|points| deviations(points).map(|(_, deviation)| deviation).collect()),
        }
    }
}

fn each<T>(value: impl Fn(usize) -> T) -> [T; 3] {
    std::array::from_fn(value)
}
