//! Many samples at once: the same differences level by level, in loops that a compiler can vectorise.

mod powers;

use super::Cascade;
use super::moments::unit_bits;
use powers::{Word, differences};

/// Samples that are taken together.
const BLOCK: usize = 1024;
/// Running sums of earlier samples that a block's differences reach back to.
const HISTORY: usize = 2 * 16;

/// Running sums of one level, less a common base: those of the past in front, then the block's own.
struct Sums<W> {
    values: [W; HISTORY + BLOCK],
    base: i64,
    /// Steps that the level had taken before the block.
    past: u64,
    new: usize,
}

impl<const OCTAVES: usize, const OVERLAP: usize> Cascade<OCTAVES, OVERLAP> {
    /// Takes samples in order; the same as [`push`](Self::push) for each, and faster where words have 64 bits.
    pub fn push_slice(&mut self, samples: &[i32]) {
        if cfg!(target_pointer_width = "32") {
            return samples.iter().for_each(|&sample| self.push(sample));
        }
        let mut narrow = Sums::<i32>::new();
        for block in samples.chunks(BLOCK) {
            if let Some((level, mut wide)) = self.push_narrow(block, &mut narrow) {
                self.descend(level, &mut wide);
            }
        }
    }

    /// Takes a block down to the level whose sums do not fit in narrow words; returns that level and its sums.
    fn push_narrow(&mut self, block: &[i32], narrow: &mut Sums<i32>) -> Option<(usize, Sums<i64>)> {
        if self.begin(block, narrow) {
            return self.descend(0, narrow).map(|level| (level, narrow.widened()));
        }
        let mut wide = Sums::new();
        self.begin(block, &mut wide);
        Some((0, wide))
    }

    /// Adds the samples up, behind the recent sums. Nothing has happened if a sum does not fit.
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

    /// Takes the differences from `level` on; returns the level whose past does not fit.
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

    /// The differences over `reach` steps of a level that end in the block.
    fn accumulate_block<W: Word>(&mut self, octave: usize, reach: usize, sums: &Sums<W>) {
        // The first difference ends at step 2·reach.
        let first = (2 * reach as u64).saturating_sub(sums.past + 1);
        if first >= sums.new as u64 {
            return;
        }
        let steps = HISTORY + first as usize..HISTORY + sums.new;
        let sums = [0, reach, 2 * reach].map(|back| &sums.values[steps.start - back..steps.end - back]);
        let moments = &mut self.octaves[octave].moments;
        if let Some((squares, fourths)) = W::powers(sums, unit_bits(octave)) {
            moments.squares.add(squares);
            moments.fourths.add(fourths);
        } else {
            differences(sums).for_each(|difference| moments.add(octave, difference));
        }
    }
}

impl<W: Word> Sums<W> {
    fn new() -> Self {
        Self { values: [W::default(); HISTORY + BLOCK], base: 0, past: 0, new: 0 }
    }

    /// The same in words that hold any sum.
    fn widened(&self) -> Sums<i64> {
        let values = self.values.map(|value| self.base.wrapping_add(value.into()));
        Sums { values, base: 0, past: self.past, new: self.new }
    }

    /// The sum of `back` steps before the newest.
    fn before(&self, back: usize) -> i64 {
        self.base.wrapping_add(self.values[HISTORY + self.new - 1 - back].into())
    }

    /// Puts a line of sums, of `nearest` steps ago and before, in front of the block; returns the bits that they use.
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

    /// Fills a line anew, with the sums of `nearest` steps ago and before.
    #[inline]
    fn keep_past<const OVERLAP: usize>(&self, nearest: usize, line: &mut [i64; OVERLAP]) {
        let last = self.past + self.new as u64;
        for back in nearest..nearest + OVERLAP {
            line[last.wrapping_sub(back as u64) as usize & (OVERLAP - 1)] = self.before(back);
        }
    }

    /// Leaves every second running sum: those of the next level, the last `history` of the past among them.
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
