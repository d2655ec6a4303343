//! What an estimator has learnt, as sums alone: a fifth of what the estimator takes, and all that a report is made of.

use crate::estimators::Estimator;
use crate::summary::OCTAVES;
use adis16405_driver::{Channel, Config};
use allan_core::{Curve, Learnt};

/// The exact sums of one channel. Fourth powers are not kept: nothing that the device reports is made of them.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Sums {
    /// Samples taken.
    pub samples: u64,
    /// Samples known to be missing among them.
    pub missing: u64,
    /// Of every octave, the sum of the squared second differences in counts², and their number.
    pub octaves: [(u128, u64); OCTAVES],
}

impl Sums {
    /// Of no samples.
    pub const NONE: Self = Self { samples: 0, missing: 0, octaves: [(0, 0); OCTAVES] };

    /// Of an estimator.
    #[must_use]
    pub fn of(estimator: &Estimator) -> Self {
        let octaves = core::array::from_fn(|octave| estimator.sum_of_squares(octave).unwrap_or_default());
        Self { samples: estimator.len(), missing: estimator.missing(), octaves }
    }

    /// Has an estimator go on from them, as after a gap.
    pub fn resume(&self, estimator: &mut Estimator) {
        estimator.resume(self.samples, self.missing, |octave| self.learnt(octave));
    }

    /// Draws the curve of a channel in its unit.
    #[inline(never)] // so that its stack is not everybody's
    pub fn draw(&self, curve: &mut Curve<OCTAVES>, channel: Channel, config: Config) {
        let period = 1.0 / config.sample_period().hz();
        Estimator::draw(curve, period, self.samples, |octave| self.learnt(octave));
        curve.scale(channel.lsb(config.range()));
    }

    fn learnt(&self, octave: usize) -> Learnt {
        let (squares, count) = self.octaves[octave];
        Learnt { squares, fourths: 0, count }
    }
}
