//! What a finished epoch has left: sums, while the next epoch's are under way.

use crate::couplings::Couplings;
use crate::estimators::{CHANNELS, Estimator};
use crate::summary::OCTAVES;
use adis16405_driver::Config;
use allan_core::{Curve, Learnt};

/// The exact sums of an epoch that is over. Fourth moments are not kept.
#[derive(Debug, Clone)]
pub struct Epoch {
    /// Epochs finished before it.
    pub number: u32,
    channels: [Sums; CHANNELS.len()],
    couplings: Couplings,
}

/// The sums of one channel.
#[derive(Debug, Clone, Copy)]
struct Sums {
    samples: u64,
    missing: u64,
    squares: [u128; OCTAVES],
    counts: [u64; OCTAVES],
}

impl Epoch {
    /// An epoch of no samples.
    pub const EMPTY: Self = Self {
        number: 0,
        channels: [Sums { samples: 0, missing: 0, squares: [0; OCTAVES], counts: [0; OCTAVES] }; CHANNELS.len()],
        couplings: Couplings::new(),
    };

    /// Takes the place of what was there before.
    pub(crate) fn take(&mut self, cascades: &[Estimator; CHANNELS.len()], couplings: &Couplings) {
        for (sums, cascade) in self.channels.iter_mut().zip(cascades) {
            (sums.samples, sums.missing) = (cascade.len(), cascade.missing());
            for octave in 0..OCTAVES {
                (sums.squares[octave], sums.counts[octave]) = cascade.sum_of_squares(octave).unwrap_or_default();
            }
        }
        self.couplings.clone_from(couplings);
    }

    /// The estimator of [`CHANNELS`]`[index]` as the epoch left it, without its fourth moments.
    #[must_use]
    pub fn estimator(&self, index: usize) -> Estimator {
        let sums = &self.channels[index];
        let learnt = core::array::from_fn(|octave| Learnt {
            squares: sums.squares[octave],
            fourths: 0,
            count: sums.counts[octave],
        });
        Estimator::resumed(sums.samples, sums.missing, &learnt)
    }

    /// The curve of [`CHANNELS`]`[index]` in its unit.
    #[must_use]
    #[inline(never)] // so that the estimator is not on everybody's stack
    pub fn curve(&self, index: usize, config: Config) -> Curve<OCTAVES> {
        self.estimator(index).curve(1.0 / config.sample_period().hz()).scaled(CHANNELS[index].lsb(config.range()))
    }

    /// What the channels have in common; `None` if that is not known of all their samples, as after a restart.
    #[must_use]
    pub fn couplings(&self) -> Option<&Couplings> {
        let whole = self.channels.iter().all(|sums| sums.samples == self.couplings.samples());
        whole.then_some(&self.couplings)
    }

    /// Samples of [`CHANNELS`]`[index]`.
    #[must_use]
    pub fn samples(&self, index: usize) -> u64 {
        self.channels[index].samples
    }
}
