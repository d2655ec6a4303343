//! Stuck outputs: runs of equal samples that are longer than noise makes them.
//!
//! Samples are independent from the lag `g` on at which they are equal no more often than at 2`g`. With the probability
//! `p` of the most frequent value, chance makes a run of `L` among `n` samples with at most `n·p^(L/g − 1)`.

use crate::bounds::BoundedEstimate;
use crate::effects::findings::SIGNIFICANCE;
use crate::effects::{Effect, StuckOutput};
use crate::parallel::{self, in_parallel};
use measurement::{MeasuredChannel, Measurement, SampleBlock};
use std::borrow::Cow;

const CAUSE: &str = "stuck";
/// Samples in which the noise is taken as constant.
const TOGETHER: usize = 1 << 14;
/// Longest lag: filters average 64 samples, once or twice.
const LONGEST_LAG: usize = 512;
/// Largest ratio of equality at a lag to that at twice the lag for independent samples.
const ALIKE: f64 = 1.1;
const SCATTER: f64 = 4.0;
/// Fewest changes of the value from which `p` is estimated, to a tenth.
const FEWEST_CHANGES: usize = 100;
/// Largest `p`; noise of half a count around a whole count has 0.683.
const MOST_EQUAL: f64 = 0.69;
/// Largest part of changes by one count; noise of half a count has 0.918 between two counts.
const MOST_BY_ONE: f64 = 0.92;
const FEWEST_SAMPLES: f64 = 3.0;

/// Refuses the samples of stuck channels in a recording that is read in blocks.
pub(crate) struct StuckScreen {
    channels: Vec<Option<StuckChannel>>,
    samples: u64,
    last: Vec<i32>,
}

struct StuckChannel {
    /// Lag from which on samples are independent; that of the filter, which does not change.
    lag: Option<usize>,
    /// Length of a run with the p-value [`SIGNIFICANCE`]; `None` while unknown.
    shortest: Option<u64>,
    /// Smallest and largest count; a run there is cut off, not stuck.
    extremes: Option<(i32, i32)>,
    last: Option<i32>,
    run: Run,
    found: StuckRuns,
}

#[derive(Clone, Copy, Default)]
struct Run {
    from: u64,
    to: u64,
    samples: u64,
}

#[derive(Clone, Copy, Default)]
pub(crate) struct StuckRuns {
    longest: Run,
    runs: u64,
    samples: u64,
}

impl StuckScreen {
    /// For `samples` samples in all; `beginning` has the first ones.
    pub(crate) fn new(beginning: &Measurement, samples: u64) -> Self {
        let channel = |of: &MeasuredChannel| {
            of.profile.quantity.is_inertial().then(|| {
                let counts: Vec<i32> = of.used_samples(&beginning.slots).map(|(_, count)| count).collect();
                let lag = independent_lag(&counts);
                StuckChannel {
                    lag,
                    shortest: lag.and_then(|lag| shortest_run(&counts, lag, samples)),
                    extremes: counts.iter().min().copied().zip(counts.iter().max().copied()),
                    last: None,
                    run: Run::default(),
                    found: StuckRuns::default(),
                }
            })
        };
        Self { channels: in_parallel(&beginning.channels, channel), samples, last: Vec::new() }
    }

    /// The next samples; a run is refused from the sample on that makes it significant.
    pub(crate) fn screen<'b>(&mut self, block: &'b SampleBlock) -> Cow<'b, SampleBlock> {
        let mut screened = Cow::Borrowed(block);
        for from in (0..block.slots.len()).step_by(TOGETHER) {
            let positions = from..(from + TOGETHER).min(block.slots.len());
            // A row that repeats all channels was read twice.
            let is_new: Vec<bool> = positions
                .clone()
                .map(|at| {
                    let before = |channel: usize| match at.checked_sub(1) {
                        Some(before) => Some(block.channels[channel].counts[before]),
                        None => self.last.get(channel).copied(),
                    };
                    let mut channels = block.channels.iter().enumerate();
                    block.channels.len() == 1 || channels.any(|(number, of)| before(number) != Some(of.counts[at]))
                })
                .collect();
            let together = self.channels.iter_mut().zip(&block.channels).map(|(channel, of)| (channel, of, Vec::new()));
            let mut together: Vec<_> = together.collect();
            parallel::for_each(&mut together, |(channel, measured, stuck)| {
                let Some(channel) = channel else { return };
                let refused = measured.refused.iter().filter(|(cause, _)| **cause != CAUSE);
                let mut is_usable = is_new.clone();
                let refused = refused.flat_map(|(_, refused)| refused).filter(|at| positions.contains(at));
                refused.for_each(|at| is_usable[at - from] = false);
                let samples: Vec<(usize, i32)> =
                    positions.clone().filter(|at| is_usable[at - from]).map(|at| (at, measured.counts[at])).collect();
                *stuck = channel.take(&block.slots, &samples, self.samples);
            });
            for (number, (_, _, stuck)) in together.into_iter().enumerate() {
                if !stuck.is_empty() {
                    let of = screened.to_mut().channels[number].refused.entry(CAUSE).or_default();
                    of.extend(stuck);
                    of.sort_unstable();
                    of.dedup();
                }
            }
        }
        if !block.slots.is_empty() {
            self.last = block.channels.iter().filter_map(|of| of.counts.last().copied()).collect();
        }
        screened
    }

    pub(crate) fn found(&self) -> Vec<StuckRuns> {
        self.channels.iter().map(|channel| channel.as_ref().map_or_else(StuckRuns::default, |of| of.found)).collect()
    }
}

/// Refuses the samples of stuck channels, and returns the runs; the second half does not affect the first.
pub(crate) fn screened(measurement: Cow<Measurement>) -> (Cow<Measurement>, Vec<StuckRuns>) {
    let middle = measurement.middle();
    let mut screen = StuckScreen::new(&measurement.before(middle), measurement.len() as u64);
    let mut stuck: Vec<Vec<usize>> = vec![Vec::new(); measurement.channels.len()];
    let mut position_of_block = 0;
    for block in measurement.blocks(TOGETHER) {
        let of_first_half = block.slots.partition_point(|&slot| slot < middle);
        for positions in [0..of_first_half, of_first_half..block.slots.len()] {
            let from = position_of_block + positions.start;
            if let Cow::Owned(screened) = screen.screen(&block.part(positions)) {
                for (all, channel) in stuck.iter_mut().zip(&screened.channels) {
                    all.extend(channel.refused.get(CAUSE).into_iter().flatten().map(|position| from + position));
                }
            }
        }
        position_of_block += block.slots.len();
    }
    let mut measurement = measurement;
    if stuck.iter().any(|stuck| !stuck.is_empty()) {
        for (channel, stuck) in measurement.to_mut().channels.iter_mut().zip(stuck) {
            if !stuck.is_empty() {
                channel.refused.insert(CAUSE, stuck);
            }
        }
    }
    (measurement, screen.found())
}

impl StuckChannel {
    fn take(&mut self, slots: &[u64], samples: &[(usize, i32)], of_recording: u64) -> Vec<usize> {
        let counts: Vec<i32> = samples.iter().map(|(_, count)| *count).collect();
        // Smaller noise has more equal neighbours, so the first lag stays.
        if changes(&counts, 1).count() >= FEWEST_CHANGES {
            self.lag = self.lag.or_else(|| independent_lag(&counts));
            self.shortest = self.lag.and_then(|lag| shortest_run(&counts, lag, of_recording));
        }
        let mut stuck = Vec::new();
        for &(at, count) in samples {
            let (least, largest) = self.extremes.get_or_insert((count, count));
            (*least, *largest) = (count.min(*least), count.max(*largest));
            let is_within = *least < count && count < *largest;
            if self.last.replace(count) != Some(count) {
                self.run = Run { from: slots[at], to: slots[at], samples: 0 };
            }
            (self.run.to, self.run.samples) = (slots[at] + 1, self.run.samples + 1);
            if self.shortest.is_some_and(|shortest| self.run.samples >= shortest) && is_within {
                self.found.add(self.run, self.shortest);
                stuck.push(at);
            }
        }
        stuck
    }
}

impl StuckRuns {
    fn add(&mut self, run: Run, shortest: Option<u64>) {
        let is_first = Some(run.samples) == shortest;
        self.runs += u64::from(is_first);
        self.samples += if is_first { run.samples } else { 1 };
        if run.samples > self.longest.samples {
            self.longest = run;
        }
    }

    pub(crate) fn effect(&self, samples: u64, period_s: f64) -> Option<Effect> {
        let time = |slot: u64| BoundedEstimate::exact(slot as f64 * period_s);
        (self.runs > 0).then(|| {
            let found = StuckOutput {
                fraction: BoundedEstimate::exact(self.samples as f64 / samples as f64),
                from_s: time(self.longest.from),
                to_s: time(self.longest.to),
                runs: self.runs,
                stuck: self.samples,
                samples,
            };
            found.into()
        })
    }
}

struct Change {
    position: usize,
    count: i32,
    /// True if the sample a lag after it is equal to it.
    is_kept: bool,
    is_by_one: bool,
}

fn changes(counts: &[i32], lag: usize) -> impl Iterator<Item = Change> + '_ {
    let changed = counts.windows(2 * lag + 1).enumerate().filter(move |(_, of)| of[0] != of[lag]);
    changed.map(move |(position, of)| Change {
        position,
        count: of[lag],
        is_kept: of[lag] == of[2 * lag],
        is_by_one: of[lag].abs_diff(of[0]) == 1,
    })
}

/// Part of the changes that an equal sample follows, at least 1/count; `None` for too few.
fn share(changes: &[Change]) -> Option<f64> {
    let kept = changes.iter().filter(|change| change.is_kept).count();
    (changes.len() >= FEWEST_CHANGES).then(|| (kept as f64 + 1.0) / (changes.len() as f64 + 1.0))
}

/// The [`share`] at a lag, with its variance from the scatter between stretches as long as the lag.
fn share_at(counts: &[i32], lag: usize) -> Option<(f64, f64)> {
    let changes: Vec<Change> = changes(counts, lag).collect();
    let share = share(&changes)?;
    let stretches = changes.chunk_by(|one, other| one.position / lag == other.position / lag);
    let beyond = |of: &[Change]| of.iter().map(|change| f64::from(u8::from(change.is_kept)) - share).sum::<f64>();
    let scatter: f64 = stretches.map(|of| beyond(of).powi(2)).sum();
    Some((share, scatter / (changes.len() as f64).powi(2)))
}

/// Smallest lag at which samples are equal no more often than at twice the lag, up to [`LONGEST_LAG`].
fn independent_lag(counts: &[i32]) -> Option<usize> {
    let counts = &counts[..counts.len().min(TOGETHER)];
    let lags = std::iter::successors(Some(1), |lag| Some(2 * lag)).take_while(|lag| *lag <= 2 * LONGEST_LAG);
    let shares: Vec<(usize, (f64, f64))> = lags.map_while(|lag| Some((lag, share_at(counts, lag)?))).collect();
    let is_dependent = |pair: &&[(usize, (f64, f64))]| {
        let [(_, (own, variance)), (_, (twice, of_twice))] = [pair[0], pair[1]];
        own > ALIKE * twice + SCATTER * (variance + of_twice).sqrt()
    };
    let (first, _) = *shares.first()?;
    let lag = shares.windows(2).rfind(is_dependent).map_or(first, |pair| pair[1].0);
    (lag <= LONGEST_LAG).then_some(lag)
}

/// Shortest run that chance does not make among `samples` samples, independent from `lag` on.
fn shortest_run(counts: &[i32], lag: usize, samples: u64) -> Option<u64> {
    let mut by_count: Vec<Change> = changes(counts, lag).collect();
    let of_all = share(&by_count);
    by_count.sort_unstable_by_key(|change| change.count);
    let of_counts = by_count.chunk_by(|one, other| one.count == other.count).filter_map(share);
    let most = of_counts.chain(of_all).reduce(f64::max)?;
    let share_by_one = by_count.iter().filter(|change| change.is_by_one).count() as f64 / by_count.len() as f64;
    let independent = 1.0 + (SIGNIFICANCE / samples as f64).ln() / most.ln();
    let is_decidable = most < MOST_EQUAL && share_by_one < MOST_BY_ONE;
    is_decidable.then(|| (lag as f64 * independent).ceil().max(FEWEST_SAMPLES) as u64)
}
