//! Hours of the virtual gyro, and what two methods make of each.

use super::slopes::{deviations, read_off};
use super::{RATE_HZ, SECONDS, TRUTH};
use adis16405_driver::{Channel, GyroRange};
use allan_core::term::MovingAverageFilter;
use allan_core::{Cascade, Model, NoiseTerm, fit::fit};
use serde::Serialize;
use virtual_sensor::{NoiseModel, OutputRegister, VirtualAdis16405};

const OCTAVES: usize = 20;
/// deg/s.
const LSB: f64 = Channel::GyroZ.lsb(GyroRange::Dps300);
/// Write 7 to the lower byte of SMPL_PRD: eight ticks of 1/1638.4 s.
const PERIOD_OF_EIGHT_TICKS: u16 = 0xB607;
/// The part's filter after a reset: two averages over four samples each.
const FILTER: MovingAverageFilter = MovingAverageFilter::bartlett(4);

/// Which seeds to run.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Experiment {
    /// Hours to simulate.
    pub seeds: u64,
    /// The first of them.
    pub first_seed: u64,
}

/// Bias and scatter of a quantity over the seeds, relative to the truth.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Error {
    /// Mean over the truth, less 1.
    pub bias: f64,
    /// Standard deviation over the truth.
    pub scatter: f64,
}

/// One octave: how the deviation scatters and what is claimed.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Scatter {
    /// s.
    pub tau_s: f64,
    /// `1/√(2(N/n − 1))`, the paper's formula 6.
    pub formula: f64,
    /// `1/√(2·edf)` of the overlapped estimate.
    pub confidence: f64,
    /// Relative standard deviation over the seeds, without overlap.
    pub plain: f64,
    /// The same with eightfold overlap.
    pub overlapped: f64,
    /// What N, B and K contribute to the true variance.
    pub shares: [f64; 3],
}

/// What came out.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Outcome {
    /// Hours.
    pub seeds: u64,
    /// What the read-off of the true curve errs by: no noise, only the overlap of terms.
    pub inherent: [f64; 3],
    /// Read off the curve without overlap, as the paper does.
    pub plain: [Error; 3],
    /// Read off the overlapped curve.
    pub overlapped: [Error; 3],
    /// Fitted.
    pub fitted: [Error; 3],
    /// Share of the seeds in which the fit's 95 % bounds hold the truth.
    pub covered: [f64; 3],
    /// By octave.
    pub scatter: Vec<Scatter>,
}

/// One hour.
struct Hour {
    plain: Vec<f64>,
    overlapped: Vec<f64>,
    read_off: [[f64; 3]; 2],
    fitted: [f64; 3],
    covered: [bool; 3],
}

impl Experiment {
    /// Runs it. `progress` hears how many hours are done.
    #[must_use]
    pub fn run(&self, mut progress: impl FnMut(u64)) -> Outcome {
        let hours: Vec<Hour> = (0..self.seeds)
            .map(|index| {
                let hour = hour(self.first_seed.wrapping_add(index));
                progress(index + 1);
                hour
            })
            .collect();
        let truth = truth();
        let octaves = (0..hours.iter().map(|hour| hour.plain.len()).min().unwrap_or(0)).map(|octave| 1_u64 << octave);
        let tau = |n: u64| n as f64 / RATE_HZ;
        let inherent = read_off(octaves.clone().map(|n| (tau(n), truth.avar(n).sqrt())));
        Outcome {
            seeds: self.seeds,
            inherent: errors_of(inherent),
            plain: each(|term| over(&hours, |hour| hour.read_off[0][term] / TRUTH[term])),
            overlapped: each(|term| over(&hours, |hour| hour.read_off[1][term] / TRUTH[term])),
            fitted: each(|term| over(&hours, |hour| hour.fitted[term] / TRUTH[term])),
            covered: each(|term| hours.iter().filter(|hour| hour.covered[term]).count() as f64 / hours.len() as f64),
            scatter: octaves
                .enumerate()
                .map(|(octave, n)| Scatter {
                    tau_s: tau(n),
                    formula: allan_core::slope_method::percentage_accuracy(samples(), n) / 100.0,
                    confidence: confidence(&truth, octave),
                    plain: relative(over(&hours, |hour| hour.plain[octave])),
                    overlapped: relative(over(&hours, |hour| hour.overlapped[octave])),
                    shares: each(|term| {
                        let kind = NoiseTerm::BASELINE[term];
                        TRUTH[term] * TRUTH[term] * kind.avar(n, 1.0 / RATE_HZ) / unfiltered(n)
                    }),
                })
                .collect(),
        }
    }
}

fn samples() -> u64 {
    (SECONDS * RATE_HZ) as u64
}

/// The terms that the fit looks for: N behind the part's filter, B, K, and the rounding to counts, which is white noise too
/// but comes after the filter.
fn terms() -> [NoiseTerm; 4] {
    [NoiseTerm::Filtered(FILTER), NoiseTerm::BiasInstability, NoiseTerm::RateRandomWalk, NoiseTerm::AngleRandomWalk]
}

/// Of the rounding, as an N: `LSB·√(dt/12)`.
fn rounding() -> f64 {
    LSB * (1.0 / RATE_HZ / 12.0).sqrt()
}

/// The model that is true.
fn truth() -> Model {
    let terms = terms()
        .into_iter()
        .zip(TRUTH.into_iter().chain([rounding()]))
        .map(|(kind, value)| allan_core::model::FittedTerm::exact(kind, value));
    Model::new(1.0 / RATE_HZ, terms)
}

/// Variance of the noise before the filter.
fn unfiltered(n: u64) -> f64 {
    NoiseTerm::BASELINE.iter().zip(TRUTH).map(|(kind, value)| value * value * kind.avar(n, 1.0 / RATE_HZ)).sum()
}

/// Relative standard deviation of the overlapped deviation by the degrees of freedom of the true mixture.
fn confidence(truth: &Model, octave: usize) -> f64 {
    let mut cascade = Cascade::<OCTAVES, 8>::new();
    cascade.push_slice(&vec![0; samples() as usize]);
    let curve = cascade.curve(1.0 / RATE_HZ);
    curve.points().get(octave).map_or(f64::NAN, |point| 1.0 / (2.0 * truth.edf(point)).sqrt())
}

fn hour(seed: u64) -> Hour {
    let mut noise = NoiseModel::noiseless();
    let gyro = noise.channel_mut(OutputRegister::GyroZ);
    [gyro.angle_random_walk, gyro.bias_instability, gyro.rate_random_walk] = TRUTH;
    let mut part = VirtualAdis16405::new(noise, seed);
    part.select();
    part.transfer(PERIOD_OF_EIGHT_TICKS);
    part.deselect();
    let mut plain = Cascade::<OCTAVES, 1>::new();
    let mut overlapped = Cascade::<OCTAVES, 8>::new();
    for _ in 0..samples() {
        part.advance_to(part.next_data_ready());
        let count = i32::from(part.counts()[OutputRegister::GyroZ as usize]);
        plain.push(count);
        overlapped.push(count);
    }
    let plain = plain.curve(1.0 / RATE_HZ).scaled(LSB);
    let overlapped = overlapped.curve(1.0 / RATE_HZ).scaled(LSB);
    let model = fit(&overlapped, &terms());
    let term = |index: usize| &model.terms()[index];
    let value = |found: [Option<f64>; 3]| found.map(|value| value.unwrap_or(f64::NAN));
    Hour {
        read_off: [value(read_off(deviations(plain.points()))), value(read_off(deviations(overlapped.points())))],
        plain: deviations(plain.points()).map(|(_, deviation)| deviation).collect(),
        overlapped: deviations(overlapped.points()).map(|(_, deviation)| deviation).collect(),
        fitted: each(|index| term(index).value),
        covered: each(|index| (term(index).low..=term(index).high).contains(&TRUTH[index])),
    }
}

fn each<T>(of: impl Fn(usize) -> T) -> [T; 3] {
    std::array::from_fn(of)
}

fn errors_of(found: [Option<f64>; 3]) -> [f64; 3] {
    each(|term| found[term].map_or(f64::NAN, |value| value / TRUTH[term] - 1.0))
}

/// Mean and standard deviation of a ratio.
fn over(hours: &[Hour], ratio: impl Fn(&Hour) -> f64) -> Error {
    let count = hours.len() as f64;
    let mean = hours.iter().map(&ratio).sum::<f64>() / count;
    let square = hours.iter().map(|hour| (ratio(hour) - mean).powi(2)).sum::<f64>();
    Error { bias: mean - 1.0, scatter: (square / (count - 1.0)).sqrt() }
}

fn relative(error: Error) -> f64 {
    error.scatter / (1.0 + error.bias)
}
