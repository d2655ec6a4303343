//! What is kept of a recording that is too long to be kept: the means of as many samples in a row as leave 2¹⁹ of them, the
//! curves at averaging times that are too short for the means, and the first samples.
//!
//! ```text
//! blocks of samples ─► Screen (spikes, repeated samples) ─► means ─► all that is slow: drift, steps, temperature, lines
//!        └─────────────────────┴─► StreamedCurves ─► curves at averaging times below 8 means
//! first samples ─► TracedRecord ─► all that is fast: spikes, faster lines, resolution, sample clock
//! ```
//!
//! The second differences of means are those of the samples at longer averaging times, so that the two curves of a channel are
//! one. Memory does not depend on the length of the recording.

use crate::detectors::spikes::SpikeRule;
use crate::findings::{Detection, Effect};
use crate::interpolation::REACH;
use crate::parallel::{self, in_parallel};
use crate::preprocessing::Exclusion;
use crate::sampling_faults;
use crate::series::Series;
use crate::shorter_times::{ShorterTimes, ShorterTimesOfChannel};
use crate::spectral_lines::MergedLine;
use crate::streamed_curves::{STEPS_PER_COUNT, StreamedCurves};
use crate::traced_record::{Condensed, TracedRecord};
use measurement::{ChannelProfile, MeasuredChannel, Measurement, RecordingDescription, SampleBlock};
use std::collections::BTreeMap;

/// Sample periods of the longest recording that is analysed whole.
pub const MOST_PERIODS: u64 = 1 << 20;
/// Means of a longer recording, at most.
const MOST_MEANS: u64 = 1 << 19;
/// Sample periods at the start of the recording whose samples are analysed: a line of a faster rate than that of the means has as
/// many periods there that its frequency is known to a millionth of the rate.
const FIRST_PERIODS: u64 = 1 << 17;
/// Steps into which a count is divided for a mean, as a power of two: the rounding of the means of 256 samples is then a 16th of the
/// deviation of the mean of their roundings, `1/√(12·256)` of a count.
const MEAN_STEPS_LOG2: u32 = 8;
/// Largest mean in steps, which the estimators divide further.
const LARGEST_MEAN: f64 = (i32::MAX as f64) / STEPS_PER_COUNT;
/// Least part of the samples of a mean that is there.
const LEAST_FILL: f64 = 0.5;
/// Means are rates of at least this many times the highest frequency at which a line is sought in them.
const MEANS_PER_PERIOD: f64 = 2.5;
/// A block mean at this place has no sample.
const MISSING: i32 = i32::MIN;
/// Effects that only the samples themselves show, and that are looked for in the first of them.
const FAST_KINDS: [&str; 5] = ["spikes", "saturated", "noise_below_count", "repeated_samples", "sample_clock"];

/// Reads a long recording block by block.
pub struct LongRecordReader {
    description: RecordingDescription,
    first: Measurement,
    samples_per_mean: u64,
    screen: Screen,
    channels: Vec<LongChannel>,
    fast: Vec<FastFindings>,
    last: Option<u64>,
    gaps: usize,
}

/// What the samples of a channel at the start of the recording show.
struct FastFindings {
    effects: Vec<Effect>,
    /// Lines of a frequency that the means do not show.
    lines: Vec<MergedLine>,
    /// Smallest distance of two values, in the channel's unit.
    resolution: f64,
}

/// What is kept of one channel.
struct LongChannel {
    recorded: StreamedCurves,
    /// Without what the screen leaves out; `None` if that is nothing.
    screened: Option<StreamedCurves>,
    means: Means,
}

/// A long recording, condensed.
pub struct LongRecord {
    pub(crate) description: RecordingDescription,
    /// The first samples, as recorded.
    pub(crate) first: Measurement,
    /// Means of [`ShorterTimes::samples_per_mean`] samples each.
    pub(crate) means: Measurement,
    pub(crate) shorter: ShorterTimes,
    /// Of each channel, the lines that the means do not show.
    pub(crate) faster_lines: Vec<Vec<MergedLine>>,
    /// Of each channel, what only the samples themselves show.
    pub(crate) effects: Vec<Vec<Effect>>,
    /// Of each channel, the samples that are refused in it alone, by cause.
    pub(crate) refused: Vec<BTreeMap<&'static str, u64>>,
}

impl LongRecord {
    /// What the analysis of the means needs beside them.
    pub(crate) fn condensed(&self) -> Condensed<'_> {
        Condensed { shorter: &self.shorter, faster_lines: &self.faster_lines }
    }
}

impl LongRecordReader {
    /// For the recording of this description, which begins with the samples of `beginning`.
    #[must_use]
    pub fn new(description: RecordingDescription, beginning: &Measurement) -> Self {
        let first = beginning.before(FIRST_PERIODS);
        let samples_per_mean = description.periods.div_ceil(MOST_MEANS).next_power_of_two();
        let means = description.periods / samples_per_mean;
        let boundaries = [means / 2 / 2 * samples_per_mean, means / 2 * samples_per_mean];
        let record = TracedRecord::new(&first, None);
        let highest_hz = description.sample_rate_hz / samples_per_mean as f64 / MEANS_PER_PERIOD;
        let effects = record.effects();
        let of = |profile: &ChannelProfile| {
            let at = record.channels.iter().position(|trace| trace.channel.name == profile.name);
            let effects = at.map(|at| effects[at].clone()).unwrap_or_default();
            let lines = at.map(|at| record.channels[at].lines.clone()).unwrap_or_default();
            let counts = at.map_or(1, |at| record.preprocessing.counts_per_step(record.channels[at].channel));
            FastFindings {
                effects: effects.into_iter().filter(is_fast).collect(),
                lines: lines.into_iter().filter(|line| line.frequency.value > highest_hz).collect(),
                resolution: profile.lsb * f64::from(counts),
            }
        };
        let fast: Vec<FastFindings> = description.channels.iter().map(of).collect();
        let shows = |of: &FastFindings, kind: &str| of.effects.iter().any(|effect| effect.kind == kind);
        let rules = in_parallel(&description.channels, |profile| {
            let at = record.channels.iter().position(|trace| trace.channel.name == profile.name)?;
            let channel = record.channels[at].channel;
            let has_spikes = shows(fast.iter().zip(&description.channels).find(|(_, of)| *of == profile)?.0, "spikes");
            let series = record.preprocessing.series(&first, channel, Exclusion::None);
            SpikeRule::fit(&series).filter(|_| has_spikes)
        });
        let leaves_out_repeated = fast.iter().any(|of| shows(of, "repeated_samples"));
        drop(record);
        let screen = Screen { rules, leaves_out_repeated, ..Screen::default() };
        let is_screened = screen.leaves_out_any();
        let channel = |profile: &ChannelProfile| {
            let at_first = first.channels.iter().find(|channel| channel.profile.name == profile.name);
            let largest = at_first.iter().flat_map(|channel| &channel.counts).map(|count| count.unsigned_abs()).max();
            LongChannel {
                recorded: StreamedCurves::new(&boundaries),
                screened: is_screened.then(|| StreamedCurves::new(&boundaries)),
                means: Means::new(samples_per_mean, means, largest.unwrap_or(0)),
            }
        };
        let channels = description.channels.iter().map(channel).collect();
        Self { description, first, samples_per_mean, screen, channels, fast, last: None, gaps: 0 }
    }

    /// Takes the next samples, the channels on as many threads as there are cores.
    pub fn push(&mut self, block: &SampleBlock) {
        let before = self.last.into_iter().chain(block.slots.iter().copied());
        self.gaps += before
            .zip(&block.slots[usize::from(self.last.is_none()).min(block.slots.len())..])
            .filter(|(a, b)| **b - a > 1)
            .count();
        self.last = block.slots.last().copied().or(self.last);
        parallel::for_each_pair(&mut self.channels, &block.channels, |of, channel| {
            of.recorded.push(&block.slots, channel);
            if of.screened.is_none() {
                of.means.push(&block.slots, channel);
            }
        });
        if self.screen.leaves_out_any() {
            let settled = self.screen.push(block, &self.description.channels);
            self.push_screened(&settled);
        }
    }

    fn push_screened(&mut self, block: &SampleBlock) {
        parallel::for_each_pair(&mut self.channels, &block.channels, |of, channel| {
            of.screened.iter_mut().for_each(|screened| screened.push(&block.slots, channel));
            of.means.push(&block.slots, channel);
        });
    }

    /// The recording, all of which was read.
    #[must_use]
    pub fn finish(mut self) -> LongRecord {
        if self.screen.leaves_out_any() {
            let rest = self.screen.finish(&self.description.channels);
            self.push_screened(&rest);
        }
        let Self { description, first, samples_per_mean, channels, fast, gaps, .. } = self;
        let lost = sampling_faults::lost_samples(description.samples, &description.dropped, gaps);
        let lost = lost.map(|Detection { effect, .. }| effect);
        let with_lost = |of: &FastFindings| lost.iter().chain(&of.effects).cloned().collect();
        let refused = |of: &LongChannel| of.screened.as_ref().unwrap_or(&of.recorded).refused.clone();
        let (effects, refused) = (fast.iter().map(with_lost).collect(), channels.iter().map(refused).collect());
        let means = measurement_of_means(&description, samples_per_mean, &channels);
        let faster_lines = fast.iter().map(|of| of.lines.clone()).collect();
        let period_s = description.period_s();
        let all = channels.into_iter().zip(fast).zip(description.channels.iter().zip(&means.channels));
        let shorter =
            |((channel, fast), (profile, mean)): ((LongChannel, FastFindings), (&ChannelProfile, &MeasuredChannel))| {
                let halves = |curves: &StreamedCurves| {
                    let mut parts: Vec<_> = curves.parts().cloned().collect();
                    let second = parts.split_off(parts.len() - 1);
                    [parts, second]
                };
                ShorterTimesOfChannel {
                    profile: mean.profile,
                    resolution: fast.resolution,
                    measured: channel.recorded.whole().curve(period_s).scaled(profile.lsb),
                    recorded: halves(&channel.recorded),
                    screened: halves(channel.screened.as_ref().unwrap_or(&channel.recorded)),
                    is_screened: channel.screened.is_some_and(|screened| screened.refused != channel.recorded.refused),
                    period_s,
                    lsb: profile.lsb,
                }
            };
        let shorter = ShorterTimes { samples_per_mean, channels: all.map(shorter).collect() };
        LongRecord { description, first, means, shorter, faster_lines, effects, refused }
    }
}

fn measurement_of_means(
    description: &RecordingDescription,
    samples_per_mean: u64,
    channels: &[LongChannel],
) -> Measurement {
    let rate = description.sample_rate_hz / samples_per_mean as f64;
    let count = channels.iter().map(|channel| channel.means.counts.len()).max().unwrap_or(0);
    let mean = |of: &LongChannel, at: usize| of.means.counts.get(at).copied().filter(|mean| *mean != MISSING);
    let present: Vec<usize> =
        (0..count).filter(|&at| channels.iter().any(|channel| mean(channel, at).is_some())).collect();
    let channel = |(profile, of): (&ChannelProfile, &LongChannel)| {
        let counts: Vec<i32> = present.iter().map(|&at| mean(of, at).unwrap_or(0)).collect();
        let missing: Vec<usize> =
            (0..present.len()).filter(|&position| mean(of, present[position]).is_none()).collect();
        let refused = if missing.is_empty() { BTreeMap::new() } else { BTreeMap::from([("incomplete_mean", missing)]) };
        let profile = ChannelProfile { lsb: profile.lsb / f64::from(1_u32 << of.means.steps_log2), ..*profile };
        MeasuredChannel { profile, counts, refused }
    };
    Measurement {
        profile: description.profile.clone(),
        sample_rate_hz: rate,
        stated_rate_hz: Some(rate),
        slots: present.iter().map(|&at| at as u64).collect(),
        times_s: None,
        channels: description.channels.iter().zip(channels).map(channel).collect(),
        dropped: BTreeMap::new(),
        flagged: BTreeMap::new(),
    }
}

/// Means of samples in a row, of one channel.
struct Means {
    samples_per_mean: u64,
    /// Means that the record has; what is left over at its end is in none.
    most: u64,
    /// Steps of a count, as a power of two.
    steps_log2: u32,
    /// In steps, [`MISSING`] where too few samples are there.
    counts: Vec<i32>,
    sum: i64,
    present: u64,
}

impl Means {
    /// For a channel whose first samples reach to `largest` counts; it may reach four times as far.
    fn new(samples_per_mean: u64, most: u64, largest: u32) -> Self {
        let room = (LARGEST_MEAN / (4.0 * f64::from(largest.max(1)))).max(1.0).log2() as u32;
        let steps_log2 = MEAN_STEPS_LOG2.min(room);
        Self { samples_per_mean, most, steps_log2, counts: Vec::new(), sum: 0, present: 0 }
    }

    fn push(&mut self, slots: &[u64], channel: &MeasuredChannel) {
        let mut refused: Vec<usize> = channel.refused.values().flatten().copied().collect();
        refused.sort_unstable();
        let mut refused = refused.into_iter().peekable();
        for (position, (&slot, &count)) in slots.iter().zip(&channel.counts).enumerate() {
            if refused.next_if_eq(&position).is_some() {
                while refused.next_if_eq(&position).is_some() {}
                continue;
            }
            self.end_before(slot / self.samples_per_mean);
            self.sum += i64::from(count);
            self.present += 1;
        }
        // The last mean is complete with the last sample period of the record.
        if let Some(&last) = slots.last() {
            self.end_before((last + 1) / self.samples_per_mean);
        }
    }

    /// Ends the means before the one of this number.
    fn end_before(&mut self, number: u64) {
        let number = number.min(self.most);
        while (self.counts.len() as u64) < number {
            let is_filled = self.present as f64 >= LEAST_FILL * self.samples_per_mean as f64;
            let mean = self.sum as f64 / self.present.max(1) as f64 * f64::from(1_u32 << self.steps_log2);
            self.counts.push(if is_filled { mean.round().clamp(-LARGEST_MEAN, LARGEST_MEAN) as i32 } else { MISSING });
            (self.sum, self.present) = (0, 0);
        }
    }
}

/// Marks spikes and repeated samples by the rules of the first samples.
#[derive(Default)]
struct Screen {
    /// Of the channels that have spikes.
    rules: Vec<Option<SpikeRule>>,
    leaves_out_repeated: bool,
    /// Samples that were not passed on, behind a few that were.
    held: SampleBlock,
    /// How many of these were.
    settled: usize,
}

impl Screen {
    fn leaves_out_any(&self) -> bool {
        self.leaves_out_repeated || self.rules.iter().any(Option::is_some)
    }

    /// Takes a block, and returns the samples whose neighbours on both sides are known.
    fn push(&mut self, block: &SampleBlock, channels: &[ChannelProfile]) -> SampleBlock {
        if self.held.channels.is_empty() {
            let empty = |profile: &ChannelProfile| MeasuredChannel::new(*profile, Vec::new());
            self.held.channels = channels.iter().map(empty).collect();
        }
        let offset = self.held.slots.len();
        self.held.slots.extend(&block.slots);
        for (held, channel) in self.held.channels.iter_mut().zip(&block.channels) {
            held.counts.extend(&channel.counts);
            for (&cause, positions) in &channel.refused {
                held.refused.entry(cause).or_default().extend(positions.iter().map(|position| position + offset));
            }
        }
        let end = self.held.slots.len().saturating_sub(REACH).max(self.settled);
        let passed = self.marked(channels, end);
        let kept = end.saturating_sub(REACH);
        self.held = part(&self.held, kept..self.held.slots.len());
        self.settled = end - kept;
        passed
    }

    /// The samples that are left at the end.
    fn finish(&mut self, channels: &[ChannelProfile]) -> SampleBlock {
        self.marked(channels, self.held.slots.len())
    }

    /// The samples up to `end` that were not passed on, with those refused that are spikes or repeated.
    fn marked(&self, channels: &[ChannelProfile], end: usize) -> SampleBlock {
        let mut marked = part(&self.held, self.settled..end);
        let numbered: Vec<usize> = (0..channels.len()).collect();
        let spikes = in_parallel(&numbered, |&at| {
            let Some(Some(rule)) = self.rules.get(at) else { return Vec::new() };
            let slots = rule.slots(&series(&self.held, &channels[at], at));
            let position = |slot: &u64| marked.slots.binary_search(slot).ok();
            slots.iter().filter_map(position).collect::<Vec<usize>>()
        });
        let repeated: Vec<usize> = if self.leaves_out_repeated {
            let is_repeated = |at: &usize| {
                let at = at + self.settled;
                at > 0 && self.held.channels.iter().all(|channel| channel.counts[at] == channel.counts[at - 1])
            };
            (0..marked.slots.len()).filter(is_repeated).collect()
        } else {
            Vec::new()
        };
        for (channel, spikes) in marked.channels.iter_mut().zip(spikes) {
            for (cause, positions) in [("spikes", spikes), ("repeated", repeated.clone())] {
                if !positions.is_empty() {
                    channel.refused.insert(cause, positions);
                }
            }
        }
        marked
    }
}

/// Whether only the samples themselves show an effect; a resolution of several counts is a `quantization` with a `step`.
fn is_fast(effect: &Effect) -> bool {
    FAST_KINDS.contains(&effect.kind.as_str()) || effect.parameters.contains_key("step")
}

/// Some samples of a block.
fn part(block: &SampleBlock, positions: std::ops::Range<usize>) -> SampleBlock {
    let channel = |channel: &MeasuredChannel| MeasuredChannel {
        profile: channel.profile,
        counts: channel.counts[positions.clone()].to_vec(),
        refused: channel
            .refused
            .iter()
            .map(|(&cause, of)| {
                let within = of.iter().filter(|position| positions.contains(position));
                (cause, within.map(|position| position - positions.start).collect::<Vec<usize>>())
            })
            .filter(|(_, of)| !of.is_empty())
            .collect(),
    };
    SampleBlock {
        slots: block.slots[positions.clone()].to_vec(),
        channels: block.channels.iter().map(channel).collect(),
    }
}

/// The samples of a channel in a block.
fn series(block: &SampleBlock, profile: &ChannelProfile, at: usize) -> Series {
    let channel = &block.channels[at];
    let used = || (0..channel.counts.len()).filter(|position| !channel.is_refused(*position));
    let slots = used().map(|position| block.slots[position]).collect();
    let values = used().map(|position| f64::from(channel.counts[position]) * profile.lsb).collect();
    let span = block.slots.first().copied().unwrap_or(0)..block.slots.last().map_or(0, |last| last + 1);
    Series { slots, values, span, period_s: 1.0, resolution: profile.lsb, unit: profile.unit }
}
