//! Noise that other threads generate before it is needed.
//!
//! The values are those of [`NoiseSource`] sample by sample. They depend only on the sample period, which the controller programs. If it
//! changes, the channels return to the last sample taken.

use crate::noise::{ChannelSource, NoiseSource};
use crate::registers::OutputRegister;
use std::thread::{self, JoinHandle};

/// Samples of the longest block. Those of three gyros take about 2 ms, a hundred times the start of a thread.
const LONGEST: usize = 1 << 12;

/// The noise of all channels, in two groups with about the same work.
#[derive(Clone, Debug)]
pub(crate) struct NoiseAhead {
    groups: [ChannelGroup; 2],
}

impl NoiseAhead {
    pub(crate) fn new(source: NoiseSource) -> Self {
        let mut first = Vec::from(source.into_channels());
        let second = first.split_off(OutputRegister::AcclX as usize);
        Self { groups: [first, second].map(ChannelGroup::new) }
    }

    /// Sets the time between samples, s, as [`NoiseSource::set_sample_period`] does.
    pub(crate) fn set_sample_period(&mut self, sample_period_s: f64) {
        self.groups.iter_mut().for_each(|group| group.set_sample_period(sample_period_s));
    }

    /// The next value of every channel, as [`NoiseSource::sample`] gives it.
    pub(crate) fn sample(&mut self) -> [f64; 12] {
        let mut values = [0.0; 12];
        let mut rest = values.iter_mut();
        for group in &mut self.groups {
            group.advance();
            rest.by_ref().zip(group.latest()).for_each(|(value, latest)| *value = latest);
        }
        values
    }
}

/// A group of channels, block by block.
#[derive(Debug)]
struct ChannelGroup {
    block: Block,
    /// Number of samples of the block that were taken.
    taken: usize,
    /// The thread that generates the next block, once blocks have their full length.
    ahead: Option<JoinHandle<Block>>,
}

impl Clone for ChannelGroup {
    /// The clone generates its next block itself.
    fn clone(&self) -> Self {
        Self { block: self.block.clone(), taken: self.taken, ahead: None }
    }
}

impl ChannelGroup {
    fn new(channels: Vec<ChannelSource>) -> Self {
        Self { block: Block::generate(channels, 0), taken: 0, ahead: None }
    }

    fn set_sample_period(&mut self, sample_period_s: f64) {
        let mut channels = Block::generate(self.block.before.clone(), self.taken).behind;
        channels.iter_mut().for_each(|channel| channel.set_sample_period(sample_period_s));
        *self = Self::new(channels);
    }

    /// Takes the next sample.
    fn advance(&mut self) {
        if self.taken == self.block.samples {
            self.begin_block();
        }
        self.taken += 1;
    }

    /// The latest sample of every channel.
    fn latest(&self) -> impl Iterator<Item = f64> {
        self.block.values.chunks_exact(self.block.samples).map(|of_channel| of_channel[self.taken - 1])
    }

    /// Starts the next block. It is twice as long as the one before, so that a part with few samples wastes little.
    fn begin_block(&mut self) {
        let samples = (2 * self.block.samples).clamp(1, LONGEST);
        let ahead = self.ahead.take().and_then(|thread| thread.join().ok());
        self.block = ahead.unwrap_or_else(|| Block::generate(self.block.behind.clone(), samples));
        self.taken = 0;
        if samples == LONGEST {
            let channels = self.block.behind.clone();
            // If no thread can be started, the block is generated when it is needed.
            self.ahead = thread::Builder::new().spawn(move || Block::generate(channels, LONGEST)).ok();
        }
    }
}

/// Consecutive samples of some channels.
#[derive(Clone, Debug)]
struct Block {
    /// The channels before the first sample.
    before: Vec<ChannelSource>,
    /// The channels after the last sample.
    behind: Vec<ChannelSource>,
    samples: usize,
    /// All samples of the first channel, then those of the others.
    values: Vec<f64>,
}

impl Block {
    fn generate(before: Vec<ChannelSource>, samples: usize) -> Self {
        let mut behind = before.clone();
        let mut values = Vec::with_capacity(samples * behind.len());
        behind.iter_mut().for_each(|channel| values.extend((0..samples).map(|_| channel.sample())));
        Self { before, behind, samples, values }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::noise::NoiseModel;

    /// Number of samples, which includes every length of a block and three blocks of threads.
    const SAMPLES: usize = 5 * LONGEST;

    #[test]
    fn the_noise_is_that_of_the_source_sample_by_sample() {
        let mut source = NoiseSource::new(&NoiseModel::paper(), 7, 0.005);
        let mut ahead = NoiseAhead::new(source.clone());
        for sample in 0..SAMPLES {
            assert_eq!(ahead.sample(), source.sample(), "sample {sample}");
        }
        let mut clone = ahead.clone();
        assert_eq!([ahead.sample(), clone.sample()], [source.sample(); 2]);
    }

    #[test]
    fn a_sample_period_holds_from_the_sample_on_before_which_it_is_set() {
        let mut source = NoiseSource::new(&NoiseModel::paper(), 7, 0.005);
        let mut ahead = NoiseAhead::new(source.clone());
        // Changes occur before the first sample, twice in a row, inside a block, at the end of one (1 + 2 + 4 samples), and while a thread
        // generates.
        for (samples, period_s) in [(0, 0.01), (0, 0.02), (5, 0.01), (7, 0.005), (3 * LONGEST, 0.01), (10, 0.02)] {
            for _ in 0..samples {
                assert_eq!(ahead.sample(), source.sample());
            }
            source.set_sample_period(period_s);
            ahead.set_sample_period(period_s);
        }
        assert_eq!(ahead.sample(), source.sample());
    }
}
