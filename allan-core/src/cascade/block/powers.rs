//! Sums of squares and of fourth powers of the second differences of a block.

use crate::cascade::moments::rounded;
use crate::cascade::second_difference;

/// What running sums are held in, less a base.
pub(super) trait Word: Copy + Default + Into<i64> {
    /// No bits beyond these may be in use.
    const MAX: u64;

    /// What to take off the sums around this one.
    fn base(sum: i64) -> i64;

    fn truncated(sum: i64) -> Self;

    /// Sums of squares and of fourth powers of the differences of newest, middle and oldest sums, rounded by `bits` for
    /// the latter; `None` where they might not fit.
    fn powers(sums: [&[Self]; 3], bits: u32) -> Option<(u128, u128)>;
}

/// Any sum.
impl Word for i64 {
    const MAX: u64 = u64::MAX;

    fn base(_: i64) -> i64 {
        0
    }

    fn truncated(sum: i64) -> Self {
        sum
    }

    fn powers(sums: [&[Self]; 3], bits: u32) -> Option<(u128, u128)> {
        wide_powers(sums, bits)
    }
}

/// Sums of 30 bits, whose second differences do not leave the word: of those, vector units take more at once.
impl Word for i32 {
    const MAX: u64 = (1 << 30) - 1;

    fn base(sum: i64) -> i64 {
        sum.wrapping_sub(1 << 29)
    }

    fn truncated(sum: i64) -> Self {
        sum as i32
    }

    fn powers(sums: [&[Self]; 3], bits: u32) -> Option<(u128, u128)> {
        let exact = (bits == 0).then(|| narrow_powers(sums)).flatten();
        exact.or_else(|| wide_powers(sums, bits))
    }
}

/// `None` if a difference has 14 bits or more, as a block of fourth powers of 13 bits fills 62.
fn narrow_powers(sums: [&[i32]; 3]) -> Option<(u128, u128)> {
    let (mut digits, mut squares, mut fourths) = (0, 0_u64, 0_u64);
    for (newest, middle, oldest) in zipped(sums) {
        let magnitude = (newest - middle - (middle - oldest)).unsigned_abs();
        digits |= magnitude;
        // Factors of 15 bits: that much the vector units of every x86-64 multiply at once.
        let small = magnitude & 0x7fff;
        let square = u64::from(small * small);
        squares += square;
        fourths = fourths.wrapping_add(square * square);
    }
    (digits < 1 << 13).then_some((squares.into(), fourths.into()))
}

/// `None` if a difference has 29 bits or more, as a block of fourth powers of 28 bits fills 122.
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

/// In the widest word.
pub(super) fn differences<W: Word>(sums: [&[W]; 3]) -> impl Iterator<Item = i64> {
    zipped(sums).map(|(newest, middle, oldest)| second_difference(newest.into(), middle.into(), oldest.into()))
}

fn zipped<W: Word>([newest, middle, oldest]: [&[W]; 3]) -> impl Iterator<Item = (W, W, W)> {
    newest.iter().zip(middle).zip(oldest).map(|((&newest, &middle), &oldest)| (newest, middle, oldest))
}
