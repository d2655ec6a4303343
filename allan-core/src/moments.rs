//! Exact sums of the squares and fourth powers of second differences.

/// Exact sum of squares, and the sum of fourth powers of the differences rounded by [`unit_bits`] binary digits.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Moments {
    pub(crate) squares: Sum,
    pub(crate) fourths: Sum,
}

impl Moments {
    pub(crate) const ZERO: Self = Self { squares: Sum::ZERO, fourths: Sum::ZERO };

    /// Adds one difference of an octave below [`ROUNDED`].
    ///
    /// A fourth power is at least its square, so `squares.low` stays below `2⁶³ + fourths.low` and its carry may wait.
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

    /// Adds one difference of any octave.
    pub(crate) fn add(&mut self, octave: usize, difference: i64) {
        if octave < ROUNDED {
            self.add_unrounded(difference);
        } else if is_small(difference) {
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

    /// Excess kurtosis of `count` differences; `None` if all are 0 or a sum is full.
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

/// Binary digits that a difference is rounded by: at 1 count rms of white noise the kurtosis changes by 1.5·10⁻³.
#[inline]
pub(crate) const fn unit_bits(octave: usize) -> u32 {
    (octave.saturating_sub(ROUNDED - 2) / 2) as u32
}

/// The difference in units of `2^bits`, rounded to nearest, ties up.
#[inline]
pub(crate) const fn rounded(difference: i64, bits: u32) -> i64 {
    (difference + (1 << bits >> 1)) >> bits
}

/// True if the fourth power fits in 60 bits.
#[inline]
const fn is_small(difference: i64) -> bool {
    difference.wrapping_add(1 << 15) as u64 >> 16 == 0
}

/// Fourth power of a difference rounded by `bits` digits; `u128::MAX` where it does not fit.
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

/// A sum of 127 bits that stays at its maximum once it is full.
///
/// Held as `high·2⁶³ + low`, with the top bit of `low` a pending carry; equality compares values.
#[derive(Debug, Clone, Copy)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub(crate) struct Sum {
    low: u64,
    high: u64,
}

const CARRY: u64 = 1 << 63;

impl Sum {
    pub(crate) const ZERO: Self = Self { low: 0, high: 0 };
    pub(crate) const MAX: u128 = (1 << 127) - 1;

    #[inline]
    pub(crate) fn get(self) -> u128 {
        ((u128::from(self.high) << 63) + u128::from(self.low)).min(Self::MAX)
    }

    pub(crate) fn is_full(self) -> bool {
        self.get() == Self::MAX
    }

    /// Adds `value`, saturating at [`MAX`](Self::MAX).
    pub(crate) fn add(&mut self, value: u128) {
        *self = Self::from(self.get().saturating_add(value));
    }

    /// Adds less than 2⁶³.
    #[inline]
    pub(crate) fn add_word(&mut self, word: u64) {
        if self.must_carry() {
            self.carry();
        }
        self.low += word;
        if self.must_carry() {
            self.carry();
        }
    }

    /// Adds a word without propagating the carry; the caller ensures that `low` stays below 2⁶⁴.
    #[inline]
    pub(crate) fn add_below_carry(&mut self, word: u64) {
        self.low += word;
    }

    #[inline]
    pub(crate) fn must_carry(self) -> bool {
        self.low >= CARRY
    }

    #[cold]
    pub(crate) fn carry(&mut self) {
        *self = Self::from(self.get());
    }

    /// Both words with the carry propagated, the lower one first.
    #[cfg(feature = "serde")]
    pub(crate) fn words(&mut self) -> [&mut u64; 2] {
        self.carry();
        [&mut self.low, &mut self.high]
    }
}

impl From<u128> for Sum {
    fn from(value: u128) -> Self {
        let value = value.min(Self::MAX);
        Self { low: value as u64 & (CARRY - 1), high: (value >> 63) as u64 }
    }
}

impl PartialEq for Sum {
    fn eq(&self, other: &Self) -> bool {
        self.get() == other.get()
    }
}

impl Eq for Sum {}
