//! What was learnt, as plain data: to be stored before a restart and gone on from after it.

use super::{Cascade, Moments};

/// What an estimator has learnt at one octave, exactly.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Learnt {
    /// Sum of the squared second differences, counts².
    pub squares: u128,
    /// Sum of their fourth powers, in the unit that the kurtosis is made of.
    pub fourths: u128,
    /// How many there were.
    pub count: u64,
}

impl<const OCTAVES: usize, const OVERLAP: usize> Cascade<OCTAVES, OVERLAP> {
    /// What was learnt at an octave; `None` beyond the last.
    #[must_use]
    pub fn learnt(&self, octave: usize) -> Option<Learnt> {
        let Moments { squares, fourths } = self.octaves.get(octave)?.moments;
        Some(Learnt { squares: squares.get(), fourths: fourths.get(), count: self.count(octave) })
    }

    /// An estimator that goes on, as after a gap, from what one had [`learnt`](Self::learnt) of `samples` samples with
    /// `missing` missing.
    #[must_use]
    pub fn resumed(samples: u64, missing: u64, learnt: &[Learnt; OCTAVES]) -> Self {
        let mut resumed = Self { ended: samples, missing, ..Self::new() };
        for (octave, &Learnt { squares, fourths, count }) in resumed.octaves.iter_mut().zip(learnt) {
            octave.moments = Moments { squares: squares.into(), fourths: fourths.into() };
            octave.differences = count;
        }
        resumed
    }
}
