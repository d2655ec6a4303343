//! Sums over pairs of channels: Allan covariances and means of an epoch.

use crate::channels::{CHANNELS, ChannelEstimator, ChannelSet, GYROS};

/// First octave of the cross sums, 256 samples; they are updated once in 32 samples.
pub(crate) const FIRST_CROSS_OCTAVE: usize = 8;
/// Octaves of the cross sums: up to 2¹⁹ samples, 43 minutes at 204.8 samples a second.
pub(crate) const CROSS_OCTAVES: usize = 12;
/// Pairs for regression: all but two gyros.
pub(crate) const PAIRS: [(usize, usize); 25] = {
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

/// Sum of products of second differences of a pair, in 64 + 32 bits: it stays below 2⁹⁰ for 2⁴⁰ samples.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct ProductSum {
    low: u64,
    high: i32,
    /// Number of products; it rises once in 32 samples at most.
    count: u32,
}

impl ProductSum {
    const NONE: Self = Self { low: 0, high: 0, count: 0 };

    fn sum(self) -> i128 {
        i128::from(self.high) << 64 | i128::from(self.low)
    }
}

/// Sums over channel pairs by octave, and of counts.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct CrossSums {
    products: [[ProductSum; PAIRS.len()]; CROSS_OCTAVES],
    totals: [i64; CHANNELS.len()],
    /// Samples in any channel, and refused counts per channel.
    samples: u64,
    refused_counts: [u64; CHANNELS.len()],
    /// True if samples before a restart are missing.
    pub(crate) incomplete: bool,
}

impl CrossSums {
    pub(crate) const fn new() -> Self {
        Self {
            products: [[ProductSum::NONE; PAIRS.len()]; CROSS_OCTAVES],
            totals: [0; CHANNELS.len()],
            samples: 0,
            refused_counts: [0; CHANNELS.len()],
            incomplete: false,
        }
    }

    pub(crate) fn reset(&mut self) {
        // The array is filled in place: a new value would put 5 kB on the stack.
        self.products.fill([ProductSum::NONE; PAIRS.len()]);
        (self.totals, self.samples, self.refused_counts) = ([0; CHANNELS.len()], 0, [0; CHANNELS.len()]);
        self.incomplete = false;
    }

    /// Adds counts of all but the `refused` channels, and completed second differences.
    pub(crate) fn add(
        &mut self,
        estimators: &[ChannelEstimator; CHANNELS.len()],
        counts: [i32; CHANNELS.len()],
        refused: ChannelSet,
    ) {
        if refused == ChannelSet::ALL {
            return;
        }
        self.samples += 1;
        for (total, count) in self.totals.iter_mut().zip(counts) {
            *total += i64::from(count);
        }
        if !refused.is_empty() {
            self.subtract_refused(counts, refused);
        }
        // All channels have the same time and the same due octaves.
        let due =
            (0..CHANNELS.len()).find(|&index| !refused.contains(index)).map(|index| estimators[index].octaves_due());
        for octave in FIRST_CROSS_OCTAVE..due.unwrap_or(0).min(FIRST_CROSS_OCTAVE + CROSS_OCTAVES) {
            let newest =
                |index: usize| estimators[index].newest_difference(octave).filter(|_| !refused.contains(index));
            self.add_products(octave - FIRST_CROSS_OCTAVE, &core::array::from_fn(newest));
        }
    }

    /// Removes refused counts from the totals; rare, so not inlined.
    #[inline(never)]
    fn subtract_refused(&mut self, counts: [i32; CHANNELS.len()], refused: ChannelSet) {
        for (index, (total, refused_counts)) in self.totals.iter_mut().zip(&mut self.refused_counts).enumerate() {
            if refused.contains(index) {
                (*total, *refused_counts) = (*total - i64::from(counts[index]), *refused_counts + 1);
            }
        }
    }

    fn add_products(&mut self, row: usize, differences: &[Option<i64>; CHANNELS.len()]) {
        // `get` and `get_mut` avoid a panic in the sampling path.
        let Some(products) = self.products.get_mut(row) else { return };
        let difference = |of: usize| differences.get(of).copied().flatten();
        for (product, (a, b)) in products.iter_mut().zip(PAIRS) {
            if let (Some(a), Some(b)) = (difference(a), difference(b)) {
                let sum = product.sum() + i128::from(a) * i128::from(b);
                (product.low, product.high) = (sum as u64, (sum >> 64) as i32);
                product.count = product.count.saturating_add(1);
            }
        }
    }
}

const NOT_OBSERVED: f64 = 0.0;

/// Mean of every channel of [`CHANNELS`] in counts.
pub(crate) type ChannelMeans = [f64; CHANNELS.len()];

/// Rounded Allan covariances and means of a finished epoch.
#[derive(Debug, Clone, PartialEq)]
pub struct AllanCovariances {
    /// Covariance by pair and octave, counts²; 0 if not observed, −0 for a covariance of 0.
    pub(crate) pairs: [[f64; CROSS_OCTAVES]; PAIRS.len()],
    /// Mean of every channel; 0 without samples.
    pub means: ChannelMeans,
    /// False if the device restarted in the epoch.
    pub complete: bool,
}

impl AllanCovariances {
    /// Covariances of no samples.
    pub const EMPTY: Self =
        Self { pairs: [[NOT_OBSERVED; CROSS_OCTAVES]; PAIRS.len()], means: [0.0; CHANNELS.len()], complete: false };

    /// Filled in place: it has 2.5 kB.
    pub(crate) fn fill(&mut self, sums: &CrossSums) {
        self.complete = !sums.incomplete;
        let samples = |index: usize| (sums.samples - sums.refused_counts[index]).max(1);
        self.means = core::array::from_fn(|index| sums.totals[index] as f64 / samples(index) as f64);
        for (pair, covariances) in self.pairs.iter_mut().enumerate() {
            for (k, covariance) in covariances.iter_mut().enumerate() {
                let product = sums.products[k][pair];
                let (n, count) = ((1_u64 << (FIRST_CROSS_OCTAVE + k)) as f64, f64::from(product.count));
                let sum = product.sum() as f64;
                // An observed sum of 0 is stored as −0, since +0 is [`NOT_OBSERVED`].
                let sum = if sum == 0.0 { -0.0 } else { sum };
                *covariance = if count > 0.0 { sum / (2.0 * count * n * n) } else { NOT_OBSERVED };
            }
        }
    }

    /// Allan covariance at averaging factor `n`, in counts of both; `None` if not estimated, as for two gyros.
    pub fn covariance(&self, a: usize, b: usize, n: u64) -> Option<f64> {
        let pair = PAIRS.iter().position(|&pair| pair == (a.min(b), a.max(b)))?;
        let octave = (n.trailing_zeros() as usize).checked_sub(FIRST_CROSS_OCTAVE).filter(|_| n.is_power_of_two())?;
        self.pairs[pair].get(octave).copied().filter(|covariance| covariance.to_bits() != NOT_OBSERVED.to_bits())
    }
}

#[cfg(test)]
mod tests {
    extern crate std;

    use super::*;
    use std::boxed::Box;

    const GYRO_X: usize = 0;
    const TEMPERATURE: usize = 6;
    const SUPPLY: usize = 7;

    fn count(k: u32) -> i32 {
        (k % 1000) as i32
    }

    /// Sums of `samples` samples; `refused` returns the missing channels of a sample.
    fn sums(samples: u32, refused: impl Fn(u32) -> ChannelSet) -> Box<CrossSums> {
        let mut estimators = Box::new([const { ChannelEstimator::new() }; CHANNELS.len()]);
        let mut sums = Box::new(CrossSums::new());
        for k in 0..samples {
            for (index, estimator) in estimators.iter_mut().enumerate() {
                if refused(k).contains(index) { estimator.gap(1) } else { estimator.push(count(k)) }
            }
            sums.add(&estimators, [count(k); CHANNELS.len()], refused(k));
        }
        sums
    }

    fn observed(sums: &CrossSums, a: usize, b: usize) -> u32 {
        let pair = PAIRS.iter().position(|&pair| pair == (a, b)).expect("a pair");
        sums.products[0][pair].count
    }

    /// Gyro x loses forty samples from the 600th on, more than n = 256 bridges. Other pairs lose nothing.
    #[test]
    fn a_channel_without_a_sample_costs_its_own_pairs_only() {
        let complete = sums(4096, |_| ChannelSet::EMPTY);
        let gap = |k| if (600..640).contains(&k) { ChannelSet(1 << GYRO_X) } else { ChannelSet::EMPTY };
        let gapped = sums(4096, gap);
        let pair = (TEMPERATURE, SUPPLY);
        // The first difference at n = 256 takes 512 samples; further ones end every 32nd sample.
        assert_eq!(observed(&complete, pair.0, pair.1), (4096 - 512) / 32 + 1);
        assert_eq!(observed(&gapped, pair.0, pair.1), observed(&complete, pair.0, pair.1));
        assert!(observed(&gapped, GYRO_X, TEMPERATURE) < observed(&complete, GYRO_X, TEMPERATURE));
        let mut covariances = Box::new(AllanCovariances::EMPTY);
        covariances.fill(&complete);
        let expected = covariances.covariance(pair.0, pair.1, 256);
        covariances.fill(&gapped);
        assert!(expected.is_some_and(|value| value > 0.0));
        assert_eq!(covariances.covariance(pair.0, pair.1, 256), expected);
        let total: i64 = (0..4096).map(|k| i64::from(count(k))).sum();
        let missing: i64 = (600..640).map(|k| i64::from(count(k))).sum();
        assert_eq!(covariances.means[GYRO_X], (total - missing) as f64 / 4056.0);
        assert_eq!(covariances.means[SUPPLY], total as f64 / 4096.0);
    }

    #[test]
    fn a_pair_that_was_never_observed_has_no_covariance() {
        let never = sums(2048, |_| ChannelSet(1 << GYRO_X));
        let mut covariances = Box::new(AllanCovariances::EMPTY);
        covariances.fill(&never);
        assert_eq!(covariances.covariance(GYRO_X, TEMPERATURE, 256), None);
        assert!(covariances.covariance(TEMPERATURE, SUPPLY, 256).is_some());
        assert_eq!(covariances.means[GYRO_X], 0.0);
    }

    /// A covariance of 0 differs from a missing one.
    #[test]
    fn a_covariance_of_zero_counts_as_observed() {
        let mut estimators = Box::new([const { ChannelEstimator::new() }; CHANNELS.len()]);
        let mut sums = Box::new(CrossSums::new());
        for _ in 0..2048 {
            estimators.iter_mut().for_each(|estimator| estimator.push(0));
            sums.add(&estimators, [0; CHANNELS.len()], ChannelSet::EMPTY);
        }
        let mut covariances = Box::new(AllanCovariances::EMPTY);
        assert_eq!(covariances.covariance(GYRO_X, TEMPERATURE, 256), None);
        covariances.fill(&sums);
        assert_eq!(covariances.covariance(GYRO_X, TEMPERATURE, 256), Some(0.0));
    }
}
