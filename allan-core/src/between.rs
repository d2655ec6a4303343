//! Averaging factors between the octaves, which make a narrow line visible.

#[cfg(feature = "serde")]
mod state;

use crate::Cascade;
use crate::cascade::{Moments, second_difference};
use crate::curve::{Curve, Point};
use crate::noise_type::Noise;
use heapless::Vec;

/// Factors to an octave: 5, 6 and 7 quarters of its lower end.
const FACTORS: [u64; 3] = [5, 6, 7];

/// Allan variance at `n = 5·2^i, 6·2^i, 7·2^i` from the running sums that a [`Cascade`] holds, up to its last octave.
///
/// ```
/// use allan_core::{Between, Cascade};
///
/// let (mut cascade, mut between) = (Cascade::<12, 8>::new(), Between::<12, 8>::new());
/// for k in 0..10_000 {
///     cascade.push(k * k % 1_009);
///     between.observe(&cascade); // after every sample
/// }
/// let curve = between.curve::<48>(&cascade, 1.0);
/// assert!(curve.points().iter().map(|point| point.n).take(9).eq([1, 2, 4, 5, 6, 7, 8, 10, 12]));
/// ```
///
/// # Range
/// As of [`Cascade`].
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Between<const OCTAVES: usize, const OVERLAP: usize> {
    moments: [[Moments; FACTORS.len()]; OCTAVES],
    counts: [[u64; FACTORS.len()]; OCTAVES],
}

impl<const OCTAVES: usize, const OVERLAP: usize> Between<OCTAVES, OVERLAP> {
    /// One that has seen nothing.
    ///
    /// An `OVERLAP` below 8 has no sums to make them from and does not compile:
    ///
    /// ```compile_fail,E0080
    /// allan_core::Between::<12, 4>::new();
    /// ```
    #[must_use]
    pub const fn new() -> Self {
        const { assert!(OVERLAP == 8 || OVERLAP == 16, "in-between factors need an OVERLAP of 8 or 16") };
        Self { moments: [[Moments::NONE; FACTORS.len()]; OCTAVES], counts: [[0; FACTORS.len()]; OCTAVES] }
    }

    /// Takes the differences that the newest sample completed. To be called once after each.
    pub fn observe(&mut self, cascade: &Cascade<OCTAVES, OVERLAP>) {
        for doubling in 0..OCTAVES.saturating_sub(3) {
            for (k, factor) in FACTORS.into_iter().enumerate() {
                let (level, n) = place::<OVERLAP>(doubling, factor);
                if !cascade.has(level, 2 * n) {
                    return; // longer ones are not complete either
                }
                let [newest, middle, oldest] = [0, n, 2 * n].map(|back| cascade.sum_before(level, back));
                self.moments[doubling][k].add(doubling + 2, second_difference(newest, middle, oldest));
                self.counts[doubling][k] += 1;
            }
        }
    }

    /// Adds what was learnt of the same channel in a later stretch.
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

    /// The curve of `cascade`, which is the one that was observed, with the in-between factors in their places.
    ///
    /// `POINTS` is what it can hold, `4·OCTAVES` or more. An in-between point takes its noise type from the octave
    /// below. Its neighbours are correlated much more than octaves are: the fit's intervals are for octaves only.
    #[must_use]
    pub fn curve<const POINTS: usize>(&self, cascade: &Cascade<OCTAVES, OVERLAP>, sample_period: f64) -> Curve<POINTS> {
        const { assert!(POINTS >= 4 * OCTAVES, "POINTS must be 4·OCTAVES or more") };
        let octaves = cascade.curve(sample_period);
        let mut points = Vec::new();
        for point in octaves.points() {
            let between = (point.n.ilog2() as usize).checked_sub(2);
            let between = between.into_iter().flat_map(|doubling| {
                (0..FACTORS.len()).filter_map(move |k| self.point(doubling, k, point.noise, sample_period))
            });
            points.extend(core::iter::once(*point).chain(between));
        }
        Curve::of_named(sample_period, cascade.len(), points)
    }

    fn point(&self, doubling: usize, k: usize, noise: Noise, sample_period: f64) -> Option<Point> {
        let (moments, count) = (&self.moments[doubling][k], self.counts[doubling][k]);
        let n = FACTORS[k] << doubling;
        let overlap = place::<OVERLAP>(doubling, FACTORS[k]).1 as u32;
        (count > 0).then(|| Point::new(n, sample_period, moments, doubling + 2, count, overlap, noise))
    }
}

impl<const OCTAVES: usize, const OVERLAP: usize> Default for Between<OCTAVES, OVERLAP> {
    fn default() -> Self {
        Self::new()
    }
}

/// Level of delay line, and strides of it to an averaging time of `factor·2^doubling` samples.
const fn place<const OVERLAP: usize>(doubling: usize, factor: u64) -> (usize, u64) {
    let fine = OVERLAP.trailing_zeros() as usize - 3;
    let level = doubling.saturating_sub(fine);
    (level, factor << (doubling - level))
}
