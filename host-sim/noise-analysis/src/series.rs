//! The samples of one channel on the recording's time base.

use crate::findings::Correction;
use measurement::{ChannelProfile, Measurement};

/// The samples of one channel, each with the sample period in which it was taken.
#[derive(Debug, Clone, PartialEq)]
pub struct Series {
    /// Sample period of each sample, counted from the first; strictly increasing. A step of more than 1 is a gap.
    pub slots: Vec<u64>,
    /// One value for each slot, in [`unit`](Self::unit).
    pub values: Vec<f64>,
    /// Sample period, s.
    pub period_s: f64,
    /// Smallest distance of two values, in [`unit`](Self::unit): one count, unless the values are known to be coarser.
    pub resolution: f64,
    /// Unit of the values.
    pub unit: &'static str,
}

impl Series {
    /// The samples of `channel`; an empty series if it was not recorded.
    #[must_use]
    pub fn from_measurement(measurement: &Measurement, channel: &ChannelProfile) -> Self {
        let counts = measurement.channel(channel).map(|channel| channel.counts.as_slice()).unwrap_or_default();
        Self {
            slots: measurement.slots[..counts.len()].to_vec(),
            values: counts.iter().map(|&count| f64::from(count) * channel.lsb).collect(),
            period_s: measurement.period_s(),
            resolution: channel.lsb,
            unit: channel.unit,
        }
    }

    /// The same values, known to be multiples of `counts` counts.
    #[must_use]
    pub fn with_counts_per_step(self, counts: u32) -> Self {
        Self { resolution: self.resolution * f64::from(counts), ..self }
    }

    /// Time from the first sample to the last, s.
    #[must_use]
    pub fn duration_s(&self) -> f64 {
        self.slots.last().map_or(0.0, |&slot| slot as f64 * self.period_s)
    }

    /// The first half of the samples.
    #[must_use]
    pub fn first_half(&self) -> Self {
        let half = self.values.len() / 2;
        Self { slots: self.slots[..half].to_vec(), values: self.values[..half].to_vec(), ..*self }
    }

    /// The series without the effect that `correction` removes.
    #[must_use]
    pub fn corrected(mut self, correction: &Correction) -> Self {
        match correction {
            Correction::Exclude(positions) => {
                let kept = |position: &usize| positions.binary_search(position).is_err();
                let positions: Vec<usize> = (0..self.values.len()).filter(kept).collect();
                self.slots = positions.iter().map(|&position| self.slots[position]).collect();
                self.values = positions.iter().map(|&position| self.values[position]).collect();
            }
            &Correction::Offset { from, size } => {
                self.values.iter_mut().skip(from).for_each(|value| *value -= size);
            }
        }
        self
    }

    /// Whether the samples from `first` to `last` follow each other without a gap.
    pub fn is_gapless(&self, first: usize, last: usize) -> bool {
        self.slots[last] - self.slots[first] == (last - first) as u64
    }
}
