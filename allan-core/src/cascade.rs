//! The streaming estimator: integer samples in, exact sums of squared second differences out.

use crate::interpolation::Interpolation;
use crate::moments::{Moments, ROUNDED};
use core::mem::replace;
use core::num::Wrapping;
use core::ops::Sub;

/// Streaming Allan variance at the averaging factors `n = 1, 2, 4 … 2^(OCTAVES−1)` samples.
///
/// With the running sums `x` of the samples, the variance at `n` is the mean of `(x[k+2n] − 2x[k+n] + x[k])²/(2n²)` over
/// `k` in steps of `n/OVERLAP`, or of 1 for `n < OVERLAP` (overlapping Allan variance; W. Riley, NIST SP 1065).
///
/// ```
/// let mut estimator = allan_core::Cascade::<20, 8>::new();
/// estimator.push(-12); // a sample, in counts
/// estimator.gap(3); // three samples are missing
/// estimator.push(-11);
/// # (0..100).for_each(|k| estimator.push(k * k % 7));
/// let curve = estimator.curve(1.0 / 204.8).scaled(0.05); // sample period in s, deg/s per count
/// for point in curve.points() {
///     println!("{} s: {} deg/s", point.tau, point.avar.sqrt());
/// }
/// ```
///
/// The running sum of the samples passes through a chain of delay lines: level `j` receives every second value of the
/// level above and delays it by `OVERLAP` strides of `2^j` samples. Every `2^j` samples these lines therefore hold the
/// three sums of a second difference with `OVERLAP·2^j` samples, for `OVERLAP` words a level. A sample costs
/// `log2(OVERLAP) + 2` differences on average, independent of the length of the record.
///
/// # Gaps
/// Time goes on through a gap of `m` samples. They are replaced by the mean of the `2m` samples around the gap, of
/// which one follows it. Octaves with `n ≥ 8m` (`n ≥ 16m` with an `OVERLAP` of 16) keep their differences over the gap;
/// shorter ones leave out those that it touches. A gap that is too long for the longest octave is cut out: no
/// difference contains it.
///
/// The variance that replacing adds is measured on the samples before each gap, and [`curve`](Self::curve) subtracts
/// it. A gap costs a bounded number of operations, whatever its length.
///
/// # Range
/// Sums of squares are exact for `n ≤ 2²³` and 2⁴⁰ samples within ±2²³. If wider samples fill the 127 bits of a sum, it
/// stays at its maximum and [`is_saturated`](Self::is_saturated) returns true. The kurtosis is `None` where a sum of
/// fourth powers is full; its differences at `n > 2¹⁰` are rounded to `√(n/512)` counts.
#[derive(Debug, Clone, PartialEq, Eq)]
#[repr(C)] // the fields that every sample touches come first, within reach of one base register
pub struct Cascade<const OCTAVES: usize, const OVERLAP: usize> {
    /// Sample periods since the start, those of missing samples included.
    elapsed: u64,
    /// The time, modulo 2³², [`WARM`](Self::WARM) samples before all octaves below [`ROUNDED`] have their differences.
    settling: u32,
    /// Running sum of the samples since the start, or since the last gap that was cut out, modulo 2⁶⁴.
    sum: i64,
    /// The last `OVERLAP` running sums, that of sample `k` in slot `k mod OVERLAP`.
    recent: [i64; OVERLAP],
    octaves: [Octave<OVERLAP>; OCTAVES],
    /// End of the last gap.
    resumed: u64,
    /// Missing samples among the elapsed ones.
    absent: u64,
    /// Samples reported missing since the last sample.
    pending: u64,
    /// Samples before the start: those of merged and restored stretches.
    ended: u64,
    /// Samples missing before the start.
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
    /// End of the last gap that this octave does not bridge.
    resumed: u64,
    /// Number of differences before that gap.
    differences: u64,
    /// The gaps that this octave bridges and the one before does not.
    interpolation: Interpolation,
}

impl<const OVERLAP: usize> Octave<OVERLAP> {
    const NEW: Self = Self {
        moments: Moments::ZERO,
        oldest: 0,
        line: [0; OVERLAP],
        resumed: 0,
        differences: 0,
        interpolation: Interpolation::NONE,
    };

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
        Self {
            elapsed: 0,
            settling: 0,
            sum: 0,
            recent: [0; OVERLAP],
            octaves: [Octave::NEW; OCTAVES],
            resumed: 0,
            absent: 0,
            pending: 0,
            ended: 0,
            missing: 0,
        }
    }

    /// Adds the next sample, in counts. Every `i32` is allowed; see the range of [`Cascade`].
    ///
    /// The first 2048 samples, and those after a gap until the shortest octaves have left it behind, take more time.
    ///
    /// # Cost
    /// | `Cascade::push` | Cortex-M4F | Cortex-M0+ |
    /// |---|---|---|
    /// | instructions on average | 198 | 505 |
    /// | instructions at most | 3,690 | 11,892 |
    /// | stack, bytes | 108 | 284 |
    /// | flash, bytes | 4,890 | — |
    ///
    /// See [`guide::costs`](crate::guide::costs) for how they are counted.
    #[inline]
    pub fn push(&mut self, sample: i32) {
        // The subtraction wraps, so this is true once in 2³² samples without need: the slow path gives the same sums.
        if (self.elapsed as u32).wrapping_sub(self.settling) < Self::WARM as u32 - 1 {
            return self.push_unsettled(sample);
        }
        let previous = self.sum;
        self.elapsed += 1;
        self.sum = previous.wrapping_add(i64::from(sample));
        let newest = self.sum;
        let mut middle = previous;
        for (k, octave) in self.octaves[..Self::FINE].iter_mut().enumerate() {
            let oldest = self.recent[Self::slot(self.elapsed.wrapping_sub(2 << k))];
            octave.moments.add_unrounded(second_difference(newest, middle, oldest));
            middle = oldest;
        }
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

    /// [`push`](Self::push) for a sample after a gap, or while an octave must leave out differences.
    #[inline(never)]
    fn push_unsettled(&mut self, sample: i32) {
        if self.pending > 0 {
            self.close_gap(sample);
        }
        let mut middle = self.sum;
        let (elapsed, newest) = (self.elapsed + 1, middle.wrapping_add(i64::from(sample)));
        (self.elapsed, self.sum) = (elapsed, newest);
        for (k, octave) in self.octaves[..Self::FINE].iter_mut().enumerate() {
            let oldest = self.recent[Self::slot(elapsed.wrapping_sub(2 << k))];
            if elapsed - octave.resumed >= 2 << k {
                octave.moments.add_unrounded(second_difference(newest, middle, oldest));
            }
            middle = oldest;
        }
        let middle = replace(&mut self.recent[Self::slot(elapsed)], newest);
        self.advance(0, middle);
    }

    /// Passes `middle`, the sum that left the line above `level`, down all lines whose stride the newest sample ends.
    #[inline(never)]
    fn advance(&mut self, level: usize, mut middle: i64) {
        let (elapsed, newest) = (self.elapsed, self.sum);
        let due = (elapsed.trailing_zeros() as usize + 1).min(Self::LEVELS);
        // A slice: chained iterators would be kept on the stack, and an index would link the code of its panic.
        let lines = self.octaves.get_mut(Self::FINE + level..Self::FINE + due).unwrap_or_default();
        // 32 bits are enough for a slot, and a 64-bit shift by a variable takes ten instructions.
        let (mut step, mut reach) = ((elapsed >> level) as u32, 2 << (Self::FINE + level));
        for (at, octave) in (Self::FINE + level..).zip(lines) {
            let oldest = octave.exchange(step.into(), middle);
            if elapsed - octave.resumed >= reach {
                octave.moments.add(at, second_difference(newest, middle, oldest));
            }
            (step, reach, middle) = (step >> 1, reach << 1, oldest);
        }
    }
}

// rustdoc lists the methods in this order: `new`, `push`, `gap`, `curve`, `snapshot`, the others.
mod gap;

pub(crate) mod checkpoint;
pub(crate) mod snapshot;

mod block;
mod small_powers;

impl<const OCTAVES: usize, const OVERLAP: usize> Cascade<OCTAVES, OVERLAP> {
    /// Size of an estimator in bytes.
    #[must_use]
    pub const fn memory() -> usize {
        size_of::<Self>()
    }

    /// Adds the sums of another estimator, which has seen a later stretch of the same channel; further samples continue
    /// that stretch.
    ///
    /// No difference contains samples of both stretches.
    ///
    /// # Cost
    /// | `Cascade::merge` | Cortex-M4F | Cortex-M0+ |
    /// |---|---|---|
    /// | instructions | 6,840 | 11,800 |
    /// | stack, bytes | 140 | 216 |
    /// | flash, bytes | 1,070 | — |
    ///
    /// See [`guide::costs`](crate::guide::costs) for how they are counted.
    pub fn merge(&mut self, later: &Self) {
        for k in 0..OCTAVES {
            let differences = self.count(k).saturating_add(later.octaves[k].differences);
            let Octave { mut moments, mut interpolation, .. } = self.octaves[k];
            moments.merge(&later.octaves[k].moments);
            interpolation.merge(&later.octaves[k].interpolation);
            self.octaves[k] = Octave { moments, interpolation, differences, ..later.octaves[k] };
        }
        *self = Self {
            ended: self.len().saturating_add(later.ended),
            missing: self.missing().saturating_add(later.missing),
            octaves: self.octaves,
            ..*later
        };
    }

    /// Removes all samples.
    ///
    /// # Cost
    /// | `Cascade::reset` | Cortex-M4F | Cortex-M0+ |
    /// |---|---|---|
    /// | instructions | 1,360 | 1,800 |
    /// | stack, bytes | 24 | 32 |
    /// | flash, bytes | 0 | — |
    ///
    /// See [`guide::costs`](crate::guide::costs) for how they are counted.
    pub fn reset(&mut self) {
        // In place: a new estimator would be built on the stack first.
        self.recent.fill(0);
        self.octaves.fill(Octave::NEW);
        (self.elapsed, self.settling, self.sum) = (0, 0, 0);
        (self.resumed, self.absent, self.pending) = (0, 0, 0);
        (self.ended, self.missing) = (0, 0);
    }

    /// Number of samples taken, without missing ones.
    #[must_use]
    pub const fn len(&self) -> u64 {
        self.ended.saturating_add(self.elapsed - self.absent)
    }

    /// True if no sample was taken.
    #[must_use]
    pub const fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Number of samples reported missing through [`gap`](Self::gap).
    #[must_use]
    pub const fn missing(&self) -> u64 {
        self.missing.saturating_add(self.absent).saturating_add(self.pending)
    }

    /// Number of missing samples that the curve replaces: those in gaps that its longer octaves bridge.
    #[must_use]
    pub fn replaced(&self) -> u64 {
        self.octaves.iter().map(|octave| u64::from(octave.interpolation.replaced())).sum()
    }

    /// True if a sum of squares is full, so that the curve is a lower bound there; see the range of [`Cascade`].
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

    /// Number of differences at `n = 2^octave`; 0 beyond the last octave.
    fn count(&self, octave: usize) -> u64 {
        let known = self.octaves.get(octave);
        known.map_or(0, |known| {
            known.differences.saturating_add(Self::open_differences(self.elapsed, octave, known.resumed))
        })
    }

    /// Differences since the last gap that the octave does not bridge, one at each multiple of its stride.
    fn open_differences(elapsed: u64, octave: usize, resumed: u64) -> u64 {
        let level = octave.saturating_sub(Self::FINE);
        let incomplete = (resumed + (2 << octave) - 1) >> level;
        (elapsed >> level).saturating_sub(incomplete)
    }

    /// Number of octaves at which [`newest_difference`](Self::newest_difference) may be `Some`.
    #[inline]
    #[must_use]
    pub const fn octaves_due(&self) -> usize {
        let levels = self.elapsed.trailing_zeros() as usize + 1;
        if self.elapsed == 0 {
            0
        } else if levels < Self::LEVELS {
            Self::FINE + levels
        } else {
            OCTAVES
        }
    }

    /// The second difference of sums of `2^octave` samples that the newest sample completed. `None` without one, in a
    /// gap that the octave does not bridge, and beyond the last octave.
    #[inline]
    #[must_use]
    pub fn newest_difference(&self, octave: usize) -> Option<i64> {
        let level = octave.saturating_sub(Self::FINE);
        let n = 1 << (octave - level);
        let span = self.elapsed - self.octaves.get(octave)?.resumed;
        (self.ends_stride(level) && span >= 2 << octave)
            .then(|| second_difference(self.sum, self.sum_before(level, n), self.sum_before(level, 2 * n)))
    }

    /// True if the newest sample ends a stride of `level`.
    #[inline]
    pub(crate) const fn ends_stride(&self, level: usize) -> bool {
        self.elapsed.trailing_zeros() as usize >= level
    }

    /// Sample periods since the last gap that `octave` does not bridge.
    #[inline]
    pub(crate) const fn span(&self, octave: usize) -> u64 {
        self.elapsed - self.octaves[octave].resumed
    }

    #[inline]
    pub(crate) const fn newest_sum(&self) -> i64 {
        self.sum
    }

    /// The running sum of `back` strides (1 to `2·OVERLAP`) of `level` before the newest sample, which ends a stride.
    #[inline]
    pub(crate) fn sum_before(&self, level: usize, back: u64) -> i64 {
        let (mut level, mut back) = (level, back);
        while back < OVERLAP as u64 && level > 0 {
            (level, back) = (level - 1, 2 * back);
        }
        let slot = Self::slot((self.elapsed >> level).wrapping_sub(back));
        // Callers have a level below LEVELS; the bound spares the code for an index's panic.
        let octave = &self.octaves[Self::FINE + level.min(Self::LEVELS - 1)];
        match back / OVERLAP as u64 {
            0 => self.recent[slot],
            1 => octave.line[slot],
            _ => octave.oldest,
        }
    }

    /// Sample periods since the start with the missing ones, and samples missing since.
    pub(crate) const fn now(&self) -> (u64, u64) {
        (self.elapsed, self.pending)
    }

    /// The slot of a step's sum in the line of its level.
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
    wrapped_second_difference(Wrapping(newest), Wrapping(middle), Wrapping(oldest)).0
}

/// [`second_difference`] in words of any width `w`, which hold the sums modulo `2ʷ`.
///
/// The result is exact while the true difference is below `2ʷ⁻¹`. For samples of `w/2` bits it is, up to `n =
/// 2^(w/2−1)`: up to `n = 2³¹` in 64 bits, and the longest octave has `2³⁰`.
#[inline]
fn wrapped_second_difference<W: Sub<Output = W> + Copy>(newest: W, middle: W, oldest: W) -> W {
    newest - middle - (middle - oldest)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Tries all sums of 4-bit samples from every start of an 8-bit running sum.
    #[test]
    fn second_differences_of_wrapped_sums_are_exact_up_to_the_longest_averaging_time() {
        let word = |sum: i32| Wrapping(sum as i8);
        let mut wrong = 0;
        for n in 1..=8 {
            let sums = || -8 * n..=7 * n;
            for (oldest, earlier, later) in
                (-128..128).flat_map(|start| sums().flat_map(move |a| sums().map(move |b| (start, a, b))))
            {
                let (middle, newest) = (oldest + earlier, oldest + earlier + later);
                let difference = wrapped_second_difference(word(newest), word(middle), word(oldest));
                wrong += usize::from(i32::from(difference.0) != later - earlier);
            }
            assert_eq!(wrong, 0, "n = {n}");
        }
        assert_ne!(i32::from(wrapped_second_difference(word(-9), word(-72), word(0)).0), 135);
    }
}
