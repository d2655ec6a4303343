//! Sums of the powers of small second differences, with the registers of 128 bits that every x86-64 has.

#[cfg(not(target_arch = "x86_64"))]
use portable::Powers;
#[cfg(target_arch = "x86_64")]
use sse2::Powers;

/// Differences below this have 13 bits at most: the fourth powers of 1024 fill 62 bits.
pub(super) const SMALL: u32 = 1 << 13;
/// Differences that are added together.
const LANES: usize = 16;

/// Sums of the squares and of the fourth powers of up to 1024 second differences of `sums`, the newest first. `None` if
/// a difference has 14 bits or more.
pub(super) fn small_powers(sums: [&[i32]; 3]) -> Option<(u128, u128)> {
    let [(newest, last_newest), (middle, last_middle), (oldest, last_oldest)] = sums.map(<[i32]>::as_chunks);
    let mut powers = Powers::default();
    for ((newest, middle), oldest) in newest.iter().zip(middle).zip(oldest) {
        powers.add([newest, middle, oldest]);
    }
    let filled_with_zeros = |sums: &[i32]| {
        let mut lanes = [0; LANES];
        lanes[..sums.len()].copy_from_slice(sums);
        lanes
    };
    powers.add([last_newest, last_middle, last_oldest].map(filled_with_zeros).each_ref());
    powers.sums()
}

#[cfg(any(not(target_arch = "x86_64"), test))]
mod portable {
    use super::{LANES, SMALL};

    #[derive(Default)]
    pub(super) struct Powers {
        /// Bitwise or of the magnitudes.
        digits: u32,
        /// Valid if the digits are below [`SMALL`], as the fourth powers.
        squares: u64,
        fourths: u64,
    }

    impl Powers {
        #[inline(always)] // a call would keep the sums in memory
        pub(super) fn add(&mut self, [newest, middle, oldest]: [&[i32; LANES]; 3]) {
            let mut squares = [0; LANES];
            for lane in 0..LANES {
                let magnitude = (newest[lane] - middle[lane] - (middle[lane] - oldest[lane])).unsigned_abs();
                self.digits |= magnitude;
                let small = magnitude & 0x7fff;
                squares[lane] = small * small;
            }
            for square in squares.map(u64::from) {
                self.squares += square;
                self.fourths = self.fourths.wrapping_add(square * square);
            }
        }

        pub(super) fn sums(self) -> Option<(u128, u128)> {
            (self.digits < SMALL).then_some((self.squares.into(), self.fourths.into()))
        }
    }
}

#[cfg(target_arch = "x86_64")]
mod sse2 {
    use super::{LANES, SMALL};
    use safe_arch::{
        add_i32_m128i as add_words, add_i64_m128i as add_doubles, bitand_m128i as and, bitor_m128i as or, m128i,
        mul_i16_horizontal_add_m128i as multiply_halves, mul_widen_u32_odd_m128i as multiply_lower,
        set_splat_i32_m128i as all, shr_imm_u64_m128i as shift_right, sub_i32_m128i as subtract,
    };

    #[derive(Default)]
    pub(super) struct Powers {
        /// Bitwise or of the differences plus [`SMALL`].
        digits: m128i,
        /// Valid if the digits are below 2·[`SMALL`], as the fourth powers.
        squares: m128i,
        fourths: m128i,
    }

    impl Powers {
        #[inline(always)] // a call would keep the sums in memory
        pub(super) fn add(&mut self, sums: [&[i32; LANES]; 3]) {
            let [newest, middle, oldest] = sums.map(|sums| sums.as_chunks::<4>().0);
            let mut words = m128i::default();
            for ((&newest, &middle), &oldest) in newest.iter().zip(middle).zip(oldest) {
                let [newest, middle, oldest] = [newest, middle, oldest].map(m128i::from);
                let difference = subtract(add_words(newest, oldest), add_words(middle, middle));
                self.digits = or(self.digits, add_words(difference, all(SMALL as i32)));
                // A small difference is its lower half, as a signed number of 16 bits; its upper half has no part.
                let half = and(difference, all(0xffff));
                let squares = multiply_halves(half, half);
                words = add_words(words, squares);
                let upper = shift_right::<32>(squares);
                self.fourths = add_doubles(self.fourths, multiply_lower(squares, squares));
                self.fourths = add_doubles(self.fourths, multiply_lower(upper, upper));
            }
            let [lower, upper] = [and(words, m128i::from([u64::from(u32::MAX); 2])), shift_right::<32>(words)];
            self.squares = add_doubles(self.squares, add_doubles(lower, upper));
        }

        pub(super) fn sums(self) -> Option<(u128, u128)> {
            let digits = <[u32; 4]>::from(self.digits).into_iter().fold(0, |all, digits| all | digits);
            let sum = |lanes| <[u64; 2]>::from(lanes).map(u128::from).iter().sum();
            (digits < 2 * SMALL).then(|| (sum(self.squares), sum(self.fourths)))
        }
    }
}

#[cfg(all(test, target_arch = "x86_64"))]
mod tests {
    use super::{portable, sse2};
    use proptest::array::uniform16;
    use proptest::prelude::*;

    proptest! {
        /// Where both find all differences small. At −2¹³ they disagree on that.
        #[test]
        fn both_ways_to_add_powers_are_equal(
            sums in [uniform16(any::<i32>()), uniform16(any::<i32>()), uniform16(any::<i32>())], shift in 3..31_u32
        ) {
            let sums = sums.map(|sums| sums.map(|sum| sum >> shift));
            let (mut portable, mut sse2) = (portable::Powers::default(), sse2::Powers::default());
            portable.add(sums.each_ref());
            sse2.add(sums.each_ref());
            if let Some(powers) = portable.sums() {
                prop_assert_eq!(Some(powers), sse2.sums());
            }
        }
    }
}
