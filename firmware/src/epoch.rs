//! What a finished epoch has left: sums, while the next epoch's are under way.

use crate::couplings::{Couplings, Covariances};
use crate::estimators::{CHANNELS, Estimator};
use crate::retained::{Records, Retained};
use crate::summary::OCTAVES;
use crate::sums::Sums;
use adis16405_driver::Config;
use allan_core::Curve;

/// An epoch that is over. The sums of its channels lie where those of the running one are kept for the next start: as long
/// as they are needed, nothing else may be kept there.
#[derive(Clone)]
pub struct Epoch {
    /// Epochs finished before it.
    pub number: u32,
    records: Records,
    covariances: Covariances,
}

impl Epoch {
    /// An epoch of no samples.
    pub const EMPTY: Self = Self { number: 0, records: Records::NONE, covariances: Covariances::NONE };

    /// Takes the place of what was there before.
    pub(crate) fn take(
        &mut self,
        retained: &mut Retained,
        cascades: &[Estimator; CHANNELS.len()],
        couplings: &Couplings,
    ) {
        for (index, cascade) in cascades.iter().enumerate() {
            retained.keep_sums(index, &Sums::of(cascade));
        }
        self.records = retained.records();
        self.covariances.take(couplings);
    }

    /// The sums of [`CHANNELS`]`[index]`.
    #[must_use]
    pub fn sums(&self, index: usize) -> Sums {
        self.records.sums(index)
    }

    /// Draws the curve of [`CHANNELS`]`[index]` in its unit.
    #[inline(never)] // so that the sums are not on everybody's stack
    pub fn draw(&self, curve: &mut Curve<OCTAVES>, index: usize, config: Config) {
        self.sums(index).draw(curve, CHANNELS[index], config);
    }

    /// What the channels have in common; `None` if that is not known of all their samples, as after a restart.
    #[must_use]
    pub fn covariances(&self) -> Option<&Covariances> {
        let whole = (0..CHANNELS.len()).all(|index| self.samples(index) == self.covariances.samples);
        whole.then_some(&self.covariances)
    }

    /// Samples of [`CHANNELS`]`[index]`.
    #[must_use]
    pub fn samples(&self, index: usize) -> u64 {
        self.records.samples(index)
    }
}
