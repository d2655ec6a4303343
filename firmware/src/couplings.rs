//! What the channels have in common at the longer octaves, and their means: exact sums over samples that all took together.

use crate::estimators::{CHANNELS, Estimator};

/// First octave that is coupled: 256 samples. What can be subtracted is slow, and at an eighth of its averaging time the
/// products of an octave cost next to nothing.
pub const FIRST: usize = 8;
/// Octaves that are coupled: up to 2¹⁹ samples, 43 minutes at 204.8 samples a second.
pub const COUPLED: usize = 12;
/// Pairs of channels with one that the other may follow: all but those of two gyros.
const PAIRS: [(usize, usize); 25] = {
    let mut pairs = [(0, 0); 25];
    let (mut low, mut at) = (0, 0);
    while low < CHANNELS.len() {
        let mut high = if low < GYROS { GYROS } else { low + 1 };
        while high < CHANNELS.len() {
            pairs[at] = (low, high);
            (high, at) = (high + 1, at + 1);
        }
        low += 1;
    }
    assert!(at == pairs.len());
    pairs
};
/// Gyros among [`CHANNELS`], which come first.
pub(crate) const GYROS: usize = 3;

/// Sums of products of the channels' second differences, octave by octave.
///
/// A count has 14 bits and a difference `n` times as many values, so in 2⁴⁰ samples no sum reaches 2¹⁰⁰.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Couplings {
    products: [[i128; PAIRS.len()]; COUPLED],
    counts: [u64; COUPLED],
    totals: [i64; CHANNELS.len()],
    samples: u64,
}

impl Couplings {
    /// Of channels that have taken no sample.
    #[must_use]
    pub const fn new() -> Self {
        Self { products: [[0; PAIRS.len()]; COUPLED], counts: [0; COUPLED], totals: [0; CHANNELS.len()], samples: 0 }
    }

    /// Takes the counts that all channels have just taken, and the differences that these completed.
    pub fn observe(&mut self, cascades: &[Estimator; CHANNELS.len()], counts: [i32; CHANNELS.len()]) {
        self.samples += 1;
        for (total, count) in self.totals.iter_mut().zip(counts) {
            *total += i64::from(count);
        }
        for (octave, (products, count)) in (FIRST..).zip(self.products.iter_mut().zip(&mut self.counts)) {
            if cascades[0].newest_difference(octave).is_none() {
                return; // longer ones are not complete either
            }
            // All have the same gaps: they complete their differences together.
            let differences = cascades.each_ref().map(|cascade| cascade.newest_difference(octave).unwrap_or_default());
            for (product, (low, high)) in products.iter_mut().zip(PAIRS) {
                *product += i128::from(differences[low]) * i128::from(differences[high]);
            }
            *count += 1;
        }
    }

    /// Samples that all channels took together.
    #[must_use]
    pub const fn samples(&self) -> u64 {
        self.samples
    }

    /// Mean of the channel [`CHANNELS`]`[index]` in counts; 0 of no samples.
    #[must_use]
    pub fn mean(&self, index: usize) -> f64 {
        self.totals.get(index).map_or(0.0, |&total| total as f64 / self.samples.max(1) as f64)
    }

    /// What two channels have in common at averaging factor `n`, in the product of their counts; `None` where it is not
    /// known, as for two gyros, which no one follows.
    #[must_use]
    pub fn covariance(&self, a: usize, b: usize, n: u64) -> Option<f64> {
        let pair = PAIRS.iter().position(|&pair| pair == (a.min(b), a.max(b)))?;
        let octave = (n.trailing_zeros() as usize).checked_sub(FIRST).filter(|_| n.is_power_of_two())?;
        let (products, &count) = (self.products.get(octave)?, self.counts.get(octave)?);
        (count > 0).then(|| products[pair] as f64 / (2.0 * count as f64 * n as f64 * n as f64))
    }
}

impl Default for Couplings {
    fn default() -> Self {
        Self::new()
    }
}
