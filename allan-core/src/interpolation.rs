//! What the interpolation of missing samples adds to an Allan or Hadamard variance.

use crate::confidence::Difference;
use crate::moments::Sum;

/// The gaps of one length class that were closed by interpolation, and how far the interpolation was off where it was
/// tested on samples that are known.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
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

    /// Sum over the tests of the squared error of the sum of the replaced samples, counts². It stays at its maximum of
    /// 2¹²⁷ − 1 once it is reached.
    #[must_use]
    pub fn squared_error(&self) -> u128 {
        self.squared_error.get()
    }

    /// Adds a gap of `missing` samples.
    pub(crate) fn add_gap(&mut self, missing: u32) {
        self.replaced = self.replaced.saturating_add(missing);
    }

    /// Adds a test on `samples` known samples, the sum of which was off by `error`. Tests stop when they can no longer be
    /// counted.
    pub(crate) fn add_test(&mut self, samples: u32, error: i64) {
        if let Some(tested) = self.tested.checked_add(samples) {
            self.tested = tested;
            let magnitude = u128::from(error.unsigned_abs());
            self.squared_error.add(magnitude * magnitude);
        }
    }

    /// Adds the gaps of another stretch.
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
pub(crate) struct BridgedGaps {
    /// Variance of a sample if the noise were white, counts²: for gaps without a test.
    white: f64,
    /// Number of replaced samples.
    replaced: f64,
    /// Sum over the gaps of the expected squared error of the sum of their samples, counts².
    squared_error: f64,
    /// The same, each multiplied by the length of the gap.
    squared_error_length: f64,
    /// Replaced samples of classes without a test.
    untested: f64,
    tested: f64,
    tested_error: f64,
}

/// The variance that the bridged gaps add at an averaging factor, and the share of the samples that is replaced.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct AddedVariance {
    /// Counts².
    pub(crate) variance: f64,
    /// Between 0 and 1.
    pub(crate) replaced: f64,
}

/// Largest share of a measured variance that is subtracted.
const LARGEST_SUBTRACTION: f64 = 0.9;

impl AddedVariance {
    /// What is subtracted from a measured variance.
    pub(crate) fn subtracted(&self, measured: f64) -> f64 {
        self.variance.min(LARGEST_SUBTRACTION * measured)
    }
}

/// Factor on the degrees of freedom of a measured variance of which `subtracted` was taken and `left` remains: the scatter
/// is the same, the value smaller.
pub(crate) fn subtraction_factor(left: f64, subtracted: f64) -> f64 {
    if subtracted > 0.0 {
        let share = left / (left + subtracted);
        share * share
    } else {
        1.0
    }
}

impl BridgedGaps {
    /// No gaps, in a record with an Allan variance of `white` counts² at one sample.
    pub(crate) fn new(white: f64) -> Self {
        let (replaced, squared_error, squared_error_length) = (0.0, 0.0, 0.0);
        Self { white, replaced, squared_error, squared_error_length, untested: 0.0, tested: 0.0, tested_error: 0.0 }
    }

    /// Adds the gaps that an octave with an averaging factor of `n` bridges and the one before does not. `shortest` is the
    /// octave at which gaps of one sample are bridged.
    pub(crate) fn add(&mut self, gaps: &Interpolation, n: u64, shortest: u64) {
        let replaced = f64::from(gaps.replaced);
        self.replaced += replaced;
        if gaps.tested == 0 {
            self.untested += replaced;
            return;
        }
        // A class holds the lengths from half its upper limit on.
        let longest = n as f64 / shortest as f64;
        let length = if longest > 1.0 { 0.75 * longest } else { 1.0 };
        let squared_error = gaps.squared_error() as f64 * replaced / f64::from(gaps.tested);
        self.squared_error += squared_error;
        self.squared_error_length += squared_error * length;
        self.tested += f64::from(gaps.tested);
        self.tested_error += gaps.squared_error() as f64;
    }

    /// What the gaps add to the variance at the averaging factor `n` of a record of `samples` samples, beside which those
    /// of the gaps are replaced.
    ///
    /// A gap of `m` samples whose sum is off by `e` lies in the second differences that end within `2n` periods after it
    /// and adds `e²` to their squares. Where it lies at an edge or in the middle of a difference the replaced samples
    /// vary with neighbours of other signs, which for white noise takes away `4m·e²`. The squares have a mean of `2n²σ²`,
    /// so `⟨e²⟩(1 − 2m/n)/n` times the number of gaps per sample period remains. For third differences, which reach over `3n` periods and have a
    /// mean square of `6n²σ²`, it is `⟨e²⟩(1 − 20m/9n)/n`.
    pub(crate) fn added_variance(&self, difference: Difference, n: u64, samples: u64) -> AddedVariance {
        if self.replaced == 0.0 {
            return AddedVariance::default();
        }
        let edges = match difference {
            Difference::Second => 2.0,
            Difference::Third => 20.0 / 9.0,
        };
        let n = n as f64;
        // Gaps without a test of their own length are taken to be off as those with one, or as white noise would be.
        let per_sample = if self.tested > 0.0 { self.tested_error / self.tested } else { 1.5 * self.white };
        let squared_error = self.squared_error - edges * self.squared_error_length / n + self.untested * per_sample;
        let periods = samples as f64 + self.replaced;
        AddedVariance { variance: (squared_error / n / periods).max(0.0), replaced: self.replaced / periods }
    }
}
