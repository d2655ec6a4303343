//! A recording that is read in blocks.

use crate::{ChannelProfile, MeasuredChannel, Measurement, SensorProfile};
use std::collections::BTreeMap;
use std::ops::Range;

/// Description of a recording before its samples are used.
#[derive(Debug, Clone, PartialEq)]
pub struct RecordingDescription {
    pub profile: SensorProfile,
    /// Sample rate in Hz, stated by the user or derived from the time stamps.
    pub sample_rate_hz: f64,
    pub samples: u64,
    /// Sample periods from the first to the last sample, inclusive.
    pub periods: u64,
    /// The recorded channels, in the order of the sensor's burst.
    pub channels: Vec<ChannelProfile>,
    /// Samples that are missing or were refused, by cause: see [`Measurement::dropped`].
    pub dropped: BTreeMap<&'static str, u64>,
    /// Samples that are used although a warning was raised, by cause: see [`Measurement::flagged`].
    pub flagged: BTreeMap<&'static str, u64>,
}

impl RecordingDescription {
    /// Sample period, s.
    #[must_use]
    pub fn period_s(&self) -> f64 {
        1.0 / self.sample_rate_hz
    }

    /// First sample period of the second half by time.
    #[must_use]
    pub fn middle(&self) -> u64 {
        self.periods / 2
    }
}

impl From<&Measurement> for RecordingDescription {
    fn from(measurement: &Measurement) -> Self {
        Self {
            profile: measurement.profile.clone(),
            sample_rate_hz: measurement.sample_rate_hz,
            samples: measurement.len() as u64,
            periods: measurement.periods(),
            channels: measurement.profiles().collect(),
            dropped: measurement.dropped.clone(),
            flagged: measurement.flagged.clone(),
        }
    }
}

/// Consecutive usable samples of a recording.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct SampleBlock {
    /// Sample period of each sample, counted from the recording's first sample; strictly increasing.
    pub slots: Vec<u64>,
    /// The channels, in the order of [`RecordingDescription::channels`]. Positions of refused samples count from the
    /// block's begin.
    pub channels: Vec<MeasuredChannel>,
}

impl SampleBlock {
    /// The samples of the block at these positions.
    #[must_use]
    pub fn part(&self, positions: Range<usize>) -> Self {
        let channels = self.channels.iter().map(|channel| channel.part(positions.clone())).collect();
        Self { slots: self.slots[positions].to_vec(), channels }
    }
}

impl Measurement {
    /// The recording in blocks of `rows` samples; the last block may be shorter.
    pub fn blocks(&self, rows: usize) -> impl Iterator<Item = SampleBlock> {
        (0..self.len()).step_by(rows).map(move |from| {
            let positions = from..(from + rows).min(self.len());
            let channels = self.channels.iter().map(|channel| channel.part(positions.clone())).collect();
            SampleBlock { slots: self.slots[positions].to_vec(), channels }
        })
    }
}
