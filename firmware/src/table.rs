//! A report for a person: lines of plain text, one at a time.

use crate::estimators::{CHANNELS, Estimators};
use crate::last_words::line;
use crate::summary::OCTAVES;
use adis16405_driver::Channel;
use core::fmt;
use link::Line;

/// Columns: the inertial channels.
const COLUMNS: usize = Channel::INERTIAL.len();

/// A number in four digits and a power of ten, such as `3.333e-2`.
///
/// The formatting of `core` takes 20 kB of flash; this takes 1 kB, and rounds in the fourth digit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Short(pub f64);

impl fmt::Display for Short {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (sign, mut value) = if self.0 < 0.0 { ("-", -self.0) } else { ("", self.0) };
        if !value.is_finite() {
            return f.write_str("-");
        }
        if value < 1e-300 {
            return f.write_str("0");
        }
        let mut exponent = 0;
        while value >= 10.0 {
            (value, exponent) = (value / 10.0, exponent + 1);
        }
        while value < 1.0 {
            (value, exponent) = (value * 10.0, exponent - 1);
        }
        let mut digits = (value * 1000.0 + 0.5) as u32;
        if digits >= 10_000 {
            (digits, exponent) = (digits / 10, exponent + 1);
        }
        write!(f, "{sign}{}.{:03}e{exponent}", digits / 1000, digits % 1000)
    }
}

/// Head of the table.
pub const HEAD: [&str; 2] = [
    "Allan deviation, gyros in deg/s, accelerometers in g",
    "     tau/s     gyro_x     gyro_y     gyro_z     accl_x     accl_y     accl_z",
];

/// The row of one octave; `None` where no channel has a value.
#[must_use]
pub fn row(estimators: &Estimators<'_>, octave: usize) -> Option<Line> {
    let config = estimators.config();
    let n = (1_u64 << octave.min(OCTAVES)) as f64;
    let deviation = |index: usize| {
        let (sum, count) = estimators.get(index)?.sum_of_squares(octave).filter(|&(_, count)| count > 0)?;
        let lsb = CHANNELS[index].lsb(config.range());
        Some(lsb * libm::sqrt(sum as f64 / (2.0 * count as f64)) / n)
    };
    let mut any = false;
    let cells: [f64; COLUMNS] = core::array::from_fn(|index| {
        let cell = deviation(index);
        any |= cell.is_some();
        cell.unwrap_or(f64::NAN)
    });
    let [a, b, c, d, e, f] = cells.map(|cell| line(format_args!("{}", Short(cell))));
    let tau = line(format_args!("{}", Short(n / config.sample_period().hz())));
    any.then(|| line(format_args!("{tau:>10} {a:>10} {b:>10} {c:>10} {d:>10} {e:>10} {f:>10}")))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `core`'s own formatting is the reference.
    #[test]
    fn short_numbers_are_those_of_the_standard_formatting() {
        let mut value = 1.234_56e-30;
        while value < 1e30 {
            let expected = format_args!("{value:.3e}").to_string();
            assert_eq!(format_args!("{}", Short(value)).to_string(), expected);
            assert_eq!(format_args!("{}", Short(-value)).to_string(), format_args!("-{expected}").to_string());
            value *= 1.37;
        }
        for (value, text) in [(0.0, "0"), (f64::NAN, "-"), (9.9999, "1.000e1"), (1.0, "1.000e0")] {
            assert_eq!(format_args!("{}", Short(value)).to_string(), text);
        }
    }

    extern crate std;
    use std::string::ToString;
}
