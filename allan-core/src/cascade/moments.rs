//! What is kept of the second differences of one octave.

/// Exact sum of squares, and the sum of fourth powers of the differences rounded to [`unit_bits`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Moments {
    pub(crate) squares: u128,
    pub(crate) fourths: u128,
}

impl Moments {
    pub(crate) const NONE: Self = Self { squares: 0, fourths: 0 };

    /// Takes one difference. Most are small: a microcontroller multiplies 32 bits at a time.
    #[inline]
    pub(crate) fn add(&mut self, octave: usize, difference: i64) {
        if let Ok(small) = i16::try_from(difference) {
            let small = i32::from(small);
            let bits = unit_bits(octave);
            let rounded = (small + (1 << bits >> 1)) >> bits;
            let square = u64::from((rounded * rounded) as u32);
            self.add_sums(u128::from((small * small) as u32), u128::from(square * square));
        } else {
            let magnitude = u128::from(difference.unsigned_abs());
            self.add_sums(magnitude * magnitude, fourth_power(difference, unit_bits(octave)));
        }
    }

    /// A full sum stays full.
    #[inline]
    pub(crate) fn add_sums(&mut self, squares: u128, fourths: u128) {
        self.squares = self.squares.saturating_add(squares);
        self.fourths = self.fourths.saturating_add(fourths);
    }

    /// Excess kurtosis of `count` differences; `None` if there is none, or a sum is full.
    pub(crate) fn excess_kurtosis(&self, octave: usize, count: u64) -> Option<f64> {
        if self.squares == 0 || self.squares == u128::MAX || self.fourths == u128::MAX {
            return None;
        }
        let unit = (1_u64 << unit_bits(octave)) as f64;
        let square = self.squares as f64 / (unit * unit);
        Some(self.fourths as f64 * count as f64 / (square * square) - 3.0)
    }
}

/// Binary digits that a difference is rounded by before its fourth power is summed.
///
/// White noise of 1 count has differences of `√(2n)` counts, 32 units or more: the rounding adds 1.5·10⁻³ to
/// the kurtosis at most. Ties go up, whatever the sign, so they cancel.
#[inline]
pub(crate) const fn unit_bits(octave: usize) -> u32 {
    (octave.saturating_sub(9) / 2) as u32
}

/// Fourth power of a difference rounded by `bits` digits, saturating.
#[inline]
pub(crate) fn fourth_power(difference: i64, bits: u32) -> u128 {
    let rounded = (difference + (1 << bits >> 1)) >> bits;
    match u32::try_from(rounded.unsigned_abs()) {
        Ok(magnitude) => {
            let square = u128::from(u64::from(magnitude) * u64::from(magnitude));
            square * square
        }
        Err(_) => u128::MAX,
    }
}
