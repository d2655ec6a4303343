//! Samples in memory with time stamps and faults, checked by [`BurstValidator`] in a [`Recorder`].

use adis16405_driver::{Burst, BurstValidator, Channel, ChannelMask, Counts, Faults, GyroRange};

pub use readers::MAX_SAMPLES;

/// Counts for missing channels: 0, and a supply of 5 V (2068 counts of 2.418 mV).
pub const NOT_RECORDED: [i16; 12] = {
    let mut counts = [0; 12];
    counts[Channel::Supply as usize] = 2068;
    counts
};

/// Time of a sample, as far as recorded.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct TimeStamp {
    /// Running number; larger steps are gaps.
    pub index: Option<u64>,
    /// Host time of the reading, s.
    pub time_s: Option<f64>,
}

impl TimeStamp {
    pub fn from_time(time_s: f64) -> Self {
        Self { index: None, time_s: Some(time_s) }
    }
}

/// Verdict on a row of register counts.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Verdict {
    pub(crate) loss: Option<&'static str>,
    pub(crate) faults: Faults,
    pub(crate) refused: ChannelMask,
}

impl Verdict {
    fn new(faults: Faults, refused: ChannelMask) -> Self {
        let is_lost = refused == ChannelMask::ALL;
        Self { loss: is_lost.then(|| (faults - Faults::WARNINGS).cause()).flatten(), faults, refused }
    }
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RecordedSample {
    pub time_stamp: TimeStamp,
    /// Unrecorded channels have [`NOT_RECORDED`].
    pub counts: Counts,
    pub faults: Faults,
    pub refused: ChannelMask,
}

impl RecordedSample {
    pub(crate) fn verdict(&self) -> Verdict {
        Verdict::new(self.faults, self.refused)
    }
}

/// Samples in the order in which they were read.
#[derive(Debug, Clone, PartialEq)]
pub struct Recording {
    pub channels: Vec<Channel>,
    /// Sets the size of gyroscope counts.
    pub range: GyroRange,
    pub samples: Vec<RecordedSample>,
    /// The reason, if it ends early.
    pub damage: Option<String>,
}

/// Builds a [`Recording`] burst by burst.
#[derive(Debug)]
pub struct Recorder {
    recording: Recording,
    validator: BurstValidator,
    detectable: Faults,
}

impl Recorder {
    pub fn new(mut channels: Vec<Channel>, range: GyroRange) -> Self {
        channels.sort();
        // Equal counts of all six inertial channels mark repeats and frozen outputs; fewer may be chance.
        let detectable = if Channel::INERTIAL.iter().all(|c| channels.contains(c)) {
            Faults::all()
        } else {
            Faults::all() - Faults::REPEATED - Faults::FROZEN
        };
        Self {
            recording: Recording { channels, range, samples: Vec::new(), damage: None },
            validator: BurstValidator::default().with_refused_faults(detectable & Faults::REFUSED),
            detectable,
        }
    }

    /// Reserves memory, if there is enough.
    #[must_use]
    pub fn with_capacity(mut self, samples: u64) -> Self {
        // Otherwise it fails when samples come.
        let _ = self.recording.samples.try_reserve_exact(usize::try_from(samples).unwrap_or(0));
        self
    }

    pub(crate) fn channels(&self) -> &[Channel] {
        &self.recording.channels
    }

    pub fn push(&mut self, time_stamp: TimeStamp, burst: &Burst) {
        let Verdict { faults, refused, .. } = self.judge(burst);
        self.recording.samples.push(RecordedSample { time_stamp, counts: burst.counts(), faults, refused });
    }

    /// Verdict on the next burst, which is not added.
    pub(crate) fn judge(&mut self, burst: &Burst) -> Verdict {
        let validity = self.validator.validate(burst);
        Verdict::new(validity.faults & self.detectable, validity.refused)
    }

    /// For all bursts, also earlier ones.
    pub fn set_range(&mut self, range: GyroRange) {
        self.recording.range = range;
    }

    pub fn finish(self) -> Recording {
        self.recording
    }
}
