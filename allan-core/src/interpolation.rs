//! The variance that interpolating missing samples adds to an Allan or Hadamard variance.

use crate::confidence::Difference;
use crate::math::Real;
use crate::moments::Sum;

/// The gaps of one length class that were closed by interpolation, and the errors of interpolating samples that are
/// known.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Interpolation {
    replaced: u32,
    tested: u32,
    squared_error: Sum,
}

impl Interpolation {
    /// No gap.
    pub const NONE: Self = Self { replaced: 0, tested: 0, squared_error: Sum::ZERO };

    /// The gaps with these [`replaced`](Self::replaced) and [`tested`](Self::tested) samples and this
    /// [`squared_error`](Self::squared_error).
    #[must_use]
    pub fn new(replaced: u32, tested: u32, squared_error: u128) -> Self {
        Self { replaced, tested, squared_error: squared_error.into() }
    }

    /// Number of samples that were replaced. It stays at its maximum once it is reached.
    #[must_use]
    pub const fn replaced(&self) -> u32 {
        self.replaced
    }

    /// Number of known samples that were replaced to test the interpolation.
    #[must_use]
    pub const fn tested(&self) -> u32 {
        self.tested
    }

    /// Sum over the tests of the squared error of the sum of the replaced samples, counts², at most 2¹²⁷ − 1.
    #[must_use]
    pub fn squared_error(&self) -> u128 {
        self.squared_error.get()
    }

    pub(crate) fn add_gap(&mut self, missing: u32) {
        self.replaced = self.replaced.saturating_add(missing);
    }

    /// Adds a test on `samples` known samples whose sum was off by `error`, while tests can be counted.
    pub(crate) fn add_test(&mut self, samples: u32, error: i64) {
        if let Some(tested) = self.tested.checked_add(samples) {
            self.tested = tested;
            let magnitude = u128::from(error.unsigned_abs());
            self.squared_error.add(magnitude * magnitude);
        }
    }

    pub(crate) fn merge(&mut self, other: &Self) {
        self.add_gap(other.replaced);
        if let Some(tested) = self.tested.checked_add(other.tested) {
            self.tested = tested;
            self.squared_error.add(other.squared_error.get());
        }
    }

    /// The three numbers as words of 64 bits, for reading or for writing.
    #[cfg(feature = "serde")]
    pub(crate) fn visit_words<E>(&mut self, mut visit: impl FnMut(&mut u64) -> Result<(), E>) -> Result<(), E> {
        let mut samples = u64::from(self.tested) << 32 | u64::from(self.replaced);
        visit(&mut samples)?;
        (self.tested, self.replaced) = ((samples >> 32) as u32, samples as u32);
        self.squared_error.words().into_iter().try_for_each(visit)
    }
}

impl Default for Interpolation {
    fn default() -> Self {
        Self::NONE
    }
}

/// The gaps that an averaging factor bridges, gathered from the shortest octave to the one of that factor.
#[derive(Debug, Clone, Copy)]
pub(crate) struct BridgedGaps<F = f64> {
    /// Variance of a sample if the noise were white, counts²: for gaps without a test.
    white: F,
    replaced: F,
    /// Sum over the gaps of the expected squared error of the sum of their samples, counts².
    squared_error: F,
    /// Sum over the gaps of that squared error times the length of the gap, counts²·samples.
    squared_error_length: F,
    /// Number of replaced samples in classes without a test.
    untested: F,
    tested: F,
    tested_error: F,
}

/// The variance that the bridged gaps add at an averaging factor, and the share of the samples that is replaced.
#[derive(Debug, Clone, Copy)]
pub(crate) struct AddedVariance<F = f64> {
    /// The added variance, counts².
    pub(crate) variance: F,
    /// The replaced share of the samples, 0 to 1.
    pub(crate) replaced: F,
}

/// Largest share of a measured variance that is subtracted.
const LARGEST_SUBTRACTION: f64 = 0.9;

impl<F: Real> AddedVariance<F> {
    pub(crate) fn subtracted(&self, measured: F) -> F {
        let largest = F::constant(LARGEST_SUBTRACTION) * measured;
        if self.variance < largest { self.variance } else { largest }
    }
}

/// Factor on the degrees of freedom of a measured variance after a subtraction: the square of the remaining fraction.
pub(crate) fn subtraction_factor<F: Real>(left: F, subtracted: F) -> F {
    if subtracted > F::ZERO {
        let share = left / (left + subtracted);
        share * share
    } else {
        F::constant(1.0)
    }
}

impl<F: Real> BridgedGaps<F> {
    /// No gaps yet, in a record with an Allan variance of `white` counts² at one sample.
    pub(crate) fn new(white: F) -> Self {
        let none = F::constant(0.0);
        Self {
            white,
            replaced: none,
            squared_error: none,
            squared_error_length: none,
            untested: none,
            tested: none,
            tested_error: none,
        }
    }

    /// Adds the gaps that the octave of `n` bridges first; `shortest` is the octave that bridges gaps of one sample.
    pub(crate) fn add(&mut self, gaps: &Interpolation, n: u64, shortest: u64) {
        let replaced = F::from_word(gaps.replaced.into());
        self.replaced += replaced;
        if gaps.tested == 0 {
            self.untested += replaced;
            return;
        }
        // A class holds the lengths from half its upper limit on.
        let longest = F::from_word(n) / F::from_word(shortest);
        let one = F::constant(1.0);
        let length = if longest > one { F::constant(0.75) * longest } else { one };
        let (tested, error) = (F::from_word(gaps.tested.into()), F::from_integer(gaps.squared_error()));
        let squared_error = error * replaced / tested;
        self.squared_error += squared_error;
        self.squared_error_length += squared_error * length;
        self.tested += tested;
        self.tested_error += error;
    }

    /// The variance that the gaps add at averaging factor `n` of a record of `samples` samples beside the replaced
    /// ones.
    ///
    /// A gap of `m` samples whose sum is off by `e` adds `⟨e²⟩(1 − 2m/n)/n` times the number of gaps per sample period
    /// to Allan variances, and `⟨e²⟩(1 − 20m/9n)/n` times it to Hadamard variances.
    pub(crate) fn added_variance(&self, difference: Difference, n: u64, samples: u64) -> AddedVariance<F> {
        let none = F::constant(0.0);
        if self.replaced == none {
            return AddedVariance { variance: none, replaced: none };
        }
        let edges = match difference {
            Difference::Second => F::constant(2.0),
            Difference::Third => F::constant(20.0 / 9.0),
        };
        let n = F::from_word(n);
        // Gaps without a test of their own length get the error of those with one, or else that of white noise.
        let per_sample =
            if self.tested > none { self.tested_error / self.tested } else { F::constant(1.5) * self.white };
        let squared_error = self.squared_error - edges * self.squared_error_length / n + self.untested * per_sample;
        let periods = F::from_word(samples) + self.replaced;
        let variance = squared_error / n / periods;
        AddedVariance { variance: if variance > none { variance } else { none }, replaced: self.replaced / periods }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const WHITE: f64 = 110.0;

    fn added(gaps: Interpolation, n: u64) -> AddedVariance {
        let mut bridged = BridgedGaps::new(WHITE);
        bridged.add(&gaps, n, 8);
        bridged.added_variance(Difference::Second, n, 900)
    }

    fn assert_close(found: f64, expected: f64) {
        assert!((found / expected - 1.0).abs() < 1e-14, "{found}, expected {expected}");
    }

    /// A sample replaced by the mean of its two neighbours has the error of its own noise and half of theirs: `3/2 σ²`.
    #[test]
    fn gaps_without_a_test_add_the_variance_of_white_noise() {
        let AddedVariance { variance, replaced } = added(Interpolation::new(100, 0, 0), 64);
        assert_close(variance, 100.0 * 1.5 * WHITE / 64.0 / 1_000.0);
        assert_close(replaced, 0.1);
    }

    /// A gap of 6 samples adds its squared error less `2·6/64` of it in the octave of 64.
    #[test]
    fn the_variance_that_a_gap_adds_falls_with_its_length() {
        let tested = Interpolation::new(100, 50, 7_000);
        assert_close(added(tested, 64).variance, 14_000.0 * (1.0 - 12.0 / 64.0) / 64.0 / 1_000.0);
        assert_close(added(tested, 8).variance, 14_000.0 * (1.0 - 2.0 / 8.0) / 8.0 / 1_000.0);
    }
}
