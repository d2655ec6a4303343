//! Slices of samples: the same differences as sample by sample, computed level by level in loops that vectorise.

use super::small_powers::{SMALL, small_powers};
use super::{Cascade, second_difference};
use crate::moments::{rounded, unit_bits};

/// Samples of one block.
const BLOCK: usize = 1024;
/// Slices with fewer samples are added sample by sample.
const SHORTEST_BLOCK: usize = 64;
/// Running sums before a block that its differences reach back to.
const HISTORY: usize = 2 * 16;

/// Running sums of one level, relative to a common base: first those before the block, then those of the block.
struct Sums<W> {
    values: [W; HISTORY + BLOCK],
    base: i64,
    /// Number of steps of the level before the block.
    past: u64,
    /// Number of sums of the block at this level.
    new: usize,
    /// Bit set of the octaves whose differences had 14 bits or more in the last block: sums for smaller ones are not tried.
    large: u64,
}

impl<const OCTAVES: usize, const OVERLAP: usize> Cascade<OCTAVES, OVERLAP> {
    /// Adds samples in order: the same result as [`push`](Self::push) for each, and faster on 64-bit machines.
    ///
    /// # Cost
    /// | `Cascade::push_slice` | Cortex-M4F | Cortex-M0+ |
    /// |---|---|---|
    /// | instructions on average | 198 | 505 |
    /// | stack, bytes | 124 | 300 |
    /// | flash, bytes | 4,970 | — |
    ///
    /// See [`guide::costs`](crate::guide::costs) for how they are counted.
    pub fn push_slice(&mut self, samples: &[i32]) {
        if cfg!(target_pointer_width = "32") {
            return samples.iter().for_each(|&sample| self.push(sample));
        }
        // Few samples are cheaper one by one, and the first sample after a gap closes it.
        let single = if samples.len() < SHORTEST_BLOCK { samples.len() } else { usize::from(self.pending > 0) };
        let (single, samples) = samples.split_at(single);
        single.iter().for_each(|&sample| self.push(sample));
        if samples.is_empty() {
            return;
        }
        let mut narrow = Sums::<i32>::new();
        for block in samples.chunks(BLOCK) {
            if let Some((level, mut wide)) = self.push_narrow(block, &mut narrow) {
                self.descend(level, &mut wide);
            }
        }
    }

    /// Processes a block in 32-bit sums, down to the first level whose sums do not fit; returns that level and its sums.
    fn push_narrow(&mut self, block: &[i32], narrow: &mut Sums<i32>) -> Option<(usize, Sums<i64>)> {
        if self.begin(block, narrow) {
            return self.descend(0, narrow).map(|level| (level, narrow.widened()));
        }
        let mut wide = Sums::new();
        self.begin(block, &mut wide);
        Some((0, wide))
    }

    /// Sets `sums` to those of the first level; false, and no change, if one does not fit in a word.
    fn begin<W: Word>(&mut self, block: &[i32], sums: &mut Sums<W>) -> bool {
        sums.base = W::base(self.sum);
        sums.past = self.elapsed;
        sums.new = block.len();
        let mut used = sums.put_past(0, &self.recent);
        let mut sum = self.sum.wrapping_sub(sums.base);
        for (slot, &sample) in sums.values[HISTORY..].iter_mut().zip(block) {
            sum = sum.wrapping_add(i64::from(sample));
            used |= sum as u64;
            *slot = W::truncated(sum);
        }
        let fits = used <= W::MAX;
        if fits {
            self.sum = sum.wrapping_add(sums.base);
            self.elapsed += block.len() as u64;
            sums.keep_past(0, &mut self.recent);
        }
        fits
    }

    /// Adds the differences from `level` on; returns the first level whose earlier sums do not fit in a word.
    fn descend<W: Word>(&mut self, level: usize, sums: &mut Sums<W>) -> Option<usize> {
        for level in level..Self::LEVELS {
            let line = &mut self.octaves[level + Self::FINE].line;
            if sums.put_past(OVERLAP, line) > W::MAX {
                return Some(level);
            }
            sums.keep_past(OVERLAP, line);
            self.octaves[level + Self::FINE].oldest = sums.before(2 * OVERLAP);
            if level == 0 {
                for octave in 0..Self::FINE {
                    self.accumulate_block(octave, 1 << octave, sums);
                }
            }
            self.accumulate_block(level + Self::FINE, OVERLAP, sums);
            sums.halve(OVERLAP);
            if sums.new == 0 {
                break;
            }
        }
        None
    }

    /// Adds the differences with an averaging time of `reach` steps that end in the block.
    fn accumulate_block<W: Word>(&mut self, octave: usize, reach: usize, sums: &mut Sums<W>) {
        // The first difference ends two averaging times after the gap.
        let level = octave.saturating_sub(Self::FINE);
        let complete = self.octaves[octave].resumed + (2 << octave);
        let first = ((complete + (1 << level) - 1) >> level).saturating_sub(sums.past + 1);
        if first >= sums.new as u64 {
            return;
        }
        let steps = HISTORY + first as usize..HISTORY + sums.new;
        let terms = [0, reach, 2 * reach].map(|back| &sums.values[steps.start - back..steps.end - back]);
        let moments = &mut self.octaves[octave].moments;
        let mut is_large = (sums.large >> octave) & 1 == 1;
        if let Some((squares, fourths)) = W::powers(terms, unit_bits(octave), &mut is_large) {
            moments.squares.add(squares);
            moments.fourths.add(fourths);
        } else {
            differences(terms).for_each(|difference| moments.add(octave, difference));
        }
        sums.large = (sums.large & !(1 << octave)) | (u64::from(is_large) << octave);
    }
}

impl<W: Word> Sums<W> {
    fn new() -> Self {
        Self { values: [W::default(); HISTORY + BLOCK], base: 0, past: 0, new: 0, large: 0 }
    }

    fn widened(&self) -> Sums<i64> {
        let values = self.values.map(|value| self.base.wrapping_add(value.into()));
        Sums { values, base: 0, past: self.past, new: self.new, large: self.large }
    }

    fn before(&self, back: usize) -> i64 {
        self.base.wrapping_add(self.values[HISTORY + self.new - 1 - back].into())
    }

    /// Copies the sums of `nearest` and more steps ago from a delay line in front of the block; returns the bits they use.
    #[inline]
    fn put_past<const OVERLAP: usize>(&mut self, nearest: usize, line: &[i64; OVERLAP]) -> u64 {
        let mut used = 0;
        for back in nearest..nearest + OVERLAP {
            let sum = line[self.past.wrapping_sub(back as u64) as usize & (OVERLAP - 1)].wrapping_sub(self.base);
            used |= sum as u64;
            self.values[HISTORY - 1 - back] = W::truncated(sum);
        }
        used
    }

    /// Fills a delay line with the sums of `nearest` and more steps before the end of the block.
    #[inline]
    fn keep_past<const OVERLAP: usize>(&self, nearest: usize, line: &mut [i64; OVERLAP]) {
        let last = self.past + self.new as u64;
        for back in nearest..nearest + OVERLAP {
            line[last.wrapping_sub(back as u64) as usize & (OVERLAP - 1)] = self.before(back);
        }
    }

    /// Keeps every second sum, which are those of the next level, and the last `history` of those before the block.
    fn halve(&mut self, history: usize) {
        let odd = (self.past & 1) as usize;
        let new = (self.new + odd) / 2;
        for index in 0..new {
            self.values[HISTORY + index] = self.values[HISTORY + 2 * index + 1 - odd];
        }
        for back in 0..history {
            self.values[HISTORY - 1 - back] = self.values[HISTORY - 1 - odd - 2 * back];
        }
        self.past >>= 1;
        self.new = new;
    }
}

/// A word that holds a running sum relative to a base.
trait Word: Copy + Default + Into<i64> {
    const MAX: u64;

    fn base(sum: i64) -> i64;

    fn truncated(sum: i64) -> Self;

    /// Sums of the squares and, rounded by `bits`, of the fourth powers of the second differences; `None` if they might
    /// not fit. `is_large` is the expectation that differences have 14 bits or more, and on return whether they did.
    fn powers(sums: [&[Self]; 3], bits: u32, is_large: &mut bool) -> Option<(u128, u128)>;
}

impl Word for i64 {
    const MAX: u64 = u64::MAX;

    fn base(_: i64) -> i64 {
        0
    }

    fn truncated(sum: i64) -> Self {
        sum
    }

    fn powers(sums: [&[Self]; 3], bits: u32, _: &mut bool) -> Option<(u128, u128)> {
        wide_powers(sums, bits)
    }
}

/// Holds sums of 30 bits, whose second differences fit in the word; vector units process more of these at once.
impl Word for i32 {
    const MAX: u64 = (1 << 30) - 1;

    fn base(sum: i64) -> i64 {
        sum.wrapping_sub(1 << 29)
    }

    fn truncated(sum: i64) -> Self {
        sum as i32
    }

    fn powers(sums: [&[Self]; 3], bits: u32, is_large: &mut bool) -> Option<(u128, u128)> {
        if bits > 0 {
            return wide_powers(sums, bits);
        }
        if !*is_large && let Some(powers) = small_powers(sums) {
            return Some(powers);
        }
        let powers = middle_powers(sums);
        *is_large = powers.is_none_or(|(_, digits)| digits >= SMALL);
        powers.map(|(powers, _)| powers).or_else(|| wide_powers(sums, bits))
    }
}

/// Bits of a difference, and of a half of its square, in [`middle_powers`].
const HALF: u32 = 26;

/// The sums, and the bits of the differences; `None` if one has 27 bits or more.
fn middle_powers(sums: [&[i32]; 3]) -> Option<((u128, u128), u32)> {
    let product = |one: u64, other: u64| (one & 0xffff_ffff) * (other & 0xffff_ffff);
    let (mut digits, mut squares, mut high, mut middle, mut low) = (0, 0_u64, 0_u64, 0_u64, 0_u64);
    for (newest, middle_sum, oldest) in zipped(sums) {
        let magnitude = newest.wrapping_sub(middle_sum).wrapping_sub(middle_sum.wrapping_sub(oldest)).unsigned_abs();
        digits |= magnitude;
        let square = product(magnitude.into(), magnitude.into());
        squares = squares.wrapping_add(square);
        let (upper, lower) = (square >> HALF, square & ((1 << HALF) - 1));
        high = high.wrapping_add(product(upper, upper));
        middle = middle.wrapping_add(product(upper, lower));
        low = low.wrapping_add(product(lower, lower));
    }
    let fourths = (u128::from(high) << (2 * HALF)) + (u128::from(middle) << (HALF + 1)) + u128::from(low);
    (digits < 1 << HALF).then_some(((squares.into(), fourths), digits))
}

/// Sums of the powers of differences of up to 28 bits: the fourth powers of a block fill 122 bits. `None` if a
/// difference has 29 bits or more.
fn wide_powers<W: Word>(sums: [&[W]; 3], bits: u32) -> Option<(u128, u128)> {
    let square = |factor: i64| u128::from(factor.wrapping_mul(factor) as u64);
    let (mut digits, mut squares, mut fourths) = (0, 0_u128, 0_u128);
    for difference in differences(sums) {
        digits |= difference.unsigned_abs();
        let rounded = square(rounded(difference, bits));
        squares += square(difference);
        fourths = fourths.wrapping_add(rounded * rounded);
    }
    (digits < 1 << 28).then_some((squares, fourths))
}

fn differences<W: Word>(sums: [&[W]; 3]) -> impl Iterator<Item = i64> {
    zipped(sums).map(|(newest, middle, oldest)| second_difference(newest.into(), middle.into(), oldest.into()))
}

fn zipped<W: Word>([newest, middle, oldest]: [&[W]; 3]) -> impl Iterator<Item = (W, W, W)> {
    newest.iter().zip(middle).zip(oldest).map(|((&newest, &middle), &oldest)| (newest, middle, oldest))
}
