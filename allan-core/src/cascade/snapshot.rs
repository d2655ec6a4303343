//! A copy of the sums of a cascade, to be taken where there is little time.

use super::Cascade;
use crate::cascade::checkpoint::OctaveSums;
use crate::curve::Curve;

/// The sums of a [`Cascade`] at one time, without its delay lines: what a curve is made of.
///
/// `16 + 64·OCTAVES` bytes, copied without floating-point arithmetic: an interrupt's estimator is copied with the
/// interrupt disabled, and the curve made with it enabled; see [`guide::interrupts`](crate::guide::interrupts).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Snapshot<const OCTAVES: usize, const OVERLAP: usize> {
    samples: u64,
    missing: u64,
    sums: [OctaveSums; OCTAVES],
}

impl<const OCTAVES: usize, const OVERLAP: usize> Snapshot<OCTAVES, OVERLAP> {
    /// The sums of no samples, to be filled in place by [`Cascade::snapshot_into`].
    #[must_use]
    pub const fn empty() -> Self {
        Self { samples: 0, missing: 0, sums: [OctaveSums::EMPTY; OCTAVES] }
    }

    /// [`Cascade::len`] at the time of the snapshot.
    #[must_use]
    pub const fn len(&self) -> u64 {
        self.samples
    }

    /// True if no sample had been taken.
    #[must_use]
    pub const fn is_empty(&self) -> bool {
        self.samples == 0
    }

    /// [`Cascade::missing`] at the time of the snapshot.
    #[must_use]
    pub const fn missing(&self) -> u64 {
        self.missing
    }

    /// The sums of each octave, as [`Cascade::octave_sums`].
    #[must_use]
    pub const fn octaves(&self) -> &[OctaveSums] {
        &self.sums
    }

    /// [`Cascade::curve`] at the time of the snapshot, bit for bit; `sample_period` is in seconds.
    #[must_use]
    pub fn curve(&self, sample_period: f64) -> Curve<OCTAVES> {
        let mut curve = Curve::empty();
        Cascade::<OCTAVES, OVERLAP>::rebuild_curve(&mut curve, sample_period, self.samples, |octave| {
            self.sums_of(octave)
        });
        curve
    }

    /// [`Cascade::curve_without_confidence`] at the time of the snapshot, bit for bit; `sample_period` is in seconds.
    #[must_use]
    pub fn curve_without_confidence(&self, sample_period: f64) -> Curve<OCTAVES> {
        let mut curve = Curve::empty();
        Cascade::<OCTAVES, OVERLAP>::rebuild_without_confidence(&mut curve, sample_period, self.samples, |octave| {
            self.sums_of(octave)
        });
        curve
    }

    fn sums_of(&self, octave: usize) -> OctaveSums {
        self.sums.get(octave).copied().unwrap_or_default()
    }
}

impl<const OCTAVES: usize, const OVERLAP: usize> Cascade<OCTAVES, OVERLAP> {
    /// Copies the sums.
    #[must_use]
    pub fn snapshot(&self) -> Snapshot<OCTAVES, OVERLAP> {
        let mut snapshot = Snapshot::empty();
        self.snapshot_into(&mut snapshot);
        snapshot
    }

    /// Copies the sums into `snapshot`, without a second copy on the stack.
    ///
    /// # Cost
    /// | `Cascade::snapshot_into` | Cortex-M4F | Cortex-M0+ |
    /// |---|---|---|
    /// | instructions | 2,600 | 4,320 |
    /// | stack, bytes | 60 | 80 |
    /// | flash, bytes | 452 | — |
    ///
    /// See [`guide::costs`](crate::guide::costs) for how they are counted.
    pub fn snapshot_into(&self, snapshot: &mut Snapshot<OCTAVES, OVERLAP>) {
        (snapshot.samples, snapshot.missing) = (self.len(), self.missing());
        for (octave, sums) in snapshot.sums.iter_mut().enumerate() {
            *sums = self.octave_sums(octave).unwrap_or_default();
        }
    }
}
