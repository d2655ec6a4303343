//! Spectra of parts of a record, such as epochs, whose samples are not kept.

use super::welch::{Welch, WelchSum};
use crate::samples::uniform_series::UniformSeries;
use std::sync::Arc;

/// Samples of a segment: lines from 1/100 to 2/5 of the sample rate are resolved to a 20th.
const SEGMENT: usize = 2048;

/// Spectra of consecutive parts with their first sample periods; none for a part without a whole segment.
pub(crate) type PartSpectra = Arc<Vec<(u64, Welch)>>;

pub(crate) struct EpochSpectra {
    sample_period: f64,
    /// First sample periods of later parts, the last one first.
    later: Vec<u64>,
    /// First sample period of the current part.
    part: u64,
    sum: WelchSum,
    /// First sample period of the segment, and its samples, `NaN` if missing.
    from: u64,
    segment: Vec<f64>,
    finished: Vec<(u64, Welch)>,
}

impl EpochSpectra {
    /// `boundaries`, ascending, are the first sample periods of each part but the first.
    pub(crate) fn new(sample_period: f64, boundaries: &[u64]) -> Self {
        Self {
            sample_period,
            later: boundaries.iter().rev().copied().collect(),
            part: 0,
            sum: WelchSum::new(sample_period, SEGMENT),
            from: 0,
            segment: vec![f64::NAN; SEGMENT],
            finished: Vec::new(),
        }
    }

    pub(crate) fn push(&mut self, slot: u64, value: f64) {
        while let Some(next) = self.later.pop_if(|next| *next <= slot) {
            self.end_part(next);
        }
        while slot >= self.from + SEGMENT as u64 {
            self.end_segment();
            let is_empty = self.segment.iter().all(|value| value.is_nan());
            if is_empty && slot >= self.from + SEGMENT as u64 {
                // Skips the segments within a long gap.
                let half = SEGMENT as u64 / 2;
                self.from += (slot - self.from) / half * half;
            }
        }
        self.segment[(slot - self.from) as usize] = value;
    }

    /// The spectra of all parts; the last one ends with the sample period `end`.
    pub(crate) fn finish(mut self, end: u64) -> PartSpectra {
        self.end_part(end);
        Arc::new(self.finished)
    }

    fn end_segment(&mut self) {
        let segment = UniformSeries::new(self.sample_period, self.segment.clone());
        let (filled, _) = segment.interpolated();
        self.sum.add(segment.values(), filled.values());
        self.segment.copy_within(SEGMENT / 2.., 0);
        self.segment[SEGMENT / 2..].fill(f64::NAN);
        self.from += SEGMENT as u64 / 2;
    }

    fn end_part(&mut self, next: u64) {
        if self.from + SEGMENT as u64 <= next {
            self.end_segment();
        }
        let sum = std::mem::replace(&mut self.sum, WelchSum::new(self.sample_period, SEGMENT));
        self.finished.extend(sum.mean().map(|spectrum| (self.part, spectrum)));
        self.segment.fill(f64::NAN);
        (self.part, self.from) = (next, next);
    }
}

#[cfg(test)]
mod tests {
    use super::{EpochSpectra, SEGMENT};
    use crate::samples::uniform_series::UniformSeries;
    use crate::spectra::Welch;
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::StandardNormal;

    #[test]
    fn parts_have_the_spectra_of_their_samples() {
        let boundaries = [10_000_u64, 30_000, 90_000];
        let end = 120_000;
        let is_lost = |slot: u64| slot.is_multiple_of(7919) || (40_000..40_000 + 20 * SEGMENT as u64).contains(&slot);
        let mut random = ChaCha8Rng::seed_from_u64(9);
        let values: Vec<f64> =
            (0..end).map(|slot| if is_lost(slot) { f64::NAN } else { random.sample(StandardNormal) }).collect();
        let mut spectra = EpochSpectra::new(0.01, &boundaries);
        for (slot, value) in (0..end).zip(&values).filter(|(_, value)| value.is_finite()) {
            spectra.push(slot, *value);
        }
        let parts = spectra.finish(end);
        let starts: Vec<u64> = parts.iter().map(|(start, _)| *start).collect();
        assert_eq!(starts, [0, 10_000, 30_000, 90_000]);
        let ends = boundaries.into_iter().chain([end]);
        for ((start, spectrum), end) in parts.iter().zip(ends) {
            let part = UniformSeries::new(0.01, values[*start as usize..end as usize].to_vec());
            let expected = Welch::estimate(&part, SEGMENT).expect("whole segments");
            assert_eq!(spectrum.segments(), expected.segments());
            for ((_, density), (_, expected)) in spectrum.points().zip(expected.points()) {
                // The interpolation uses the segment's correlation: 1 in 8,000 samples, off by 1/√2,048.
                assert!((density - expected).abs() < 1e-3 * (density + expected) + 1e-5, "{density} {expected}");
            }
        }
    }
}
