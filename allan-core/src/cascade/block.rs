//! Many samples at once: the same differences level by level, in loops that a compiler can vectorise.

use super::moments::ROUNDED;
use super::{Cascade, second_difference};

/// Samples that are taken together.
const BLOCK: usize = 256;
/// Running sums of earlier samples that a block's differences reach back to.
const HISTORY: usize = 2 * 16;

/// Running sums of one level: those of the past in front, then the block's own.
struct Sums {
    values: [i64; HISTORY + BLOCK],
    /// The same less a common part, where that leaves 30 bits.
    narrow: [i32; HISTORY + BLOCK],
    is_narrow: bool,
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
        let mut sums =
            Sums { values: [0; HISTORY + BLOCK], narrow: [0; HISTORY + BLOCK], is_narrow: false, past: 0, new: 0 };
        for block in samples.chunks(BLOCK) {
            self.push_block(block, &mut sums);
        }
    }

    fn push_block(&mut self, block: &[i32], sums: &mut Sums) {
        sums.past = self.elapsed;
        sums.new = block.len();
        for back in 0..OVERLAP {
            sums.values[HISTORY - 1 - back] = self.recent[Self::slot(sums.past.wrapping_sub(back as u64))];
        }
        for (slot, &sample) in sums.values[HISTORY..].iter_mut().zip(block) {
            self.sum = self.sum.wrapping_add(i64::from(sample));
            *slot = self.sum;
        }
        self.elapsed += block.len() as u64;
        for back in 0..OVERLAP {
            self.recent[Self::slot(self.elapsed.wrapping_sub(back as u64))] = sums.before(back);
        }

        for level in 0..Self::LEVELS {
            self.recall(level, sums);
            sums.narrow(2 * OVERLAP);
            if level == 0 {
                for octave in 0..Self::FINE {
                    self.accumulate_block(octave, 1 << octave, sums);
                }
            }
            self.accumulate_block(level + Self::FINE, OVERLAP, sums);
            self.keep(level, sums);
            sums.halve(OVERLAP);
            if sums.new == 0 {
                break;
            }
        }
    }

    /// Brings what the level's line holds in front of the sums that the level above left.
    fn recall(&self, level: usize, sums: &mut Sums) {
        for back in OVERLAP..2 * OVERLAP {
            let slot = Self::slot(sums.past.wrapping_sub(back as u64));
            sums.values[HISTORY - 1 - back] = self.octaves[level + Self::FINE].line[slot];
        }
    }

    /// Fills the level's line anew.
    fn keep(&mut self, level: usize, sums: &Sums) {
        let last = sums.past + sums.new as u64;
        let octave = &mut self.octaves[level + Self::FINE];
        for back in OVERLAP..2 * OVERLAP {
            octave.line[Self::slot(last.wrapping_sub(back as u64))] = sums.before(back);
        }
        octave.oldest = sums.before(2 * OVERLAP);
    }

    /// The differences over `reach` steps of a level that end in the block.
    fn accumulate_block(&mut self, octave: usize, reach: usize, sums: &Sums) {
        // The first difference ends at step 2·reach.
        let first = (2 * reach as u64).saturating_sub(sums.past + 1);
        if first >= sums.new as u64 {
            return;
        }
        let first = HISTORY + first as usize;
        let moments = &mut self.octaves[octave].moments;
        if let Some((squares, fourths)) = sums.narrow_powers(first, reach).filter(|_| octave < ROUNDED) {
            moments.squares.add(u128::from(squares));
            moments.fourths.add(u128::from(fourths));
            return;
        }
        let [newest, middle, oldest] = sums.differing(&sums.values, first, reach);
        for ((&newest, &middle), &oldest) in newest.iter().zip(middle).zip(oldest) {
            moments.add(octave, second_difference(newest, middle, oldest));
        }
    }
}

impl Sums {
    /// The sum of `back` steps before the newest.
    fn before(&self, back: usize) -> i64 {
        self.values[HISTORY + self.new - 1 - back]
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

    /// Takes what all sums have in common off them, if they differ by less than 2³⁰: so do not their differences leave
    /// 32 bits.
    fn narrow(&mut self, history: usize) {
        let steps = HISTORY - history..HISTORY + self.new;
        let base = self.values[steps.start].wrapping_sub(1 << 29);
        let mut used = 0;
        for (narrow, value) in self.narrow[steps.clone()].iter_mut().zip(&self.values[steps]) {
            let rest = value.wrapping_sub(base);
            used |= rest;
            *narrow = rest as i32;
        }
        self.is_narrow = used as u64 >> 30 == 0;
    }

    /// The new sums from step `first` on, and those of `reach` and of `2·reach` steps before each.
    fn differing<'a, T>(&self, values: &'a [T], first: usize, reach: usize) -> [&'a [T]; 3] {
        let steps = first..HISTORY + self.new;
        [0, reach, 2 * reach].map(|back| &values[steps.start - back..steps.end - back])
    }

    /// Sums of squares and of fourth powers in the width of a vector unit; `None` if a difference has 15 bits or more,
    /// as 256 fourth powers of 14 bits fill the word.
    fn narrow_powers(&self, first: usize, reach: usize) -> Option<(u64, u64)> {
        if !self.is_narrow {
            return None;
        }
        let [newest, middle, oldest] = self.differing(&self.narrow, first, reach);
        let (mut digits, mut squares, mut fourths) = (0, 0_u64, 0_u64);
        for ((newest, middle), oldest) in newest.iter().zip(middle).zip(oldest) {
            let difference = newest.wrapping_sub(*middle).wrapping_sub(middle.wrapping_sub(*oldest));
            digits |= difference ^ (difference >> 31);
            let small = i32::from(difference as i16);
            let square = u64::from(small.wrapping_mul(small) as u32);
            squares = squares.wrapping_add(square);
            fourths = fourths.wrapping_add(square.wrapping_mul(square));
        }
        (digits < 1 << 14).then_some((squares, fourths))
    }
}
