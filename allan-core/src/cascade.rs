//! The streaming estimator: integers in, exact sums of squared second differences out.

mod block;
mod checkpoint;
mod moments;
#[cfg(feature = "serde")]
mod state;
mod sum;

pub use checkpoint::Learnt;
pub(crate) use moments::Moments;
use moments::ROUNDED;

use crate::curve::Curve;
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
/// `n ≤ 2²³` no sum exceeds `2¹¹⁵`: nothing is ever rounded. Should wider samples fill the 127 bits all the same,
/// the sum stays at its maximum and [`is_saturated`](Self::is_saturated) says so. Fourth powers are summed in 127
/// bits too, of differences rounded to `√(n/512)` counts at `n > 2¹⁰`; where they fill up (over
/// 2⁴⁰ samples: white noise above 2¹⁷ counts, or averages over `n = 2²³` that differ by more than 2¹⁰ counts
/// throughout) the kurtosis is `None`.
#[derive(Debug, Clone, PartialEq, Eq)]
#[repr(C)] // what every sample touches lies together, within reach of one base register
pub struct Cascade<const OCTAVES: usize, const OVERLAP: usize> {
    /// Samples since the start or the last gap.
    elapsed: u64,
    /// Their running sum, modulo 2⁶⁴.
    sum: i64,
    /// The last `OVERLAP` running sums; the one of sample `k` in slot `k mod OVERLAP`, in the lines below likewise.
    recent: [i64; OVERLAP],
    octaves: [Octave<OVERLAP>; OCTAVES],
    /// Samples before the last gap.
    ended: u64,
    missing: u64,
}

/// What was learnt at `n = 2^octave`, and from `n = OVERLAP` on the delay line of its level.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(C)]
struct Octave<const OVERLAP: usize> {
    moments: Moments,
    /// What the line let out last: the sum of `2·OVERLAP` strides ago.
    oldest: i64,
    /// The `OVERLAP` sums before those that the line above holds, at the level's own stride.
    line: [i64; OVERLAP],
    /// Differences of the stretches that a gap has ended.
    differences: u64,
}

impl<const OVERLAP: usize> Octave<OVERLAP> {
    const NEW: Self = Self { moments: Moments::NONE, oldest: 0, line: [0; OVERLAP], differences: 0 };

    /// Puts the sum of `step` into the line; out comes the one of `OVERLAP` strides before.
    #[inline]
    fn exchange(&mut self, step: u64, sum: i64) -> i64 {
        self.oldest = replace(&mut self.line[step as usize & (OVERLAP - 1)], sum);
        self.oldest
    }
}

impl<const OCTAVES: usize, const OVERLAP: usize> Cascade<OCTAVES, OVERLAP> {
    /// Averaging factors below `OVERLAP`, all of which the first line serves.
    const FINE: usize = OVERLAP.trailing_zeros() as usize;
    const LEVELS: usize = OCTAVES - Self::FINE;
    /// Levels whose differences are not rounded for the kurtosis.
    const SHORT: usize = if OCTAVES < ROUNDED { Self::LEVELS } else { ROUNDED - Self::FINE };
    /// Samples after which all of these have differences: 2048 for eleven octaves or more.
    const WARM: u64 = (2 * OVERLAP as u64) << (Self::SHORT - 1);

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
        Self { elapsed: 0, sum: 0, recent: [0; OVERLAP], octaves: [Octave::NEW; OCTAVES], ended: 0, missing: 0 }
    }

    /// The estimator that has taken `sample` so many times, at once: to start tests and benchmarks late in a record.
    #[must_use]
    pub fn after_constant(sample: i32, samples: u64) -> Self {
        let sum_at = |step: u64, level: usize| i64::from(sample).wrapping_mul((step << level) as i64);
        let mut cascade = Self { elapsed: samples, sum: sum_at(samples, 0), ..Self::new() };
        for back in 0..samples.min(OVERLAP as u64) {
            cascade.recent[Self::slot(samples - back)] = sum_at(samples - back, 0);
        }
        let overlap = OVERLAP as u64;
        for level in 0..Self::LEVELS {
            let step = samples >> level;
            for back in overlap..step.min(2 * overlap) {
                cascade.octaves[level + Self::FINE].line[Self::slot(step - back)] = sum_at(step - back, level);
            }
            cascade.octaves[level + Self::FINE].oldest = sum_at(step.saturating_sub(2 * overlap), level);
        }
        cascade
    }

    /// Bytes that an estimator takes.
    #[must_use]
    pub const fn memory() -> usize {
        size_of::<Self>()
    }

    /// Takes the next sample.
    ///
    /// The first 2048 samples after a gap take a slower way.
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

    /// The same while some levels have no differences yet.
    #[inline(never)]
    fn push_early(&mut self, previous: i64) {
        self.add_fine((self.elapsed.ilog2() as usize).min(Self::FINE), previous);
        let middle = replace(&mut self.recent[Self::slot(self.elapsed)], self.sum);
        self.advance(0, middle);
    }

    /// Takes the differences of the first octaves, at `n < OVERLAP`.
    #[inline(always)]
    fn add_fine(&mut self, octaves: usize, previous: i64) {
        let mut middle = previous;
        for (k, octave) in self.octaves[..Self::FINE].iter_mut().enumerate().take(octaves) {
            let oldest = self.recent[Self::slot(self.elapsed.wrapping_sub(2 << k))];
            octave.moments.add_unrounded(second_difference(self.sum, middle, oldest));
            middle = oldest;
        }
    }

    /// Passes on what the line above let out, as far as the newest sample ends strides, from `level` on.
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

    /// Notes that `missing` samples were lost before the next one: no difference will straddle the gap.
    ///
    /// What was learnt is kept. A gap of 0 samples is none.
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

    /// Adds what another estimator learnt from a later stretch of the same channel, and goes on where it stands.
    ///
    /// No difference straddles the seam: the result is that of one estimator with a gap there, of no samples.
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

    /// Forgets everything.
    pub fn reset(&mut self) {
        // In place: a new one would pass over the stack.
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

    /// Whether samples far beyond 24 bits have filled an accumulator, so that the curve is a lower bound.
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

    /// The Allan variance, in counts², of every octave that has at least one difference.
    ///
    /// `sample_period` in seconds. The confidence is that of the noise that the local slope suggests; a
    /// [`fit`](crate::fit::fit) gives the one of the fitted mixture.
    #[must_use]
    pub fn curve(&self, sample_period: f64) -> Curve<OCTAVES> {
        let mut curve = Curve::empty();
        Self::draw(&mut curve, sample_period, self.len(), |octave| self.learnt(octave).unwrap_or_default());
        curve
    }

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
    /// For products of channels in step, as [`Coupling`](crate::Coupling) makes them; `octave` below `OCTAVES`.
    #[inline]
    #[must_use]
    pub fn newest_difference(&self, octave: usize) -> Option<i64> {
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
            1 => self.octaves[level + Self::FINE].line[slot],
            _ => self.octaves[level + Self::FINE].oldest,
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
