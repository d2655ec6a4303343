//! The streaming estimator: integer samples in, exact sums of squared second differences out.

mod block;
pub(crate) mod checkpoint;

use crate::moments::{Moments, ROUNDED};
use core::mem::replace;

/// Streaming Allan variance at the averaging factors `n = 1, 2, 4 … 2^(OCTAVES−1)` samples.
///
/// The running sum of the samples passes through a chain of delay lines. Level `j` receives every second value that
/// leaves the level above it and delays it by `OVERLAP` strides of `2^j` samples. The sums of now, `n` samples ago and
/// `2n` samples ago, of which a second difference with `n = OVERLAP·2^j` consists, are therefore available every `2^j`
/// samples: an `OVERLAP`-fold overlap for `OVERLAP` words a level. The first line also serves `n < OVERLAP`, fully
/// overlapping. A sample costs `log2(OVERLAP) + 2` differences on average, independent of the length of the record.
///
/// # Range
/// Running sums wrap modulo 2⁶⁴, but their second differences do not: `|d| ≤ n·2³²` stays below `2⁶³` for `n ≤ 2³⁰`.
/// For samples within ±2²³, `d² ≤ 2⁴⁸·n²`, and 2⁴⁰ samples have at most `2⁴⁴/n` differences with `n ≥ 16`, so for
/// `n ≤ 2²³` no sum of squares exceeds `2¹¹⁵` and nothing is rounded. If wider samples fill the 127 bits of a sum, it
/// stays at its maximum and [`is_saturated`](Self::is_saturated) returns true. The fourth powers are summed in 127 bits
/// too, with differences at `n > 2¹⁰` rounded to `√(n/512)` counts. Where such a sum is full the kurtosis is `None`;
/// within 2⁴⁰ samples that takes white noise above 2¹⁷ counts rms, or averages over `n = 2²³` samples that differ by
/// more than 2¹⁰ counts throughout.
#[derive(Debug, Clone, PartialEq, Eq)]
#[repr(C)] // the fields that every sample touches come first, within reach of one base register
pub struct Cascade<const OCTAVES: usize, const OVERLAP: usize> {
    /// Samples since the start or the last gap.
    elapsed: u64,
    /// Running sum of these samples, modulo 2⁶⁴.
    sum: i64,
    /// The last `OVERLAP` running sums. The sum up to sample `k` is in slot `k mod OVERLAP`; the lines below use the
    /// same rule with the step of their level.
    recent: [i64; OVERLAP],
    octaves: [Octave<OVERLAP>; OCTAVES],
    /// Samples before the last gap.
    ended: u64,
    /// Samples reported missing.
    missing: u64,
}

/// The sums at `n = 2^octave` and, from `n = OVERLAP` on, the delay line of the level.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(C)]
struct Octave<const OVERLAP: usize> {
    moments: Moments,
    /// The sum that left the line last: that of `2·OVERLAP` strides ago.
    oldest: i64,
    /// The `OVERLAP` sums, at the level's own stride, before those that the line above holds.
    line: [i64; OVERLAP],
    /// Number of differences in the stretches before the last gap.
    differences: u64,
}

impl<const OVERLAP: usize> Octave<OVERLAP> {
    const NEW: Self = Self { moments: Moments::ZERO, oldest: 0, line: [0; OVERLAP], differences: 0 };

    /// Puts the sum of `step` into the line and returns the one of `OVERLAP` strides before.
    #[inline]
    fn exchange(&mut self, step: u64, sum: i64) -> i64 {
        self.oldest = replace(&mut self.line[step as usize & (OVERLAP - 1)], sum);
        self.oldest
    }
}

impl<const OCTAVES: usize, const OVERLAP: usize> Cascade<OCTAVES, OVERLAP> {
    /// Number of octaves with `n < OVERLAP`, all of which the first line serves.
    const FINE: usize = OVERLAP.trailing_zeros() as usize;
    /// Number of delay lines below the first.
    const LEVELS: usize = OCTAVES - Self::FINE;
    /// Number of levels whose differences are not rounded for the kurtosis.
    const SHORT: usize = if OCTAVES < ROUNDED { Self::LEVELS } else { ROUNDED - Self::FINE };
    /// Number of samples after which all of these levels have differences: 2048 for eleven octaves or more.
    const WARM: u64 = (2 * OVERLAP as u64) << (Self::SHORT - 1);

    /// An estimator without samples.
    ///
    /// `OVERLAP` is 1, 2, 4, 8 or 16 and `log2(OVERLAP) < OCTAVES ≤ 31`; other values do not compile:
    ///
    /// ```compile_fail,E0080
    /// allan_core::Cascade::<24, 3>::new(); // not a power of two
    /// ```
    /// ```compile_fail,E0080
    /// allan_core::Cascade::<24, 32>::new(); // more than 16
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
        Self { elapsed: 0, sum: 0, recent: [0; OVERLAP], octaves: [Octave::NEW; OCTAVES], ended: 0, missing: 0 }
    }

    /// Size of an estimator in bytes.
    #[must_use]
    pub const fn memory() -> usize {
        size_of::<Self>()
    }

    /// Adds the next sample, in counts.
    ///
    /// The first 2048 samples after a gap take more time, as they test which octaves are complete.
    #[inline]
    pub fn push(&mut self, sample: i32) {
        let previous = self.sum;
        self.elapsed += 1;
        self.sum = previous.wrapping_add(i64::from(sample));
        if self.elapsed < Self::WARM {
            return self.push_early(previous);
        }
        self.add_fine(Self::FINE, previous);
        let newest = self.sum;
        let mut step = self.elapsed as u32;
        let mut middle = replace(&mut self.recent[Self::slot(self.elapsed)], newest);
        for octave in &mut self.octaves[Self::FINE..Self::FINE + Self::SHORT] {
            let oldest = octave.exchange(u64::from(step), middle);
            octave.moments.add_unrounded(second_difference(newest, middle, oldest));
            if step & 1 == 1 {
                return;
            }
            (step, middle) = (step >> 1, oldest);
        }
        self.advance(Self::SHORT, middle);
    }

    /// [`push`](Self::push) while some levels have no differences yet.
    #[inline(never)]
    fn push_early(&mut self, previous: i64) {
        self.add_fine((self.elapsed.ilog2() as usize).min(Self::FINE), previous);
        let middle = replace(&mut self.recent[Self::slot(self.elapsed)], self.sum);
        self.advance(0, middle);
    }

    /// Adds the differences of the first `octaves` octaves, at `n < OVERLAP`.
    #[inline(always)]
    fn add_fine(&mut self, octaves: usize, previous: i64) {
        let mut middle = previous;
        for (k, octave) in self.octaves[..Self::FINE].iter_mut().enumerate().take(octaves) {
            let oldest = self.recent[Self::slot(self.elapsed.wrapping_sub(2 << k))];
            octave.moments.add_unrounded(second_difference(self.sum, middle, oldest));
            middle = oldest;
        }
    }

    /// Passes `middle`, the sum that left the line above `level`, down all lines of which the newest sample ends a stride.
    #[inline(never)]
    fn advance(&mut self, level: usize, mut middle: i64) {
        let due = (self.elapsed.trailing_zeros() as usize + 1).min(Self::LEVELS);
        for level in level..due {
            let step = self.elapsed >> level;
            let octave = &mut self.octaves[level + Self::FINE];
            let oldest = octave.exchange(step, middle);
            if step >= 2 * OVERLAP as u64 {
                octave.moments.add(level + Self::FINE, second_difference(self.sum, middle, oldest));
            }
            middle = oldest;
        }
    }

    /// Records that `missing` samples were lost before the next one: no difference will include samples from both sides.
    ///
    /// The sums are kept. A gap of 0 samples has no effect.
    pub fn gap(&mut self, missing: u32) {
        if missing > 0 {
            self.missing = self.missing.saturating_add(u64::from(missing));
            for k in 0..OCTAVES {
                let differences = self.count(k);
                self.octaves[k] = Octave { moments: self.octaves[k].moments, differences, ..Octave::NEW };
            }
            self.ended = self.len();
            self.elapsed = 0;
            self.sum = 0;
            self.recent = [0; OVERLAP];
        }
    }

    /// Adds the sums of another estimator, which has seen a later stretch of the same channel; further samples continue
    /// that stretch.
    ///
    /// The result is that of one estimator with a gap of no missing samples between the two stretches.
    pub fn merge(&mut self, later: &Self) {
        for k in 0..OCTAVES {
            let differences = self.count(k).saturating_add(later.octaves[k].differences);
            let mut moments = self.octaves[k].moments;
            moments.merge(&later.octaves[k].moments);
            self.octaves[k] = Octave { moments, differences, ..later.octaves[k] };
        }
        *self = Self {
            ended: self.len().saturating_add(later.ended),
            missing: self.missing.saturating_add(later.missing),
            octaves: self.octaves,
            ..*later
        };
    }

    /// Removes all samples.
    pub fn reset(&mut self) {
        // In place: a new estimator would be built on the stack first.
        self.recent.fill(0);
        self.octaves.fill(Octave::NEW);
        (self.elapsed, self.sum, self.ended, self.missing) = (0, 0, 0, 0);
    }

    /// Samples taken.
    #[must_use]
    pub const fn len(&self) -> u64 {
        self.ended.saturating_add(self.elapsed)
    }

    /// Whether no sample was taken.
    #[must_use]
    pub const fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Samples reported missing through [`gap`](Self::gap).
    #[must_use]
    pub const fn missing(&self) -> u64 {
        self.missing
    }

    /// Whether a sum of squares is full, so that the curve is a lower bound there; see the range of [`Cascade`].
    #[must_use]
    pub fn is_saturated(&self) -> bool {
        self.octaves.iter().any(|octave| octave.moments.squares.is_full())
    }

    /// The exact sum of squared second differences of sums of `2^octave` samples, in counts², and their number.
    ///
    /// `None` beyond the last octave.
    #[must_use]
    pub fn sum_of_squares(&self, octave: usize) -> Option<(u128, u64)> {
        Some((self.octaves.get(octave)?.moments.squares.get(), self.count(octave)))
    }

    /// Number of differences at `n = 2^octave`.
    fn count(&self, octave: usize) -> u64 {
        self.octaves[octave].differences.saturating_add(self.open_differences(octave))
    }

    /// Differences since the last gap.
    fn open_differences(&self, octave: usize) -> u64 {
        let level = octave.saturating_sub(Self::FINE);
        let reach = 2 * (1 << (octave - level));
        ((self.elapsed >> level) + 1).saturating_sub(reach)
    }

    /// The second difference of sums of `2^octave` samples that the newest sample completed, if it completed one.
    ///
    /// [`Coupling`](crate::Coupling) multiplies these of two channels. `octave` must be below `OCTAVES`.
    #[inline]
    #[must_use]
    pub fn newest_difference(&self, octave: usize) -> Option<i64> {
        let level = octave.saturating_sub(Self::FINE);
        let n = 1 << (octave - level);
        (self.has(level, 2 * n))
            .then(|| second_difference(self.sum, self.sum_before(level, n), self.sum_before(level, 2 * n)))
    }

    /// Whether the newest sample ends a stride of `level` and the sum of `back` strides before it exists.
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
            1 => self.octaves[level + Self::FINE].line[slot],
            _ => self.octaves[level + Self::FINE].oldest,
        }
    }

    /// Samples since the start or the last gap.
    pub(crate) const fn elapsed(&self) -> u64 {
        self.elapsed
    }

    /// Where the sum of a step of a level is kept in its line.
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

/// Second difference of three running sums: exact although the sums wrap, because the true difference fits.
#[inline]
pub(crate) fn second_difference(newest: i64, middle: i64, oldest: i64) -> i64 {
    newest.wrapping_sub(middle).wrapping_sub(middle.wrapping_sub(oldest))
}
