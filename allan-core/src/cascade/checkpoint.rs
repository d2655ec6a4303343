//! What was learnt, as plain data: to be stored before a restart and gone on from after it.

use super::{Cascade, Moments};
use crate::curve::{Curve, Point};
use crate::noise_type::Noise;

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
        let mut resumed = Self::new();
        resumed.resume(samples, missing, |octave| learnt[octave]);
        resumed
    }

    /// The same in the place of what there is: `learnt` tells it octave by octave.
    pub fn resume(&mut self, samples: u64, missing: u64, learnt: impl Fn(usize) -> Learnt) {
        self.reset();
        (self.ended, self.missing) = (samples, missing);
        for (octave, place) in self.octaves.iter_mut().enumerate() {
            let Learnt { squares, fourths, count } = learnt(octave);
            place.moments = Moments { squares: squares.into(), fourths: fourths.into() };
            place.differences = count;
        }
    }

    /// Makes `curve` the [`curve`](Self::curve) of an estimator that has `learnt` so much of `samples` samples, without
    /// the estimator.
    pub fn draw(curve: &mut Curve<OCTAVES>, sample_period: f64, samples: u64, learnt: impl Fn(usize) -> Learnt) {
        let points = (0..OCTAVES).map(|octave| (octave, learnt(octave))).filter(|(_, learnt)| learnt.count > 0);
        let point = |(octave, Learnt { squares, fourths, count })| {
            let moments = Moments { squares: squares.into(), fourths: fourths.into() };
            let n = 1_u64 << octave;
            Point::new(n, sample_period, &moments, octave, count, n.min(OVERLAP as u64) as u32, Noise::White)
        };
        curve.take(sample_period, samples, points.map(point));
    }
}
