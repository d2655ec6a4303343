//! Samples in memory, each with its time stamp and its faults.
//!
//! [`Recorder`] takes the rows of a table and the bursts from the bus alike and checks both with the driver's
//! [`BurstValidator`], so that the same words give the same recording either way.

use adis16405_driver::{Burst, BurstValidator, Channel, ChannelMask, Counts, Faults, GyroRange};

pub use readers::MAX_SAMPLES;

/// Counts that stand for the channels that a table lacks: 0, and a supply of 5 V (2068 counts of 2.418 mV).
pub const NOT_RECORDED: [i16; 12] = {
    let mut counts = [0; 12];
    counts[Channel::Supply as usize] = 2068;
    counts
};

/// When a sample was taken, as far as the recording says it.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct TimeStamp {
    /// Running number of the sample; grows by one a sample, by more across a gap.
    pub index: Option<u64>,
    /// The host's time at which the sample was read, s.
    pub time_s: Option<f64>,
}

impl TimeStamp {
    /// The time stamp of a sample without an index that was read at `time_s`, in s.
    pub fn from_time(time_s: f64) -> Self {
        Self { index: None, time_s: Some(time_s) }
    }
}

/// Verdict of the burst validator on a row of register counts.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Verdict {
    /// Why no channel of the row is used; `None` if one is.
    pub(crate) loss: Option<&'static str>,
    /// Faults that the row and the rows before it show.
    pub(crate) faults: Faults,
    /// Channels whose words are not to be used.
    pub(crate) refused: ChannelMask,
}

impl Verdict {
    fn new(faults: Faults, refused: ChannelMask) -> Self {
        let is_lost = refused == ChannelMask::ALL;
        Self { loss: is_lost.then(|| (faults - Faults::WARNINGS).cause()).flatten(), faults, refused }
    }
}

/// One sample of all channels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RecordedSample {
    /// When it was taken.
    pub time_stamp: TimeStamp,
    /// Register counts; those of channels outside [`Recording::channels`] are [`NOT_RECORDED`].
    pub counts: Counts,
    /// Faults that the burst and the bursts before it show.
    pub faults: Faults,
    /// Channels whose words are not to be used for these faults.
    pub refused: ChannelMask,
}

impl RecordedSample {
    /// Verdict by the faults of the sample.
    pub(crate) fn verdict(&self) -> Verdict {
        Verdict::new(self.faults, self.refused)
    }
}

/// Samples in the order in which they were read.
#[derive(Debug, Clone, PartialEq)]
pub struct Recording {
    /// The channels that were recorded, in the order of the burst.
    pub channels: Vec<Channel>,
    /// Range of the gyroscopes, which sets the size of their counts.
    pub range: GyroRange,
    /// All samples, those with faults included.
    pub samples: Vec<RecordedSample>,
}

/// Builds a [`Recording`] burst by burst.
#[derive(Debug)]
pub struct Recorder {
    recording: Recording,
    validator: BurstValidator,
    /// Faults that can be detected with the channels that are recorded.
    detectable: Faults,
}

impl Recorder {
    /// Starts an empty recording of `channels`.
    pub fn new(mut channels: Vec<Channel>, range: GyroRange) -> Self {
        channels.sort();
        // A sample that was read twice and a frozen output are detected by equal counts of all six inertial channels; fewer
        // channels may be equal by chance.
        let detectable = if Channel::INERTIAL.iter().all(|c| channels.contains(c)) {
            Faults::all()
        } else {
            Faults::all() - Faults::REPEATED - Faults::FROZEN
        };
        Self {
            recording: Recording { channels, range, samples: Vec::new() },
            validator: BurstValidator::default().with_refused_faults(detectable & Faults::REFUSED),
            detectable,
        }
    }

    /// Takes the memory of so many samples at once, if it is there; without, it grows with them.
    #[must_use]
    pub fn with_capacity(mut self, samples: u64) -> Self {
        // Samples that need more memory than there is fail when they come.
        let _ = self.recording.samples.try_reserve_exact(usize::try_from(samples).unwrap_or(0));
        self
    }

    /// The channels that are recorded, in the order of the burst.
    pub(crate) fn channels(&self) -> &[Channel] {
        &self.recording.channels
    }

    /// Adds a burst.
    pub fn push(&mut self, time_stamp: TimeStamp, burst: &Burst) {
        let Verdict { faults, refused, .. } = self.judge(burst);
        self.recording.samples.push(RecordedSample { time_stamp, counts: burst.counts(), faults, refused });
    }

    /// Verdict of the burst validator on the next burst, which is not added.
    pub(crate) fn judge(&mut self, burst: &Burst) -> Verdict {
        let validity = self.validator.validate(burst);
        Verdict::new(validity.faults & self.detectable, validity.refused)
    }

    /// Sets the gyroscopes' range of the whole recording, bursts that were added before included.
    pub fn set_range(&mut self, range: GyroRange) {
        self.recording.range = range;
    }

    /// The recording of all bursts that were added.
    pub fn finish(self) -> Recording {
        self.recording
    }
}
