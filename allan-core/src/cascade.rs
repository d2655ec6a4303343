//! The streaming estimator: integers in, exact sums of squared second differences out.

mod block;

use crate::curve::{Curve, Point};

/// Streaming Allan variance at the averaging factors `n = 1, 2, 4 … 2^(OCTAVES−1)` samples.
///
/// Level `j` keeps the last `2·OVERLAP` running sums taken every `2^j` samples. From them come the second
/// differences with `n = OVERLAP·2^j` at a stride of `2^j` samples, an `OVERLAP`-fold overlap; level 0 also gives
/// `n < OVERLAP`, fully overlapping. A sample costs `log2(OVERLAP) + 2` differences on average, whatever the length
/// of the record.
///
/// # Range
/// Running sums wrap, their second differences do not: `|d| ≤ n·2³²` stays below `2⁶³` for `n ≤ 2³⁰`. For samples
/// within ±2²³, `d² ≤ 2⁴⁸·n²`, and over `2⁴⁰` samples there are at most `2⁴³/n` differences with `n ≥ 8`, so with
/// `n ≤ 2²³` no sum exceeds `2¹¹⁴`: nothing is ever rounded. Should wider samples fill the 128 bits all the same,
/// the sum stays at its maximum and [`is_saturated`](Self::is_saturated) says so.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Cascade<const OCTAVES: usize, const OVERLAP: usize> {
    samples: u64,
    missing: u64,
    /// Samples since the start or the last gap.
    elapsed: u64,
    /// Their running sum, modulo 2⁶⁴.
    sum: i64,
    /// Running sums of each level; `[half][slot]` because an array of `2·OVERLAP` cannot be written.
    rings: [[[i64; OVERLAP]; 2]; OCTAVES],
    squares: [u128; OCTAVES],
    differences: [u64; OCTAVES],
}

impl<const OCTAVES: usize, const OVERLAP: usize> Cascade<OCTAVES, OVERLAP> {
    /// Averaging factors below `OVERLAP`, all of which level 0 serves.
    const FINE: usize = OVERLAP.trailing_zeros() as usize;

    /// An estimator that has seen nothing.
    ///
    /// A parameter without meaning does not compile: `OVERLAP` is a power of two up to 16, and
    /// `log2(OVERLAP) < OCTAVES ≤ 31`.
    #[must_use]
    pub const fn new() -> Self {
        const {
            assert!(OVERLAP.is_power_of_two() && OVERLAP <= 16, "OVERLAP must be 1, 2, 4, 8 or 16");
            assert!(OCTAVES > Self::FINE && OCTAVES <= 31, "OCTAVES must be in log2(OVERLAP)+1 ..= 31");
        }
        Self {
            samples: 0,
            missing: 0,
            elapsed: 0,
            sum: 0,
            rings: [[[0; OVERLAP]; 2]; OCTAVES],
            squares: [0; OCTAVES],
            differences: [0; OCTAVES],
        }
    }

    /// Takes the next sample.
    #[inline]
    pub fn push(&mut self, sample: i32) {
        self.samples += 1;
        self.elapsed += 1;
        self.sum = self.sum.wrapping_add(i64::from(sample));
        let (sum, elapsed) = (self.sum, self.elapsed);

        for octave in 0..Self::FINE {
            let n = 1 << octave;
            if elapsed >= 2 * n {
                let middle = self.running_sum(0, elapsed - n);
                let oldest = self.running_sum(0, elapsed - 2 * n);
                self.accumulate(octave, second_difference(sum, middle, oldest));
            }
        }
        let due = elapsed.trailing_zeros() as usize + 1;
        for level in 0..due.min(OCTAVES - Self::FINE) {
            let step = elapsed >> level;
            // The slot that is about to be overwritten holds the sum of 2·OVERLAP steps ago.
            let (half, slot) = Self::slot(step);
            if step >= 2 * OVERLAP as u64 {
                let ring = &self.rings[level];
                let difference = second_difference(sum, ring[half ^ 1][slot], ring[half][slot]);
                self.accumulate(level + Self::FINE, difference);
            }
            self.rings[level][half][slot] = sum;
        }
    }

    /// Notes that `missing` samples were lost before the next one: no difference will straddle the gap.
    ///
    /// What was learnt is kept. A gap of 0 samples is none.
    pub fn gap(&mut self, missing: u32) {
        if missing > 0 {
            self.missing += u64::from(missing);
            self.break_off();
        }
    }

    /// Adds what another estimator learnt from a later stretch of the same channel, and goes on where it stands.
    ///
    /// No difference straddles the seam: the result is that of one estimator with a gap there.
    pub fn merge(&mut self, later: &Self) {
        self.samples += later.samples;
        self.missing += later.missing;
        self.elapsed = later.elapsed;
        self.sum = later.sum;
        self.rings = later.rings;
        for octave in 0..OCTAVES {
            self.squares[octave] = self.squares[octave].saturating_add(later.squares[octave]);
            self.differences[octave] += later.differences[octave];
        }
    }

    /// Forgets everything.
    pub fn reset(&mut self) {
        *self = Self::new();
    }

    /// Samples taken.
    #[must_use]
    pub const fn len(&self) -> u64 {
        self.samples
    }

    /// Whether no sample was taken.
    #[must_use]
    pub const fn is_empty(&self) -> bool {
        self.samples == 0
    }

    /// Samples reported missing through [`gap`](Self::gap).
    #[must_use]
    pub const fn missing(&self) -> u64 {
        self.missing
    }

    /// Whether samples far beyond 24 bits have filled an accumulator, so that the curve is a lower bound.
    #[must_use]
    pub fn is_saturated(&self) -> bool {
        self.squares.contains(&u128::MAX)
    }

    /// The exact sum of squared second differences of sums of `2^octave` samples, in counts², and their number.
    ///
    /// `None` beyond the last octave.
    #[must_use]
    pub fn sum_of_squares(&self, octave: usize) -> Option<(u128, u64)> {
        Some((*self.squares.get(octave)?, *self.differences.get(octave)?))
    }

    /// The Allan variance, in counts², of every octave that has at least one difference.
    ///
    /// `sample_period` in seconds. The confidence is that of the noise that the local slope suggests; a
    /// [`fit`](crate::fit::fit) gives the one of the fitted mixture.
    #[must_use]
    pub fn curve(&self, sample_period: f64) -> Curve<OCTAVES> {
        let points = (0..OCTAVES).filter(|&octave| self.differences[octave] > 0).map(|octave| {
            let n = 1_u64 << octave;
            let count = self.differences[octave];
            Point {
                n,
                tau: n as f64 * sample_period,
                avar: self.squares[octave] as f64 / (2.0 * count as f64 * n as f64 * n as f64),
                count,
                overlap: n.min(OVERLAP as u64) as u32,
                edf: 0.0,
                low: 0.0,
                high: 0.0,
            }
        });
        Curve::new(sample_period, self.samples, points.collect())
    }

    /// Restarts the running sum; the sum at step 0 of every level is 0.
    fn break_off(&mut self) {
        self.elapsed = 0;
        self.sum = 0;
        for ring in &mut self.rings {
            ring[0][0] = 0;
        }
    }

    #[inline]
    fn slot(step: u64) -> (usize, usize) {
        let slot = step as usize & (2 * OVERLAP - 1);
        (slot / OVERLAP, slot % OVERLAP)
    }

    #[inline]
    fn running_sum(&self, level: usize, step: u64) -> i64 {
        let (half, slot) = Self::slot(step);
        self.rings[level][half][slot]
    }

    #[inline]
    fn accumulate(&mut self, octave: usize, difference: i64) {
        let magnitude = u128::from(difference.unsigned_abs());
        self.squares[octave] = self.squares[octave].saturating_add(magnitude * magnitude);
        self.differences[octave] += 1;
    }
}

impl<const OCTAVES: usize, const OVERLAP: usize> Default for Cascade<OCTAVES, OVERLAP> {
    fn default() -> Self {
        Self::new()
    }
}

/// Exact although the running sums wrap, because the true difference fits.
#[inline]
fn second_difference(newest: i64, middle: i64, oldest: i64) -> i64 {
    newest.wrapping_sub(middle).wrapping_sub(middle.wrapping_sub(oldest))
}
