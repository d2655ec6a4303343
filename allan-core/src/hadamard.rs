//! Hadamard variance (W. Riley, NIST SP 1065): by third differences of the running sum, on which a linear drift of the
//! rate has no effect.

use crate::cascade::Cascade;
use crate::confidence::{ChiSquareApproximation, Difference};
use crate::interpolation::subtraction_factor;
use crate::list::List;
use crate::noise_type::{OctaveVariance, VarianceFractions, classify};
#[cfg(feature = "serde")]
use crate::serialized::{StateWords, serde_by_words, visit_wide};
use heapless::Vec;

/// One averaging factor of a Hadamard curve.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub struct HadamardPoint {
    /// Averaging factor, samples.
    pub n: u64,
    /// Averaging time, s.
    pub tau: f64,
    /// Hadamard variance `⟨(ȳ₂ − 2ȳ₁ + ȳ₀)²⟩/6`, in the square of the unit of the samples, without
    /// [`interpolation`](Self::interpolation).
    pub hvar: f64,
    /// Variance that was subtracted because replacing missing samples had added it, at most nine tenths of the measured
    /// variance.
    pub interpolation: f64,
    /// Share of the samples that was replaced because it was missing, 0 to 1.
    pub replaced: f64,
    /// Number of squared differences that `hvar` is the mean of.
    pub count: u64,
    /// Differences per averaging time: one is taken every `n/overlap` samples.
    pub overlap: u32,
    /// Equivalent degrees of freedom of `hvar`.
    pub edf: f64,
    /// Lower 95 % bound of `hvar`.
    pub low: f64,
    /// Upper 95 % bound of `hvar`.
    pub high: f64,
}

impl HadamardPoint {
    fn octave_variance(&self) -> OctaveVariance {
        let weight = self.count as f64 / f64::from(self.overlap);
        OctaveVariance { octave: f64::from(self.n.ilog2()), variance: self.hvar, weight }
    }

    fn set_confidence(&mut self, fractions: VarianceFractions) {
        let approximation = ChiSquareApproximation::new(Difference::Third, self.n, self.count, self.overlap, fractions);
        self.edf = subtraction_factor(self.hvar, self.interpolation) * approximation.edf;
        (self.low, self.high) = approximation.bounds(self.hvar, self.interpolation);
    }
}

/// Estimator of the Hadamard variance from the running sums of a [`Cascade`], at every octave but its last.
///
/// A third difference at `n ≥ OVERLAP` is taken every `2n/OVERLAP` samples: half the overlap of the Allan variance.
///
/// ```
/// use allan_core::{Cascade, Hadamard};
///
/// let (mut cascade, mut hadamard) = (Cascade::<12, 8>::new(), Hadamard::<12, 8>::new());
/// for k in 0..10_000 {
///     cascade.push(k % 2 + 5 * k); // an alternation on a steep drift
///     hadamard.observe(&cascade); // after every sample
/// }
/// let drift_free = hadamard.points(&cascade, 1.0);
/// assert_eq!(drift_free[0].hvar, 4.0 / 6.0);
/// assert_eq!(drift_free[10].hvar, 0.0);
/// ```
///
/// # Range
/// The sums of squares of 2⁴⁰ samples within ±2²³ are exact. A sum that overflows 128 bits stays at its maximum, and
/// its octave has no point from then on.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Hadamard<const OCTAVES: usize, const OVERLAP: usize> {
    squares: [u128; OCTAVES],
    counts: [u64; OCTAVES],
}

impl<const OCTAVES: usize, const OVERLAP: usize> Hadamard<OCTAVES, OVERLAP> {
    /// An estimator without samples.
    ///
    /// A cascade without overlap (`OVERLAP` = 1) does not hold the sums that are needed, so this does not compile:
    ///
    /// ```compile_fail,E0080
    /// allan_core::Hadamard::<12, 1>::new();
    /// ```
    #[must_use]
    pub const fn new() -> Self {
        const { assert!(OVERLAP >= 2, "the Hadamard variance needs an OVERLAP of 2 or more") };
        Self { squares: [0; OCTAVES], counts: [0; OCTAVES] }
    }

    /// Adds the third differences that the newest sample completed; called once after each sample.
    ///
    /// # Cost
    /// | `Hadamard::observe` | Cortex-M4F | Cortex-M0+ |
    /// |---|---|---|
    /// | instructions on average | 1,260 | 3,080 |
    /// | stack, bytes | 260 | 284 |
    /// | flash, bytes | 744 | — |
    ///
    /// See [`guide::costs`](crate::guide::costs) for how they are counted.
    pub fn observe(&mut self, cascade: &Cascade<OCTAVES, OVERLAP>) {
        for octave in 0..OCTAVES - 1 {
            let (level, n) = place::<OVERLAP>(octave);
            if !cascade.ends_stride(level) {
                return; // longer averaging times end no stride either
            }
            if cascade.span(octave) < 3 << octave {
                continue;
            }
            let sum = |back| cascade.sum_before(level, back);
            let steps = [cascade.newest_sum(), sum(n), sum(2 * n), sum(3 * n)];
            let [newest, middle, oldest] = [0, 1, 2].map(|k| i128::from(steps[k].wrapping_sub(steps[k + 1])));
            let difference = (newest - 2 * middle + oldest).unsigned_abs();
            self.add(octave, difference * difference, 1);
        }
    }

    /// Adds the sums of the same channel in a later stretch.
    pub fn merge(&mut self, later: &Self) {
        for octave in 0..OCTAVES {
            self.add(octave, later.squares[octave], later.counts[octave]);
        }
    }

    /// The exact sum of squared third differences of sums of `2^octave` samples, in counts², and their number.
    ///
    /// `None` beyond the last octave.
    #[must_use]
    pub fn sum_of_squares(&self, octave: usize) -> Option<(u128, u64)> {
        Some((*self.squares.get(octave)?, *self.counts.get(octave)?))
    }

    /// The Hadamard variance, in counts², of every octave that has at least one difference, shortest first.
    ///
    /// `cascade` must be the observed one, `sample_period` is in seconds.
    ///
    /// # Cost
    /// | `Hadamard::points` | Cortex-M4F | Cortex-M0+ |
    /// |---|---|---|
    /// | instructions | 23.9 million | 73.2 million |
    /// | stack, bytes | 7,150 | 7,110 |
    /// | flash, bytes | 18,700 | — |
    ///
    /// See [`guide::costs`](crate::guide::costs) for how they are counted.
    #[must_use]
    pub fn points(&self, cascade: &Cascade<OCTAVES, OVERLAP>, sample_period: f64) -> List<HadamardPoint, OCTAVES> {
        let mut points = self.points_with(cascade, sample_period, |_| VarianceFractions::WHITE);
        let octaves: Vec<OctaveVariance, OCTAVES> = points.iter().map(HadamardPoint::octave_variance).collect();
        for (at, point) in points.iter_mut().enumerate() {
            point.set_confidence(classify(&octaves, at).variance_fractions());
        }
        points
    }

    /// [`points`](Self::points) with degrees of freedom and bounds from the variance fractions that `fractions` returns
    /// for an averaging factor.
    #[must_use]
    pub fn points_with(
        &self,
        cascade: &Cascade<OCTAVES, OVERLAP>,
        sample_period: f64,
        fractions: impl Fn(u64) -> VarianceFractions,
    ) -> List<HadamardPoint, OCTAVES> {
        let points = (0..OCTAVES).filter_map(|octave| {
            let (square, count) = (self.squares[octave], self.counts[octave]);
            if count == 0 || square == u128::MAX {
                return None;
            }
            let n = 1_u64 << octave;
            let measured = square as f64 / (6.0 * count as f64 * n as f64 * n as f64);
            let added = cascade.bridged_gaps(n).added_variance(Difference::Third, n, cascade.len());
            let interpolation = added.subtracted(measured);
            let mut point = HadamardPoint {
                n,
                tau: n as f64 * sample_period,
                hvar: measured - interpolation,
                interpolation,
                replaced: added.replaced,
                count,
                overlap: place::<OVERLAP>(octave).1 as u32,
                edf: 0.0,
                low: 0.0,
                high: 0.0,
            };
            point.set_confidence(fractions(n));
            Some(point)
        });
        points.collect()
    }

    fn add(&mut self, octave: usize, square: u128, count: u64) {
        self.squares[octave] = self.squares[octave].saturating_add(square);
        self.counts[octave] = self.counts[octave].saturating_add(count);
    }
}

impl<const OCTAVES: usize, const OVERLAP: usize> Default for Hadamard<OCTAVES, OVERLAP> {
    fn default() -> Self {
        Self::new()
    }
}

/// The delay line that serves an octave, and the number of its strides in an averaging time.
const fn place<const OVERLAP: usize>(octave: usize) -> (usize, u64) {
    let fine = OVERLAP.trailing_zeros() as usize;
    let level = (octave + 1).saturating_sub(fine);
    (level, 1 << (octave - level))
}

#[cfg(feature = "serde")]
serde_by_words!(OCTAVES, OVERLAP for Hadamard<OCTAVES, OVERLAP>);

#[cfg(feature = "serde")]
impl<const OCTAVES: usize, const OVERLAP: usize> StateWords for Hadamard<OCTAVES, OVERLAP> {
    const EMPTY: Self = Self::new();
    const KIND: u8 = b'H';
    const OCTAVES: usize = OCTAVES;
    const OVERLAP: usize = OVERLAP;
    const WORDS: usize = OCTAVES * 3;

    fn visit_words<E>(&mut self, mut visit: impl FnMut(&mut u64) -> Result<(), E>) -> Result<(), E> {
        for square in &mut self.squares {
            visit_wide(square, &mut visit)?;
        }
        self.counts.iter_mut().try_for_each(visit)
    }

    fn inconsistency(&self) -> Option<&'static str> {
        let idle = |(square, count): (&u128, &u64)| *count == 0 && *square != 0;
        self.squares.iter().zip(&self.counts).any(idle).then_some("a sum over no differences that is not 0")
    }
}
