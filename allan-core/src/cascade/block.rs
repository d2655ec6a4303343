//! Many samples at once: the same differences level by level, in loops that a compiler can vectorise.

use super::{Cascade, second_difference};

/// Samples that are taken together.
const BLOCK: usize = 256;
/// Running sums of earlier samples that a block's differences reach back to: `2·OVERLAP` for the largest one.
const HISTORY: usize = 32;

/// Running sums of one level: those of the past in front, then the block's own.
struct Sums {
    values: [i64; HISTORY + BLOCK],
    /// Steps that the level had taken before the block.
    past: u64,
    new: usize,
}

impl<const OCTAVES: usize, const OVERLAP: usize> Cascade<OCTAVES, OVERLAP> {
    /// Takes samples in order; the same as [`push`](Self::push) for each, in a third of the time.
    pub fn push_slice(&mut self, samples: &[i32]) {
        let mut sums = Sums { values: [0; HISTORY + BLOCK], past: 0, new: 0 };
        for block in samples.chunks(BLOCK) {
            self.push_block(block, &mut sums);
        }
    }

    fn push_block(&mut self, block: &[i32], sums: &mut Sums) {
        sums.past = self.elapsed;
        sums.new = block.len();
        self.recall(0, sums);
        for (slot, &sample) in sums.values[HISTORY..].iter_mut().zip(block) {
            self.sum = self.sum.wrapping_add(i64::from(sample));
            *slot = self.sum;
        }
        self.samples += block.len() as u64;
        self.elapsed += block.len() as u64;

        for octave in 0..=Self::FINE {
            self.accumulate_block(octave, 1 << octave, sums);
        }
        self.keep(0, sums);
        for level in 1..OCTAVES - Self::FINE {
            sums.halve();
            if sums.new == 0 {
                break;
            }
            self.recall(level, sums);
            self.accumulate_block(level + Self::FINE, OVERLAP, sums);
            self.keep(level, sums);
        }
    }

    /// Brings the ring of a level in front of its new sums.
    fn recall(&self, level: usize, sums: &mut Sums) {
        for back in 0..2 * OVERLAP as u64 {
            let (half, slot) = Self::slot(sums.past.wrapping_sub(back));
            sums.values[HISTORY - 1 - back as usize] = self.rings[level][half][slot];
        }
    }

    /// Writes the new sums of a level into its ring.
    fn keep(&mut self, level: usize, sums: &Sums) {
        for index in sums.new.saturating_sub(2 * OVERLAP)..sums.new {
            let (half, slot) = Self::slot(sums.past + 1 + index as u64);
            self.rings[level][half][slot] = sums.values[HISTORY + index];
        }
    }

    /// The differences over `reach` steps of a level that end in the block.
    fn accumulate_block(&mut self, octave: usize, reach: usize, sums: &Sums) {
        // The first difference ends at step 2·reach.
        let first = (2 * reach as u64).saturating_sub(sums.past + 1);
        if first >= sums.new as u64 {
            return;
        }
        let first = HISTORY + first as usize;
        let newest = &sums.values[first..HISTORY + sums.new];
        let middle = &sums.values[first - reach..][..newest.len()];
        let oldest = &sums.values[first - 2 * reach..][..newest.len()];
        let differences =
            || newest.iter().zip(middle).zip(oldest).map(|((&new, &mid), &old)| second_difference(new, mid, old));
        self.squares[octave] = self.squares[octave].saturating_add(sum_of_squares(differences));
        self.differences[octave] += newest.len() as u64;
    }
}

impl Sums {
    /// Leaves every second running sum: those of the next level.
    fn halve(&mut self) {
        let odd = (self.past & 1) as usize;
        let new = (self.new + odd) / 2;
        for index in 0..new {
            self.values[HISTORY + index] = self.values[HISTORY + 2 * index + 1 - odd];
        }
        self.past >>= 1;
        self.new = new;
    }
}

/// At most [`BLOCK`] squares: those of numbers below 2²⁸ fit in 64 bits together.
fn sum_of_squares<I: Iterator<Item = i64>>(differences: impl Fn() -> I) -> u128 {
    let widest = differences().fold(0, |bits, difference| bits | difference.unsigned_abs());
    if widest < 1 << 28 {
        let sum: u64 = differences()
            .map(|difference| {
                let magnitude = u64::from((difference as i32).unsigned_abs());
                magnitude * magnitude
            })
            .sum();
        u128::from(sum)
    } else {
        differences().fold(0, |sum: u128, difference| {
            let magnitude = u128::from(difference.unsigned_abs());
            sum.saturating_add(magnitude * magnitude)
        })
    }
}
