//! Which of several filters stands, by the deviance of each.

use crate::bounds::BoundedEstimate;
use allan_core::term::MovingAverageFilter;
use statrs::distribution::{ChiSquared, ContinuousCDF};
use std::collections::BTreeSet;

/// Probability with which bounds hold a parameter.
pub(super) const BOUNDED: f64 = 0.95;

/// A filter and the deviance of each channel with it.
pub(super) struct Hypothesis {
    pub(super) filter: MovingAverageFilter,
    pub(super) deviances: Vec<f64>,
}

impl Hypothesis {
    /// The deviance of all channels.
    pub(super) fn total(&self) -> f64 {
        self.deviances.iter().sum()
    }
}

/// A filter that curves or samples identify.
pub(super) struct Identified {
    pub(super) filter: MovingAverageFilter,
    pub(super) decimation: BoundedEstimate,
    /// Taps of others that fit as well.
    pub(super) other_taps: Vec<u16>,
}

impl Identified {
    /// With a decimation between these.
    pub(super) fn new(filter: MovingAverageFilter, (low, high): (f64, f64), other_taps: Vec<u16>) -> Self {
        let decimation = BoundedEstimate { value: filter.decimation, low, high };
        Self { filter, decimation, other_taps }
    }
}

/// The position of the simplest of those of `tried` whose deviance is at most `limit`, and the other taps of these. Every value recorded
/// is simpler than a filter that is read slowly, and of several of these the one nearest to the sensor's own clock is.
pub(super) fn simplest(tried: &[Hypothesis], limit: f64, nominal_decimation: f64) -> Option<(usize, Vec<u16>)> {
    let from_nominal = |of: &Hypothesis| (of.filter.decimation / nominal_decimation).ln().abs();
    let as_good = || tried.iter().enumerate().filter(|(_, of)| of.total() <= limit);
    let own_rate = as_good().filter(|(_, of)| of.filter.decimation == 1.0);
    let own_rate = own_rate.min_by(|(_, a), (_, b)| a.total().total_cmp(&b.total()));
    let slow = || as_good().min_by(|(_, a), (_, b)| from_nominal(a).total_cmp(&from_nominal(b)));
    let (at, chosen) = own_rate.or_else(slow)?;
    let others: BTreeSet<u16> =
        as_good().map(|(_, of)| of.filter.taps).filter(|taps| *taps != chosen.filter.taps).collect();
    Some((at, others.into_iter().collect()))
}

/// By how much channels differ among themselves: the sum of the `rises` of their deviances over its expectation, at least 1
/// (R. Birge, Phys. Rev. 40, 1932).
pub(super) fn birge_ratio(rises: &[f64]) -> f64 {
    (rises.iter().sum::<f64>() / (rises.len() as f64 - 1.0).max(1.0)).max(1.0)
}

pub(super) fn chi_squared_quantile(probability: f64, degrees_of_freedom: f64) -> f64 {
    // The degrees of freedom are constants in the range of the distribution.
    ChiSquared::new(degrees_of_freedom).map_or(f64::INFINITY, |of| of.inverse_cdf(probability))
}
