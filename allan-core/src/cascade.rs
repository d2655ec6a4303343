//! The streaming estimator: integers in, exact sums of squared second differences out.

mod block;
mod checkpoint;
mod moments;
#[cfg(feature = "serde")]
mod state;

pub use checkpoint::Learnt;
pub(crate) use moments::Moments;

use crate::curve::{Curve, Point};
use crate::noise_type::Noise;
use core::mem::replace;

/// Streaming Allan variance at the averaging factors `n = 1, 2, 4 … 2^(OCTAVES−1)` samples.
///
/// The running sum runs down a chain of delay lines: each level `j` delays by `OVERLAP·2^j` samples what the level
/// above it lets out, keeping every `2^j`-th. So the sums of now, `n` ago and `2n` ago that a second difference with
/// `n = OVERLAP·2^j` takes are there every `2^j` samples, an `OVERLAP`-fold overlap, for `OVERLAP` words a level; the
/// first line also gives `n < OVERLAP`, fully overlapping. A sample costs `log2(OVERLAP) + 2` differences on average,
/// whatever the length of the record.
///
/// # Range
/// Running sums wrap, their second differences do not: `|d| ≤ n·2³²` stays below `2⁶³` for `n ≤ 2³⁰`. For samples
/// within ±2²³, `d² ≤ 2⁴⁸·n²`, and over `2⁴⁰` samples there are at most `2⁴⁴/n` differences with `n ≥ 16`, so with
/// `n ≤ 2²³` no sum exceeds `2¹¹⁵`: nothing is ever rounded. Should wider samples fill the 128 bits all the same,
/// the sum stays at its maximum and [`is_saturated`](Self::is_saturated) says so. Fourth powers are summed in 128
/// bits too, of differences rounded to `√(n/512)` counts at `n > 2¹⁰`; where they fill up (over
/// 2⁴⁰ samples: white noise above 2¹⁷ counts, or averages over `n = 2²³` that differ by more than 2¹⁰ counts
/// throughout) the kurtosis is `None`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Cascade<const OCTAVES: usize, const OVERLAP: usize> {
    samples: u64,
    missing: u64,
    /// Samples since the start or the last gap.
    elapsed: u64,
    /// Their running sum, modulo 2⁶⁴.
    sum: i64,
    /// The last `OVERLAP` running sums; the one of sample `k` in slot `k mod OVERLAP`, in the lines below likewise.
    recent: [i64; OVERLAP],
    /// The `OVERLAP` sums before those that the line above holds, at the level's own stride.
    lines: [[i64; OVERLAP]; OCTAVES],
    /// What each line let out last: the sum of `2·OVERLAP` strides ago.
    oldest: [i64; OCTAVES],
    moments: [Moments; OCTAVES],
    /// Differences of the stretches that a gap has ended.
    differences: [u64; OCTAVES],
}

impl<const OCTAVES: usize, const OVERLAP: usize> Cascade<OCTAVES, OVERLAP> {
    /// Averaging factors below `OVERLAP`, all of which the first line serves.
    const FINE: usize = OVERLAP.trailing_zeros() as usize;
    const LEVELS: usize = OCTAVES - Self::FINE;

    /// An estimator that has seen nothing.
    ///
    /// A parameter without meaning does not compile: `OVERLAP` is a power of two up to 16, and
    /// `log2(OVERLAP) < OCTAVES ≤ 31`.
    ///
    /// ```compile_fail,E0080
    /// allan_core::Cascade::<24, 3>::new(); // not a power of two
    /// ```
    /// ```compile_fail,E0080
    /// allan_core::Cascade::<24, 32>::new(); // more overlap than is of use
    /// ```
    /// ```compile_fail,E0080
    /// allan_core::Cascade::<3, 8>::new(); // no octave with 8-fold overlap
    /// ```
    /// ```compile_fail,E0080
    /// allan_core::Cascade::<32, 8>::new(); // differences beyond 64 bits
    /// ```
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
            recent: [0; OVERLAP],
            lines: [[0; OVERLAP]; OCTAVES],
            oldest: [0; OCTAVES],
            moments: [Moments::NONE; OCTAVES],
            differences: [0; OCTAVES],
        }
    }

    /// The estimator that has taken `sample` so many times, at once: to start tests and benchmarks late in a record.
    #[must_use]
    pub fn after_constant(sample: i32, samples: u64) -> Self {
        let sum_at = |step: u64, level: usize| i64::from(sample).wrapping_mul((step << level) as i64);
        let mut cascade = Self { samples, elapsed: samples, sum: sum_at(samples, 0), ..Self::new() };
        for back in 0..samples.min(OVERLAP as u64) {
            cascade.recent[Self::slot(samples - back)] = sum_at(samples - back, 0);
        }
        let overlap = OVERLAP as u64;
        for level in 0..Self::LEVELS {
            let step = samples >> level;
            for back in overlap..step.min(2 * overlap) {
                cascade.lines[level][Self::slot(step - back)] = sum_at(step - back, level);
            }
            cascade.oldest[level] = sum_at(step.saturating_sub(2 * overlap), level);
        }
        cascade
    }

    /// Bytes that an estimator takes.
    #[must_use]
    pub const fn memory() -> usize {
        size_of::<Self>()
    }

    /// Takes the next sample.
    #[inline]
    pub fn push(&mut self, sample: i32) {
        self.samples += 1;
        self.elapsed += 1;
        self.sum = self.sum.wrapping_add(i64::from(sample));
        let (newest, elapsed) = (self.sum, self.elapsed);

        for octave in 0..Self::FINE {
            let n = 1 << octave;
            if elapsed >= 2 * n {
                let middle = self.recent[Self::slot(elapsed - n)];
                let oldest = self.recent[Self::slot(elapsed - 2 * n)];
                self.moments[octave].add(octave, second_difference(newest, middle, oldest));
            }
        }
        let mut middle = replace(&mut self.recent[Self::slot(elapsed)], newest);
        let due = (elapsed.trailing_zeros() as usize + 1).min(Self::LEVELS);
        for level in 0..due {
            let step = elapsed >> level;
            let oldest = replace(&mut self.lines[level][Self::slot(step)], middle);
            if step >= 2 * OVERLAP as u64 {
                let octave = level + Self::FINE;
                self.moments[octave].add(octave, second_difference(newest, middle, oldest));
            }
            self.oldest[level] = oldest;
            middle = oldest;
        }
    }

    /// Notes that `missing` samples were lost before the next one: no difference will straddle the gap.
    ///
    /// What was learnt is kept. A gap of 0 samples is none.
    pub fn gap(&mut self, missing: u32) {
        if missing > 0 {
            self.missing = self.missing.saturating_add(u64::from(missing));
            for octave in 0..OCTAVES {
                self.differences[octave] = self.count(octave);
            }
            self.elapsed = 0;
            self.sum = 0;
            self.recent = [0; OVERLAP];
            self.lines = [[0; OVERLAP]; OCTAVES];
            self.oldest = [0; OCTAVES];
        }
    }

    /// Adds what another estimator learnt from a later stretch of the same channel, and goes on where it stands.
    ///
    /// No difference straddles the seam: the result is that of one estimator with a gap there, of no samples.
    pub fn merge(&mut self, later: &Self) {
        for octave in 0..OCTAVES {
            self.differences[octave] = self.count(octave).saturating_add(later.differences[octave]);
            let Moments { squares, fourths } = later.moments[octave];
            self.moments[octave].add_sums(squares, fourths);
        }
        *self = Self {
            samples: self.samples.saturating_add(later.samples),
            missing: self.missing.saturating_add(later.missing),
            moments: self.moments,
            differences: self.differences,
            ..*later
        };
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
        self.moments.iter().any(|moments| moments.squares == u128::MAX)
    }

    /// The exact sum of squared second differences of sums of `2^octave` samples, in counts², and their number.
    ///
    /// `None` beyond the last octave.
    #[must_use]
    pub fn sum_of_squares(&self, octave: usize) -> Option<(u128, u64)> {
        Some((self.moments.get(octave)?.squares, self.count(octave)))
    }

    /// The Allan variance, in counts², of every octave that has at least one difference.
    ///
    /// `sample_period` in seconds. The confidence is that of the noise that the local slope suggests; a
    /// [`fit`](crate::fit::fit) gives the one of the fitted mixture.
    #[must_use]
    pub fn curve(&self, sample_period: f64) -> Curve<OCTAVES> {
        let points = (0..OCTAVES).filter(|&octave| self.count(octave) > 0).map(|octave| {
            let n = 1_u64 << octave;
            let overlap = n.min(OVERLAP as u64) as u32;
            Point::new(n, sample_period, &self.moments[octave], octave, self.count(octave), overlap, Noise::White)
        });
        Curve::new(sample_period, self.samples, points.collect())
    }

    fn count(&self, octave: usize) -> u64 {
        self.differences[octave].saturating_add(self.open_differences(octave))
    }

    /// Differences since the last gap.
    fn open_differences(&self, octave: usize) -> u64 {
        let level = octave.saturating_sub(Self::FINE);
        let reach = 2 * (1 << (octave - level));
        ((self.elapsed >> level) + 1).saturating_sub(reach)
    }

    /// The difference that the newest sample completed, if it completed one.
    #[inline]
    pub(crate) fn newest_difference(&self, octave: usize) -> Option<i64> {
        let level = octave.saturating_sub(Self::FINE);
        let n = 1 << (octave - level);
        (self.has(level, 2 * n))
            .then(|| second_difference(self.sum, self.sum_before(level, n), self.sum_before(level, 2 * n)))
    }

    /// Whether the newest sample ends a stride of `level` and there are sums of `back` strides before it.
    #[inline]
    pub(crate) fn has(&self, level: usize, back: u64) -> bool {
        self.elapsed.trailing_zeros() as usize >= level && self.elapsed >> level >= back && self.elapsed > 0
    }

    /// The running sum of `back ≤ 2·OVERLAP` strides of `level` before the newest sample, which ends a stride.
    #[inline]
    pub(crate) fn sum_before(&self, level: usize, back: u64) -> i64 {
        let (mut level, mut back) = (level, back);
        while back < OVERLAP as u64 && level > 0 {
            (level, back) = (level - 1, 2 * back);
        }
        let slot = Self::slot((self.elapsed >> level).wrapping_sub(back));
        match back / OVERLAP as u64 {
            0 => self.recent[slot],
            1 => self.lines[level][slot],
            _ => self.oldest[level],
        }
    }

    /// Samples since the start or the last gap.
    pub(crate) const fn elapsed(&self) -> u64 {
        self.elapsed
    }

    #[inline]
    const fn slot(step: u64) -> usize {
        step as usize & (OVERLAP - 1)
    }
}

impl<const OCTAVES: usize, const OVERLAP: usize> Default for Cascade<OCTAVES, OVERLAP> {
    fn default() -> Self {
        Self::new()
    }
}

/// Exact although the running sums wrap, because the true difference fits.
#[inline]
pub(crate) fn second_difference(newest: i64, middle: i64, oldest: i64) -> i64 {
    newest.wrapping_sub(middle).wrapping_sub(middle.wrapping_sub(oldest))
}
