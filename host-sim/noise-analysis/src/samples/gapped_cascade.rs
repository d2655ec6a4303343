//! A cascade that counts the samples that are missing until the next one.

use crate::samples::neighbouring_gaps::NeighbouringGaps;
use crate::samples::series::Series;
use crate::{OCTAVES, OVERLAP};
use allan_core::{Cascade, Curve};
use measurement::MeasuredChannel;
use std::ops::Range;

/// An estimator and the samples that are missing since its last one.
#[derive(Clone, Default)]
pub(crate) struct GappedCascade {
    cascade: Cascade<OCTAVES, OVERLAP>,
    missing: u32,
    gaps: NeighbouringGaps,
}

impl GappedCascade {
    /// The estimator, without the samples that are missing since its last one.
    pub(crate) fn cascade(&self) -> &Cascade<OCTAVES, OVERLAP> {
        &self.cascade
    }

    /// Its curve, in counts.
    pub(crate) fn curve(&self, period_s: f64) -> Curve<OCTAVES> {
        let mut curve = self.cascade.curve(period_s);
        self.gaps.take_off(&mut curve, self.cascade.len() + self.cascade.missing());
        curve
    }

    /// Whether the sample of the latest sample period is there.
    pub(crate) fn has_latest(&self) -> bool {
        self.missing == 0
    }

    /// Takes samples that follow each other.
    pub(crate) fn push(&mut self, counts: &[i32]) {
        if !counts.is_empty() {
            self.close_gap();
        }
        self.cascade.push_slice(counts);
        self.gaps.push(counts.len() as u64);
    }

    /// Tells the estimator of the samples that are missing before the next one.
    fn close_gap(&mut self) {
        if self.missing > 0 {
            self.gaps.close(self.missing.into());
            self.cascade.gap(std::mem::take(&mut self.missing));
        }
    }

    /// Takes the next sample, if there is one.
    pub(crate) fn push_one(&mut self, count: Option<i32>) {
        match count {
            Some(count) => {
                self.close_gap();
                self.cascade.push(count);
                self.gaps.push(1);
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

    /// Takes samples, each with the sample period in which it was taken, from the sample period `from` on.
    pub(crate) fn push_slots(&mut self, from: u64, samples: impl Iterator<Item = (u64, i32)>) {
        let mut next = from;
        for (slot, count) in samples {
            self.miss(slot - next);
            self.push_one(Some(count));
            next = slot + 1;
        }
    }

    /// The estimator of the samples of a channel that are not refused, which were taken in the sample periods `slots`, in counts.
    pub(crate) fn of_channel(slots: &[u64], channel: &MeasuredChannel) -> Self {
        let mut cascade = Self::default();
        cascade.push_slots(slots.first().copied().unwrap_or(0), channel.used_samples(slots));
        cascade
    }

    /// The estimator of the samples of `series` at some positions, in steps of its resolution.
    pub(crate) fn of_series(series: &Series, positions: Range<usize>) -> Self {
        let (slots, values) = (&series.slots[positions.clone()], &series.values[positions]);
        let count = |value: &f64| (value / series.resolution).round() as i32;
        let mut cascade = Self::default();
        let samples = slots.iter().copied().zip(values.iter().map(count));
        cascade.push_slots(slots.first().copied().unwrap_or(0), samples);
        cascade
    }

    /// The estimator of these samples followed, after a gap, by those of `later`.
    pub(crate) fn merge(&mut self, later: &Self) {
        self.cascade.merge(&later.cascade);
        self.gaps.merge(&later.gaps);
    }
}
