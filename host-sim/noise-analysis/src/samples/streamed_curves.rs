//! Curves of a channel whose samples come in blocks: of the record, and of consecutive parts.

use crate::samples::gapped_cascade::GappedCascade;
use measurement::MeasuredChannel;
use std::collections::BTreeMap;

/// Integer steps of a count: a subtracted bias is not a whole number of counts.
pub(crate) const STEPS_PER_COUNT: f64 = 16.0;

#[derive(Clone)]
pub(crate) struct StreamedCurves {
    whole: GappedCascade,
    parts: Vec<GappedCascade>,
    /// First sample period of each part but the first.
    boundaries: Vec<u64>,
    /// The first count, subtracted from all: an offset is in no difference, and a large one leaves no room.
    origin: Option<i32>,
    last: Option<u64>,
    pub refused: BTreeMap<&'static str, u64>,
}

/// The estimator of consecutive parts, with gaps between them.
pub(crate) fn joined<'a>(parts: impl IntoIterator<Item = &'a GappedCascade>) -> GappedCascade {
    let mut parts = parts.into_iter();
    let mut joined = parts.next().cloned().unwrap_or_default();
    parts.for_each(|later| joined.merge(later));
    joined
}

impl StreamedCurves {
    /// `boundaries`, ascending, are the first sample periods of each part but the first.
    pub(crate) fn new(boundaries: &[u64]) -> Self {
        Self {
            whole: GappedCascade::default(),
            parts: vec![GappedCascade::default(); boundaries.len() + 1],
            boundaries: boundaries.to_vec(),
            origin: None,
            last: None,
            refused: BTreeMap::new(),
        }
    }

    pub(crate) const fn whole(&self) -> &GappedCascade {
        &self.whole
    }

    /// First sample period and estimator of each part, in steps of a count ([`STEPS_PER_COUNT`]).
    pub(crate) fn parts(&self) -> impl Iterator<Item = (u64, &GappedCascade)> {
        let starts = std::iter::once(0).chain(self.boundaries.iter().copied());
        starts.zip(&self.parts)
    }

    pub(crate) fn part(&self, number: usize) -> GappedCascade {
        self.parts.get(number).cloned().unwrap_or_default()
    }

    pub(crate) fn push(&mut self, slots: &[u64], channel: &MeasuredChannel) {
        for (&cause, positions) in &channel.refused {
            *self.refused.entry(cause).or_insert(0) += positions.len() as u64;
        }
        self.origin = self.origin.or_else(|| channel.used_samples(slots).next().map(|(_, count)| count));
        let origin = self.origin.unwrap_or(0);
        let in_steps = |count: &i32| count.saturating_sub(origin).saturating_mul(STEPS_PER_COUNT as i32);
        let steps: Vec<i32> = channel.counts.iter().map(in_steps).collect();
        let mut refused = channel.refused_positions().into_iter().peekable();
        let mut first = 0;
        while first < slots.len() {
            let slot = slots[first];
            let part = self.boundaries.partition_point(|&from| from <= slot);
            let part_from = part.checked_sub(1).map_or(0, |before| self.boundaries[before]);
            let part_end =
                self.boundaries.get(part).map_or(slots.len(), |&to| slots.partition_point(|&slot| slot < to));
            // A run of used samples in one part; the next one may be refused.
            let refused_at = refused.peek().copied().unwrap_or(usize::MAX).min(part_end);
            let follows = |&at: &usize| slots[at] - slots[at - 1] == 1;
            let end = (first + 1..refused_at).take_while(follows).last().map_or(first, |last| last) + 1;
            let missing = self.last.map_or(0, |last| slot - last - 1);
            let of_part = &mut self.parts[part];
            if missing > 0 {
                self.whole.miss(missing);
                // A gap over a boundary is split between the parts.
                of_part.miss(missing.min(slot - part_from));
            }
            if refused.next_if_eq(&first).is_some() {
                self.whole.miss(1);
                of_part.miss(1);
                self.last = Some(slot);
                first += 1;
                continue;
            }
            self.whole.push(&channel.counts[first..end]);
            of_part.push(&steps[first..end]);
            self.last = Some(slots[end - 1]);
            first = end;
        }
    }
}
