//! Benchmark of lost samples: curve and model of complete records and of records with losses.
//!
//! ```text
//! seed ─► noise ─► complete record ─► Cascade ─► curve, N, B, K ─┐
//!                  └► losses ───────► Cascade ─► curve, N, B, K ─┴► JSON ─► tables.py: ratios, degrees of freedom, intervals
//! ```

mod estimate;
mod loss_pattern;
mod noise;

pub use estimate::{EstimatedCoefficient, EstimatedOctave, EstimatedRecord};
pub use loss_pattern::LossPattern;
pub use noise::{RATE_HZ, TestNoise};

use crate::arguments::{MOST_RECORDINGS, cores, jobs};
use crate::parallel;
use clap::{Args, value_parser};
use serde::Serialize;
use std::convert::Infallible;

/// Take samples out of records and compare variance and coefficients with those of the complete records.
#[derive(Debug, Clone, Copy, PartialEq, Args)]
pub struct LossPlan {
    /// Records of each noise.
    #[arg(long, default_value_t = 100, value_parser = value_parser!(u64).range(2..=MOST_RECORDINGS))]
    pub records: u64,
    /// Binary logarithm of the number of samples of a record, at 204.8 SPS; 20 is 1.4 hours.
    #[arg(long, default_value_t = 20, value_parser = value_parser!(u32).range(14..=24))]
    pub samples_log2: u32,
    /// Seed of the first record.
    #[arg(long, default_value_t = 1)]
    pub first_seed: u64,
    /// Records that are simulated at a time [default: one a core].
    #[arg(long, default_value_t = cores(), value_parser = jobs, hide_default_value = true)]
    pub jobs: usize,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LossTable {
    pub rate_hz: f64,
    /// Length of a complete record.
    pub samples: usize,
    pub noises: Vec<LossyNoise>,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LossyNoise {
    pub noise: String,
    pub complete: Vec<EstimatedRecord>,
    /// The same records with losses of each pattern.
    pub lossy: Vec<(String, Vec<EstimatedRecord>)>,
}

impl LossPlan {
    /// Runs the benchmark; `progress` gets the numbers of finished and of all records.
    pub fn run(&self, progress: impl Fn(usize, usize) + Sync) -> LossTable {
        let seeds = self.first_seed..self.first_seed + self.records;
        let items: Vec<(TestNoise, u64)> =
            TestNoise::all().into_iter().flat_map(|noise| seeds.clone().map(move |seed| (noise, seed))).collect();
        let work = |&(noise, seed): &(TestNoise, u64)| Ok::<_, Infallible>((noise, self.record(noise, seed)));
        let Ok(results) = parallel::map(&items, self.jobs, work, progress);
        let noises = results.chunk_by(|(a, _), (b, _)| a == b).map(|of_noise| {
            let column = |index: usize| of_noise.iter().map(|(_, records)| records[index].clone()).collect();
            let lossy = (1..).zip(LossPattern::ALL).map(|(index, pattern)| (pattern.to_string(), column(index)));
            LossyNoise { noise: of_noise[0].0.to_string(), complete: column(0), lossy: lossy.collect() }
        });
        LossTable { rate_hz: RATE_HZ, samples: self.samples(), noises: noises.collect() }
    }

    fn samples(&self) -> usize {
        1 << self.samples_log2
    }

    /// The record of a seed, complete and with each pattern of losses.
    fn record(&self, noise: TestNoise, seed: u64) -> Vec<EstimatedRecord> {
        let record = noise.record(self.samples(), seed);
        let losses = LossPattern::ALL.into_iter().map(|pattern| pattern.gaps(self.samples(), seed));
        std::iter::once(Vec::new()).chain(losses).map(|gaps| EstimatedRecord::new(noise, &record, &gaps)).collect()
    }
}
