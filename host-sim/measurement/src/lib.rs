//! The samples of a sensor on a uniform time base, and the sensor's profile: [`adis16405`], a [file](profile_file), or
//! [any sensor](SensorProfile::generic).

pub mod adis16405;
mod block;
mod channel_id;
mod profile;
pub mod profile_file;
mod repetition;

pub use block::{RecordingDescription, SampleBlock};
pub use channel_id::{ChannelId, PerChannel};
pub use profile::{
    ChannelProfile, DataSheetDeviation, DataSheetNoise, DataSheetSensitivities, HOST_CLOCK_ERROR, Quantity,
    SensorProfile,
};

pub use repetition::repeated_fraction;

use std::collections::BTreeMap;
use std::ops::Range;

/// Samples of all channels at the same times.
#[derive(Debug, Clone, PartialEq)]
pub struct Measurement {
    pub profile: SensorProfile,
    /// Sample rate in Hz, stated by the user or derived from the time stamps.
    pub sample_rate_hz: f64,
    /// Sample rate in Hz that the user states, if any.
    pub stated_rate_hz: Option<f64>,
    /// Sample period of each sample, counted from the first; strictly increasing, with a step above 1 at a gap.
    pub slots: Vec<u64>,
    /// Time stamps, s, if every sample has one.
    pub times_s: Option<Vec<f64>>,
    /// The recorded channels, in the order of the sensor's burst.
    pub channels: Vec<MeasuredChannel>,
    /// Samples that are missing or were refused, by cause; `gap` counts those that never arrived.
    pub dropped: BTreeMap<&'static str, u64>,
    /// Samples that are used although a warning was raised, by cause.
    pub flagged: BTreeMap<&'static str, u64>,
}

/// The samples of one channel.
#[derive(Debug, Clone, PartialEq)]
pub struct MeasuredChannel {
    pub profile: ChannelProfile,
    /// One register count per slot; meaningless for a refused sample.
    pub counts: Vec<i32>,
    /// Positions in `counts` of samples refused in this channel alone, ascending, by cause.
    pub refused: BTreeMap<&'static str, Vec<usize>>,
}

impl MeasuredChannel {
    /// A channel without a refused sample.
    #[must_use]
    pub fn new(profile: ChannelProfile, counts: Vec<i32>) -> Self {
        Self { profile, counts, refused: BTreeMap::new() }
    }

    /// Positions of refused samples, ascending.
    #[must_use]
    pub fn refused_positions(&self) -> Vec<usize> {
        let mut positions: Vec<usize> = self.refused.values().flatten().copied().collect();
        positions.sort_unstable();
        positions.dedup();
        positions
    }

    /// Sample period and count of each sample that is not refused; `slots` are the sample periods of all samples.
    pub fn used_samples<'a>(&'a self, slots: &'a [u64]) -> impl Iterator<Item = (u64, i32)> + 'a {
        let mut refused = self.refused_positions().into_iter().peekable();
        let samples = slots.iter().copied().zip(self.counts.iter().copied()).enumerate();
        samples.filter_map(move |(position, sample)| refused.next_if_eq(&position).is_none().then_some(sample))
    }

    /// The samples of the channel at these positions.
    #[must_use]
    pub fn part(&self, positions: Range<usize>) -> Self {
        let within = |of: &[usize]| -> Vec<usize> {
            let from = of.partition_point(|position| *position < positions.start);
            let to = of.partition_point(|position| *position < positions.end);
            of[from..to].iter().map(|position| position - positions.start).collect()
        };
        let refused = self.refused.iter().map(|(&cause, of)| (cause, within(of)));
        Self {
            profile: self.profile,
            counts: self.counts[positions.clone()].to_vec(),
            refused: refused.filter(|(_, of)| !of.is_empty()).collect(),
        }
    }

    /// True if the sample at `position` is refused for any cause.
    #[must_use]
    pub fn is_refused(&self, position: usize) -> bool {
        self.refused.values().any(|positions| positions.binary_search(&position).is_ok())
    }
}

/// Missing fraction of a record with `samples` samples in `periods` sample periods, 0 to 1; 0 without a period.
#[must_use]
pub fn lost_part(samples: u64, periods: u64) -> f64 {
    periods.saturating_sub(samples) as f64 / periods.max(1) as f64
}

impl Measurement {
    /// Number of samples.
    #[must_use]
    pub fn len(&self) -> usize {
        self.slots.len()
    }

    /// True if there is no sample.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.slots.is_empty()
    }

    /// Sample period, s.
    #[must_use]
    pub fn period_s(&self) -> f64 {
        1.0 / self.sample_rate_hz
    }

    /// Empty sample periods before the sample at `position`; 0 for the first sample.
    #[must_use]
    pub fn missing_before(&self, position: usize) -> u32 {
        let previous = position.checked_sub(1).map(|previous| self.slots[previous]);
        previous.map_or(0, |previous| u32::try_from(self.slots[position] - previous - 1).unwrap_or(u32::MAX))
    }

    /// First sample period of the second half by time.
    #[must_use]
    pub fn middle(&self) -> u64 {
        self.periods() / 2
    }

    /// The recording cut off before the sample period `slot`, with its share of samples that never arrived.
    #[must_use]
    pub fn before(&self, slot: u64) -> Self {
        let count = self.slots.partition_point(|&of| of < slot);
        let missing = |slots: &[u64]| slots.last().map_or(0, |&last| last + 1 - slots.len() as u64);
        let lost = self.dropped.get("gap").copied().unwrap_or(0) as f64;
        let gap = lost * missing(&self.slots[..count]) as f64 / missing(&self.slots).max(1) as f64;
        let channel = |channel: &MeasuredChannel| {
            let refused = channel.refused.iter().map(|(&cause, positions)| {
                (cause, positions[..positions.partition_point(|&position| position < count)].to_vec())
            });
            MeasuredChannel {
                profile: channel.profile,
                counts: channel.counts[..count].to_vec(),
                refused: refused.collect(),
            }
        };
        Self {
            profile: self.profile.clone(),
            sample_rate_hz: self.sample_rate_hz,
            stated_rate_hz: self.stated_rate_hz,
            slots: self.slots[..count].to_vec(),
            times_s: self.times_s.as_ref().map(|times| times[..count].to_vec()),
            channels: self.channels.iter().map(channel).collect(),
            dropped: BTreeMap::from([("gap", gap.round() as u64)]),
            flagged: BTreeMap::new(),
        }
    }

    /// Sample periods from the first to the last sample, inclusive.
    #[must_use]
    pub fn periods(&self) -> u64 {
        self.slots.last().map_or(0, |&last| last + 1)
    }

    /// Number of gaps between the samples.
    #[must_use]
    pub fn gaps(&self) -> usize {
        self.slots.windows(2).filter(|pair| pair[1] - pair[0] > 1).count()
    }

    /// The recorded channels' profiles, in the order of [`Measurement::channels`].
    pub fn profiles(&self) -> impl Iterator<Item = ChannelProfile> {
        self.channels.iter().map(|channel| channel.profile)
    }

    /// The channel of this profile; `None` if it was not recorded.
    #[must_use]
    pub fn channel(&self, profile: &ChannelProfile) -> Option<&MeasuredChannel> {
        self.channels.iter().find(|channel| channel.profile.name == profile.name)
    }
}
