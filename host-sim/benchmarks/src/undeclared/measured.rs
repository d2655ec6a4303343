//! Effects hidden in measured noise: each is added to a stretch of a recording, and the report of the stretch with the effect is
//! scored against that of the same stretch untouched.
//!
//! ```text
//! recording ─► stretch ─┬───────────────────────────► analysis ─► report of the noise ──────────────┐
//!                       ├─► N, B, K ─► size ─► effect ─┐                                            ├─► score ─► table
//!                       └──────────────────────────────┴► counts ─► analysis ─► report ─────────────┘
//! ```
//!
//! The effects in the noise itself are not known. So an effect is named if a finding of its kind is there that the untouched stretch does
//! not have, and a wrong name is one that the untouched stretch does not have. An effect that needs a quantity beside the noise
//! (temperature, supply, acceleration, a clock) or that would change the noise itself (another filter) is not hidden.

mod hidden_kind;
mod hide;
mod noise_estimate;
mod recording;
mod score;
mod stretch;
mod table;

pub use hidden_kind::HiddenKind;
pub use recording::{MeasuredNoiseError, NoiseRecording};
pub use score::{MeasuredErrors, MeasuredScore};
pub use table::MeasuredNoiseTable;

use crate::parallel;
use noise_analysis::analysis::analyze;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::convert::Infallible;
use stretch::Stretch;

/// Random stream of the stretches; those of the effects are in `stretch` and `hide`.
const STRETCHES: u64 = u64::MAX;

/// Length of a stretch; a shorter recording is one stretch.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum StretchLength {
    /// In s.
    Seconds(f64),
    /// In sample periods.
    Samples(u64),
}

/// Which effects to hide in which recordings.
#[derive(Debug, Clone, PartialEq)]
pub struct MeasuredNoisePlan {
    /// Recordings of sensors at rest, used in turn.
    pub recordings: Vec<NoiseRecording>,
    /// Number of stretches, in each of which every kind is hidden alone.
    pub stretches: u64,
    /// Length of every stretch.
    pub length: StretchLength,
    /// Size of every effect over the detection limit for the N, B and K of its channel in the stretch.
    pub strength: f64,
    /// Seed of the first stretch.
    pub seed: u64,
    /// Number of threads.
    pub jobs: usize,
}

impl MeasuredNoisePlan {
    /// Hides and scores every effect. `progress` is called with the number of finished analyses and of all.
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
