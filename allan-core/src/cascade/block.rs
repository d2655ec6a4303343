//! Many samples at once: the same differences level by level, in loops that a compiler can vectorise.

use super::moments::{fourth_power, unit_bits};
use super::{Cascade, second_difference};

/// Samples that are taken together.
const BLOCK: usize = 256;
/// Running sums of earlier samples that a block's differences reach back to.
const HISTORY: usize = 2 * 16;

/// Running sums of one level: those of the past in front, then the block's own.
struct Sums {
    values: [i64; HISTORY + BLOCK],
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
        let mut sums = Sums { values: [0; HISTORY + BLOCK], past: 0, new: 0 };
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
        let newest = &sums.values[first..HISTORY + sums.new];
        let middle = &sums.values[first - reach..][..newest.len()];
        let oldest = &sums.values[first - 2 * reach..][..newest.len()];
        let differences =
            || newest.iter().zip(middle).zip(oldest).map(|((&new, &mid), &old)| second_difference(new, mid, old));
        let (squares, fourths) = sums_of_powers(unit_bits(octave), differences);
        let moments = &mut self.octaves[octave].moments;
        moments.squares.add(squares);
        moments.fourths.add(fourths);
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
}

/// Sums of the second and, of magnitudes rounded by `bits` digits, the fourth powers of at most [`BLOCK`] differences.
fn sums_of_powers<I: Iterator<Item = i64>>(bits: u32, differences: impl Fn() -> I) -> (u128, u128) {
    let square_of = |x: i32| u64::from(x.unsigned_abs()) * u64::from(x.unsigned_abs());
    let widest = differences().fold(0, |digits, difference| digits | difference.unsigned_abs());
    if widest < 1 << 28 {
        // Squares below 2⁵⁶, 256 of which fit in 64 bits. Of the fourth power, (a·2²⁸ + b)², the parts fit likewise.
        const HALF: u64 = (1 << 28) - 1;
        let half_unit = 1 << bits >> 1;
        let (mut squares, mut high, mut mixed, mut low) = (0_u64, 0_u64, 0_u64, 0_u64);
        for difference in differences() {
            let difference = difference as i32;
            squares += square_of(difference);
            let square = square_of((difference + half_unit) >> bits);
            let (a, b) = (square >> 28, square & HALF);
            high += a * a;
            mixed += a * b;
            low += b * b;
        }
        (u128::from(squares), (u128::from(high) << 56) + (u128::from(mixed) << 29) + u128::from(low))
    } else {
        differences().fold((0, 0), |(squares, fourths): (u128, u128), difference| {
            let magnitude = u128::from(difference.unsigned_abs());
            (squares.saturating_add(magnitude * magnitude), fourths.saturating_add(fourth_power(difference, bits)))
        })
    }
}
