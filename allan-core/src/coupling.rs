//! What two channels have in common at every octave, without a second pass over the data.

#[cfg(feature = "serde")]
mod state;

use crate::Cascade;
use heapless::Vec;

/// Allan covariance of two channels at one averaging factor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Covariance {
    /// Averaging factor, samples.
    pub n: u64,
    /// Half the mean product of the two channels' differences of averages, in the product of their units.
    pub covariance: f64,
    /// Products that it is the mean of.
    pub count: u64,
}

/// Allan covariance of a pair of channels whose [`Cascade`]s take their samples in step.
///
/// It multiplies the second differences that the two estimators have anyway, so for channels `y` and `c`
///
/// `σ²(y − βc) = σ²(y) − 2β·cov(y, c) + β²·σ²(c)`
///
/// holds exactly at every octave: the left side is what compensation of `y` by `c` would leave.
///
/// ```
/// use allan_core::{Cascade, Coupling};
///
/// let (mut rate, mut temperature) = (Cascade::<12, 8>::new(), Cascade::<12, 8>::new());
/// let mut coupling = Coupling::<12>::new();
/// for k in 0..5_000 {
///     let t = k * k % 1_009;
///     temperature.push(t);
///     rate.push(3 * t + k % 2);
///     coupling.observe(&rate, &temperature); // after every sample of the two
/// }
/// let at_16 = &coupling.points()[4];
/// let variance = temperature.curve(1.0).points()[4].avar;
/// assert!((at_16.covariance / variance - 3.0).abs() < 1e-3);
/// ```
///
/// Both estimators must hear of every gap in either channel, so that both leave out the same differences. Samples that
/// they have taken since their last gaps must be as many; where they are not, nothing is multiplied and
/// [`out_of_step`](Self::out_of_step) counts it. There is no way for slices.
///
/// # Range
/// As of [`Cascade`]: exact for samples within ±2²³ over 2⁴⁰ samples. An octave whose sum has left 128 bits has no
/// covariance any more.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Coupling<const OCTAVES: usize> {
    products: [i128; OCTAVES],
    counts: [u64; OCTAVES],
    out_of_step: u64,
}

/// Takes the place of a sum that left 128 bits.
const FULL: i128 = i128::MIN;

impl<const OCTAVES: usize> Coupling<OCTAVES> {
    /// A pair of which nothing was seen.
    #[must_use]
    pub const fn new() -> Self {
        Self { products: [0; OCTAVES], counts: [0; OCTAVES], out_of_step: 0 }
    }

    /// Multiplies the differences that the newest sample of both channels completed. To be called once after each.
    #[inline]
    pub fn observe<const OVERLAP: usize>(&mut self, a: &Cascade<OCTAVES, OVERLAP>, b: &Cascade<OCTAVES, OVERLAP>) {
        if a.elapsed() != b.elapsed() {
            self.out_of_step += 1;
            return;
        }
        for octave in 0..OCTAVES {
            let (Some(a), Some(b)) = (a.newest_difference(octave), b.newest_difference(octave)) else {
                return; // longer ones are not complete either
            };
            self.add(octave, i128::from(a) * i128::from(b), 1);
        }
    }

    /// Adds what was learnt of the same pair in a later stretch.
    pub fn merge(&mut self, later: &Self) {
        for octave in 0..OCTAVES {
            self.add(octave, later.products[octave], later.counts[octave]);
        }
        self.out_of_step = self.out_of_step.saturating_add(later.out_of_step);
    }

    /// The exact sum of products of second differences of sums of `2^octave` samples, and their number.
    ///
    /// `None` beyond the last octave and where the sum has left its range.
    #[must_use]
    pub fn sum_of_products(&self, octave: usize) -> Option<(i128, u64)> {
        let sum = *self.products.get(octave)?;
        (sum != FULL).then(|| (sum, self.counts[octave]))
    }

    /// The covariance of every octave that has at least one product, shortest first.
    #[must_use]
    pub fn points(&self) -> Vec<Covariance, OCTAVES> {
        let points = (0..OCTAVES).filter_map(|octave| {
            let (sum, count) = self.sum_of_products(octave).filter(|&(_, count)| count > 0)?;
            let n = 1_u64 << octave;
            let covariance = sum as f64 / (2.0 * count as f64 * n as f64 * n as f64);
            Some(Covariance { n, covariance, count })
        });
        points.collect()
    }

    /// Samples at which the two estimators did not stand at the same place after their gaps.
    #[must_use]
    pub const fn out_of_step(&self) -> u64 {
        self.out_of_step
    }

    #[inline]
    fn add(&mut self, octave: usize, product: i128, count: u64) {
        let sum = &mut self.products[octave];
        *sum = match sum.checked_add(product) {
            Some(next) if *sum != FULL && product != FULL => next,
            _ => FULL,
        };
        self.counts[octave] = self.counts[octave].saturating_add(count);
    }
}

impl<const OCTAVES: usize> Default for Coupling<OCTAVES> {
    fn default() -> Self {
        Self::new()
    }
}
