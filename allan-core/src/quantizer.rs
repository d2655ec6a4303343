//! Samples that are not counts of 32 bits: physical values, wider integers, and the phase of a clock.

use crate::math::{abs, is_finite, sqrt};
use core::fmt;

/// Turns values in a physical unit into the counts that a [`Cascade`](crate::Cascade) takes.
///
/// A count is `round((value − origin)/lsb)`, ties up; `origin` is best near the mean. Multiply the curve with the LSB
/// ([`Curve::scaled`](crate::Curve::scaled)) to have it in the unit again.
///
/// Rounding adds the variance of the rounding error. In white noise with a standard deviation of σ the estimate of N is
/// off by a part that depends on where the mean lies between two counts:
///
/// | LSB | N, mean at a count | N, mean between two |
/// |---|---|---|
/// | σ/4 | +0.3 % | +0.3 % |
/// | σ/2 | +1.0 % | +1.0 % |
/// | σ | +4.1 % | +4.1 % |
/// | 2σ | +14.1 % | +16.8 % |
/// | 3σ | +9.7 % | +51.6 % |
/// | 4σ | −14.7 % | +100.1 % |
///
/// An LSB of σ/4 or less has a negligible effect; beyond 2σ rounding dominates the curve.
///
/// ```
/// use allan_core::{Cascade, Quantizer};
///
/// let in_g = Quantizer::new(1.0, 50e-6).unwrap(); // an accelerometer that points up, 50 µg per count
/// let mut cascade = Cascade::<16, 8>::new();
/// for value in [1.000_12_f32, 0.999_87, 1.000_05] {
///     cascade.push(in_g.count(value).unwrap());
/// }
/// assert!(in_g.count(f32::NAN).is_err());
/// let curve = cascade.curve(0.01).scaled(in_g.lsb()); // in g
/// # assert_eq!(curve.points().len(), 1);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Quantizer {
    origin: f64,
    lsb: f64,
}

/// Steps of [`Quantizer::for_samples`] in the standard deviation of white noise.
const STEPS: f64 = 65_536.0;

/// Values that are rounded, or measured, together.
const BLOCK: usize = 16;
/// 1.5·2⁵²: a double of this size has no fraction, and the sum with an integer of 32 bits has that integer in its low bits.
const SHIFT: f64 = 6_755_399_441_055_744.0;
/// Steps up to which every count fits.
const LARGEST_IN_BLOCK: f64 = i32::MAX as f64;

/// The reason for which a value has no count.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum SampleError {
    /// It is not a number.
    NotANumber,
    /// It is infinite.
    Infinite,
    /// It is more than 2³¹ counts from the origin, or for a phase from the phase before.
    OutOfRange,
}

impl fmt::Display for SampleError {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(match self {
            Self::NotANumber => "the sample is not a number",
            Self::Infinite => "the sample is infinite",
            Self::OutOfRange => "the sample is more than 2^31 counts from the origin: use a larger LSB",
        })
    }
}

impl core::error::Error for SampleError {}

impl Quantizer {
    /// `origin` and `lsb` in the unit of the values. `None` unless both are finite and `lsb` is positive.
    #[must_use]
    pub fn new(origin: f64, lsb: f64) -> Option<Self> {
        (is_finite(origin) && is_finite(lsb) && lsb > 0.0).then_some(Self { origin, lsb })
    }

    /// A quantizer for these samples: `origin` is the first one, `lsb` the largest power of two below 1/65536 of the
    /// root mean square of `(x[k+1] − x[k])/√2`.
    ///
    /// Rounding adds 2·10⁻¹¹ of the variance of white noise, and counts reach 32,768 standard deviations. Samples that
    /// are not finite are left out. `None` if no two neighbouring samples are finite and different.
    ///
    /// ```
    /// use allan_core::Quantizer;
    ///
    /// let quantizer = Quantizer::for_samples([9.81, 9.83, 9.80]).unwrap();
    /// // √((0.02² + 0.03²)/4) = 0.018, and a power of two below 1/65536 of it.
    /// assert_eq!((quantizer.origin(), quantizer.lsb()), (9.81, 2.0_f64.powi(-22)));
    /// ```
    #[must_use]
    pub fn for_samples(samples: impl IntoIterator<Item = f64>) -> Option<Self> {
        let mut samples = samples.into_iter().peekable();
        let mut origin = None;
        // Each place of a block has a sum of its own, since an addition to the same sum must wait for the one before.
        let (mut sums, mut counts) = ([0.0; BLOCK], [0.0; BLOCK]);
        // The last sample before a block, and its samples.
        let mut block = [f64::NAN; BLOCK + 1];
        while samples.peek().is_some() {
            block[0] = block[BLOCK];
            block[1..].fill(f64::NAN);
            block[1..].iter_mut().zip(&mut samples).for_each(|(slot, sample)| *slot = sample);
            origin = origin.or_else(|| block[1..].iter().copied().find(|&value| is_finite(value)));
            for at in 0..BLOCK {
                let difference = block[at + 1] - block[at];
                let is_usable = abs(difference) <= f64::MAX; // false for NaN
                sums[at] += if is_usable { difference * difference } else { 0.0 };
                counts[at] += if is_usable { 1.0 } else { 0.0 };
            }
        }
        let finest = sqrt(sums.iter().sum::<f64>() / (2.0 * counts.iter().sum::<f64>())) * (1.0 / STEPS);
        // A normal number without its fraction is a power of two.
        let lsb = f64::from_bits(finest.to_bits() >> 52 << 52);
        if finest.is_normal() { Self::new(origin?, lsb) } else { None }
    }

    /// The value of a count of 0.
    #[must_use]
    pub const fn origin(&self) -> f64 {
        self.origin
    }

    /// Units per count.
    #[must_use]
    pub const fn lsb(&self) -> f64 {
        self.lsb
    }

    /// The count of a value: an `f32`, an `f64`, or an integer of up to 32 bits.
    ///
    /// # Cost
    /// | `Quantizer::count` | Cortex-M4F | Cortex-M0+ |
    /// |---|---|---|
    /// | instructions on average | 901 | 1,950 |
    /// | stack, bytes | 140 | 196 |
    /// | flash, bytes | 3,120 | — |
    ///
    /// See [`guide::costs`](crate::guide::costs) for how they are counted.
    ///
    /// # Errors
    /// The value is not finite, or its count does not fit.
    pub fn count(&self, value: impl Into<f64>) -> Result<i32, SampleError> {
        let count = self.wide_count(value.into())?;
        i32::try_from(count).map_err(|_| SampleError::OutOfRange)
    }

    /// Puts the counts of `values` into the first places of `counts` up to the first value that has none; returns their
    /// number.
    ///
    /// ```
    /// use allan_core::Quantizer;
    ///
    /// let quantizer = Quantizer::new(0.0, 0.5).unwrap();
    /// let mut counts = [0; 4];
    /// assert_eq!(quantizer.counts(&[1.0, -2.0, f64::NAN, 3.0], &mut counts), 2);
    /// assert_eq!(counts[..2], [2, -4]);
    /// ```
    pub fn counts<T: Copy + Into<f64>>(&self, values: &[T], counts: &mut [i32]) -> usize {
        // Dividing by a power of two and multiplying by its reciprocal round the same number.
        let reciprocal = 1.0 / self.lsb;
        let is_power_of_two = self.lsb.is_normal() && reciprocal.is_normal() && self.lsb.to_bits() << 12 == 0;
        if is_power_of_two {
            self.put_counts(values, counts, |offset| offset * reciprocal)
        } else {
            self.put_counts(values, counts, |offset| offset / self.lsb)
        }
    }

    #[inline(always)] // for each way to scale
    fn put_counts<T: Copy + Into<f64>>(&self, values: &[T], counts: &mut [i32], steps: impl Fn(f64) -> f64) -> usize {
        let length = values.len().min(counts.len());
        for start in (0..length).step_by(BLOCK) {
            let end = length.min(start + BLOCK);
            let mut all_fit = true;
            for (count, &value) in counts[start..end].iter_mut().zip(&values[start..end]) {
                let steps = steps(value.into() - self.origin);
                // The comparison is false for NaN.
                all_fit &= abs(steps) <= LARGEST_IN_BLOCK;
                // The low bits of the sum are the nearest integer, ties to even, in two's complement.
                let shifted = steps + SHIFT;
                let is_tie_below = steps - (shifted - SHIFT) == 0.5;
                *count = (shifted.to_bits() as i32).wrapping_add(i32::from(is_tie_below));
            }
            if !all_fit {
                for at in start..end {
                    match self.count(values[at]) {
                        Ok(count) => counts[at] = count,
                        Err(_) => return at,
                    }
                }
            }
        }
        length
    }

    /// The count, if it is within ±2⁵³, where every integer is a double.
    fn wide_count(&self, value: f64) -> Result<i64, SampleError> {
        if value.is_nan() {
            return Err(SampleError::NotANumber);
        }
        if !is_finite(value) {
            return Err(SampleError::Infinite);
        }
        let steps = (value - self.origin) / self.lsb;
        const LARGEST: f64 = (1_u64 << 53) as f64;
        if abs(steps) >= LARGEST {
            return Err(SampleError::OutOfRange);
        }
        let truncated = steps as i64;
        let below = truncated - i64::from(truncated as f64 > steps);
        // The difference is exact; a half added to the steps would be rounded.
        Ok(below + i64::from(steps - below as f64 >= 0.5))
    }
}

/// The difference of an integer of up to 64 bits, for example a `u32` or a `u64`, to an `origin` near the mean.
///
/// ```
/// use allan_core::integer_count;
///
/// assert_eq!(integer_count(4_294_967_295_u32, 4_294_967_290_u32), Ok(5));
/// assert!(integer_count(u64::MAX, 0_u64).is_err());
/// ```
///
/// # Errors
/// The difference does not fit in 32 bits.
pub fn integer_count(value: impl Into<i128>, origin: impl Into<i128>) -> Result<i32, SampleError> {
    i32::try_from(value.into() - origin.into()).map_err(|_| SampleError::OutOfRange)
}

/// Turns phase (time error) data of a clock into counts of its frequency.
///
/// A count is the difference of two neighbouring phases, each rounded to the quantizer's LSB, so rounding errors do not
/// accumulate. With phases in s and a sample period in s, [`Curve::scaled`](crate::Curve::scaled) by `lsb/period` gives
/// the curve of the fractional frequency.
///
/// ```
/// use allan_core::{Cascade, PhaseCounts, Quantizer};
///
/// let mut phases = PhaseCounts::new(Quantizer::new(0.0, 1e-12).unwrap()); // a counter with 1 ps
/// let mut cascade = Cascade::<16, 8>::new();
/// for phase in [0.0, 1.2e-9, 2.1e-9, 3.5e-9] {
///     if let Some(count) = phases.count(phase).unwrap() {
///         cascade.push(count);
///     }
/// }
/// assert_eq!(cascade.len(), 3); // frequencies between four phases
/// let curve = cascade.curve(1.0).scaled(1e-12 / 1.0);
/// # assert!((curve.points()[0].avar / 0.085e-18 - 1.0).abs() < 1e-9); // ((−0.3)² + 0.5²)/(2·2) · 10⁻¹⁸
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct PhaseCounts {
    quantizer: Quantizer,
    /// Counts of the phase before.
    last: Option<i64>,
}

impl PhaseCounts {
    /// The quantizer is that of the phase, in its unit.
    #[must_use]
    pub const fn new(quantizer: Quantizer) -> Self {
        Self { quantizer, last: None }
    }

    /// The count between the phase before and this one; `None` for the first.
    ///
    /// # Errors
    /// The phase is not finite, beyond 2⁵³ counts, or 2³¹ counts or more from the phase before, which a phase that is
    /// not finite leaves as it was.
    pub fn count(&mut self, phase: f64) -> Result<Option<i32>, SampleError> {
        let count = self.quantizer.wide_count(phase)?;
        let Some(last) = self.last.replace(count) else { return Ok(None) };
        i32::try_from(count - last).map(Some).map_err(|_| SampleError::OutOfRange)
    }

    /// Forgets the phase before; `m` missing phases are a [`gap`](crate::Cascade::gap) of `m + 1` frequencies.
    pub fn restart(&mut self) {
        self.last = None;
    }
}
