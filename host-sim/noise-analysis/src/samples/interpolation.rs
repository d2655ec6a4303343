//! The best linear interpolation of a sample from its present neighbours, by the autocovariance of the channel.

use nalgebra::{DMatrix, DVector};

/// White noise over the variance, in increasing order, that keeps the equations of a sinusoid solvable.
const WHITE: [f64; 5] = [LEAST_WHITE, 1e-7, 1e-5, 1e-3, 1e-1];
pub(crate) const LEAST_WHITE: f64 = 1e-9;

pub(crate) const REACH: usize = 6;

/// Autocovariance at lags 0 to 2·[`REACH`].
pub(crate) type Autocovariance = [f64; 2 * REACH + 1];

/// Present neighbours of a sample: bits `k` and `REACH + k` for those `k + 1` samples before and after it.
pub(crate) type Neighbours = u16;

pub(crate) const ALL_NEIGHBOURS: Neighbours = (1 << (2 * REACH)) - 1;
#[derive(Debug, Clone)]
pub(crate) struct PartialInterpolation {
    pub weights: [f64; 2 * REACH],
    /// Standard deviation of the error over that with all neighbours.
    pub scale: f64,
}

impl PartialInterpolation {
    pub(crate) fn mean(present: Neighbours) -> Self {
        let weight = 1.0 / f64::from(present.count_ones());
        let weights = std::array::from_fn(|bit| if present >> bit & 1 == 1 { weight } else { 0.0 });
        Self { weights, scale: 1.0 }
    }

    /// `None` if the equations have no solution.
    pub(crate) fn best(covariance: &Autocovariance, present: Neighbours) -> Option<Self> {
        let (weights, variance) = Self::solve(covariance, present)?;
        let (_, complete) = Self::solve(covariance, ALL_NEIGHBOURS)?;
        // A pure sinusoid leaves only rounding errors.
        let least = LEAST_WHITE * covariance[0];
        let scale = (variance.max(least) / complete.max(least)).sqrt();
        scale.is_finite().then_some(Self { weights, scale })
    }

    fn solve(covariance: &Autocovariance, present: Neighbours) -> Option<([f64; 2 * REACH], f64)> {
        let bits: Vec<usize> = (0..2 * REACH).filter(|bit| present >> bit & 1 == 1).collect();
        let offset = |bit: usize| if bit < REACH { -(bit as i64) - 1 } else { (bit - REACH) as i64 + 1 };
        let between = |a: usize, b: usize| covariance[offset(a).abs_diff(offset(b)) as usize];
        let factor = |white: f64| {
            let entry =
                |a: usize, b: usize| between(bits[a], bits[b]) + if a == b { white * covariance[0] } else { 0.0 };
            DMatrix::from_fn(bits.len(), bits.len(), entry).cholesky()
        };
        let with_sample =
            DVector::from_iterator(bits.len(), bits.iter().map(|&bit| covariance[offset(bit).unsigned_abs() as usize]));
        let solved = WHITE.into_iter().find_map(factor)?.solve(&with_sample);
        let mut weights = [0.0; 2 * REACH];
        bits.iter().zip(solved.iter()).for_each(|(&bit, &weight)| weights[bit] = weight);
        Some((weights, covariance[0] - solved.dot(&with_sample)))
    }
}
