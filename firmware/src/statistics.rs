//! The running epoch: exact sums of channels and pairs, curve and baseline model.

pub use crate::channels::{CHANNELS, ChannelEstimator, OCTAVES, OVERLAP};
pub(crate) use crate::channels::{GYROS, INERTIAL};
pub(crate) use crate::cross_sums::{AllanCovariances, CROSS_OCTAVES, ChannelMeans, FIRST_CROSS_OCTAVE};

use crate::channels::ChannelSet;
use crate::cross_sums::CrossSums;
use crate::scale::ReportScale;
use adis16405_driver::Channel;
use allan_core::{Cascade, Curve, Interpolation, Model, NoiseTerm, OctaveSums, fit::fit};

/// The statistics of the running epoch.
#[derive(Debug)]
pub struct Statistics {
    pub(crate) estimators: [ChannelEstimator; CHANNELS.len()],
    pub(crate) cross_sums: CrossSums,
    pub(crate) losses: SampleLosses,
}

/// Losses since the statistics or the device began.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct SampleLosses {
    pub(crate) lost: u64,
    /// Refused samples per channel of [`CHANNELS`].
    pub(crate) refused: [u64; CHANNELS.len()],
}

impl SampleLosses {
    pub(crate) const NONE: Self = Self { lost: 0, refused: [0; CHANNELS.len()] };
}

impl Statistics {
    /// Statistics of no sample.
    pub const fn new() -> Self {
        Self {
            estimators: [const { ChannelEstimator::new() }; CHANNELS.len()],
            cross_sums: CrossSums::new(),
            losses: SampleLosses::NONE,
        }
    }

    /// Adds a sample to all channels except the `refused` ones.
    pub(crate) fn push(&mut self, counts: [i32; CHANNELS.len()], refused: ChannelSet) {
        if refused.is_empty() {
            for (estimator, count) in self.estimators.iter_mut().zip(counts) {
                estimator.push(count);
            }
        } else {
            self.push_some(counts, refused);
        }
        self.cross_sums.add(&self.estimators, counts, refused);
    }

    #[inline(never)]
    fn push_some(&mut self, counts: [i32; CHANNELS.len()], refused: ChannelSet) {
        let channels = self.estimators.iter_mut().zip(counts).zip(&mut self.losses.refused);
        for (index, ((estimator, count), refusals)) in channels.enumerate() {
            if refused.contains(index) {
                estimator.gap(1);
                *refusals = refusals.saturating_add(1);
            } else {
                estimator.push(count);
            }
        }
    }

    pub(crate) fn has_samples(&self) -> bool {
        self.estimators.iter().any(|estimator| !estimator.is_empty())
    }

    pub(crate) fn lose(&mut self, missing: u32) {
        self.losses.lost = self.losses.lost.saturating_add(u64::from(missing));
        for estimator in &mut self.estimators {
            estimator.gap(missing);
        }
    }

    pub(crate) fn reset(&mut self) {
        self.estimators.iter_mut().for_each(Cascade::reset);
        self.cross_sums.reset();
        self.losses = SampleLosses::NONE;
    }
}

impl Default for Statistics {
    fn default() -> Self {
        Self::new()
    }
}

/// Exact sums of one channel for reports and models. They are a fifth of the estimator's size, without fourth powers.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ChannelSums {
    /// Samples taken.
    pub samples: u64,
    /// Samples missing between them: lost or refused.
    pub missing: u64,
    /// For every octave the sum of the squared second differences in counts², and their number.
    pub octaves: [(u128, u64); OCTAVES],
    /// Gaps by the first octave that bridges them.
    pub gaps: [Interpolation; OCTAVES],
}

impl ChannelSums {
    /// Sums of no samples.
    pub const EMPTY: Self =
        Self { samples: 0, missing: 0, octaves: [(0, 0); OCTAVES], gaps: [Interpolation::NONE; OCTAVES] };

    /// Copies the sums of an estimator.
    pub fn from_estimator(estimator: &ChannelEstimator) -> Self {
        let mut sums = Self { samples: estimator.len(), missing: estimator.missing(), ..Self::EMPTY };
        for octave in 0..OCTAVES {
            let OctaveSums { squares, count, interpolation, .. } = estimator.octave_sums(octave).unwrap_or_default();
            (sums.octaves[octave], sums.gaps[octave]) = ((squares, count), interpolation);
        }
        sums
    }

    /// Makes an estimator continue from these sums, as after a gap.
    pub fn restore(&self, estimator: &mut ChannelEstimator) {
        estimator.restore(self.samples, self.missing, |octave| self.octave(octave));
    }

    /// The Allan variance curve of a channel in its unit.
    pub fn curve(&self, channel: Channel, scale: ReportScale) -> Curve<OCTAVES> {
        let mut curve = Curve::empty();
        ChannelEstimator::rebuild_curve(&mut curve, scale.period_s(), self.samples, |octave| self.octave(octave));
        curve.scale(scale.lsb(channel));
        curve
    }

    /// Fits the baseline model (N, B and K) to the curve of a channel, in its unit.
    pub fn fit_baseline(&self, channel: Channel, scale: ReportScale) -> Model {
        fit(&self.curve(channel, scale), &NoiseTerm::BASELINE)
    }

    pub(crate) fn octave(&self, octave: usize) -> OctaveSums {
        let (squares, count) = self.octaves[octave];
        OctaveSums { squares, count, fourths: 0, interpolation: self.gaps[octave] }
    }
}
