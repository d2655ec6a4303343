//! Benchmark of undeclared effects: random effects in generated recordings; the analysis is scored by their names.
//!
//! ```text
//! seed ─► draw (noise, environment, effects; sizes from the detection limit) ─► generator ─► analysis ─► report ─┐
//!           └──────────────────────────── truth ────────────────────────────────────────────────────► score ─► JSON ─► tables.py
//! ```
//!
//! Development uses the open seeds; sealed seeds only measure the finished method.

mod block_covariance;
mod channel_under_test;
mod detection_limit;
mod draw;
mod effect;
mod environment;
mod generator;
mod measured;
mod outside;
mod outside_limit;
mod sample_loss;
mod score;
mod truth;

#[cfg(test)]
mod tests;

pub use draw::{DrawnRecording, RecordingGroup};
pub use effect::EffectKind;
pub use generator::{Sampling, TrueRecording};
pub use measured::{
    HiddenKind, MeasuredErrors, MeasuredNoiseError, MeasuredNoisePlan, MeasuredNoiseTable, MeasuredScore,
    NoiseRecording,
};
pub use outside::{OutsideEffect, OutsideKind};
pub use score::{EffectScore, OutsideScore, ParameterScore, RecordingScore, ScoreError, UnseenErrors, score_recording};

use crate::arguments::{MOST_RECORDINGS, cores, jobs, loss_percent};
use crate::parallel;
use clap::{Args, ValueEnum, value_parser};
use serde::Serialize;

/// Offset of the sealed seeds; earlier ones, 2⁴⁰ … 2⁶², have been used.
const SEALED: u64 = 1 << 63;
/// Number of seeds reserved for each group.
pub const SEEDS_PER_GROUP: u64 = 1 << 20;

/// Hide random effects in recordings and score how well the analysis names them.
#[derive(Debug, Clone, PartialEq, Args)]
pub struct UndeclaredPlan {
    /// Kind that is hidden alone; may be repeated [default: all].
    #[arg(long = "kind", value_enum)]
    pub kinds: Vec<EffectKind>,
    /// Recordings a kind.
    #[arg(long, default_value_t = 40, value_parser = value_parser!(u64).range(..=MOST_RECORDINGS))]
    pub per_kind: u64,
    /// Recordings with nothing hidden.
    #[arg(long, default_value_t = 200, value_parser = value_parser!(u64).range(..=MOST_RECORDINGS))]
    pub nothing: u64,
    /// Recordings with two effects.
    #[arg(long, default_value_t = 200, value_parser = value_parser!(u64).range(..=MOST_RECORDINGS))]
    pub pairs: u64,
    /// Recordings with three effects.
    #[arg(long, default_value_t = 100, value_parser = value_parser!(u64).range(..=MOST_RECORDINGS))]
    pub triples: u64,
    /// Recordings of each kind of effect that no kind of the report describes.
    #[arg(long, value_name = "PER_KIND", default_value_t = 20, value_parser = value_parser!(u64).range(..=MOST_RECORDINGS))]
    pub outside: u64,
    /// Length of a recording, s.
    #[arg(long, default_value_t = 1800.0)]
    pub seconds: f64,
    /// Samples that are lost at random in every recording, %.
    #[arg(long = "loss", value_name = "PERCENT", default_value_t = 0.0, value_parser = loss_percent)]
    pub loss_percent: f64,
    /// First seed of each group of recordings.
    #[arg(long, default_value_t = 0, value_parser = value_parser!(u64).range(..SEEDS_PER_GROUP / 2))]
    pub seed: u64,
    /// Take the seeds that are kept for the end.
    #[arg(long)]
    pub sealed: bool,
    /// Recordings that are examined at a time [default: one a core].
    #[arg(long, default_value_t = cores(), value_parser = jobs, hide_default_value = true)]
    pub jobs: usize,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ScoreTable {
    pub outcomes: Vec<(RecordingGroup, RecordingScore)>,
}

impl UndeclaredPlan {
    fn recordings(&self) -> Vec<(RecordingGroup, u64)> {
        let base = self.seed + if self.sealed { SEALED } else { 0 };
        let seed = |group: u64, number: u64| group * SEEDS_PER_GROUP + base + number;
        let nothing = (0..self.nothing).map(|number| (RecordingGroup::Nothing, seed(0, number)));
        let kinds = if self.kinds.is_empty() { &EffectKind::ALL[..] } else { self.kinds.as_slice() };
        let singles = kinds.iter().flat_map(|&kind| {
            (0..self.per_kind).map(move |number| (RecordingGroup::Single(kind), seed(2 + kind as u64, number)))
        });
        let pairs = (0..self.pairs).map(|number| (RecordingGroup::Pair, seed(1, number)));
        let triples = (0..self.triples).map(|number| (RecordingGroup::Triple, seed(64, number)));
        let outside = OutsideKind::value_variants().iter().flat_map(|&kind| {
            (0..self.outside).map(move |number| (RecordingGroup::Outside(kind), seed(65 + kind as u64, number)))
        });
        nothing.chain(singles).chain(pairs).chain(triples).chain(outside).collect()
    }

    /// Generates and scores every recording; `progress` gets the numbers of finished and of all.
    ///
    /// # Errors
    /// The error of the first recording without a time base, in the order of the plan.
    pub fn run(&self, progress: impl Fn(usize, usize) + Sync) -> Result<ScoreTable, ScoreError> {
        let work = |&(group, seed): &(RecordingGroup, u64)| {
            let drawn = DrawnRecording::from_group(group, self.seconds, seed);
            Ok((group, score_recording(&drawn, self.loss_percent / 100.0)?))
        };
        let outcomes = parallel::map(&self.recordings(), self.jobs, work, progress)?;
        Ok(ScoreTable { outcomes })
    }
}
