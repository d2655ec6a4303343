//! Undeclared effects: recordings whose hidden effects are drawn at random, and how well an analysis that is given the
//! recording and nothing else names them.
//!
//! ```text
//! seed ─► draw (noise, surroundings, effect; size from limit) ─► virtual sensor ─► analysis ─► report ─┐
//!           └──────────────────────────── truth ───────────────────────────────────────► examine ─► table
//! ```
//!
//! A part of the seeds is sealed: it is not looked at while the method is being made.

pub mod draw;
pub mod examine;
pub mod kind;
pub mod limit;
mod place;
mod shape;
mod size;
pub mod table;
mod truth;

#[cfg(test)]
mod tests;

pub use draw::Case;
pub use examine::{ExamineError, Outcome, examine};
pub use kind::Kind;
pub use table::Table;

use serde::Serialize;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

/// Distance of the sealed seeds from the open ones. Those at 2⁴⁰ are spent: the method has changed since they were run.
const SEALED: u64 = 1 << 41;
/// Distance of the seeds of one group of recordings from those of the next.
pub const GROUP: u64 = 1 << 20;

/// What to make and examine.
#[derive(Debug, Clone, PartialEq)]
pub struct Plan {
    /// Kinds that are hidden alone.
    pub kinds: Vec<Kind>,
    /// Recordings a kind.
    pub per_kind: u64,
    /// Recordings with nothing hidden.
    pub empty: u64,
    /// Recordings with two effects.
    pub pairs: u64,
    /// Length of a recording, s.
    pub seconds: f64,
    /// First seed of each group; with the numbers of recordings below [`GROUP`].
    pub seed: u64,
    /// Whether the seeds are those that were kept sealed.
    pub sealed: bool,
    /// Recordings that are examined at a time.
    pub jobs: usize,
}

/// A group of recordings of the table.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Group {
    /// Nothing is hidden.
    Nothing,
    /// One effect.
    Single(Kind),
    /// Two effects.
    Pair,
}

impl Plan {
    /// Every recording: its group, its seed and what it hides.
    fn recordings(&self) -> Vec<(Group, u64)> {
        let seed = |group: u64, number: u64| group * GROUP + self.seed + number + if self.sealed { SEALED } else { 0 };
        let nothing = (0..self.empty).map(|number| (Group::Nothing, seed(0, number)));
        let singles = self.kinds.iter().flat_map(|&kind| {
            (0..self.per_kind).map(move |number| (Group::Single(kind), seed(2 + kind as u64, number)))
        });
        let pairs = (0..self.pairs).map(|number| (Group::Pair, seed(1, number)));
        nothing.chain(singles).chain(pairs).collect()
    }

    /// Makes and examines every recording. `progress` hears the number done.
    ///
    /// # Errors
    /// The first recording that cannot be made or laid along a timeline.
    pub fn run(&self, progress: impl Fn(usize, usize) + Sync) -> Result<Table, ExamineError> {
        let recordings = self.recordings();
        let (next, done, failed) = (AtomicUsize::new(0), AtomicUsize::new(0), AtomicBool::new(false));
        let results = Mutex::new(Vec::with_capacity(recordings.len()));
        std::thread::scope(|scope| {
            for _ in 0..self.jobs.max(1) {
                scope.spawn(|| {
                    while !failed.load(Ordering::Relaxed) {
                        let at = next.fetch_add(1, Ordering::Relaxed);
                        let Some(&(group, seed)) = recordings.get(at) else { break };
                        let outcome = examine(&case(group, self.seconds, seed));
                        failed.fetch_or(outcome.is_err(), Ordering::Relaxed);
                        // A thread that panicked took nothing half-done into the list.
                        results.lock().unwrap_or_else(std::sync::PoisonError::into_inner).push((at, group, outcome));
                        progress(done.fetch_add(1, Ordering::Relaxed) + 1, recordings.len());
                    }
                });
            }
        });
        let mut results = results.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner);
        results.sort_by_key(|(at, ..)| *at);
        let outcomes: Result<Vec<_>, _> =
            results.into_iter().map(|(_, group, outcome)| Ok((group, outcome?))).collect();
        Ok(Table { outcomes: outcomes? })
    }
}

/// The recording of a group and a seed.
#[must_use]
pub fn case(group: Group, seconds: f64, seed: u64) -> Case {
    match group {
        Group::Nothing => Case::draw(&[], seconds, seed),
        Group::Single(kind) => Case::draw(&[kind], seconds, seed),
        Group::Pair => Case::draw(&Case::pair(seed), seconds, seed),
    }
}
