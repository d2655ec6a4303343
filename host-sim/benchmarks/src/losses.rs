//! Benchmark of lost samples: curve and model of complete records and of records with losses.
//!
//! ```text
//! seed ─► noise ─► complete record ─► Cascade ─► curve, N, B, K ─┐
//!                  └► losses ───────► Cascade ─► curve, N, B, K ─┴► ratios, degrees of freedom, intervals ─► JSON ─► tables.py
//! ```

mod estimate;
mod loss_pattern;
mod noise;
mod table;

pub use estimate::EstimatedRecord;
pub use loss_pattern::LossPattern;
pub use noise::{RATE_HZ, TestNoise};
pub use table::{CoefficientComparison, LossComparison, LossTable, OctaveRatio};

use crate::parallel;
use std::convert::Infallible;

/// The records to simulate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LossPlan {
    pub records: u64,
    /// Samples of each record; a power of two.
    pub samples: usize,
    pub first_seed: u64,
    pub jobs: usize,
}

impl LossPlan {
    /// Runs the benchmark; `progress` gets the numbers of finished and of all records.
    #[must_use]
    pub fn run(&self, progress: impl Fn(usize, usize) + Sync) -> LossTable {
        let seeds = self.first_seed..self.first_seed + self.records;
        let items: Vec<(TestNoise, u64)> =
            TestNoise::ALL.into_iter().flat_map(|noise| seeds.clone().map(move |seed| (noise, seed))).collect();
        let work = |&(noise, seed): &(TestNoise, u64)| Ok::<_, Infallible>((noise, self.record(noise, seed)));
        let Ok(results) = parallel::map(&items, self.jobs, work, progress);
        let mut comparisons = Vec::new();
        for of_noise in results.chunk_by(|(a, _), (b, _)| a == b) {
            for (index, pattern) in LossPattern::ALL.into_iter().enumerate() {
                let pairs: Vec<_> = of_noise.iter().map(|(_, records)| (&records[0], &records[index + 1])).collect();
                comparisons.push(LossComparison::new(of_noise[0].0, pattern, &pairs));
            }
        }
        LossTable { records: self.records, rate_hz: RATE_HZ, samples: self.samples, comparisons }
    }

    /// The record of a seed, complete and with each pattern of losses.
    fn record(&self, noise: TestNoise, seed: u64) -> Vec<EstimatedRecord> {
        let record = noise.record(self.samples, seed);
        let losses = LossPattern::ALL.into_iter().map(|pattern| pattern.gaps(self.samples, seed));
        std::iter::once(Vec::new()).chain(losses).map(|gaps| EstimatedRecord::new(noise, &record, &gaps)).collect()
    }
}
