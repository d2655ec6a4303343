//! The sums of a cascade as plain data: restored, turned into a curve, or serialised.

use super::{Cascade, Octave};
use crate::confidence::Difference;
use crate::curve::{AllanPoint, Curve};
use crate::interpolation::{AddedVariance, BridgedGaps, Interpolation};
use crate::math::{Real, times_power_of_two};
use crate::moments::Moments;
use crate::noise_type::PowerLaw;
#[cfg(feature = "serde")]
use crate::serialized::{StateWords, serde_by_words, visit_signed};

/// The exact sums of one octave of a [`Cascade`].
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct OctaveSums {
    /// Sum of the squared second differences, counts².
    pub squares: u128,
    /// Sum of the fourth powers of the second differences, each rounded as the range of [`Cascade`] says.
    pub fourths: u128,
    /// Number of differences.
    pub count: u64,
    /// The gaps that this octave bridges and the octave before does not.
    pub interpolation: Interpolation,
}

impl OctaveSums {
    pub(super) const EMPTY: Self = Self { squares: 0, fourths: 0, count: 0, interpolation: Interpolation::NONE };
}

impl<const OCTAVES: usize, const OVERLAP: usize> Cascade<OCTAVES, OVERLAP> {
    /// The Allan variance, in counts², of every octave that has at least one difference, shortest first.
    ///
    /// `sample_period` is in seconds. Degrees of freedom and 95 % bounds are those of the power law that dominates at
    /// each point; a [`fit`](crate::fit::fit) uses the fitted mixture of noises instead.
    ///
    /// # Cost
    /// | `Cascade::curve` | Cortex-M4F | Cortex-M0+ |
    /// |---|---|---|
    /// | instructions | 6.7 million | 20.4 million |
    /// | stack, bytes | 1,896 | 2,100 |
    /// | flash, bytes | 19,700 | — |
    ///
    /// See [`guide::costs`](crate::guide::costs) for how they are counted.
    #[must_use]
    pub fn curve(&self, sample_period: f64) -> Curve<OCTAVES> {
        let mut curve = Curve::empty();
        Self::rebuild_curve(&mut curve, sample_period, self.len(), |octave| {
            self.octave_sums(octave).unwrap_or_default()
        });
        curve
    }

    /// The sums at `n = 2^octave`; `None` beyond the last octave.
    #[must_use]
    pub fn octave_sums(&self, octave: usize) -> Option<OctaveSums> {
        let Octave { moments, interpolation, .. } = *self.octaves.get(octave)?;
        let (squares, fourths) = (moments.squares.get(), moments.fourths.get());
        Some(OctaveSums { squares, fourths, count: self.count(octave), interpolation })
    }

    /// Replaces the state by one with these sums of `samples` samples; `missing` more were missing.
    ///
    /// `sums` returns the [`octave_sums`](Self::octave_sums) of an octave, which are not checked. No difference contains
    /// samples from before and after this call.
    ///
    /// # Cost
    /// | `Cascade::restore` | Cortex-M4F | Cortex-M0+ |
    /// |---|---|---|
    /// | instructions | 4,280 | 7,520 |
    /// | stack, bytes | 72 | 120 |
    /// | flash, bytes | 180 | — |
    ///
    /// See [`guide::costs`](crate::guide::costs) for how they are counted.
    pub fn restore(&mut self, samples: u64, missing: u64, sums: impl Fn(usize) -> OctaveSums) {
        self.reset();
        (self.ended, self.missing) = (samples, missing);
        for (index, octave) in self.octaves.iter_mut().enumerate() {
            let OctaveSums { squares, fourths, count, interpolation } = sums(index);
            octave.moments = Moments { squares: squares.into(), fourths: fourths.into() };
            (octave.differences, octave.interpolation) = (count, interpolation);
        }
    }

    /// The Allan variance of one octave, in counts², as in [`curve`](Self::curve); `None` beyond the last octave and
    /// without differences.
    ///
    /// # Cost
    /// | `Cascade::allan_variance` | Cortex-M4F | Cortex-M0+ |
    /// |---|---|---|
    /// | instructions | 3,160 | 6,880 |
    /// | stack, bytes | 436 | 452 |
    /// | flash, bytes | 4,740 | — |
    ///
    /// See [`guide::costs`](crate::guide::costs) for how they are counted.
    #[must_use]
    pub fn allan_variance(&self, octave: usize) -> Option<f64> {
        let OctaveSums { squares, count, .. } = self.octave_sums(octave).filter(|sums| sums.count > 0)?;
        let n = 1_u64 << octave;
        let measured = squares as f64 / (2.0 * count as f64 * n as f64 * n as f64);
        let added = self.bridged_gaps(n).added_variance(Difference::Second, n, self.len());
        Some(measured - added.subtracted(measured))
    }

    /// The [`curve`](Self::curve) without confidence: less flash, and a small part of the instructions.
    ///
    /// `sample_period` is in seconds. Variances have a relative error below 10⁻⁶, bounds of 0 and infinity, no kurtosis,
    /// and white noise as their type; the degrees of freedom are a lower limit. A [`fit`](crate::fit::fit) gives nearly
    /// the same coefficients from both curves.
    ///
    /// # Cost
    /// | `Cascade::curve_without_confidence` | Cortex-M4F | Cortex-M0+ |
    /// |---|---|---|
    /// | instructions | 18,500 | 50,800 |
    /// | stack, bytes | 520 | 556 |
    /// | flash, bytes | 1,760 | — |
    ///
    /// See [`guide::costs`](crate::guide::costs) for how they are counted.
    #[must_use]
    pub fn curve_without_confidence(&self, sample_period: f64) -> Curve<OCTAVES> {
        let mut curve = Curve::empty();
        Self::rebuild_without_confidence(&mut curve, sample_period, self.len(), |octave| {
            self.octave_sums(octave).unwrap_or_default()
        });
        curve
    }

    /// Makes `curve` the [`curve_without_confidence`](Self::curve_without_confidence) of `samples` samples every
    /// `sample_period` seconds, with the octave sums that `sums` returns.
    pub fn rebuild_without_confidence(
        curve: &mut Curve<OCTAVES>,
        sample_period: f64,
        samples: u64,
        sums: impl Fn(usize) -> OctaveSums,
    ) {
        let points = Self::points(samples, sums, |octave, sums, overlap, added: AddedVariance<f32>| {
            let n = 1_u64 << octave;
            // One division per factor keeps every intermediate value within the range of single precision.
            let measured = sums.squares as f32 / sums.count as f32 / n as f32 / (2 * n) as f32;
            let interpolation = added.subtracted(measured);
            AllanPoint {
                tau: times_power_of_two(sample_period, octave as u32),
                avar: f64::from(measured - interpolation),
                interpolation: interpolation.into(),
                replaced: added.replaced.into(),
                ..AllanPoint::without_confidence(n, sums.count, overlap)
            }
        });
        curve.fill_without_confidence(sample_period, samples, points);
    }

    /// Makes `curve` the [`curve`](Self::curve) of `samples` samples every `sample_period` seconds, with the octave sums
    /// that `sums` returns.
    pub fn rebuild_curve(
        curve: &mut Curve<OCTAVES>,
        sample_period: f64,
        samples: u64,
        sums: impl Fn(usize) -> OctaveSums,
    ) {
        let points = Self::points(samples, sums, |octave, sums, overlap, added: AddedVariance| {
            let moments = Moments { squares: sums.squares.into(), fourths: sums.fourths.into() };
            AllanPoint::new(1 << octave, sample_period, &moments, octave, sums.count, overlap, PowerLaw::White)
                .without(added)
        });
        curve.fill(sample_period, samples, points);
    }

    fn points<F: Real>(
        samples: u64,
        sums: impl Fn(usize) -> OctaveSums,
        point: impl Fn(usize, &OctaveSums, u32, AddedVariance<F>) -> AllanPoint,
    ) -> impl Iterator<Item = AllanPoint> {
        let mut gaps = BridgedGaps::new(F::constant(0.0));
        (0..OCTAVES).filter_map(move |octave| {
            let sums = sums(octave);
            let n = 1_u64 << octave;
            if octave == 0 && sums.count > 0 {
                gaps = BridgedGaps::new(F::from_integer(sums.squares) / (F::constant(2.0) * F::from_word(sums.count)));
            }
            gaps.add(&sums.interpolation, n, 1 << Self::SHORTEST_BRIDGING);
            let overlap = n.min(OVERLAP as u64) as u32;
            let added = gaps.added_variance(Difference::Second, n, samples);
            (sums.count > 0).then(|| point(octave, &sums, overlap, added))
        })
    }

    pub(crate) fn bridged_gaps(&self, n: u64) -> BridgedGaps {
        let Moments { squares, .. } = self.octaves[0].moments;
        let mut gaps = BridgedGaps::new(squares.get() as f64 / (2.0 * self.count(0).max(1) as f64));
        for (k, octave) in self.octaves.iter().enumerate().take_while(|&(k, _)| 1 << k <= n) {
            gaps.add(&octave.interpolation, 1 << k, 1 << Self::SHORTEST_BRIDGING);
        }
        gaps
    }
}

#[cfg(feature = "serde")]
impl<const OCTAVES: usize, const OVERLAP: usize> Cascade<OCTAVES, OVERLAP> {
    /// Replaces the state by a serialised one, without a second estimator on the stack. After an error the estimator is empty.
    ///
    /// # Cost
    /// | `Cascade::read_serialized` | Cortex-M4F | Cortex-M0+ |
    /// |---|---|---|
    /// | instructions | 53,200 | 83,600 |
    /// | stack, bytes | 208 | 280 |
    /// | flash, bytes | 3,430 | — |
    ///
    /// See [`guide::costs`](crate::guide::costs) for how they are counted.
    ///
    /// # Errors
    /// The state has another version, type or size, a wrong checksum, or values that no samples lead to.
    pub fn read_serialized<'de, D: serde::Deserializer<'de>>(&mut self, deserializer: D) -> Result<(), D::Error> {
        crate::serialized::deserialize_in_place(deserializer, self)
    }

    /// True if a serialised state has the version and the size of this type and a correct checksum.
    ///
    /// # Errors
    /// The state has another version, type or size, or a wrong checksum.
    pub fn check_serialized<'de, D: serde::Deserializer<'de>>(deserializer: D) -> Result<(), D::Error> {
        crate::serialized::check::<Self, D>(deserializer)
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
    const WORDS: usize = 8 + OVERLAP + OCTAVES * (4 + 1 + OVERLAP + 2 + 3);

    fn visit_words<E>(&mut self, mut visit: impl FnMut(&mut u64) -> Result<(), E>) -> Result<(), E> {
        let mut settling = u64::from(self.settling);
        let times = [&mut self.elapsed, &mut settling, &mut self.resumed];
        let samples = [&mut self.ended, &mut self.missing, &mut self.absent, &mut self.pending];
        times.into_iter().chain(samples).try_for_each(&mut visit)?;
        self.settling = settling as u32;
        for sum in [&mut self.sum].into_iter().chain(&mut self.recent) {
            visit_signed(sum, &mut visit)?;
        }
        for octave in &mut self.octaves {
            let Moments { squares, fourths } = &mut octave.moments;
            squares.words().into_iter().chain(fourths.words()).try_for_each(&mut visit)?;
            for sum in [&mut octave.oldest].into_iter().chain(&mut octave.line) {
                visit_signed(sum, &mut visit)?;
            }
            visit(&mut octave.resumed)?;
            visit(&mut octave.differences)?;
            octave.interpolation.visit_words(&mut visit)?;
        }
        Ok(())
    }

    fn inconsistency(&self) -> Option<&'static str> {
        let Some(periods) = self.ended.checked_add(self.elapsed).filter(|&periods| periods < 1 << 63) else {
            return Some("more samples than can be counted");
        };
        if self.absent > self.resumed || self.resumed > self.elapsed {
            return Some("a gap after the newest sample");
        }
        if self.settling != self.settling_time() {
            return Some("octaves that leave out other differences than the gaps say");
        }
        if self.recent[Self::slot(self.elapsed)] != self.sum {
            return Some("the newest running sum is not the running sum");
        }
        for (k, octave) in self.octaves.iter().enumerate() {
            // The sums of steps before the first sample are 0.
            let step = self.elapsed >> k.saturating_sub(Self::FINE);
            let empty = |back: u64| step <= back && octave.line[Self::slot(step.wrapping_sub(back))] != 0;
            if (OVERLAP as u64..2 * OVERLAP as u64).any(empty) {
                return Some("running sums from before the first sample");
            }
            if octave.resumed > self.resumed {
                return Some("a gap after the newest sample");
            }
            let count = octave.differences.checked_add(Self::open_differences(self.elapsed, k, octave.resumed));
            if count.is_none_or(|count| count > periods) {
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
