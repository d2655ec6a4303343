//! Benchmark of noise behind the part's filter: bias and coverage of N, B and K, and wrong names.
//!
//! ```text
//! seed ─► white, flicker, walk at 819.2 Hz ─► two averages over 1 … 64 values ─► every 1st … 9th ─► counts ─► analysis ─► JSON ─► tables.py
//! ```
//!
//! The noises follow their definitions at the sensor's own rate: white N², flicker B²/(πf) (one-sided), a walk of white
//! steps. The true N is the density far below the reading rate, with folded noise and without rounding (0.1 %).

use crate::arguments::{MOST_RECORDINGS, cores, in_filter, jobs, positive};
use crate::parallel;
use crate::reproduction::TRUTH;
use crate::spectral_noise::{baseline, moving_average};
use clap::{Args, value_parser};
use measurement::{MeasuredChannel, Measurement, adis16405};
use noise_analysis::analysis::analyze;
use noise_analysis::report::{ChannelReport, Parameter};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use serde::Serialize;
use std::collections::BTreeMap;
use std::convert::Infallible;
use virtual_sensor::ChannelNoise;

/// Rate of the sensor's own samples by the data sheet, Hz.
const INTERNAL_RATE_HZ: f64 = 819.2;
/// Size of a count of a gyro by the data sheet, °/s.
const RESOLUTION: f64 = 0.05;
/// Taps of each of the two averages.
const TAPS: [usize; 5] = [1, 4, 8, 16, 64];
/// Decimations: every 1st, 2nd, 4th or 9th value is read.
const READ_EVERY: [usize; 4] = [1, 2, 4, 9];
const GYROS: [&str; 3] = ["gyro_x", "gyro_y", "gyro_z"];

/// Compare N, B and K behind the part's filter with their truth, nothing else hidden.
#[derive(Debug, Clone, PartialEq, Args)]
pub struct FilteredNoisePlan {
    /// Taps of each of the two averages.
    #[arg(long, value_delimiter = ',', default_values_t = TAPS, value_parser = in_filter)]
    pub taps: Vec<usize>,
    /// Which of the values are read: 1 for every one, 2 for every second.
    #[arg(long, value_delimiter = ',', default_values_t = READ_EVERY, value_parser = in_filter)]
    pub every: Vec<usize>,
    /// Records of three gyros behind each filter; the noises are the same behind all filters.
    #[arg(long, default_value_t = 300, value_parser = value_parser!(u64).range(1..=MOST_RECORDINGS))]
    pub records: u64,
    /// Length of a record, s.
    #[arg(long, default_value_t = 1800.0, value_parser = positive)]
    pub seconds: f64,
    /// Seed of the first record.
    #[arg(long = "seed", default_value_t = 1)]
    pub first_seed: u64,
    /// Records that are examined at a time [default: one a core].
    #[arg(long, default_value_t = cores(), value_parser = jobs, hide_default_value = true)]
    pub jobs: usize,
}

/// An estimate with 95 % bounds; the value and the lower bound are 0 if it is not significant.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct FilteredCoefficient {
    pub truth: f64,
    pub value: f64,
    pub low: f64,
    pub high: f64,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FilteredChannel {
    /// Taps and decimation in the model.
    pub filter: Option<[f64; 2]>,
    /// N, B and K with their truth, if the model has them.
    pub coefficients: [Option<FilteredCoefficient>; 3],
    /// Named effects other than the filter itself.
    pub named: Vec<String>,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FilterCell {
    /// Taps of each of the two averages.
    pub taps: usize,
    /// Decimation: 1 if every value is read.
    pub every: usize,
    pub channels: Vec<FilteredChannel>,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FilteredNoiseTable {
    pub cells: Vec<FilterCell>,
}

impl FilteredNoisePlan {
    /// Runs the benchmark; `progress` gets the numbers of finished and of all records.
    pub fn run(&self, progress: impl Fn(usize, usize) + Sync) -> FilteredNoiseTable {
        let seeds = self.first_seed..self.first_seed + self.records;
        let items: Vec<(u64, usize)> = seeds.flat_map(|seed| self.taps.iter().map(move |taps| (seed, *taps))).collect();
        let work = |&(seed, taps): &(u64, usize)| Ok::<_, Infallible>(self.record(seed, taps));
        let Ok(results) = parallel::map(&items, self.jobs, work, progress);
        let mut cells: BTreeMap<(usize, usize), Vec<FilteredChannel>> = BTreeMap::new();
        for ((_, taps), readings) in items.iter().zip(results) {
            for (every, channels) in self.every.iter().copied().zip(readings) {
                cells.entry((*taps, every)).or_default().extend(channels);
            }
        }
        let cell = |((taps, every), channels)| FilterCell { taps, every, channels };
        FilteredNoiseTable { cells: cells.into_iter().map(cell).collect() }
    }

    /// The channels of one record behind averages over `taps`, by decimation.
    fn record(&self, seed: u64, taps: usize) -> Vec<Vec<FilteredChannel>> {
        let samples = (self.seconds * INTERNAL_RATE_HZ).round() as usize;
        let filtered = |channel: usize| {
            let noise = noise(samples + 2 * (taps - 1), seed, channel as u64);
            moving_average(&moving_average(&noise, taps), taps)
        };
        let filtered: Vec<Vec<f64>> = (0..GYROS.len()).map(filtered).collect();
        let read = |&every: &usize| {
            let report = analyze(&measurement(&filtered, every));
            let truth = truth(taps, every);
            let of = |&name: &&'static str| {
                let channel = report.channels.iter().find(|of| of.name == name)?;
                Some(FilteredChannel::new(channel, taps, truth))
            };
            GYROS.iter().filter_map(of).collect()
        };
        self.every.iter().map(read).collect()
    }
}

impl FilteredChannel {
    fn new(report: &ChannelReport, taps: usize, truth: [f64; 3]) -> Self {
        let term = |kind: &str| report.refitted.terms.iter().find(|term| term.kind() == kind);
        let filter = term("filter_bandwidth");
        let parameter = |name: &str| filter.map(|term| term.parameters()[name].value);
        // N is the coefficient of the filtered term if there is one.
        let white = filter.or(term("angle_random_walk"));
        let terms = [white, term("bias_instability"), term("rate_random_walk")];
        let coefficient = |at: usize| {
            let Parameter { value, low, high, .. } = terms[at]?.coefficient();
            Some(FilteredCoefficient { truth: truth[at], value, low, high })
        };
        let is_filter = |kind: &str| taps > 1 && kind == "filter_bandwidth";
        let kinds = report.effects.iter().map(|shown| shown.effect.name().to_owned());
        Self {
            filter: parameter("taps").zip(parameter("decimation")).map(|(taps, decimation)| [taps, decimation]),
            coefficients: std::array::from_fn(coefficient),
            named: kinds.filter(|kind| !is_filter(kind)).collect(),
        }
    }
}

fn noise(samples: usize, seed: u64, channel: u64) -> Vec<f64> {
    let [angle_random_walk, bias_instability, rate_random_walk] = TRUTH;
    let noise = ChannelNoise { angle_random_walk, bias_instability, rate_random_walk, ..ChannelNoise::default() };
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    random.set_stream(channel);
    baseline(&noise, INTERNAL_RATE_HZ, samples, &mut random)
}

fn measurement(filtered: &[Vec<f64>], every: usize) -> Measurement {
    let profile = adis16405::profile(RESOLUTION);
    let rate_hz = INTERNAL_RATE_HZ / every as f64;
    let counts = |values: &Vec<f64>| -> Vec<i32> {
        values.iter().step_by(every).map(|value| (value / RESOLUTION).round() as i32).collect()
    };
    let channels = GYROS.iter().zip(filtered).filter_map(|(name, values)| {
        profile.channel(name).map(|channel| MeasuredChannel::new(channel, counts(values)))
    });
    let channels: Vec<MeasuredChannel> = channels.collect();
    let samples = channels.first().map_or(0, |channel| channel.counts.len() as u64);
    Measurement {
        sample_rate_hz: rate_hz,
        stated_rate_hz: Some(rate_hz),
        slots: (0..samples).collect(),
        times_s: None,
        channels,
        dropped: BTreeMap::from([("gap", 0)]),
        flagged: BTreeMap::new(),
        profile,
    }
}

/// N, B and K of the values that are read. N² is multiplied by `d·Σ r(jd)` with the autocorrelation `r` of the impulse
/// response.
fn truth(taps: usize, every: usize) -> [f64; 3] {
    let [n, b, k] = TRUTH;
    let box_response = vec![1.0 / taps as f64; taps];
    let response = convolution(&box_response, &box_response);
    let reversed: Vec<f64> = response.iter().rev().copied().collect();
    let autocorrelation = convolution(&response, &reversed);
    let middle = response.len() - 1;
    let read: f64 = (middle % every..autocorrelation.len()).step_by(every).map(|lag| autocorrelation[lag]).sum();
    [n * (every as f64 * read).sqrt(), b, k]
}

fn convolution(a: &[f64], b: &[f64]) -> Vec<f64> {
    let mut sum = vec![0.0; a.len() + b.len() - 1];
    for (i, a) in a.iter().enumerate() {
        for (j, b) in b.iter().enumerate() {
            sum[i + j] += a * b;
        }
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Without a filter, every `d`-th sample has `d` times the density. 8 taps fold nothing at 204.8 Hz; 4 taps give
    /// 9·Σh².
    #[test]
    fn the_white_noise_that_is_read_has_its_closed_form() {
        let ratio = |taps: usize, every: usize| (truth(taps, every)[0] / TRUTH[0]).powi(2);
        assert!((ratio(1, 9) - 9.0).abs() < 1e-12 && (ratio(8, 4) - 1.0).abs() < 1e-12);
        assert!((ratio(4, 9) - 9.0 * 33.0 / 192.0).abs() < 1e-12);
    }

    /// The variance is `N²·f·Σh²`; flicker noise and walk add less than a hundredth. 2¹⁶ samples correlated over 8 give
    /// it to 1 % (1 σ).
    #[test]
    fn the_noise_behind_the_filter_has_the_variance_of_its_response() {
        let plan_samples = 1 << 16;
        let taps = 8;
        let filtered = moving_average(&moving_average(&noise(plan_samples, 5, 0), taps), taps);
        let mean = filtered.iter().sum::<f64>() / filtered.len() as f64;
        let variance = filtered.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / filtered.len() as f64;
        let squares = (2.0 * 64.0 + 1.0) / (3.0 * 512.0);
        let expected = TRUTH[0].powi(2) * INTERNAL_RATE_HZ * squares;
        assert!((variance / expected - 1.0).abs() < 0.05, "{variance}, {expected}");
    }

    #[test]
    fn a_small_run_has_every_cell_and_its_intervals_hold_for_the_default_filter() {
        let (taps, every) = (TAPS.to_vec(), READ_EVERY.to_vec());
        let plan = FilteredNoisePlan { taps, every, records: 1, seconds: 30.0, first_seed: 3, jobs: 2 };
        let table = plan.run(|_, _| ());
        assert_eq!(table.cells.len(), TAPS.len() * READ_EVERY.len());
        assert!(table.cells.iter().all(|cell| cell.channels.len() == GYROS.len()));
        // Half a minute gives N to 1.5 %, so a deviation of 10 % would be another filter or rate.
        let default = table.cells.iter().find(|cell| (cell.taps, cell.every) == (4, 1)).expect("4 taps");
        for channel in &default.channels {
            let n = channel.coefficients[0].expect("N");
            assert!((n.value / n.truth - 1.0).abs() < 0.1, "{channel:?}");
        }
    }
}
