//! Benchmark of lost samples: each simulated record is estimated complete and with samples taken out of it, and the two
//! curves and models are compared.
//!
//! ```text
//! seed ─► noise ─► complete record ─► Cascade ─► curve, N, B, K ─┐
//!                  └► losses ───────► Cascade ─► curve, N, B, K ─┴► ratios, degrees of freedom, intervals ─► table
//! ```

mod loss;
mod noise;
mod table;

pub use loss::Loss;
pub use noise::TestNoise;
pub use table::{LossComparison, LossTable, OctaveRatio};

use allan_core::{Cascade, Curve, Model, fit::fit};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};

/// Samples per second of the simulated records.
pub const RATE_HZ: f64 = 204.8;
/// Octaves of the estimators, of which a record fills those up to half its length.
const OCTAVES: usize = 24;

/// How many records to simulate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LossPlan {
    /// Records of each noise.
    pub records: u64,
    /// Samples of each record; a power of two.
    pub samples: usize,
    /// Seed of the first record of each noise.
    pub first_seed: u64,
    /// Number of threads.
    pub jobs: usize,
}

/// What the estimator makes of one record.
#[derive(Debug, Clone)]
pub struct EstimatedRecord {
    /// Allan variances in counts².
    pub curve: Curve<OCTAVES>,
    /// The terms of the noise, fitted to the curve; N, B and K in counts and seconds.
    pub model: Model,
    /// Samples that the estimator has seen.
    pub samples: u64,
}

impl LossPlan {
    /// Runs the benchmark. `progress` is called with the number of finished records and of all.
    #[must_use]
    pub fn run(&self, progress: impl Fn(u64, u64) + Sync) -> LossTable {
        let all = self.records * TestNoise::ALL.len() as u64;
        let next = AtomicU64::new(0);
        let done = AtomicU64::new(0);
        let results = Mutex::new(Vec::new());
        std::thread::scope(|scope| {
            for _ in 0..self.jobs.max(1) {
                scope.spawn(|| {
                    loop {
                        let at = next.fetch_add(1, Ordering::Relaxed);
                        if at >= all {
                            break;
                        }
                        let noise = TestNoise::ALL[(at % TestNoise::ALL.len() as u64) as usize];
                        let estimated = self.record(noise, self.first_seed + at / TestNoise::ALL.len() as u64);
                        // The list is valid even if a thread panicked: it is only changed by `push`.
                        results.lock().unwrap_or_else(PoisonError::into_inner).push((at, noise, estimated));
                        progress(done.fetch_add(1, Ordering::Relaxed) + 1, all);
                    }
                });
            }
        });
        let mut results = results.into_inner().unwrap_or_else(PoisonError::into_inner);
        results.sort_by_key(|(at, ..)| *at);
        let comparisons = TestNoise::ALL.into_iter().flat_map(|noise| {
            let of_noise: Vec<&[EstimatedRecord]> =
                results.iter().filter(|(_, of, _)| *of == noise).map(|(.., records)| records.as_slice()).collect();
            (0..Loss::ALL.len())
                .map(|index| {
                    let pairs: Vec<_> = of_noise.iter().map(|records| (&records[0], &records[index + 1])).collect();
                    LossComparison::new(noise, Loss::ALL[index], &pairs)
                })
                .collect::<Vec<_>>()
        });
        LossTable { plan: *self, comparisons: comparisons.collect() }
    }

    /// The record of a seed, complete and with each of the losses.
    fn record(&self, noise: TestNoise, seed: u64) -> Vec<EstimatedRecord> {
        let record = noise.record(self.samples, seed);
        let mut complete = Cascade::<OCTAVES, 8>::new();
        complete.push_slice(&record);
        let losses = Loss::ALL.into_iter().map(|loss| {
            let mut cascade = Cascade::<OCTAVES, 8>::new();
            let mut next = 0;
            for gap in loss.gaps(self.samples, seed) {
                cascade.push_slice(&record[next..gap.start]);
                cascade.gap(gap.len() as u32);
                next = gap.end;
            }
            cascade.push_slice(&record[next..]);
            cascade
        });
        let estimate = |cascade: &Cascade<OCTAVES, 8>| {
            let curve = cascade.curve(1.0 / RATE_HZ);
            let model = fit(&curve, noise.terms());
            EstimatedRecord { curve, model, samples: cascade.len() }
        };
        std::iter::once(estimate(&complete)).chain(losses.map(|cascade| estimate(&cascade))).collect()
    }
}
