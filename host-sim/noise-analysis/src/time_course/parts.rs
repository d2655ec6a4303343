//! The parts of a channel's record that are compared with each other.

use crate::series::Series;
use crate::{OCTAVES, OVERLAP};
use allan_core::{Cascade, Curve};
use std::ops::Range;

/// Longest epoch, samples: five minutes at 100 Hz.
const LONGEST_EPOCH: usize = 1 << 15;
/// Shortest epoch, samples, whose curve tells a level from a line.
const SHORTEST_EPOCH: usize = 1 << 10;
/// Epochs that a half has at least.
const FEWEST_EPOCHS: usize = 12;

/// Curves of the halves, of the quarters of the fitted half, and of epochs, in the channel's unit.
#[derive(Debug, Clone)]
pub struct Parts {
    /// First half of the record.
    pub fitted: Curve<OCTAVES>,
    /// The two halves of the fitted half, the earlier first.
    pub quarters: [Curve<OCTAVES>; 2],
    /// Second half of the record.
    pub unseen: Curve<OCTAVES>,
    /// Samples in an epoch.
    pub epoch: usize,
    /// Epochs up to the middle of the record; what is left over lies before the first.
    pub fitted_epochs: Vec<Curve<OCTAVES>>,
    /// Epochs from the middle on; what is left over lies behind the last.
    pub unseen_epochs: Vec<Curve<OCTAVES>>,
}

impl Parts {
    /// Of a series of at least 24,576 samples (two halves of twelve shortest epochs); `None` of a shorter one.
    #[must_use]
    pub fn of(series: &Series) -> Option<Self> {
        let (all, half) = (series.values.len(), series.values.len() / 2);
        let epoch = (half / FEWEST_EPOCHS).min(LONGEST_EPOCH).checked_ilog2().map(|log2| 1 << log2)?;
        if epoch < SHORTEST_EPOCH {
            return None;
        }
        let epochs = |from: usize| (0..half / epoch).map(move |k| from + k * epoch..from + (k + 1) * epoch);
        let curves =
            |ranges: &mut dyn Iterator<Item = Range<usize>>| ranges.map(|range| curve(series, range)).collect();
        Some(Self {
            fitted: curve(series, 0..half),
            quarters: [curve(series, 0..half / 2), curve(series, half / 2..half)],
            unseen: curve(series, half..all),
            epoch,
            fitted_epochs: curves(&mut epochs(half % epoch)),
            unseen_epochs: curves(&mut epochs(half)),
        })
    }

    /// Epochs of the later quarter of the fitted half.
    #[must_use]
    pub fn latest_epochs(&self) -> &[Curve<OCTAVES>] {
        &self.fitted_epochs[self.fitted_epochs.len() / 2..]
    }
}

fn curve(series: &Series, range: Range<usize>) -> Curve<OCTAVES> {
    let mut estimator = Cascade::<OCTAVES, OVERLAP>::new();
    let mut next = series.slots.get(range.start).copied().unwrap_or(0);
    for (&slot, value) in series.slots[range.clone()].iter().zip(&series.values[range]) {
        if slot > next {
            estimator.gap(u32::try_from(slot - next).unwrap_or(u32::MAX));
        }
        estimator.push((value / series.resolution).round() as i32);
        next = slot + 1;
    }
    estimator.curve(series.period_s).scaled(series.resolution)
}
