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

use crate::arguments::{MOST_RECORDINGS, cores, jobs, positive};
use crate::parallel;
use clap::{Args, value_parser};
use noise_analysis::analysis::analyze;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::Serialize;
use std::convert::Infallible;
use std::path::PathBuf;
use stretch::Stretch;

/// Random stream of the stretches; other modules use other streams.
const STRETCHES: u64 = u64::MAX;

/// Hide effects in the measured noise of recordings and score how well the analysis names them.
#[derive(Debug, Clone, PartialEq, Args)]
pub struct MeasuredNoisePlan {
    /// Recordings of any format that `analyze` reads; of those that are no register counts, the longest part at rest.
    #[arg(required = true)]
    pub recordings: Vec<PathBuf>,
    /// Sample rate of those without time stamps, Hz.
    #[arg(long)]
    pub rate: Option<f64>,
    /// Stretches, in each of which every kind of effect is hidden alone; they are taken from the recordings in turn.
    #[arg(long, default_value_t = 6, value_parser = value_parser!(u64).range(1..=MOST_RECORDINGS))]
    pub stretches: u64,
    /// Length of a stretch, s; a shorter recording is one stretch.
    #[arg(long, default_value_t = 600.0, value_parser = positive)]
    pub seconds: f64,
    /// The same in samples, for recordings of different rates.
    #[arg(long, conflicts_with = "seconds", value_parser = value_parser!(u64).range(1..))]
    pub samples: Option<u64>,
    /// Size of each effect over the detection limit in the noise of its channel.
    #[arg(long, default_value_t = 3.0, value_parser = positive)]
    pub strength: f64,
    /// Seed of the first stretch.
    #[arg(long, default_value_t = 0)]
    pub seed: u64,
    /// Stretches that are examined at a time [default: one a core].
    #[arg(long, default_value_t = cores(), value_parser = jobs, hide_default_value = true)]
    pub jobs: usize,
}

#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct MeasuredNoiseTable {
    /// Kinds that no channel of a stretch can have at the strength.
    pub not_hidden: Vec<HiddenKind>,
    pub scores: Vec<MeasuredScore>,
}

impl MeasuredNoisePlan {
    /// Reads the recordings, hides and scores every effect; `progress` gets the numbers of finished and of all analyses.
    ///
    /// # Errors
    /// The first recording that cannot be used.
    pub fn run(&self, progress: impl Fn(usize, usize) + Sync) -> Result<MeasuredNoiseTable, MeasuredNoiseError> {
        let read = self.recordings.iter().map(|file| NoiseRecording::read(file, self.rate));
        Ok(self.score(&read.collect::<Result<Vec<_>, _>>()?, progress))
    }

    fn score(&self, recordings: &[NoiseRecording], progress: impl Fn(usize, usize) + Sync) -> MeasuredNoiseTable {
        let numbers: Vec<u64> = if recordings.is_empty() { Vec::new() } else { (0..self.stretches).collect() };
        let kinds = HiddenKind::all();
        let all = numbers.len() * (1 + kinds.len());
        let Ok(stretches) = parallel::map(
            &numbers,
            self.jobs,
            |&number| Ok::<_, Infallible>(self.stretch(recordings, number)),
            |done, _| progress(done, all),
        );
        let cases: Vec<(&Stretch<'_>, HiddenKind)> =
            stretches.iter().flat_map(|stretch| kinds.iter().map(move |&kind| (stretch, kind))).collect();
        let work = |&(stretch, kind): &(&Stretch<'_>, HiddenKind)| {
            let drawn = stretch.draw(kind, self.strength);
            Ok::<_, Infallible>(drawn.map(|(effect, strength)| score::hidden(stretch, kind, &effect, strength)))
        };
        let Ok(scores) = parallel::map(&cases, self.jobs, work, |done, _| progress(numbers.len() + done, all));
        let not_hidden = cases.iter().zip(&scores).filter(|(_, score)| score.is_none()).map(|((_, kind), _)| *kind);
        MeasuredNoiseTable { not_hidden: not_hidden.collect(), scores: scores.into_iter().flatten().collect() }
    }

    fn stretch<'a>(&self, recordings: &'a [NoiseRecording], number: u64) -> Stretch<'a> {
        let seed = self.seed + number;
        let recording = &recordings[(number % recordings.len() as u64) as usize];
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        random.set_stream(STRETCHES);
        let whole = &recording.samples;
        let length = self.samples.unwrap_or((self.seconds * whole.sample_rate_hz).round() as u64);
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
