//! The sums of a cascade as plain data: restored into an estimator, turned into a curve, or serialised with the delay
//! lines.

use super::Cascade;
use crate::curve::{AllanPoint, Curve};
use crate::moments::Moments;
use crate::noise_type::PowerLaw;
#[cfg(feature = "serde")]
use crate::serialized::{StateWords, serde_by_words, visit_signed};

/// The exact sums of one octave of a [`Cascade`].
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct OctaveSums {
    /// Sum of the squared second differences, counts².
    pub squares: u128,
    /// Sum of the fourth powers of the second differences, each rounded as the range of [`Cascade`] says.
    pub fourths: u128,
    /// Number of differences.
    pub count: u64,
}

impl<const OCTAVES: usize, const OVERLAP: usize> Cascade<OCTAVES, OVERLAP> {
    /// The sums of an octave; `None` beyond the last.
    #[must_use]
    pub fn octave_sums(&self, octave: usize) -> Option<OctaveSums> {
        let Moments { squares, fourths } = self.octaves.get(octave)?.moments;
        Some(OctaveSums { squares: squares.get(), fourths: fourths.get(), count: self.count(octave) })
    }

    /// Replaces the state by one with these sums of `samples` samples, of which `missing` more were missing.
    ///
    /// `sums` returns the [`octave_sums`](Self::octave_sums) of an octave. The delay lines are empty, as after a gap.
    pub fn restore(&mut self, samples: u64, missing: u64, sums: impl Fn(usize) -> OctaveSums) {
        self.reset();
        (self.ended, self.missing) = (samples, missing);
        for (index, octave) in self.octaves.iter_mut().enumerate() {
            let OctaveSums { squares, fourths, count } = sums(index);
            octave.moments = Moments { squares: squares.into(), fourths: fourths.into() };
            octave.differences = count;
        }
    }

    /// The Allan variance, in counts², of every octave that has at least one difference.
    ///
    /// `sample_period` in seconds. The confidence is that of the power law that the local slope suggests; a
    /// [`fit`](crate::fit::fit) gives the confidence of the fitted mixture of noises.
    #[must_use]
    pub fn curve(&self, sample_period: f64) -> Curve<OCTAVES> {
        let mut curve = Curve::empty();
        Self::rebuild_curve(&mut curve, sample_period, self.len(), |octave| {
            self.octave_sums(octave).unwrap_or_default()
        });
        curve
    }

    /// Makes `curve` the [`curve`](Self::curve) of an estimator with these sums of `samples` samples, without the
    /// estimator. `sums` returns the sums of an octave.
    pub fn rebuild_curve(
        curve: &mut Curve<OCTAVES>,
        sample_period: f64,
        samples: u64,
        sums: impl Fn(usize) -> OctaveSums,
    ) {
        let octaves = (0..OCTAVES).map(|octave| (octave, sums(octave))).filter(|(_, sums)| sums.count > 0);
        let point = |(octave, OctaveSums { squares, fourths, count })| {
            let moments = Moments { squares: squares.into(), fourths: fourths.into() };
            let n = 1_u64 << octave;
            AllanPoint::new(n, sample_period, &moments, octave, count, n.min(OVERLAP as u64) as u32, PowerLaw::White)
        };
        curve.fill(sample_period, samples, octaves.map(point));
    }
}

#[cfg(feature = "serde")]
serde_by_words!(OCTAVES, OVERLAP for Cascade<OCTAVES, OVERLAP>);

#[cfg(feature = "serde")]
impl<const OCTAVES: usize, const OVERLAP: usize> StateWords for Cascade<OCTAVES, OVERLAP> {
    const EMPTY: Self = Self::new();
    const KIND: u8 = b'A';
    const OCTAVES: usize = OCTAVES;
    const OVERLAP: usize = OVERLAP;
    const WORDS: usize = 4 + OVERLAP + OCTAVES * (4 + 1 + OVERLAP + 1);

    fn visit_words<E>(&mut self, mut visit: impl FnMut(&mut u64) -> Result<(), E>) -> Result<(), E> {
        visit(&mut self.ended)?;
        visit(&mut self.missing)?;
        visit(&mut self.elapsed)?;
        for sum in [&mut self.sum].into_iter().chain(&mut self.recent) {
            visit_signed(sum, &mut visit)?;
        }
        for octave in &mut self.octaves {
            let Moments { squares, fourths } = &mut octave.moments;
            squares.words().into_iter().chain(fourths.words()).try_for_each(&mut visit)?;
            for sum in [&mut octave.oldest].into_iter().chain(&mut octave.line) {
                visit_signed(sum, &mut visit)?;
            }
            visit(&mut octave.differences)?;
        }
        Ok(())
    }

    fn inconsistency(&self) -> Option<&'static str> {
        let Some(samples) = self.ended.checked_add(self.elapsed) else {
            return Some("more samples than can be counted");
        };
        if self.recent[Self::slot(self.elapsed)] != self.sum {
            return Some("the newest running sum is not the running sum");
        }
        for (k, octave) in self.octaves.iter().enumerate() {
            // Sums of steps up to the start of the stretch are 0.
            let step = self.elapsed >> k.saturating_sub(Self::FINE);
            let empty = |back: u64| step <= back && octave.line[Self::slot(step.wrapping_sub(back))] != 0;
            if (OVERLAP as u64..2 * OVERLAP as u64).any(empty) {
                return Some("running sums from before the first sample");
            }
            let count = octave.differences.checked_add(self.open_differences(k));
            if count.is_none_or(|count| count > samples) {
                return Some("more differences than samples");
            }
            let no_sum = octave.moments.squares == Moments::ZERO.squares || count == Some(0);
            if no_sum && octave.moments != Moments::ZERO {
                return Some("a sum over no differences that is not 0");
            }
        }
        None
    }
}
