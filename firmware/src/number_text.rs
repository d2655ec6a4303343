//! Decimals without exponent, and estimates with the digits of their bounds, in 2 kB of flash.

use core::fmt::{self, Display, Formatter};

/// Values from this one on are not written.
const TOO_LARGE: f64 = 1e15;
const MOST_DECIMALS: i32 = 12;

/// Largest relative half-width, and largest ratio of both sides, of an interval that is written `+- half`; as on the
/// host.
const SYMMETRIC: f64 = 0.25;
const SKEW: f64 = 1.3;

/// A power of ten between -22 and 22, exact or one rounding off.
fn power_of_ten(exponent: i32) -> f64 {
    let power = (0..exponent.unsigned_abs()).fold(1.0, |power, _| power * 10.0);
    if exponent < 0 { 1.0 / power } else { power }
}

/// Exponent of the leading digit of a positive number.
fn exponent(mut value: f64) -> i32 {
    let mut exponent = 0;
    while value >= 10.0 {
        (value, exponent) = (value / 10.0, exponent + 1);
    }
    while value < 1.0 && exponent > -MOST_DECIMALS {
        (value, exponent) = (value * 10.0, exponent - 1);
    }
    exponent
}

/// A number with `decimals` decimals, rounded half up, with commas between thousands; `-` if not finite or at least
/// 10^15.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Decimal {
    value: f64,
    decimals: i32,
}

impl Decimal {
    /// The number with `digits` significant digits: `0.0368`, `2.43`, `1,200`.
    pub fn significant(value: f64, digits: i32) -> Self {
        let magnitude = libm::fabs(value);
        if magnitude == 0.0 || magnitude.is_nan() || magnitude >= TOO_LARGE {
            return Self { value, decimals: 0 };
        }
        let place = exponent(magnitude) - digits + 1;
        // The value is rounded first: 9.96 in two digits is 10.
        let carried = magnitude + power_of_ten(place) / 2.0;
        Self::at_place(value, exponent(carried) - digits + 1)
    }

    /// The value as a multiple of ten to the power `place`.
    fn at_place(value: f64, place: i32) -> Self {
        if place <= 0 {
            return Self { value, decimals: (-place).min(MOST_DECIMALS) };
        }
        let unit = power_of_ten(place);
        Self { value: libm::floor(value / unit + 0.5) * unit, decimals: 0 }
    }
}

impl Display for Decimal {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let magnitude = libm::fabs(self.value);
        if magnitude.is_nan() || magnitude >= TOO_LARGE {
            return f.write_str("-");
        }
        let scale = (0..self.decimals).fold(1_u64, |scale, _| scale * 10);
        let scaled = (magnitude * scale as f64 + 0.5) as u64;
        if self.value < 0.0 && scaled > 0 {
            f.write_str("-")?;
        }
        write!(f, "{}", Count(scaled / scale))?;
        if self.decimals > 0 {
            write!(f, ".{:0width$}", scaled % scale, width = self.decimals as usize)?;
        }
        Ok(())
    }
}

/// A count with a comma between thousands.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Count(pub u64);

impl Display for Count {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let mut divisor = 1;
        while self.0 / divisor >= 1000 {
            divisor *= 1000;
        }
        write!(f, "{}", self.0 / divisor)?;
        while divisor > 1 {
            divisor /= 1000;
            write!(f, ",{:03}", self.0 / divisor % 1000)?;
        }
        Ok(())
    }
}

/// An estimate with 95 % bounds: `2.43 +- 0.04`, `24 (14 .. 37)`, or `< 190` if only the upper bound is known.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Estimate {
    /// Best value.
    pub value: f64,
    /// Lower and upper 95 % bound.
    pub bounds: (f64, f64),
}

impl Display for Estimate {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let (value, (low, high)) = (self.value, self.bounds);
        let two = |value| Decimal::significant(value, 2);
        if !value.is_finite() || !low.is_finite() || !high.is_finite() || high <= low {
            return write!(f, "{}", Decimal::significant(value, 3));
        }
        if low <= 0.0 && high >= 0.0 && libm::fabs(value) <= high / 1e3 {
            return write!(f, "< {}", two(high));
        }
        let (below, above) = (value - low, high - value);
        let (half, wider, narrower) = ((high - low) / 2.0, below.max(above), below.min(above));
        if wider <= SKEW * narrower && half <= SYMMETRIC * libm::fabs(value) {
            // An uncertainty that begins with 1 or 2 has two digits.
            let leading = exponent(half);
            let place = if half / power_of_ten(leading) < 2.95 { leading - 1 } else { leading };
            return write!(f, "{} +- {}", Decimal::at_place(value, place), Decimal::at_place(half, place));
        }
        if low <= 0.0 && value > 0.0 {
            return write!(f, "{} (< {})", two(value), two(high));
        }
        write!(f, "{} ({} .. {})", two(value), two(low), two(high))
    }
}

#[cfg(test)]
mod tests {
    extern crate std;

    use super::*;
    use std::format;
    use std::string::ToString;

    /// `core` rounds the exact value, and this module a product: none of the values is a tie.
    #[test]
    fn decimals_equal_the_standard_formatting() {
        let mut value = 1.234_56e-9;
        while value < 1e14 {
            for decimals in 0..=9 {
                let text = Decimal { value, decimals }.to_string().replace(',', "");
                let expected = format!("{value:.*}", decimals as usize);
                // The product is exact to 10⁻⁵ of the last digit.
                if value * power_of_ten(decimals) < 1e11 {
                    assert_eq!(text, expected, "{value} to {decimals} decimals");
                    assert_eq!(
                        Decimal { value: -value, decimals }.to_string().replace(',', "").trim_start_matches('-'),
                        text
                    );
                }
            }
            for digits in 1..=6 {
                let shown: f64 =
                    Decimal::significant(value, digits).to_string().replace(',', "").parse().expect("a number");
                let expected: f64 = format!("{value:.*e}", digits as usize - 1).parse().expect("a number");
                // Half of the last decimal that is written.
                let limit = 0.5 * power_of_ten(-MOST_DECIMALS);
                assert!((shown - expected).abs() <= 1e-14 * expected + limit, "{value} in {digits} digits: {shown}");
            }
            value *= 1.37;
        }
    }

    #[test]
    fn numbers_are_written_as_a_person_reads_them() {
        for (value, digits, text) in [
            (0.0368, 3, "0.0368"),
            (0.99996, 3, "1.00"),
            (9.96, 2, "10"),
            (1234.0, 2, "1,200"),
            (204.8, 4, "204.8"),
            (-4.26, 2, "-4.3"),
            (0.0, 3, "0"),
            (f64::NAN, 3, "-"),
            (f64::NEG_INFINITY, 3, "-"),
            (1e300, 3, "-"),
        ] {
            assert_eq!(Decimal::significant(value, digits).to_string(), text, "{value}");
        }
        assert_eq!([0, 999, 1000, 1_002_003].map(|count| Count(count).to_string()), ["0", "999", "1,000", "1,002,003"]);
    }

    #[test]
    fn estimates_have_the_digits_that_their_bounds_support() {
        for (value, low, high, text) in [
            (2.4312, 2.4212, 2.4412, "2.431 +- 0.010"),
            (2.4312, 2.39, 2.47, "2.43 +- 0.04"),
            (24.3, 20.9, 27.4, "24 +- 3"),
            (24.3, 14.0, 37.0, "24 (14 .. 37)"),
            (240.0, 60.0, 420.0, "240 (60 .. 420)"),
            (0.0, 0.0, 187.0, "< 190"),
            (863.2, 820.0, 906.0, "860 +- 40"),
            (12.0, 0.0, 31.0, "12 (< 31)"),
            (f64::NAN, 0.0, 1.0, "-"),
            (-52.3, -59.0, -45.0, "-52 +- 7"),
        ] {
            assert_eq!(Estimate { value, bounds: (low, high) }.to_string(), text, "{value} ({low} .. {high})");
        }
    }
}
