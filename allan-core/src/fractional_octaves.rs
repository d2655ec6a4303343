//! Allan variance at three averaging factors between octaves, where narrow spectral lines may fall.

use crate::cascade::{Cascade, second_difference};
use crate::confidence::Difference;
use crate::curve::{AllanPoint, Curve};
use crate::moments::Moments;
#[cfg(feature = "serde")]
use crate::serialized::{StateWords, serde_by_words};
use heapless::Vec;

/// Averaging factors of an octave, in quarters of its lower end.
const FACTORS: [u64; 3] = [5, 6, 7];

/// Estimator of the Allan variance at `n = 5·2^i, 6·2^i, 7·2^i` from the running sums of a [`Cascade`], up to its last
/// octave.
///
/// ```
/// use allan_core::{FractionalOctaves, Cascade};
///
/// let (mut cascade, mut fractional) = (Cascade::<12, 8>::new(), FractionalOctaves::<12, 8>::new());
/// for k in 0..10_000 {
///     cascade.push(k * k % 1_009);
///     fractional.observe(&cascade); // after every sample
/// }
/// let curve = fractional.curve::<48>(&cascade, 1.0);
/// assert!(curve.points().iter().map(|point| point.n).take(9).eq([1, 2, 4, 5, 6, 7, 8, 10, 12]));
/// ```
///
/// # Range
/// The range is that of [`Cascade`].
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FractionalOctaves<const OCTAVES: usize, const OVERLAP: usize> {
    moments: [[Moments; FACTORS.len()]; OCTAVES],
    counts: [[u64; FACTORS.len()]; OCTAVES],
}

impl<const OCTAVES: usize, const OVERLAP: usize> FractionalOctaves<OCTAVES, OVERLAP> {
    /// An estimator without samples.
    ///
    /// A cascade with an `OVERLAP` below 8 does not hold the sums that are needed, so this does not compile:
    ///
    /// ```compile_fail,E0080
    /// allan_core::FractionalOctaves::<12, 4>::new();
    /// ```
    #[must_use]
    pub const fn new() -> Self {
        const { assert!(OVERLAP == 8 || OVERLAP == 16, "factors between octaves need an OVERLAP of 8 or 16") };
        Self { moments: [[Moments::ZERO; FACTORS.len()]; OCTAVES], counts: [[0; FACTORS.len()]; OCTAVES] }
    }

    /// Adds the differences that the newest sample completed; called once after each sample.
    ///
    /// # Cost
    /// | `FractionalOctaves::observe` | Cortex-M4F | Cortex-M0+ |
    /// |---|---|---|
    /// | instructions on average | 424 | 900 |
    /// | stack, bytes | 144 | 184 |
    /// | flash, bytes | 1,300 | — |
    ///
    /// See [`guide::costs`](crate::guide::costs) for how they are counted.
    pub fn observe(&mut self, cascade: &Cascade<OCTAVES, OVERLAP>) {
        let newest = cascade.newest_sum();
        for doubling in 0..OCTAVES.saturating_sub(3) {
            if !cascade.ends_stride(level::<OVERLAP>(doubling)) {
                return; // longer averaging times end no stride either
            }
            // A gap is bridged where the octave below bridges it.
            let span = cascade.span(doubling + 2) >> doubling;
            for (k, factor) in FACTORS.into_iter().enumerate() {
                if span >= 2 * factor {
                    let (level, n) = place::<OVERLAP>(doubling, factor);
                    let (middle, oldest) = (cascade.sum_before(level, n), cascade.sum_before(level, 2 * n));
                    self.moments[doubling][k].add(doubling + 2, second_difference(newest, middle, oldest));
                    self.counts[doubling][k] += 1;
                }
            }
        }
    }

    /// Adds the sums of the same channel in a later stretch.
    pub fn merge(&mut self, later: &Self) {
        for doubling in 0..OCTAVES {
            for k in 0..FACTORS.len() {
                self.moments[doubling][k].merge(&later.moments[doubling][k]);
                self.counts[doubling][k] = self.counts[doubling][k].saturating_add(later.counts[doubling][k]);
            }
        }
    }

    /// The exact sum of squared second differences of sums of `n` samples, in counts², and their number.
    ///
    /// `None` unless `n` is 5, 6 or 7 times a power of two within range.
    #[must_use]
    pub fn sum_of_squares(&self, n: u64) -> Option<(u128, u64)> {
        let doubling = (n / 4).checked_ilog2()? as usize;
        let k = FACTORS.into_iter().position(|factor| factor << doubling == n)?;
        Some((self.moments.get(doubling)?[k].squares.get(), self.counts.get(doubling)?[k]))
    }

    /// The curve, in counts², of `cascade`, which must be the observed one, with these points between its octaves.
    ///
    /// `sample_period` is in seconds; `POINTS` must be `4·OCTAVES` or more. Neighbouring points are strongly
    /// correlated: the bounds of a [`fit`](crate::fit::fit) hold for curves of octaves only.
    ///
    /// # Cost
    /// | `FractionalOctaves::curve` | Cortex-M4F | Cortex-M0+ |
    /// |---|---|---|
    /// | instructions | 44.4 million | 134 million |
    /// | stack, bytes | 32,300 | 32,200 |
    /// | flash, bytes | 23,000 | — |
    ///
    /// See [`guide::costs`](crate::guide::costs) for how they are counted.
    #[must_use]
    pub fn curve<const POINTS: usize>(&self, cascade: &Cascade<OCTAVES, OVERLAP>, sample_period: f64) -> Curve<POINTS> {
        const { assert!(POINTS >= 4 * OCTAVES, "POINTS must be 4·OCTAVES or more") };
        let octaves = cascade.curve(sample_period);
        let mut points = Vec::new();
        for point in octaves.points() {
            let doubling = (point.n.ilog2() as usize).checked_sub(2);
            let between = doubling.into_iter().flat_map(|doubling| {
                (0..FACTORS.len()).filter_map(move |k| self.point(doubling, k, point, cascade, sample_period))
            });
            points.extend(core::iter::once(*point).chain(between));
        }
        Curve::from_classified(sample_period, cascade.len(), points)
    }

    fn point(
        &self,
        doubling: usize,
        k: usize,
        octave: &AllanPoint,
        cascade: &Cascade<OCTAVES, OVERLAP>,
        sample_period: f64,
    ) -> Option<AllanPoint> {
        let (moments, count) = (&self.moments[doubling][k], self.counts[doubling][k]);
        let n = FACTORS[k] << doubling;
        let overlap = place::<OVERLAP>(doubling, FACTORS[k]).1 as u32;
        let point = || AllanPoint::new(n, sample_period, moments, doubling + 2, count, overlap, octave.power_law);
        let added = || cascade.bridged_gaps(octave.n).added_variance(Difference::Second, n, cascade.len());
        (count > 0).then(|| point().without(added()))
    }
}

impl<const OCTAVES: usize, const OVERLAP: usize> Default for FractionalOctaves<OCTAVES, OVERLAP> {
    fn default() -> Self {
        Self::new()
    }
}

/// The level whose delay line serves averaging times of 5, 6 and 7 times `2^doubling` samples.
const fn level<const OVERLAP: usize>(doubling: usize) -> usize {
    doubling.saturating_sub(OVERLAP.trailing_zeros() as usize - 3)
}

/// The [`level`], and the number of its strides in `factor·2^doubling` samples.
const fn place<const OVERLAP: usize>(doubling: usize, factor: u64) -> (usize, u64) {
    let level = level::<OVERLAP>(doubling);
    (level, factor << (doubling - level))
}

#[cfg(feature = "serde")]
serde_by_words!(OCTAVES, OVERLAP for FractionalOctaves<OCTAVES, OVERLAP>);

#[cfg(feature = "serde")]
impl<const OCTAVES: usize, const OVERLAP: usize> StateWords for FractionalOctaves<OCTAVES, OVERLAP> {
    const EMPTY: Self = Self::new();
    const KIND: u8 = b'B';
    const OCTAVES: usize = OCTAVES;
    const OVERLAP: usize = OVERLAP;
    const WORDS: usize = OCTAVES * FACTORS.len() * 5;

    fn visit_words<E>(&mut self, mut visit: impl FnMut(&mut u64) -> Result<(), E>) -> Result<(), E> {
        for Moments { squares, fourths } in self.moments.as_flattened_mut() {
            squares.words().into_iter().try_for_each(&mut visit)?;
            fourths.words().into_iter().try_for_each(&mut visit)?;
        }
        self.counts.as_flattened_mut().iter_mut().try_for_each(visit)
    }

    fn inconsistency(&self) -> Option<&'static str> {
        let idle = |(moments, count): (&Moments, &u64)| *count == 0 && *moments != Moments::ZERO;
        let mut sums = self.moments.as_flattened().iter().zip(self.counts.as_flattened());
        sums.any(idle).then_some("a sum over no differences that is not 0")
    }
}
