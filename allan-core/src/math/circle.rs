//! Sine and cosine.
//!
//! `libm`'s take 5 kB of flash and 0.8 kB of stack for what they do with arguments beyond 10⁶, and three times as many
//! instructions.

use super::floor;
use core::f64::consts::FRAC_2_PI;

/// π/2 in two parts. The first has 33 bits: times a number of quarters up to 2²⁰ it is exact.
const QUARTER: (f64, f64) = (1.570_796_326_734_125_6, 6.077_100_506_506_192e-11);

/// Ratios of the coefficients of Taylor's series, up to where it is good to 10⁻¹⁷ over an eighth of a turn.
const SINE: [f64; 7] = [1.0 / 6.0, 1.0 / 20.0, 1.0 / 42.0, 1.0 / 72.0, 1.0 / 110.0, 1.0 / 156.0, 1.0 / 210.0];
const COSINE: [f64; 8] =
    [1.0 / 2.0, 1.0 / 12.0, 1.0 / 30.0, 1.0 / 56.0, 1.0 / 90.0, 1.0 / 132.0, 1.0 / 182.0, 1.0 / 240.0];

/// To 2.5·10⁻¹⁶, or 1.2·10⁻¹⁶ of the argument where that is more: it is known no better.
pub(crate) fn sin(x: f64) -> f64 {
    quarters_later(x, 0)
}

/// As [`sin`].
pub(crate) fn cos(x: f64) -> f64 {
    quarters_later(x, 1)
}

#[inline(never)] // once
fn quarters_later(x: f64, quarters: i64) -> f64 {
    let whole = floor(x * FRAC_2_PI + 0.5);
    let rest = (x - whole * QUARTER.0) - whole * QUARTER.1;
    let square = rest * rest;
    let quarters = whole as i64 + quarters;
    let modulus = if quarters & 1 == 0 { rest * series(square, &SINE) } else { series(square, &COSINE) };
    if quarters & 2 == 0 { modulus } else { -modulus }
}

fn series(square: f64, ratios: &[f64]) -> f64 {
    ratios.iter().rev().fold(1.0, |sum, ratio| 1.0 - square * ratio * sum)
}

#[cfg(test)]
mod tests {
    #[test]
    fn agrees_with_the_standard_library() {
        for k in -200_000..=200_000 {
            let x = f64::from(k) * 0.001_234_5;
            for x in [x, 1e5 * x] {
                let bound = 2.5e-16_f64.max(1.2e-16 * x.abs());
                assert!((super::sin(x) - x.sin()).abs() <= bound, "sin {x}: {} {}", super::sin(x), x.sin());
                assert!((super::cos(x) - x.cos()).abs() <= bound, "cos {x}: {} {}", super::cos(x), x.cos());
            }
        }
    }
}
