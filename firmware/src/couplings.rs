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
/// A count has 14 bits, so a difference is within ±2¹⁴·n, and in 2⁴⁰ samples there are 2⁴³/n of them: no sum passes
/// 2⁷¹·n ≤ 2⁹⁰. In two words, the upper one of half the size, it takes 96 bits.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Couplings {
    low: [[u64; PAIRS.len()]; COUPLED],
    high: [[i32; PAIRS.len()]; COUPLED],
    counts: [u64; COUPLED],
    totals: [i64; CHANNELS.len()],
    samples: u64,
}

impl Couplings {
    /// Of channels that have taken no sample.
    #[must_use]
    pub const fn new() -> Self {
        let (low, high) = ([[0; PAIRS.len()]; COUPLED], [[0; PAIRS.len()]; COUPLED]);
        Self { low, high, counts: [0; COUPLED], totals: [0; CHANNELS.len()], samples: 0 }
    }

    /// Forgets everything.
    pub fn reset(&mut self) {
        // In place: a new one would pass over the stack.
        self.low.fill([0; PAIRS.len()]);
        self.high.fill([0; PAIRS.len()]);
        (self.counts, self.totals, self.samples) = ([0; COUPLED], [0; CHANNELS.len()], 0);
    }

    /// Takes the counts that all channels have just taken, and the differences that these completed.
    pub fn observe(&mut self, cascades: &[Estimator; CHANNELS.len()], counts: [i32; CHANNELS.len()]) {
        self.samples += 1;
        for (total, count) in self.totals.iter_mut().zip(counts) {
            *total += i64::from(count);
        }
        for (octave, count) in (FIRST..).zip(&mut self.counts) {
            if cascades[0].newest_difference(octave).is_none() {
                return; // longer ones are not complete either
            }
            // All have the same gaps: they complete their differences together.
            let differences = cascades.each_ref().map(|cascade| cascade.newest_difference(octave).unwrap_or_default());
            let sums = self.low[octave - FIRST].iter_mut().zip(&mut self.high[octave - FIRST]);
            for ((low, high), (a, b)) in sums.zip(PAIRS) {
                let sum = wide(*low, *high) + i128::from(differences[a]) * i128::from(differences[b]);
                (*low, *high) = (sum as u64, (sum >> 64) as i32);
            }
            *count += 1;
        }
    }
}

impl Default for Couplings {
    fn default() -> Self {
        Self::new()
    }
}

fn wide(low: u64, high: i32) -> i128 {
    i128::from(high) << 64 | i128::from(low)
}

/// Mean of every channel in counts.
pub type Means = [f64; CHANNELS.len()];

/// What is left of [`Couplings`] when an epoch is over: no sum has to be exact any more that nothing is added to.
#[derive(Debug, Clone, PartialEq)]
pub struct Covariances {
    /// Allan covariance of each pair at each octave in counts².
    of_pairs: [[f64; COUPLED]; PAIRS.len()],
    counts: [u64; COUPLED],
    /// Mean of every channel; 0 of no samples.
    pub means: Means,
    /// Samples that all channels took together.
    pub samples: u64,
}

impl Covariances {
    /// Of no samples.
    pub const NONE: Self = Self {
        of_pairs: [[0.0; COUPLED]; PAIRS.len()],
        counts: [0; COUPLED],
        means: [0.0; CHANNELS.len()],
        samples: 0,
    };

    /// Those of `couplings` take the place of what was there before.
    pub fn take(&mut self, couplings: &Couplings) {
        (self.counts, self.samples) = (couplings.counts, couplings.samples);
        self.means = couplings.totals.map(|total| total as f64 / couplings.samples.max(1) as f64);
        for (pair, covariances) in self.of_pairs.iter_mut().enumerate() {
            for (k, covariance) in covariances.iter_mut().enumerate() {
                let (n, count) = ((1_u64 << (FIRST + k)) as f64, couplings.counts[k].max(1) as f64);
                *covariance = wide(couplings.low[k][pair], couplings.high[k][pair]) as f64 / (2.0 * count * n * n);
            }
        }
    }

    /// What two channels have in common at averaging factor `n`, in the product of their counts; `None` where it is not
    /// known, as for two gyros, which no one follows.
    #[must_use]
    pub fn covariance(&self, a: usize, b: usize, n: u64) -> Option<f64> {
        let pair = PAIRS.iter().position(|&pair| pair == (a.min(b), a.max(b)))?;
        let octave = (n.trailing_zeros() as usize).checked_sub(FIRST).filter(|_| n.is_power_of_two())?;
        let known = *self.counts.get(octave)? > 0;
        known.then(|| self.of_pairs[pair][octave])
    }
}
