//! Outputs that stay at one value: runs of equal samples that are longer than noise makes them.
//!
//! Samples are independent from a lag `g` on at which they are no more often equal than at `2g`. One that is independent of those before
//! has the most frequent value with a probability `p`. A run of `L` samples has `L/g` independent ones, so that chance makes one among
//! `n` samples with a probability of no more than `n·p^(L/g − 1)`.

use crate::bounds::BoundedEstimate;
use crate::effects::findings::SIGNIFICANCE;
use crate::effects::{Effect, StuckOutput};
use measurement::{MeasuredChannel, Measurement, SampleBlock};
use std::borrow::Cow;

/// As a cause of refusal.
const CAUSE: &str = "stuck";
/// Samples that are looked at together: their noise is taken to be one.
const TOGETHER: usize = 1 << 14;
/// Longest lag at which samples are compared: filters average 64 samples, once or twice.
const LONGEST_LAG: usize = 512;
/// How many times more often than at twice the lag samples that are independent may be equal by the scatter of their numbers.
const ALIKE: f64 = 1.1;
/// Fewest samples behind a change of the value from which `p` is estimated, to a tenth of itself or of 1.
const FEWEST_CHANGES: usize = 100;
/// Largest `p`: 0.683 of noise of half a count around a whole one. Of smaller noise a bias between two counts decides how often it is
/// equal.
const MOST_EQUAL: f64 = 0.69;
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
                StuckChannel {
                    shortest: shortest_run(&counts, samples),
                    extremes: counts.iter().min().copied().zip(counts.iter().max().copied()),
                    last: None,
                    run: Run::default(),
                    found: StuckRuns::default(),
                }
            })
        };
        Self { channels: beginning.channels.iter().map(channel).collect(), samples, last: Vec::new() }
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
            for (number, channel) in self.channels.iter_mut().enumerate() {
                let (Some(channel), Some(measured)) = (channel, block.channels.get(number)) else { continue };
                let refused = measured.refused.iter().filter(|(cause, _)| **cause != CAUSE);
                let mut is_usable = is_new.clone();
                let refused = refused.flat_map(|(_, refused)| refused).filter(|at| positions.contains(at));
                refused.for_each(|at| is_usable[at - from] = false);
                let samples: Vec<(usize, i32)> =
                    positions.clone().filter(|at| is_usable[at - from]).map(|at| (at, measured.counts[at])).collect();
                let stuck = channel.take(&block.slots, &samples, self.samples);
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

/// A measurement in which the samples of stuck channels are refused, and the runs of each channel.
pub(crate) fn screened(measurement: Cow<Measurement>) -> (Cow<Measurement>, Vec<StuckRuns>) {
    let mut screen = StuckScreen::new(&measurement, measurement.len() as u64);
    let mut stuck: Vec<Vec<usize>> = vec![Vec::new(); measurement.channels.len()];
    for (number, block) in measurement.blocks(TOGETHER).enumerate() {
        if let Cow::Owned(screened) = screen.screen(&block) {
            for (all, channel) in stuck.iter_mut().zip(&screened.channels) {
                let positions = channel.refused.get(CAUSE).into_iter().flatten();
                all.extend(positions.map(|position| number * TOGETHER + position));
            }
        }
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
        self.shortest = if changes(&counts, 1).count() < FEWEST_CHANGES {
            self.shortest
        } else {
            shortest_run(&counts, of_recording)
        };
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

/// The samples that differ from the one a lag before, and whether the one a lag after them is equal to them. However long a channel is
/// stuck, that is one of them.
fn changes(counts: &[i32], lag: usize) -> impl Iterator<Item = (i32, bool)> + '_ {
    let changed = counts.windows(2 * lag + 1).filter(move |of| of[0] != of[lag]);
    changed.map(move |of| (of[lag], of[lag] == of[2 * lag]))
}

/// The part of some changes that are followed by an equal sample: a probability of which nothing was seen is one of so many. `None`
/// for too few.
fn share(changes: impl Iterator<Item = bool>) -> Option<f64> {
    let (all, equal) = changes.fold((0, 0), |(all, equal), is_equal| (all + 1, equal + usize::from(is_equal)));
    (all >= FEWEST_CHANGES).then(|| (equal as f64 + 1.0) / (all as f64 + 1.0))
}

/// Samples of the shortest run that chance does not make among `samples` samples with the noise of `counts`.
fn shortest_run(counts: &[i32], samples: u64) -> Option<u64> {
    let at = |lag: usize| share(changes(counts, lag).map(|(_, is_equal)| is_equal));
    let is_independent =
        |lag: &usize| matches!((at(*lag), at(2 * lag)), (Some(own), Some(twice)) if own <= ALIKE * twice);
    let mut lags = std::iter::successors(Some(1), |lag| Some(2 * lag)).take_while(|lag| *lag <= LONGEST_LAG);
    let lag = lags.find(is_independent)?;
    let mut by_value: Vec<(i32, bool)> = changes(counts, lag).collect();
    by_value.sort_unstable();
    let of_values = by_value.chunk_by(|one, other| one.0 == other.0);
    let of_values = of_values.filter_map(|of| share(of.iter().map(|(_, is_equal)| *is_equal)));
    let most = of_values.chain(at(lag)).fold(0.0, f64::max);
    let independent = 1.0 + (SIGNIFICANCE / samples as f64).ln() / most.ln();
    (most < MOST_EQUAL).then(|| (lag as f64 * independent).ceil().max(FEWEST_SAMPLES) as u64)
}
