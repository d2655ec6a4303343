//! Benchmark of undeclared effects: effects drawn at random are hidden in generated recordings, and the analysis, which
//! is given the recording only, is scored by whether it names them.
//!
//! ```text
//! seed ─► draw (noise, environment, effects; sizes from the detection limit) ─► generator ─► analysis ─► report ─┐
//!           └──────────────────────────── truth ────────────────────────────────────────────────────► score ─► table
//! ```
//!
//! Development uses the open seeds; the sealed seeds are run only to measure the finished method.

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
mod table;
mod truth;

#[cfg(test)]
mod tests;

pub use draw::{DrawnRecording, RecordingGroup};
pub use effect::EffectKind;
pub use generator::{Sampling, TrueRecording};
pub use measured::{
    HiddenKind, MeasuredErrors, MeasuredNoiseError, MeasuredNoisePlan, MeasuredNoiseTable, MeasuredScore,
    NoiseRecording, StretchLength,
};
pub use outside::{OutsideEffect, OutsideKind};
pub use score::{EffectScore, OutsideScore, ParameterScore, RecordingScore, ScoreError, UnseenErrors, score_recording};
pub use table::{Proportion, STRONG, ScoreTable};

use crate::parallel;

/// Offset of the sealed seeds from the open ones. The method has been changed after those at 2⁴⁰, 2⁴¹, … 2⁶² were run, and those at 2⁴⁰ and
/// 2⁴¹ were recordings of the virtual sensor; so these are no longer used.
const SEALED: u64 = 1 << 63;
/// Number of seeds that are reserved for each group of recordings.
pub const SEEDS_PER_GROUP: u64 = 1 << 20;

/// Which recordings to simulate and score.
#[derive(Debug, Clone, PartialEq)]
pub struct UndeclaredPlan {
    /// Kinds that are hidden as single effects.
    pub kinds: Vec<EffectKind>,
    /// Number of recordings per kind.
    pub per_kind: u64,
    /// Number of recordings without an effect.
    pub empty: u64,
    /// Number of recordings with two effects.
    pub pairs: u64,
    /// Number of recordings with three effects.
    pub triples: u64,
    /// Number of recordings of each kind of effect outside the vocabulary.
    pub outside: u64,
    /// Length of a recording, s.
    pub seconds: f64,
    /// Share of the measured samples that are lost at random in every recording, beside the hidden effects, %.
    pub loss_percent: f64,
    /// First seed of each group; its sum with any number of recordings is below [`SEEDS_PER_GROUP`].
    pub seed: u64,
    /// True if the sealed seeds are used instead of the open ones.
    pub sealed: bool,
    /// Number of threads.
    pub jobs: usize,
}

impl UndeclaredPlan {
    /// Group and seed of each recording.
    fn recordings(&self) -> Vec<(RecordingGroup, u64)> {
        let base = self.seed + if self.sealed { SEALED } else { 0 };
        let seed = |group: u64, number: u64| group * SEEDS_PER_GROUP + base + number;
        let nothing = (0..self.empty).map(|number| (RecordingGroup::Nothing, seed(0, number)));
        let singles = self.kinds.iter().flat_map(|&kind| {
            (0..self.per_kind).map(move |number| (RecordingGroup::Single(kind), seed(2 + kind as u64, number)))
        });
        let pairs = (0..self.pairs).map(|number| (RecordingGroup::Pair, seed(1, number)));
        let triples = (0..self.triples).map(|number| (RecordingGroup::Triple, seed(64, number)));
        let outside = OutsideKind::ALL.into_iter().flat_map(|kind| {
            (0..self.outside).map(move |number| (RecordingGroup::Outside(kind), seed(65 + kind as u64, number)))
        });
        nothing.chain(singles).chain(pairs).chain(triples).chain(outside).collect()
    }

    /// Generates and scores every recording. `progress` is called with the number of finished recordings and of all.
    ///
    /// # Errors
    /// That of the first recording, in the order of the plan, that has no timeline.
    pub fn run(&self, progress: impl Fn(usize, usize) + Sync) -> Result<ScoreTable, ScoreError> {
        let work = |&(group, seed): &(RecordingGroup, u64)| {
            let drawn = DrawnRecording::from_group(group, self.seconds, seed);
            Ok((group, score_recording(&drawn, self.loss_percent / 100.0)?))
        };
        let outcomes = parallel::map(&self.recordings(), self.jobs, work, progress)?;
        Ok(ScoreTable { outcomes })
    }
}
