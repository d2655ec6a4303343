//! What is kept of the second differences of one octave.

use super::sum::Sum;

/// Exact sum of squares, and the sum of fourth powers of the differences rounded to [`unit_bits`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Moments {
    pub(crate) squares: Sum,
    pub(crate) fourths: Sum,
}

impl Moments {
    pub(crate) const NONE: Self = Self { squares: Sum::ZERO, fourths: Sum::ZERO };

    /// Takes one difference of an octave below [`ROUNDED`]. Most are small: a microcontroller multiplies 32 bits.
    ///
    /// No fourth power is below its square, so a square's carry may stand until the fourth powers' comes:
    /// `squares.low` stays below `2⁶³ + fourths.low`.
    #[inline]
    pub(crate) fn add_unrounded(&mut self, difference: i64) {
        if is_small(difference) {
            let square = u64::from((difference as i32 * difference as i32) as u32);
            self.squares.add_below_carry(square);
            self.fourths.add_below_carry(square * square);
            if self.fourths.must_carry() {
                self.carry();
            }
        } else {
            self.add_wide(0, difference);
        }
    }

    /// Takes one difference.
    pub(crate) fn add(&mut self, octave: usize, difference: i64) {
        if is_small(difference) {
            let bits = unit_bits(octave);
            let rounded = (difference as i32 + (1 << bits >> 1)) >> bits;
            let square = u64::from((rounded * rounded) as u32);
            self.squares.add_below_carry((difference * difference) as u64);
            self.fourths.add_below_carry(square * square);
            if self.squares.must_carry() || self.fourths.must_carry() {
                self.carry();
            }
        } else {
            self.add_wide(octave, difference);
        }
    }

    #[cold]
    #[inline(never)]
    fn carry(&mut self) {
        self.squares.carry();
        self.fourths.carry();
    }

    #[inline(never)]
    fn add_wide(&mut self, octave: usize, difference: i64) {
        let magnitude = difference.unsigned_abs();
        if magnitude < 1 << 31 {
            self.squares.add_word(magnitude * magnitude);
        } else {
            self.squares.add(u128::from(magnitude) * u128::from(magnitude));
        }
        self.fourths.add(fourth_power(difference, unit_bits(octave)));
    }

    pub(crate) fn merge(&mut self, later: &Self) {
        self.squares.add(later.squares.get());
        self.fourths.add(later.fourths.get());
    }

    /// Excess kurtosis of `count` differences; `None` if there is none, or a sum is full.
    pub(crate) fn excess_kurtosis(&self, octave: usize, count: u64) -> Option<f64> {
        let (squares, fourths) = (self.squares.get(), self.fourths.get());
        if squares == 0 || self.squares.is_full() || self.fourths.is_full() {
            return None;
        }
        let unit = (1_u64 << unit_bits(octave)) as f64;
        let square = squares as f64 / (unit * unit);
        Some(fourths as f64 * count as f64 / (square * square) - 3.0)
    }
}

/// The first octave whose differences are rounded.
pub(crate) const ROUNDED: usize = 11;

/// Binary digits that a difference is rounded by before its fourth power is summed.
///
/// White noise of 1 count has differences of `√(2n)` counts, 32 units or more: the rounding adds 1.5·10⁻³ to
/// the kurtosis at most. Ties go up, whatever the sign, so they cancel.
#[inline]
pub(crate) const fn unit_bits(octave: usize) -> u32 {
    (octave.saturating_sub(ROUNDED - 2) / 2) as u32
}

/// The difference in units of `2^bits`.
#[inline]
pub(crate) const fn rounded(difference: i64, bits: u32) -> i64 {
    (difference + (1 << bits >> 1)) >> bits
}

/// Whether the fourth power fits in 60 bits.
#[inline]
const fn is_small(difference: i64) -> bool {
    difference.wrapping_add(1 << 15) as u64 >> 16 == 0
}

/// Fourth power of a difference rounded by `bits` digits, saturating.
#[inline]
pub(crate) fn fourth_power(difference: i64, bits: u32) -> u128 {
    match u32::try_from(rounded(difference, bits).unsigned_abs()) {
        Ok(magnitude) => {
            let square = u128::from(u64::from(magnitude) * u64::from(magnitude));
            square * square
        }
        Err(_) => u128::MAX,
    }
}
