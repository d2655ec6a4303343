//! The samples of one channel on the recording's time base.

use crate::effects::findings::Correction;
use measurement::{ChannelId, MeasuredChannel, Measurement};
use std::ops::Range;
use std::sync::Arc;

/// The samples of one channel, each with its sample period. A copy shares them until it is changed.
#[derive(Debug, Clone, PartialEq)]
pub struct Series {
    /// Sample periods from the first sample on, strictly increasing; a step of more than 1 is a gap.
    pub slots: Arc<[u64]>,
    /// One value for each slot, in [`unit`](Self::unit).
    pub values: Arc<[f64]>,
    /// Sample periods of the record, or of its part, with or without samples. Channels recorded together have the same span.
    pub span: Range<u64>,
    pub period_s: f64,
    /// Smallest distance of two values, in [`unit`](Self::unit): one count, or several.
    pub resolution: f64,
    pub unit: &'static str,
}

impl Series {
    /// The samples of `channel` that were not refused.
    #[must_use]
    pub fn from_measurement(measurement: &Measurement, channel: ChannelId) -> Self {
        Self::with_shared_slots(measurement, channel, || measurement.slots.as_slice().into())
    }

    /// `slots` are the sample periods of all samples, shared if none is refused.
    pub(crate) fn with_shared_slots(
        measurement: &Measurement,
        channel: ChannelId,
        slots: impl FnOnce() -> Arc<[u64]>,
    ) -> Self {
        let MeasuredChannel { profile, counts, .. } = &measurement[channel];
        let refused = measurement[channel].refused_positions();
        let value = |count: &i32| f64::from(*count) * profile.lsb;
        let (slots, values) = if refused.is_empty() {
            (slots(), counts.iter().map(value).collect())
        } else {
            let used: Vec<usize> =
                (0..counts.len()).filter(|position| refused.binary_search(position).is_err()).collect();
            let slots = used.iter().map(|&position| measurement.slots[position]).collect();
            (slots, used.iter().map(|&position| value(&counts[position])).collect())
        };
        Self {
            slots,
            values,
            span: 0..measurement.periods(),
            period_s: measurement.period_s(),
            resolution: profile.lsb,
            unit: profile.unit,
        }
    }

    /// The values as multiples of `counts` counts.
    #[must_use]
    pub fn with_counts_per_step(self, counts: u32) -> Self {
        Self { resolution: self.resolution * f64::from(counts), ..self }
    }

    /// Mutable values; a copy stops sharing them.
    pub fn values_mut(&mut self) -> &mut [f64] {
        Arc::make_mut(&mut self.values)
    }

    /// Sum and number of the samples in each block of `width` sample periods, the first of which begins with the sample period `from`, up to
    /// the block of the last sample. No sample is before `from`.
    pub(crate) fn sums_of_blocks(&self, from: u64, width: u64) -> Vec<(f64, u64)> {
        let blocks = self.slots.last().map_or(0, |last| (last - from) / width + 1);
        let mut sums = vec![(0.0, 0); blocks as usize];
        for (slot, value) in self.slots.iter().zip(self.values.iter()) {
            let (sum, count) = &mut sums[((slot - from) / width) as usize];
            (*sum, *count) = (*sum + value, *count + 1);
        }
        sums
    }

    /// Time from the start of the record to the last sample, s.
    #[must_use]
    pub fn duration_s(&self) -> f64 {
        self.slots.last().map_or(0.0, |&slot| slot as f64 * self.period_s)
    }

    #[must_use]
    pub fn before(&self, slot: u64) -> Self {
        let count = self.slots.partition_point(|&of| of < slot);
        Self {
            slots: self.slots[..count].into(),
            values: self.values[..count].into(),
            span: self.span.start..slot.min(self.span.end),
            ..*self
        }
    }

    #[must_use]
    pub fn from(&self, slot: u64) -> Self {
        let count = self.slots.partition_point(|&of| of < slot);
        Self {
            slots: self.slots[count..].into(),
            values: self.values[count..].into(),
            span: slot.max(self.span.start)..self.span.end,
            ..*self
        }
    }

    /// The samples for whose sample periods, in ascending order, `is_kept` holds.
    #[must_use]
    pub fn filtered(mut self, mut is_kept: impl FnMut(u64) -> bool) -> Self {
        let kept: Vec<usize> = (0..self.slots.len()).filter(|&position| is_kept(self.slots[position])).collect();
        if kept.len() < self.slots.len() {
            self.slots = kept.iter().map(|&position| self.slots[position]).collect();
            self.values = kept.iter().map(|&position| self.values[position]).collect();
        }
        self
    }

    /// Without the samples in `slots`, which are in ascending order.
    #[must_use]
    pub fn without(self, slots: &[u64]) -> Self {
        let mut has = membership(slots);
        if slots.is_empty() { self } else { self.filtered(|slot| !has(slot)) }
    }

    /// The samples for which each of `others` has one in the same sample period.
    #[must_use]
    pub fn in_common(self, others: &[&Series]) -> Self {
        let mut others: Vec<_> = others.iter().map(|other| membership(&other.slots)).collect();
        self.filtered(|slot| others.iter_mut().all(|has| has(slot)))
    }

    #[must_use]
    pub fn count_common(&self, other: &Series) -> usize {
        let mut has = membership(&other.slots);
        self.slots.iter().filter(|slot| has(**slot)).count()
    }

    /// The samples, less `offset` from `slot` on.
    #[must_use]
    pub fn lowered_from(mut self, slot: u64, offset: f64) -> Self {
        let from = self.slots.partition_point(|&of| of < slot);
        self.values_mut()[from..].iter_mut().for_each(|value| *value -= offset);
        self
    }

    #[must_use]
    pub fn corrected(self, correction: &Correction) -> Self {
        match correction {
            Correction::Exclude(slots) => self.without(slots),
            &Correction::Offset { from, size } => self.lowered_from(from, size),
        }
    }

    /// True if no sample is missing from `first` to `last`.
    pub fn is_gapless(&self, first: usize, last: usize) -> bool {
        self.slots[last] - self.slots[first] == (last - first) as u64
    }
}

/// True if each of ascending sample periods is in `slots`, also ascending.
fn membership(slots: &[u64]) -> impl FnMut(u64) -> bool {
    let mut rest = slots;
    move |slot| {
        while let [first, later @ ..] = rest
            && *first < slot
        {
            rest = later;
        }
        rest.first() == Some(&slot)
    }
}
