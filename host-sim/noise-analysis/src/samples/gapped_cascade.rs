//! A cascade that counts the samples that are missing until the next one.

use crate::samples::neighbouring_gaps::NeighbouringGaps;
use crate::samples::series::Series;
use crate::{OCTAVES, OVERLAP};
use allan_core::{Cascade, Curve};
use measurement::MeasuredChannel;
use std::ops::Range;

#[derive(Clone, Default)]
pub(crate) struct GappedCascade {
    cascade: Cascade<OCTAVES, OVERLAP>,
    missing: u32,
    gaps: NeighbouringGaps,
}

impl GappedCascade {
    /// Without the samples missing since the last one.
    pub(crate) fn cascade(&self) -> &Cascade<OCTAVES, OVERLAP> {
        &self.cascade
    }

    pub(crate) fn curve(&self, period_s: f64) -> Curve<OCTAVES> {
        let mut curve = self.cascade.curve(period_s);
        self.gaps.take_off(&mut curve, self.cascade.len() + self.cascade.missing());
        curve
    }

    pub(crate) fn has_latest(&self) -> bool {
        self.missing == 0
    }

    pub(crate) fn push(&mut self, counts: &[i32]) {
        if !counts.is_empty() {
            self.close_gap();
        }
        self.cascade.push_slice(counts);
        self.gaps.push(counts.len() as u64);
    }

    fn close_gap(&mut self) {
        if self.missing > 0 {
            self.gaps.close(self.missing.into());
            self.cascade.gap(std::mem::take(&mut self.missing));
        }
    }

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

    pub(crate) fn miss(&mut self, samples: u64) {
        self.missing = self.missing.saturating_add(u32::try_from(samples).unwrap_or(u32::MAX));
    }

    /// Takes values in units of `step`; one that is not finite is missing.
    pub(crate) fn push_values(&mut self, values: &[f64], step: f64) {
        let count = |value: &f64| value.is_finite().then(|| (value / step).round() as i32);
        values.iter().for_each(|value| self.push_one(count(value)));
    }

    /// Takes samples with their sample periods, from the sample period `from` on.
    pub(crate) fn push_slots(&mut self, from: u64, samples: impl Iterator<Item = (u64, i32)>) {
        let mut next = from;
        for (slot, count) in samples {
            self.miss(slot - next);
            self.push_one(Some(count));
            next = slot + 1;
        }
    }

    /// The channel's samples that were not refused, in counts.
    pub(crate) fn of_channel(slots: &[u64], channel: &MeasuredChannel) -> Self {
        let mut cascade = Self::default();
        cascade.push_slots(slots.first().copied().unwrap_or(0), channel.used_samples(slots));
        cascade
    }

    /// Samples of `series` at some positions, in steps of its resolution.
    pub(crate) fn of_series(series: &Series, positions: Range<usize>) -> Self {
        let (slots, values) = (&series.slots[positions.clone()], &series.values[positions]);
        let count = |value: &f64| (value / series.resolution).round() as i32;
        let mut cascade = Self::default();
        let samples = slots.iter().copied().zip(values.iter().map(count));
        cascade.push_slots(slots.first().copied().unwrap_or(0), samples);
        cascade
    }

    pub(crate) fn merge(&mut self, later: &Self) {
        self.cascade.merge(&later.cascade);
        self.gaps.merge(&later.gaps);
    }
}
