//! Outputs that stay at one value: runs of equal samples that are longer than noise makes them.
//!
//! Samples are independent from a lag `g` on from which they are no more often equal than at twice the lag: differences of a rounded
//! angle are less often equal to their neighbours than to samples further away, and more often to these than to those behind the filter.
//! A sample that is independent of those before has the most frequent value with a probability `p`. A run of `L` samples has `L/g`
//! independent ones, so that chance makes one among `n` samples with a probability of no more than `n·p^(L/g − 1)`.

use crate::bounds::BoundedEstimate;
use crate::effects::findings::SIGNIFICANCE;
use crate::effects::{Effect, StuckOutput};
use crate::parallel::{self, in_parallel};
use measurement::{MeasuredChannel, Measurement, SampleBlock};
use std::borrow::Cow;

/// As a cause of refusal.
const CAUSE: &str = "stuck";
/// Samples that are looked at together: their noise is taken to be one.
const TOGETHER: usize = 1 << 14;
/// Longest lag at which samples are compared: filters average 64 samples, once or twice.
const LONGEST_LAG: usize = 512;
/// How many times more often than at twice the lag samples that are independent may be equal, beyond so many standard deviations of the
/// difference.
const ALIKE: f64 = 1.1;
const SCATTER: f64 = 4.0;
/// Fewest samples behind a change of the value from which `p` is estimated, to a tenth of itself or of 1.
const FEWEST_CHANGES: usize = 100;
/// Largest `p`: 0.683 of noise of half a count around a whole one. Of smaller noise a bias between two counts decides how often it is
/// equal.
const MOST_EQUAL: f64 = 0.69;
/// Largest part of the changes that are by one count: 0.918 of noise of half a count around the middle between two, 0.895 around a whole one.
/// Of smaller noise it is larger wherever the bias is, also where that wanders from one count to the next and `p` is a mean.
const MOST_BY_ONE: f64 = 0.92;
/// Fewest samples of a run.
const FEWEST_SAMPLES: f64 = 3.0;

/// Refuses the samples of stuck channels in a recording that is read in blocks.
pub(crate) struct StuckScreen {
    channels: Vec<Option<StuckChannel>>,
    /// Samples of the recording.
    samples: u64,
    /// Counts of the last sample.
    last: Vec<i32>,
}

/// What is known of an inertial channel.
struct StuckChannel {
    /// Lag from which on samples are independent: the filter's, which does not change.
    lag: Option<usize>,
    /// Samples of a run that chance makes with a probability of [`SIGNIFICANCE`]; `None` where that is not known.
    shortest: Option<u64>,
    /// Smallest and largest count: what stays there is cut off.
    extremes: Option<(i32, i32)>,
    last: Option<i32>,
    run: Run,
    found: StuckRuns,
}

/// Samples that are equal.
#[derive(Clone, Copy, Default)]
struct Run {
    from: u64,
    to: u64,
    samples: u64,
}

/// The runs of a channel.
#[derive(Clone, Copy, Default)]
pub(crate) struct StuckRuns {
    longest: Run,
    runs: u64,
    samples: u64,
}

impl StuckScreen {
    /// For a recording of so many samples with the channels of `beginning`, its first ones.
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

    /// The next samples, those of a run refused from the one on by which chance does not make it.
    pub(crate) fn screen<'b>(&mut self, block: &'b SampleBlock) -> Cow<'b, SampleBlock> {
        let mut screened = Cow::Borrowed(block);
        for from in (0..block.slots.len()).step_by(TOGETHER) {
            let positions = from..(from + TOGETHER).min(block.slots.len());
            // Where all channels are as before, the sample was read twice.
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

    /// What was found until now in each channel.
    pub(crate) fn found(&self) -> Vec<StuckRuns> {
        self.channels.iter().map(|channel| channel.as_ref().map_or_else(StuckRuns::default, |of| of.found)).collect()
    }
}

/// A measurement in which the samples of stuck channels are refused, and the runs of each channel. Nothing of the second half decides what is
/// refused in the first.
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
    /// Takes samples, each with its position, and returns those that are stuck.
    fn take(&mut self, slots: &[u64], samples: &[(usize, i32)], of_recording: u64) -> Vec<usize> {
        let counts: Vec<i32> = samples.iter().map(|(_, count)| *count).collect();
        // Of noise that has become smaller neighbours are equal more often.
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
    /// Adds the newest sample of a run.
    fn add(&mut self, run: Run, shortest: Option<u64>) {
        let is_first = Some(run.samples) == shortest;
        self.runs += u64::from(is_first);
        self.samples += if is_first { run.samples } else { 1 };
        if run.samples > self.longest.samples {
            self.longest = run;
        }
    }

    /// As it is reported, of a recording of so many samples.
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

/// A sample that differs from the one a lag before.
struct Change {
    position: usize,
    count: i32,
    /// Whether the sample a lag after it is equal to it. However long a channel is stuck, there are no more such changes than a lag has
    /// samples.
    is_kept: bool,
    /// Whether it differs by one count.
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

/// The part of some changes that are followed by an equal sample: a probability of which nothing was seen is one of so many. `None`
/// for too few.
fn share(changes: &[Change]) -> Option<f64> {
    let kept = changes.iter().filter(|change| change.is_kept).count();
    (changes.len() >= FEWEST_CHANGES).then(|| (kept as f64 + 1.0) / (changes.len() as f64 + 1.0))
}

/// That part at a lag, and its variance by the scatter from one stretch as long as the lag to the next: within a stretch one stuck output
/// makes all changes alike.
fn share_at(counts: &[i32], lag: usize) -> Option<(f64, f64)> {
    let changes: Vec<Change> = changes(counts, lag).collect();
    let share = share(&changes)?;
    let stretches = changes.chunk_by(|one, other| one.position / lag == other.position / lag);
    let beyond = |of: &[Change]| of.iter().map(|change| f64::from(u8::from(change.is_kept)) - share).sum::<f64>();
    let scatter: f64 = stretches.map(|of| beyond(of).powi(2)).sum();
    Some((share, scatter / (changes.len() as f64).powi(2)))
}

/// Smallest lag from which on samples are no more often equal than at twice the lag. `None` where that is longer than [`LONGEST_LAG`], and
/// for too few samples.
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

/// Samples of the shortest run that chance does not make among `samples` samples with the noise of `counts`,
/// where they are independent from a lag on.
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
