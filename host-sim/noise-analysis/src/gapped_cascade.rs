//! A cascade that counts the samples that are missing until the next one.

use crate::{OCTAVES, OVERLAP};
use allan_core::{Cascade, Curve};
use measurement::MeasuredChannel;

/// An estimator and the samples that are missing since its last one.
#[derive(Clone, Default)]
pub(crate) struct GappedCascade {
    cascade: Cascade<OCTAVES, OVERLAP>,
    missing: u32,
}

impl GappedCascade {
    /// The estimator, without the samples that are missing since its last one.
    pub(crate) fn cascade(&self) -> &Cascade<OCTAVES, OVERLAP> {
        &self.cascade
    }

    /// Its curve, in counts.
    pub(crate) fn curve(&self, period_s: f64) -> Curve<OCTAVES> {
        self.cascade.curve(period_s)
    }

    /// Whether the sample of the latest sample period is there.
    pub(crate) fn has_latest(&self) -> bool {
        self.missing == 0
    }

    /// Takes samples that follow each other.
    pub(crate) fn push(&mut self, counts: &[i32]) {
        if self.missing > 0 && !counts.is_empty() {
            self.cascade.gap(std::mem::take(&mut self.missing));
        }
        self.cascade.push_slice(counts);
    }

    /// Takes the next sample, if there is one.
    pub(crate) fn push_one(&mut self, count: Option<i32>) {
        match count {
            Some(count) => {
                if self.missing > 0 {
                    self.cascade.gap(std::mem::take(&mut self.missing));
                }
                self.cascade.push(count);
            }
            None => self.miss(1),
        }
    }

    /// Records that so many samples are missing.
    pub(crate) fn miss(&mut self, samples: u64) {
        self.missing = self.missing.saturating_add(u32::try_from(samples).unwrap_or(u32::MAX));
    }

    /// Takes each sample of a series that is not finite for a missing one, and the others in steps of this size.
    pub(crate) fn push_values(&mut self, values: &[f64], step: f64) {
        let count = |value: &f64| value.is_finite().then(|| (value / step).round() as i32);
        values.iter().for_each(|value| self.push_one(count(value)));
    }

    /// Takes the samples of a channel that are not refused, which were taken in the sample periods `slots`, from the first on.
    pub(crate) fn push_channel(&mut self, slots: &[u64], channel: &MeasuredChannel) {
        let mut next = slots.first().copied().unwrap_or(0);
        for (slot, count) in channel.used_samples(slots) {
            self.miss(slot - next);
            self.push_one(Some(count));
            next = slot + 1;
        }
    }

    /// The estimator of these samples followed, after a gap, by those of `later`.
    pub(crate) fn merge(&mut self, later: &Self) {
        self.cascade.merge(&later.cascade);
    }
}
