//! Samples in memory, each with its clock and with what was wrong with it.
//!
//! Counts from a table and bursts from the bus meet in [`Recorder`]: the same words are judged by the same code, so that
//! both ways give the same recording.

use adis16405_driver::{Burst, BurstValidator, Channel, Counts, Faults, GyroRange};

/// What the channels that were not recorded read: 0, and a supply of 5 V (2068 counts of 2.418 mV).
pub const NOT_RECORDED: [i16; 12] = {
    let mut counts = [0; 12];
    counts[Channel::Supply as usize] = 2068;
    counts
};

/// What tells when a sample was taken.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Clock {
    /// Running number of the sample; grows by one a sample, by more across a gap.
    pub index: Option<u64>,
    /// The host's time at which the sample was read, s.
    pub time_s: Option<f64>,
}

impl Clock {
    /// A sample that carries only the time at which it was read, s.
    pub fn at(time_s: f64) -> Self {
        Self { index: None, time_s: Some(time_s) }
    }
}

/// One sample of all channels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sample {
    /// When it was taken.
    pub clock: Clock,
    /// Register counts; only those of [`Recording::channels`] mean anything.
    pub counts: Counts,
    /// What the burst itself shows to be wrong.
    pub faults: Faults,
}

/// Samples in the order in which they were read.
#[derive(Debug, Clone, PartialEq)]
pub struct Recording {
    /// The channels that were recorded, in the order of the burst.
    pub channels: Vec<Channel>,
    /// Range in which the rates were taken.
    pub range: GyroRange,
    /// As they were read, unusable ones included.
    pub samples: Vec<Sample>,
}

/// Builds a [`Recording`] burst by burst.
#[derive(Debug)]
pub struct Recorder {
    recording: Recording,
    validator: BurstValidator,
    judged: Faults,
}

impl Recorder {
    /// Starts an empty recording of `channels`.
    pub fn new(mut channels: Vec<Channel>, range: GyroRange) -> Self {
        channels.sort();
        // Re-reads and frozen outputs show in the six inertial words together; fewer may be equal by chance.
        let judged = if Channel::INERTIAL.iter().all(|c| channels.contains(c)) {
            Faults::all()
        } else {
            Faults::all() - Faults::REPEATED - Faults::FROZEN
        };
        Self {
            recording: Recording { channels, range, samples: Vec::new() },
            validator: BurstValidator::default(),
            judged,
        }
    }

    /// Adds a burst that was read at `clock`.
    pub fn push(&mut self, clock: Clock, burst: &Burst) {
        let faults = self.validator.validate(burst).faults & self.judged;
        self.recording.samples.push(Sample { clock, counts: burst.counts(), faults });
    }

    /// The range in which the rates of the following bursts are taken.
    pub fn set_range(&mut self, range: GyroRange) {
        self.recording.range = range;
    }

    /// The recording so far, complete.
    pub fn finish(self) -> Recording {
        self.recording
    }
}
