//! Allan covariance of two channels at every octave, from the sums that their estimators hold.

use crate::cascade::Cascade;
use crate::list::List;
#[cfg(feature = "serde")]
use crate::serialized::{StateWords, serde_by_words, visit_wide};

/// Allan covariance of two channels at one averaging factor.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub struct Covariance {
    /// Averaging factor, samples.
    pub n: u64,
    /// Half the mean product of the two channels' differences of averages, in the product of their units.
    pub covariance: f64,
    /// Number of products averaged.
    pub count: u64,
}

/// Estimator of the Allan covariance of two channels that are sampled together.
///
/// For channels `y` and `c` and any factor `β`, `σ²(y − βc) = σ²(y) − 2β·cov(y, c) + β²·σ²(c)` holds exactly at every
/// octave.
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
///     coupling.observe(&rate, &temperature); // after every pair of samples
/// }
/// let at_16 = &coupling.points()[4];
/// let variance = temperature.curve(1.0).points()[4].avar;
/// assert!((at_16.covariance / variance - 3.0).abs() < 1e-3);
/// ```
///
/// Products are taken after samples that both channels have, at octaves at which neither leaves out its difference. The
/// estimators must have started together and go through the same time: otherwise nothing is added and
/// [`out_of_step`](Self::out_of_step) counts the sample.
///
/// Samples missing in both channels raise the covariance of shared noise by up to 1.5 times their fraction.
///
/// # Range
/// Exact for 2⁴⁰ samples within ±2²³. An octave whose sum overflows 128 bits has no covariance from then on.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Coupling<const OCTAVES: usize> {
    products: [i128; OCTAVES],
    counts: [u64; OCTAVES],
    out_of_step: u64,
}

/// Marks a sum that has overflowed 128 bits.
const OVERFLOWED: i128 = i128::MIN;

impl<const OCTAVES: usize> Coupling<OCTAVES> {
    /// An estimator without samples.
    #[must_use]
    pub const fn new() -> Self {
        Self { products: [0; OCTAVES], counts: [0; OCTAVES], out_of_step: 0 }
    }

    /// Adds the products of the differences that the newest sample of both channels completed; called once after each
    /// pair.
    ///
    /// # Cost
    /// | `Coupling::observe` | Cortex-M4F | Cortex-M0+ |
    /// |---|---|---|
    /// | instructions on average | 1,470 | 3,650 |
    /// | stack, bytes | 136 | 212 |
    /// | flash, bytes | 752 | — |
    ///
    /// See [`guide::costs`](crate::guide::costs) for how they are counted.
    #[inline]
    pub fn observe<const OVERLAP: usize>(&mut self, a: &Cascade<OCTAVES, OVERLAP>, b: &Cascade<OCTAVES, OVERLAP>) {
        let newest = |octave: usize| (a.newest_difference(octave), b.newest_difference(octave));
        self.add_newest(a.now() == b.now(), a.octaves_due(), newest);
    }

    /// Adds the products of the newest differences of both channels at the first octaves, if these are in step.
    #[inline]
    pub(crate) fn add_newest(
        &mut self,
        are_in_step: bool,
        octaves: usize,
        newest: impl Fn(usize) -> (Option<i64>, Option<i64>),
    ) {
        if !are_in_step {
            self.out_of_step += 1;
            return;
        }
        for octave in 0..octaves {
            if let (Some(a), Some(b)) = newest(octave) {
                self.add(octave, i128::from(a) * i128::from(b), 1);
            }
        }
    }

    /// Adds the sums of the same pair of channels in a later stretch.
    pub fn merge(&mut self, later: &Self) {
        for octave in 0..OCTAVES {
            self.add(octave, later.products[octave], later.counts[octave]);
        }
        self.out_of_step = self.out_of_step.saturating_add(later.out_of_step);
    }

    /// The exact sum of products of second differences of sums of `2^octave` samples, in the product of the channels' counts,
    /// and their number.
    ///
    /// `None` beyond the last octave and where the sum has overflowed.
    #[must_use]
    pub fn sum_of_products(&self, octave: usize) -> Option<(i128, u64)> {
        let sum = *self.products.get(octave)?;
        (sum != OVERFLOWED).then(|| (sum, self.counts[octave]))
    }

    /// The covariance, in the product of the channels' counts, of every octave that has at least one product, shortest
    /// first.
    ///
    /// # Cost
    /// | `Coupling::points` | Cortex-M4F | Cortex-M0+ |
    /// |---|---|---|
    /// | instructions | 14,700 | 42,500 |
    /// | stack, bytes | 1,370 | 1,430 |
    /// | flash, bytes | 3,260 | — |
    ///
    /// See [`guide::costs`](crate::guide::costs) for how they are counted.
    #[must_use]
    pub fn points(&self) -> List<Covariance, OCTAVES> {
        let points = (0..OCTAVES).filter_map(|octave| {
            let (sum, count) = self.sum_of_products(octave).filter(|&(_, count)| count > 0)?;
            let n = 1_u64 << octave;
            let covariance = sum as f64 / (2.0 * count as f64 * n as f64 * n as f64);
            Some(Covariance { n, covariance, count })
        });
        points.collect()
    }

    /// Number of samples left out because the two estimators were not at the same time or one has a gap before its next
    /// sample.
    #[must_use]
    pub const fn out_of_step(&self) -> u64 {
        self.out_of_step
    }

    #[inline]
    fn add(&mut self, octave: usize, product: i128, count: u64) {
        let sum = &mut self.products[octave];
        *sum = match sum.checked_add(product) {
            Some(next) if *sum != OVERFLOWED && product != OVERFLOWED => next,
            _ => OVERFLOWED,
        };
        self.counts[octave] = self.counts[octave].saturating_add(count);
    }
}

impl<const OCTAVES: usize> Default for Coupling<OCTAVES> {
    fn default() -> Self {
        Self::new()
    }
}

#[cfg(feature = "serde")]
serde_by_words!(OCTAVES for Coupling<OCTAVES>);

#[cfg(feature = "serde")]
impl<const OCTAVES: usize> StateWords for Coupling<OCTAVES> {
    const EMPTY: Self = Self::new();
    const KIND: u8 = b'C';
    const OCTAVES: usize = OCTAVES;
    const OVERLAP: usize = 0;
    const WORDS: usize = OCTAVES * 3 + 1;

    fn visit_words<E>(&mut self, mut visit: impl FnMut(&mut u64) -> Result<(), E>) -> Result<(), E> {
        for product in &mut self.products {
            let mut bits = *product as u128;
            visit_wide(&mut bits, &mut visit)?;
            *product = bits as i128;
        }
        self.counts.iter_mut().chain([&mut self.out_of_step]).try_for_each(visit)
    }

    fn inconsistency(&self) -> Option<&'static str> {
        let idle = |(product, count): (&i128, &u64)| *count == 0 && *product != 0;
        self.products.iter().zip(&self.counts).any(idle).then_some("a sum over no products that is not 0")
    }
}
