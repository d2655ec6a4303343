//! The averaging times that are too short for the means that are kept of a long recording.

use crate::preprocessing::Exclusion;
use crate::streamed_curves::{STEPS_PER_COUNT, joined};
use crate::{OCTAVES, OVERLAP};
use allan_core::{Cascade, Curve};
use measurement::ChannelProfile;

/// The curve of the means is used from this averaging factor on, in means: from there on it has as many differences as that of the
/// samples ([`OVERLAP`] in an averaging time).
const LEAST_FACTOR: u64 = OVERLAP as u64;

/// By half of the record, the estimators of the parts that it is made of.
pub(crate) type Halves = [Vec<Cascade<OCTAVES, OVERLAP>>; 2];

/// The averaging times that are too short for the means of a long recording.
pub(crate) struct ShorterTimes {
    pub samples_per_mean: u64,
    /// In the order of the channels of the measurement.
    pub channels: Vec<ShorterTimesOfChannel>,
}

/// The same of one channel.
#[derive(Clone)]
pub(crate) struct ShorterTimesOfChannel {
    /// Of the means.
    pub profile: ChannelProfile,
    /// Smallest distance of two values, in the channel's unit.
    pub resolution: f64,
    /// The whole curve as recorded.
    pub measured: Curve<OCTAVES>,
    /// With all samples, and without those that the screen leaves out: by half of the record, the parts that it is made of.
    pub recorded: Halves,
    pub screened: Halves,
    /// Whether the screen leaves out a sample.
    pub is_screened: bool,
    pub period_s: f64,
    /// Size of a count, in the channel's unit.
    pub lsb: f64,
}

impl ShorterTimes {
    /// Those of the first half of the record.
    pub(crate) fn of_first_half(&self) -> Self {
        let half = |of: &ShorterTimesOfChannel| {
            let halves = |[first, _]: &Halves| {
                let (earlier, later) = first.split_at(first.len() / 2);
                [earlier.to_vec(), later.to_vec()]
            };
            ShorterTimesOfChannel { recorded: halves(&of.recorded), screened: halves(&of.screened), ..of.clone() }
        };
        Self { samples_per_mean: self.samples_per_mean, channels: self.channels.iter().map(half).collect() }
    }

    /// Averaging factor from which on the curve is that of the means, samples.
    pub(crate) fn until(&self) -> u64 {
        LEAST_FACTOR * self.samples_per_mean
    }

    /// A channel of the measurement of the means.
    pub(crate) fn of(&self, channel: ChannelProfile) -> Option<&ShorterTimesOfChannel> {
        self.channels.iter().find(|of| of.profile == channel)
    }

    /// The curve of `means`, with that of the samples at averaging times that are too short for it.
    pub(crate) fn continued(&self, shorter: Curve<OCTAVES>, means: &Curve<OCTAVES>) -> Curve<OCTAVES> {
        shorter.continued_by_means(means, self.samples_per_mean, self.until())
    }

    /// The curve of `means` alone, by averaging factors in samples.
    pub(crate) fn in_samples(&self, means: &Curve<OCTAVES>) -> Curve<OCTAVES> {
        Curve::empty().continued_by_means(means, self.samples_per_mean, 0)
    }
}

impl ShorterTimesOfChannel {
    /// The curve of a half as recorded, or without spikes and repeated samples; 0 is the first half.
    pub(crate) fn half(&self, half: usize, exclusion: Exclusion) -> Curve<OCTAVES> {
        self.curve(&self.parts(exclusion)[half])
    }

    /// The curve of both halves.
    pub(crate) fn both(&self, exclusion: Exclusion) -> Curve<OCTAVES> {
        self.curve(&self.parts(exclusion).concat())
    }

    /// The curves of the quarters of the first half.
    pub(crate) fn quarters(&self, exclusion: Exclusion) -> [Curve<OCTAVES>; 2] {
        let [first, _] = self.parts(exclusion);
        let (earlier, later) = first.split_at(first.len() / 2);
        [self.curve(earlier), self.curve(later)]
    }

    /// Samples that were replaced because they are missing.
    pub(crate) fn replaced(&self, exclusion: Exclusion) -> u64 {
        self.parts(exclusion).iter().flatten().map(Cascade::replaced).sum()
    }

    fn parts(&self, exclusion: Exclusion) -> &Halves {
        if exclusion == Exclusion::None { &self.recorded } else { &self.screened }
    }

    fn curve(&self, parts: &[Cascade<OCTAVES, OVERLAP>]) -> Curve<OCTAVES> {
        joined(parts).curve(self.period_s).scaled(self.lsb / STEPS_PER_COUNT)
    }
}
