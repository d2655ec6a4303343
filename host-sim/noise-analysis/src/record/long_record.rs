//! A recording that is too long for memory: at most 2¹⁷ means of consecutive samples, curves at shorter times, and the first samples.
//!
//! ```text
//! first samples ─► SampleEffects: resolution, repeated samples, sample clock
//!        └─► rules ─┐
//! blocks of samples ─► SampleScreen (spikes, repeated samples) ─► means ─► what is slow: drift, steps, temperature, lines
//!        │                           ├─► StackedSpectrum ─► faster lines
//!        │                           ├─► EpochSpectra ─► lines of two channels that move with each other
//!        ├─► ValueCounts ─► saturation, missing codes
//!        └───────────────────────────┴─► StreamedCurves ─► curves at averaging times below 8 means
//! ```
//!
//! Second differences of means are those of the samples at longer averaging times, so both curves join. Memory does not grow.

use crate::detectors::output_range::ValueCounts;
use crate::detectors::spikes::SpikeRule;
use crate::detectors::stuck_output::{self, StuckRuns, StuckScreen};
use crate::effects::Effect;
use crate::parallel::{self, in_parallel};
use crate::record::condensed_record::{CondensedChannel, CondensedRecord, faster_lines};
use crate::record::sample_curves::SampleCurves;
use crate::record::sample_effects::SampleEffects;
use crate::record::sample_screen::SampleScreen;
use crate::record::sampling_faults;
use crate::samples::epoch_ranges::epochs;
use crate::samples::series::Series;
use crate::samples::streamed_curves::StreamedCurves;
use crate::spectra::epoch_spectra::{EpochSpectra, PartSpectra};
use crate::spectra::spectral_lines::{self, MergedLine};
use crate::spectra::stacked_spectrum::StackedSpectrum;
use measurement::{
    ChannelId, ChannelProfile, MeasuredChannel, Measurement, RecordingDescription, SampleBlock, lost_part,
};
use std::borrow::Cow;
use std::collections::{BTreeMap, BTreeSet};

/// Samples of the longest recording that is not condensed.
pub const MOST_SAMPLES: u64 = 1 << 18;
/// Samples of the longest one that lacks more than [`MOST_LOST`]: means of fewer samples have more noise.
pub const MOST_SAMPLES_WITH_LOSSES: u64 = 1 << 20;
/// Largest part of missing samples of a shorter recording that is condensed.
pub const MOST_LOST: f64 = 1.0 / 32.0;
/// Samples taken at a time of a recording in memory.
const BLOCK: usize = 1 << 14;
/// Most means of a longer recording.
const MOST_MEANS: u64 = 1 << 17;
/// Sample periods at the start whose samples are analysed.
const FIRST_PERIODS: u64 = 1 << 16;
/// Sample periods per averaged spectrum; a line is known to a 2¹⁶th of the sample rate.
const STRETCH_PERIODS: u64 = 1 << 16;
/// Steps of a count in a mean, as a power of two: a 16th of the deviation `1/√(12·256)` of a mean of 256.
const MEAN_STEPS_LOG2: u32 = 8;
const LARGEST_MEAN: f64 = i32::MAX as f64;
const LEAST_FILL: f64 = 0.5;
/// Least rate of the means over the highest frequency of a line sought in them.
const MEANS_PER_PERIOD: f64 = 2.5;
const MISSING: i32 = i32::MIN;

pub struct LongRecordReader {
    description: RecordingDescription,
    first: Measurement,
    samples_per_mean: u64,
    /// First sample period of the second half.
    middle: u64,
    stuck: StuckScreen,
    first_half: Option<FirstHalfFindings>,
    recorded: Vec<RecordedChannel>,
    screen: SampleScreen,
    screened: Vec<ScreenedChannel>,
    fast: Vec<FastFindings>,
    last: Option<u64>,
    gaps: usize,
}

#[derive(Default)]
struct FirstHalfFindings {
    stuck: Vec<StuckRuns>,
    stacked: Vec<Option<StackedSpectrum>>,
    is_screened: Vec<bool>,
}

struct FastFindings {
    effects: Vec<Effect>,
    resolution: f64,
}

impl FastFindings {
    /// For the channel with this profile; `shown` is known of the `first` samples, `changed_clock` of more.
    fn new(
        profile: &ChannelProfile,
        first: Option<ChannelId>,
        shown: &SampleEffects,
        changed_clock: Option<&Effect>,
    ) -> Self {
        let is_better_known = |effect: &&Effect| changed_clock.is_some_and(|of| of.is_of_kind(effect));
        let effects = first.into_iter().flat_map(|of| shown.of(of)).filter(|of| is_fast(of) && !is_better_known(of));
        Self {
            effects: effects.chain(changed_clock).cloned().collect(),
            resolution: profile.lsb * f64::from(first.map_or(1, |of| shown.counts_per_step(of))),
        }
    }
}

/// True if only the samples themselves show an effect, the first ones as well as all.
fn is_fast(effect: &Effect) -> bool {
    matches!(
        effect,
        Effect::NoiseBelowCount(_) | Effect::EffectiveLsb(_) | Effect::RepeatedSamples(_) | Effect::ClockDeviation(_)
    )
}

struct RecordedChannel {
    curves: StreamedCurves,
    values: ValueCounts,
}

struct ScreenedChannel {
    curves: StreamedCurves,
    means: Means,
    spectra: Option<SampleSpectra>,
}

struct SampleSpectra {
    stacked: StackedSpectrum,
    epochs: EpochSpectra,
}

impl ScreenedChannel {
    fn push_to_spectra(&mut self, slots: &[u64], channel: &MeasuredChannel) {
        let Some(SampleSpectra { stacked, epochs }) = &mut self.spectra else { return };
        for (slot, count) in channel.used_samples(slots) {
            let value = f64::from(count) * channel.profile.lsb;
            stacked.push(slot, value);
            epochs.push(slot, value);
        }
    }
}

/// Lines of a samples' spectrum over `periods` sample periods that are too fast for the means.
fn lines_above_means(
    stacked: StackedSpectrum,
    description: &RecordingDescription,
    periods: u64,
    samples_per_mean: u64,
) -> impl FnOnce() -> Vec<MergedLine> + Send + 'static {
    let (period_s, rate_error) = (description.period_s(), description.profile.sample_rate_error);
    let highest_hz = description.sample_rate_hz / samples_per_mean as f64 / MEANS_PER_PERIOD;
    let [resolved_s, duration_s] = [STRETCH_PERIODS, periods].map(|periods| periods as f64 * period_s);
    move || {
        let lines = spectral_lines::merged(stacked.lines(), resolved_s, duration_s, rate_error);
        lines.into_iter().filter(|line| line.frequency.value > highest_hz).collect()
    }
}

/// The means of a measurement; `None` if its analysis needs all samples.
pub(crate) fn condensed_from(measurement: &Measurement) -> Option<CondensedRecord<'static>> {
    let (samples, periods) = (measurement.len() as u64, measurement.periods());
    let has_losses = lost_part(samples, periods) > MOST_LOST;
    let most = if has_losses { MOST_SAMPLES_WITH_LOSSES } else { MOST_SAMPLES };
    (samples > most).then(|| {
        let mut reader = LongRecordReader::new(RecordingDescription::from(measurement), measurement);
        measurement.blocks(BLOCK).for_each(|block| reader.push(&block));
        reader.finish()
    })
}

impl LongRecordReader {
    /// For the recording of this description that begins with the samples of `beginning`.
    #[must_use]
    pub fn new(description: RecordingDescription, beginning: &Measurement) -> Self {
        let first = beginning.before(FIRST_PERIODS);
        let stuck = StuckScreen::new(&first, description.samples);
        let first = stuck_output::screened(Cow::Owned(first)).0.into_owned();
        let samples_per_mean = description.periods.div_ceil(MOST_MEANS).next_power_of_two();
        let means = description.periods / samples_per_mean;
        let middle = means / 2 * samples_per_mean;
        let epochs: Vec<u64> = epoch_starts(means).map(|start| start * samples_per_mean).collect();
        // The LSB of the same channel may differ.
        let of_first: Vec<Option<ChannelId>> = description.channels.iter().map(|of| first.named(of.name)).collect();
        let shown = SampleEffects::detect(&first);
        let changes = |effect: &Effect| matches!(effect, Effect::ClockDeviation(of) if of.change.is_some());
        let changed_clock = sampling_faults::sample_clock(beginning).map(|found| found.effect).filter(changes);
        let fast: Vec<FastFindings> = description
            .channels
            .iter()
            .zip(&of_first)
            .map(|(of, first)| FastFindings::new(of, *first, &shown, changed_clock.as_ref()))
            .collect();
        let repeated = shown.repeated();
        let rules = in_parallel(&of_first, |of_first| {
            let is_screened = |of: &ChannelId| first[*of].profile.quantity.is_inertial() && !shown.is_saturated(*of);
            let channel = of_first.filter(is_screened)?;
            let series = Series::from_measurement(&first, channel).with_counts_per_step(shown.counts_per_step(channel));
            SpikeRule::fit_for(&series.without(&repeated), description.samples)
        });
        let screen = SampleScreen::new(&description.channels, rules, !repeated.is_empty());
        let period_s = description.period_s();
        let read_every = description.profile.read_every(1.0 / period_s);
        let spectra = |fast: &FastFindings| SampleSpectra {
            stacked: StackedSpectrum::new(period_s, STRETCH_PERIODS as usize, fast.resolution, read_every),
            epochs: EpochSpectra::new(period_s, &epochs),
        };
        let recorded = |_: &ChannelProfile| RecordedChannel {
            curves: StreamedCurves::new(&[middle]),
            values: ValueCounts::default(),
        };
        let recorded = description.channels.iter().map(recorded).collect();
        let screened = |((profile, fast), of_first): ((&ChannelProfile, &FastFindings), &Option<ChannelId>)| {
            let counts = of_first.iter().flat_map(|&of| &first[of].counts);
            let largest = counts.map(|count| count.unsigned_abs()).max();
            ScreenedChannel {
                curves: StreamedCurves::new(&epochs),
                means: Means::new(samples_per_mean, means, largest.unwrap_or(0)),
                spectra: profile.quantity.is_inertial().then(|| spectra(fast)),
            }
        };
        let screened = description.channels.iter().zip(&fast).zip(&of_first).map(screened).collect();
        Self {
            description,
            first,
            samples_per_mean,
            middle,
            stuck,
            first_half: None,
            recorded,
            screen,
            screened,
            fast,
            last: None,
            gaps: 0,
        }
    }

    /// Takes the next samples, the channels in parallel.
    pub fn push(&mut self, block: &SampleBlock) {
        for &slot in &block.slots {
            self.gaps += usize::from(self.last.is_some_and(|last| slot > last + 1));
            self.last = Some(slot);
        }
        let of_first_half = block.slots.partition_point(|&slot| slot < self.middle);
        if self.first_half.is_some() || of_first_half == block.slots.len() {
            self.push_to_half(block);
            return;
        }
        self.push_to_half(&block.part(0..of_first_half));
        self.end_first_half();
        self.push_to_half(&block.part(of_first_half..block.slots.len()));
    }

    fn push_to_half(&mut self, block: &SampleBlock) {
        let block = self.stuck.screen(block);
        let Self { recorded, screen, screened, .. } = self;
        let as_recorded = || {
            parallel::for_each_pair(recorded, &block.channels, |of, channel| {
                of.curves.push(&block.slots, channel);
                channel.used_samples(&block.slots).for_each(|(_, count)| of.values.push(count));
            });
        };
        parallel::both(as_recorded, || screen.push(&block, |block| push_screened(screened, block)));
    }

    /// Ends the first half: later samples do not affect its findings.
    fn end_first_half(&mut self) {
        let Self { stuck, recorded, screen, screened, .. } = self;
        push_screened(screened, &screen.finish_part());
        let stacked = |of: &ScreenedChannel| of.spectra.as_ref().map(|of| of.stacked.clone());
        let is_screened = |(recorded, screened): (&RecordedChannel, &ScreenedChannel)| {
            screened.curves.refused != recorded.curves.refused
        };
        self.first_half = Some(FirstHalfFindings {
            stuck: stuck.found(),
            stacked: screened.iter().map(stacked).collect(),
            is_screened: recorded.iter().zip(&*screened).map(is_screened).collect(),
        });
    }

    #[must_use]
    pub fn finish(mut self) -> CondensedRecord<'static> {
        if self.first_half.is_none() {
            self.end_first_half();
        }
        push_screened(&mut self.screened, &self.screen.finish_part());
        let found = self.stuck.found();
        let FirstHalfFindings { stuck: of_first_half, stacked: stacked_in_first_half, is_screened } =
            self.first_half.take().unwrap_or_default();
        let Self { description, first, samples_per_mean, middle, recorded, screen, screened, fast, gaps, .. } = self;
        let lost = sampling_faults::lost_samples(description.samples, &description.dropped, gaps);
        let period_s = description.period_s();
        let means = measurement_of_means(&description, samples_per_mean, &screened);
        let left_out: Vec<Vec<(u64, f64)>> = screen.found_before(middle).collect();
        let [events, events_of_half] =
            [(description.periods, found), (middle, of_first_half)].map(|(periods, stuck)| {
                let share = periods as f64 / description.periods as f64;
                let samples = (share * description.samples as f64) as u64;
                let stuck = stuck.into_iter().map(move |runs| runs.effect(samples, period_s));
                let events = screen.effects(periods, period_s).into_iter();
                events.zip(stuck).map(|(events, stuck)| events.into_iter().chain(stuck).collect::<Vec<Effect>>())
            });
        let mut condensed = Vec::new();
        let events = events.zip(events_of_half).zip(left_out);
        let channels = recorded.into_iter().zip(screened).zip(fast).zip(&description.channels);
        let in_first_half = stacked_in_first_half.into_iter().zip(is_screened);
        for (
            ((((recorded, screened), fast), profile), ((events, events_of_first_half), left_out)),
            (stacked_in_first_half, is_first_half_screened),
        ) in channels.zip(events).zip(in_first_half)
        {
            let is_inertial = profile.quantity.is_inertial();
            let shows_codes = |effect: &Effect| !matches!(effect, Effect::NoiseBelowCount(_) | Effect::EffectiveLsb(_));
            let missing_codes = || recorded.values.missing_codes(profile.lsb, profile.unit);
            let range = recorded
                .values
                .saturation(profile, fast.resolution)
                .or_else(|| missing_codes().filter(|_| fast.effects.iter().all(shows_codes)));
            let found = lost.iter().cloned().map(|found| found.effect).chain(fast.effects);
            let found = found.chain(range.map(|found| found.effect)).chain(events);
            let parts = |curves: &StreamedCurves| curves.parts().map(|(start, part)| (start, part.clone())).collect();
            let lines_of = |stacked: Option<StackedSpectrum>, periods: u64| match stacked {
                Some(stacked) => faster_lines(lines_above_means(stacked, &description, periods, samples_per_mean)),
                None => faster_lines(Vec::new),
            };
            let (stacked, spectra) = match screened.spectra {
                Some(SampleSpectra { stacked, epochs }) => (Some(stacked), epochs.finish(description.periods)),
                None => (None, PartSpectra::default()),
            };
            condensed.push(CondensedChannel {
                samples: SampleCurves {
                    samples_per_mean,
                    resolution: fast.resolution,
                    measured: recorded.curves.whole().curve(period_s).scaled(profile.lsb),
                    recorded: parts(&recorded.curves),
                    screened: parts(&screened.curves),
                    middle,
                    spectra,
                    is_screened: screened.curves.refused != recorded.curves.refused,
                    is_first_half_screened,
                    period_s,
                    lsb: profile.lsb,
                },
                variances: screened.means.variances.iter().map(|variance| variance * profile.lsb.powi(2)).collect(),
                counts_per_step: 1,
                can_show_spikes: false,
                faster_lines: lines_of(stacked, description.periods),
                faster_lines_of_first_half: lines_of(stacked_in_first_half, middle),
                effects: found.filter(|_| is_inertial).collect(),
                effects_of_first_half: events_of_first_half,
                screened: left_out,
                refused: screened.curves.refused,
            });
        }
        CondensedRecord {
            means: Cow::Owned(means),
            first: Some(first),
            samples_per_mean,
            repeated: Vec::new(),
            channels: condensed.into(),
            description,
        }
    }
}

/// First means of the quarters of the first half, of the second half and of the epochs, and the end of the last one.
fn epoch_starts(means: u64) -> impl Iterator<Item = u64> {
    let middle = means / 2;
    let ranges = epochs(0..means, middle).into_iter().flat_map(|(_, ranges)| ranges).flatten();
    let starts: BTreeSet<u64> = ranges.flat_map(|range| [range.start, range.end]).chain([middle / 2, middle]).collect();
    starts.into_iter().filter(move |start| (1..means).contains(start))
}

fn push_screened(channels: &mut [ScreenedChannel], block: &SampleBlock) {
    parallel::for_each_pair(channels, &block.channels, |of, channel| {
        of.curves.push(&block.slots, channel);
        of.means.push(&block.slots, channel);
        of.push_to_spectra(&block.slots, channel);
    });
}

fn measurement_of_means(
    description: &RecordingDescription,
    samples_per_mean: u64,
    channels: &[ScreenedChannel],
) -> Measurement {
    let rate = description.sample_rate_hz / samples_per_mean as f64;
    let count = channels.iter().map(|channel| channel.means.counts.len()).max().unwrap_or(0);
    let mean = |of: &ScreenedChannel, at: usize| of.means.counts.get(at).copied().filter(|mean| *mean != MISSING);
    let present: Vec<usize> =
        (0..count).filter(|&at| channels.iter().any(|channel| mean(channel, at).is_some())).collect();
    let channel = |(profile, of): (&ChannelProfile, &ScreenedChannel)| {
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

struct Means {
    samples_per_mean: u64,
    /// Most means; the remainder at the end is dropped.
    most: u64,
    /// Steps of a count, as a power of two.
    steps_log2: u32,
    /// In steps; [`MISSING`] without enough samples.
    counts: Vec<i32>,
    /// Variance of the samples of each mean about it, counts²; 0 without enough samples.
    variances: Vec<f64>,
    sum: i64,
    squares: i128,
    present: u64,
}

impl Means {
    /// For first samples of up to `largest` counts; later ones may be four times as large.
    fn new(samples_per_mean: u64, most: u64, largest: u32) -> Self {
        let room = (LARGEST_MEAN / (4.0 * f64::from(largest.max(1)))).max(1.0).log2() as u32;
        let steps_log2 = MEAN_STEPS_LOG2.min(room);
        Self {
            samples_per_mean,
            most,
            steps_log2,
            counts: Vec::new(),
            variances: Vec::new(),
            sum: 0,
            squares: 0,
            present: 0,
        }
    }

    fn push(&mut self, slots: &[u64], channel: &MeasuredChannel) {
        for (slot, count) in channel.used_samples(slots) {
            self.end_before(slot / self.samples_per_mean);
            self.sum += i64::from(count);
            self.squares += i128::from(count).pow(2);
            self.present += 1;
        }
        // The last sample period completes the last mean.
        if let Some(&last) = slots.last() {
            self.end_before((last + 1) / self.samples_per_mean);
        }
    }

    fn end_before(&mut self, number: u64) {
        let number = number.min(self.most);
        while (self.counts.len() as u64) < number {
            let is_filled = self.present as f64 >= LEAST_FILL * self.samples_per_mean as f64;
            let present = self.present.max(1);
            let mean = self.sum as f64 / present as f64 * f64::from(1_u32 << self.steps_log2);
            let squares = self.squares * i128::from(present) - i128::from(self.sum).pow(2);
            self.counts.push(if is_filled { mean.round().clamp(-LARGEST_MEAN, LARGEST_MEAN) as i32 } else { MISSING });
            self.variances.push(if is_filled { squares as f64 / (present as f64).powi(2) } else { 0.0 });
            (self.sum, self.squares, self.present) = (0, 0, 0);
        }
    }
}
