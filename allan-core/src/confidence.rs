//! How much a point of the curve is worth: equivalent degrees of freedom and the correlation between octaves.
//!
//! C. Greenhall and W. Riley, "Uncertainty of stability variances based on finite differences" (PTTI 2003), for
//! differences taken every `n/P` samples.

mod law;

use crate::math::{abs, ln, sqrt};
pub(crate) use law::{Difference, Law};

/// The normal quantile of 0.975: half the width of a 95 % interval in standard deviations.
pub const NORMAL_975: f64 = 1.959_963_984_540_054;

/// What part of a point's variance is due to which power law; the parts sum to 1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Shares {
    /// Angle quantization, σ² ∝ τ⁻².
    pub quantization: f64,
    /// Angle random walk (white rate noise), σ² ∝ τ⁻¹.
    pub white: f64,
    /// Bias instability (flicker rate noise), σ² constant.
    pub flicker: f64,
    /// Rate random walk and steeper, σ² ∝ τ.
    pub random_walk: f64,
}

impl Shares {
    /// White rate noise alone.
    pub const WHITE: Self = Self { quantization: 0.0, white: 1.0, flicker: 0.0, random_walk: 0.0 };
    /// Flicker rate noise alone.
    pub const FLICKER: Self = Self { quantization: 0.0, white: 0.0, flicker: 1.0, random_walk: 0.0 };
    /// Random-walk rate noise alone.
    pub const RANDOM_WALK: Self = Self { quantization: 0.0, white: 0.0, flicker: 0.0, random_walk: 1.0 };
    /// Angle quantization alone.
    pub const QUANTIZATION: Self = Self { quantization: 1.0, white: 0.0, flicker: 0.0, random_walk: 0.0 };

    /// Correlation of two differences `distance` averaging times of `n` samples apart.
    fn correlation(&self, difference: Difference, distance: f64, n: u64) -> f64 {
        let mut sum = 0.0;
        if self.white > 0.0 {
            sum += self.white * difference.correlation(abs, distance);
        }
        if self.flicker > 0.0 {
            let law = |x: f64| if x == 0.0 { 0.0 } else { x * x * ln(abs(x)) };
            sum += self.flicker * difference.correlation(law, distance);
        }
        if self.random_walk > 0.0 {
            // The double sum of white noise: |k|³ − |k| at a lag of k samples.
            let per_sample = 1.0 / (n as f64 * n as f64);
            let law = |x: f64| abs(x) * (x * x - per_sample);
            sum += self.random_walk * difference.correlation(law, distance);
        }
        if self.quantization > 0.0 {
            let law = |x: f64| if x == 0.0 { 1.0 } else { 0.0 };
            sum += self.quantization * difference.correlation(law, distance);
        }
        sum
    }
}

/// Equivalent degrees of freedom of the mean of `count` squared differences at averaging factor `n`, `overlap` to an
/// averaging time.
///
/// At least 1 for a count of at least 1. Differences that a gap separates are counted as if they were neighbours.
#[must_use]
pub fn edf(n: u64, count: u64, overlap: u32, shares: Shares) -> f64 {
    Law::new(Difference::Second, n, count, overlap, shares).edf
}

/// Correlation of the Allan variances of two octaves `lag` octaves apart, for near-full overlap.
///
/// Exact for one, two and three octaves and an infinite record; beyond, the last ratio continues.
#[must_use]
pub fn octave_correlation(lag: usize, a: Shares, b: Shares) -> f64 {
    let (a, b) = (roots(a), roots(b));
    (0..3).map(|noise| a[noise] * b[noise] * pure_octave_correlation(lag, noise)).sum()
}

/// Of white, flicker and random-walk noise: the roots of their shares.
pub(crate) fn roots(shares: Shares) -> [f64; 3] {
    // Angle quantization decorrelates faster than white noise, which bounds it from above.
    [sqrt(shares.white + shares.quantization), sqrt(shares.flicker), sqrt(shares.random_walk)]
}

/// The same where one of these noises is alone.
pub(crate) fn pure_octave_correlation(lag: usize, noise: usize) -> f64 {
    const TABLE: [[f64; 4]; 3] = [[1.0, 0.530, 0.187, 0.066], [1.0, 0.689, 0.309, 0.121], [1.0, 0.888, 0.676, 0.488]];
    let table = &TABLE[noise];
    match table.get(lag) {
        Some(&value) => value,
        None => (4..=lag).fold(table[3], |value, _| value * table[3] / table[2]),
    }
}
