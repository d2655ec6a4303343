//! Audit of the samples against the counts that the sensor had.

use adis16405_driver::Burst;
use firmware::{CHANNELS, Estimators};

/// Counts of words of the estimated channels, from the first used word on.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct SampleAudit {
    /// Words received.
    pub words: u64,
    /// Wrong words: their count is not the sensor's, or is that of a sample received before.
    pub wrong: u64,
    /// Wrong words that were used.
    pub undetected: u64,
    /// Largest difference between a used word of a gyro and the sensor's count.
    pub worst_gyro: i32,
    /// Right words that were refused.
    pub needless: u64,
    longest_gap_us: u64,
    latest_used_us: Option<u64>,
    /// Number of the latest received sample.
    sample: u64,
}

impl SampleAudit {
    /// Adds a burst that the estimators have just processed.
    pub(crate) fn add(&mut self, received: &Received, now_us: u64, estimators: &Estimators<'_>) {
        let lengths = lengths(estimators);
        let used: Vec<bool> = lengths.iter().zip(received.lengths).map(|(now, before)| *now > before).collect();
        if used.contains(&true) {
            let latest = self.latest_used_us.replace(now_us).unwrap_or(now_us);
            self.longest_gap_us = self.longest_gap_us.max(now_us - latest);
        }
        if self.latest_used_us.is_none() {
            return; // the sensor settles, and the gate learns the noise
        }
        let is_new = std::mem::replace(&mut self.sample, received.sample) != received.sample;
        let found = received.burst.counts();
        for (channel, used) in CHANNELS.into_iter().zip(used) {
            let error = i32::from(found.get(channel)) - i32::from(received.sent[channel as usize]);
            let wrong = error != 0 || !is_new;
            self.words += 1;
            self.wrong += u64::from(wrong);
            self.undetected += u64::from(wrong && used);
            self.needless += u64::from(!wrong && !used);
            if used && (1..=3).contains(&(channel as usize)) {
                self.worst_gyro = self.worst_gyro.max(error.abs());
            }
        }
    }

    /// The longest time without a used sample, including the time until now, µs.
    #[must_use]
    pub fn longest_gap_us(&self, now_us: u64) -> u64 {
        self.longest_gap_us.max(now_us - self.latest_used_us.unwrap_or(0))
    }
}

/// A received burst.
pub(crate) struct Received {
    /// The counts that the sensor had, and the number of the sample.
    pub(crate) sent: [i16; 12],
    pub(crate) sample: u64,
    /// The burst that arrived.
    pub(crate) burst: Burst,
    /// Number of samples that each channel had before.
    pub(crate) lengths: [u64; CHANNELS.len()],
}

/// Number of samples that each channel has.
pub(crate) fn lengths(estimators: &Estimators<'_>) -> [u64; CHANNELS.len()] {
    std::array::from_fn(|index| estimators.channel(index).map_or(0, |estimator| estimator.len()))
}
