//! Effects hidden in measured noise. The reports of a stretch with and without the effect are compared.
//!
//! ```text
//! recording ─► stretch ─┬───────────────────────────► analysis ─► report of the noise ──────────────┐
//!                       ├─► N, B, K ─► size ─► effect ─┐                                            ├─► score ─► JSON ─► tables.py
//!                       └──────────────────────────────┴► counts ─► analysis ─► report ─────────────┘
//! ```
//!
//! A finding counts only if the untouched stretch does not have it. Effects that need other quantities or change the
//! noise itself are not hidden.

mod hidden_kind;
mod hide;
mod noise_estimate;
mod recording;
mod score;
mod stretch;

pub use hidden_kind::HiddenKind;
pub use recording::{MeasuredNoiseError, NoiseRecording};
pub use score::{MeasuredErrors, MeasuredScore};

use crate::parallel;
use noise_analysis::analysis::analyze;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::Serialize;
use std::convert::Infallible;
use stretch::Stretch;

/// Random stream of the stretches; other modules use other streams.
const STRETCHES: u64 = u64::MAX;

/// Length of a stretch; a shorter recording is one stretch.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum StretchLength {
    /// Length in s.
    Seconds(f64),
    /// Length in sample periods.
    Samples(u64),
}

/// The effects to hide, and the recordings.
#[derive(Debug, Clone, PartialEq)]
pub struct MeasuredNoisePlan {
    pub recordings: Vec<NoiseRecording>,
    /// Number of stretches; every kind of effect is hidden alone in each.
    pub stretches: u64,
    pub length: StretchLength,
    /// Size of the effects over the detection limit in the channel's N, B and K.
    pub strength: f64,
    pub seed: u64,
    pub jobs: usize,
}

/// The scores, in the order of the stretches.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct MeasuredNoiseTable {
    /// Kinds that no channel of a stretch can have at the strength.
    pub not_hidden: Vec<HiddenKind>,
    pub scores: Vec<MeasuredScore>,
}

impl MeasuredNoisePlan {
    /// Hides and scores every effect; `progress` gets the numbers of finished and of all analyses.
    #[must_use]
    pub fn run(&self, progress: impl Fn(usize, usize) + Sync) -> MeasuredNoiseTable {
        if self.recordings.is_empty() {
            return MeasuredNoiseTable::default();
        }
        let numbers: Vec<u64> = (0..self.stretches).collect();
        let all = numbers.len() * (1 + HiddenKind::ALL.len());
        let Ok(stretches) = parallel::map(
            &numbers,
            self.jobs,
            |&number| Ok::<_, Infallible>(self.stretch(number)),
            |done, _| progress(done, all),
        );
        let cases: Vec<(&Stretch<'_>, HiddenKind)> =
            stretches.iter().flat_map(|stretch| HiddenKind::ALL.map(|kind| (stretch, kind))).collect();
        let work = |&(stretch, kind): &(&Stretch<'_>, HiddenKind)| {
            let drawn = stretch.draw(kind, self.strength);
            Ok::<_, Infallible>(drawn.map(|(effect, strength)| score::hidden(stretch, kind, &effect, strength)))
        };
        let Ok(scores) = parallel::map(&cases, self.jobs, work, |done, _| progress(numbers.len() + done, all));
        let not_hidden = cases.iter().zip(&scores).filter(|(_, score)| score.is_none()).map(|((_, kind), _)| *kind);
        MeasuredNoiseTable { not_hidden: not_hidden.collect(), scores: scores.into_iter().flatten().collect() }
    }

    fn stretch(&self, number: u64) -> Stretch<'_> {
        let seed = self.seed + number;
        let recording = &self.recordings[(number % self.recordings.len() as u64) as usize];
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        random.set_stream(STRETCHES);
        let whole = &recording.samples;
        let length = match self.length {
            StretchLength::Seconds(seconds) => (seconds * whole.sample_rate_hz).round() as u64,
            StretchLength::Samples(samples) => samples,
        };
        let length = length.clamp(1, whole.periods());
        let from = random.random_range(0..=whole.periods() - length);
        let samples = recording::part(whole, from..from + length);
        let noise = noise_estimate::noise_estimate(&samples);
        let report = analyze(&samples);
        let from_s = from as f64 / whole.sample_rate_hz;
        Stretch { recording: &recording.name, seed, from_s, samples, noise, report }
    }
}

#[cfg(test)]
mod tests;
