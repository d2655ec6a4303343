//! Hadamard variance: third differences, which a drift of the rate leaves alone.

#[cfg(feature = "serde")]
mod state;

use crate::Cascade;
use crate::confidence::{Difference, Law, Shares};
use crate::noise_type::{Level, identify};
use heapless::Vec;

/// One averaging factor of a Hadamard curve.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HadamardPoint {
    /// Averaging factor, samples.
    pub n: u64,
    /// Averaging time, s.
    pub tau: f64,
    /// Hadamard variance `⟨(ȳ₂ − 2ȳ₁ + ȳ₀)²⟩/6`, in the square of the unit of the samples.
    pub hvar: f64,
    /// Squared differences that `hvar` is the mean of.
    pub count: u64,
    /// Differences per averaging time: the stride between them is `n/overlap` samples.
    pub overlap: u32,
    /// Equivalent degrees of freedom of `hvar`.
    pub edf: f64,
    /// Lower 95 % bound of `hvar`.
    pub low: f64,
    /// Upper 95 % bound of `hvar`.
    pub high: f64,
}

impl HadamardPoint {
    fn level(&self) -> Level {
        let weight = self.count as f64 / f64::from(self.overlap);
        Level { octave: f64::from(self.n.ilog2()), variance: self.hvar, weight }
    }

    fn set_confidence(&mut self, shares: Shares) {
        let law = Law::new(Difference::Third, self.n, self.count, self.overlap, shares);
        self.edf = law.edf;
        (self.low, self.high) = law.bounds(self.hvar);
    }
}

/// Hadamard variance from the running sums that a [`Cascade`] holds, at every octave but its last.
///
/// A third difference at `n ≥ OVERLAP` reaches back three averaging times, which the next coarser delay line holds: so
/// it comes every `2n/OVERLAP` samples, half the overlap of the Allan variance.
///
/// ```
/// use allan_core::{Cascade, Hadamard};
///
/// let (mut cascade, mut hadamard) = (Cascade::<12, 8>::new(), Hadamard::<12, 8>::new());
/// for k in 0..10_000 {
///     cascade.push(k % 2 + 5 * k); // an alternation on a steep drift
///     hadamard.observe(&cascade); // after every sample
/// }
/// let drift_free = hadamard.points(1.0);
/// assert_eq!(drift_free[0].hvar, 4.0 / 6.0);
/// assert_eq!(drift_free[10].hvar, 0.0);
/// ```
///
/// # Range
/// Exact like the Cascade's sums: third differences of samples within ±2²³ stay below `2²⁵·n`, twice second ones, and
/// come half as often, so 2⁴⁰ samples leave their squares below 2¹¹⁶. Beyond 128 bits a sum stays at its maximum and
/// has no point any more.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Hadamard<const OCTAVES: usize, const OVERLAP: usize> {
    squares: [u128; OCTAVES],
    counts: [u64; OCTAVES],
}

impl<const OCTAVES: usize, const OVERLAP: usize> Hadamard<OCTAVES, OVERLAP> {
    /// One that has seen nothing.
    ///
    /// An estimator without overlap (`OVERLAP` = 1) does not hold the sums and does not compile:
    ///
    /// ```compile_fail,E0080
    /// allan_core::Hadamard::<12, 1>::new();
    /// ```
    #[must_use]
    pub const fn new() -> Self {
        const { assert!(OVERLAP >= 2, "the Hadamard variance needs an OVERLAP of 2 or more") };
        Self { squares: [0; OCTAVES], counts: [0; OCTAVES] }
    }

    /// Takes the third differences that the newest sample completed. To be called once after each.
    pub fn observe(&mut self, cascade: &Cascade<OCTAVES, OVERLAP>) {
        for octave in 0..OCTAVES - 1 {
            let (level, n) = place::<OVERLAP>(octave);
            if !cascade.has(level, 3 * n) {
                return; // longer ones are not complete either
            }
            let sum = |back| cascade.sum_before(level, back);
            let steps = [sum(0), sum(n), sum(2 * n), sum(3 * n)];
            let [newest, middle, oldest] = [0, 1, 2].map(|k| i128::from(steps[k].wrapping_sub(steps[k + 1])));
            let difference = (newest - 2 * middle + oldest).unsigned_abs();
            self.add(octave, difference * difference, 1);
        }
    }

    /// Adds what was learnt of the same channel in a later stretch.
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
    /// `sample_period` in seconds. The confidence is that of the noise that the local slope suggests.
    #[must_use]
    pub fn points(&self, sample_period: f64) -> Vec<HadamardPoint, OCTAVES> {
        let mut points = self.points_with(sample_period, |_| Shares::WHITE);
        let levels: Vec<Level, OCTAVES> = points.iter().map(HadamardPoint::level).collect();
        for (at, point) in points.iter_mut().enumerate() {
            point.set_confidence(identify(&levels, at).shares());
        }
        points
    }

    /// The same with the confidence of the noise that `shares` tells for each averaging factor.
    #[must_use]
    pub fn points_with(&self, sample_period: f64, shares: impl Fn(u64) -> Shares) -> Vec<HadamardPoint, OCTAVES> {
        let points = (0..OCTAVES).filter_map(|octave| {
            let (square, count) = (self.squares[octave], self.counts[octave]);
            if count == 0 || square == u128::MAX {
                return None;
            }
            let n = 1_u64 << octave;
            let mut point = HadamardPoint {
                n,
                tau: n as f64 * sample_period,
                hvar: square as f64 / (6.0 * count as f64 * n as f64 * n as f64),
                count,
                overlap: place::<OVERLAP>(octave).1 as u32,
                edf: 0.0,
                low: 0.0,
                high: 0.0,
            };
            point.set_confidence(shares(n));
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

/// Level of delay line, and strides of it to an averaging time.
const fn place<const OVERLAP: usize>(octave: usize) -> (usize, u64) {
    let fine = OVERLAP.trailing_zeros() as usize;
    let level = (octave + 1).saturating_sub(fine);
    (level, 1 << (octave - level))
}
