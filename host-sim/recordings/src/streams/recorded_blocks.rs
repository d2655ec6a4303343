//! The usable samples of a recording that was made in memory, to be used in blocks.
//!
//! Without the time stamps, which have told the time base, they take half of the memory of the recording, and they are released block
//! by block.

use crate::counts::recording::{RecordedSample, Recording, TimeStamp};
use crate::time_base::stream_clock::BLOCK;
use crate::time_base::{UsableSamples, channels};
use adis16405_driver::{Channel, ChannelMask, Counts, Faults};
use measurement::{SampleBlock, SensorProfile};
use std::collections::VecDeque;

/// Blocks of samples that were not taken yet.
pub(crate) struct RecordedBlocks {
    channels: Vec<Channel>,
    profile: SensorProfile,
    /// Sample periods of all samples, and how many of them were taken.
    slots: Vec<u64>,
    taken: usize,
    blocks: VecDeque<Vec<Outputs>>,
}

/// What a sample is without its time.
struct Outputs {
    counts: Counts,
    faults: Faults,
    refused: ChannelMask,
}

impl RecordedBlocks {
    /// The samples of `recording` that can be used.
    pub(crate) fn new(recording: Recording, usable: UsableSamples) -> Self {
        let outputs = |&position: &usize| {
            let RecordedSample { counts, faults, refused, .. } = recording.samples[position];
            Outputs { counts, faults, refused }
        };
        let blocks = usable.positions.chunks(BLOCK).map(|positions| positions.iter().map(outputs).collect());
        Self {
            blocks: blocks.collect(),
            channels: recording.channels,
            profile: usable.base.profile,
            slots: usable.base.slots,
            taken: 0,
        }
    }
}

impl Iterator for RecordedBlocks {
    type Item = SampleBlock;

    fn next(&mut self) -> Option<SampleBlock> {
        let block = self.blocks.pop_front()?;
        let slots = self.slots[self.taken..self.taken + block.len()].to_vec();
        self.taken += block.len();
        let sample = |&Outputs { counts, faults, refused }: &Outputs| RecordedSample {
            time_stamp: TimeStamp::default(),
            counts,
            faults,
            refused,
        };
        Some(SampleBlock { slots, channels: channels(&self.channels, &self.profile, block.iter().map(sample)) })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::counts::recording::Recorder;
    use crate::time_base::time_base;
    use adis16405_driver::{Burst, GyroRange};
    use measurement::RecordingDescription;

    const ROWS: u64 = 3 * BLOCK as u64 + 1000;

    /// Of a thousand rows the last two were lost, one in 1,500 shows a rate that no sensor of this range has, and one in 2,000 has a supply of 0 V.
    fn recording() -> Recording {
        let mut recorder = Recorder::new(vec![Channel::GyroX, Channel::GyroY, Channel::Supply], GyroRange::Dps300);
        for row in (0..ROWS).filter(|row| row % 1000 < 998) {
            let mut counts = [0; 12];
            counts[Channel::GyroX as usize] = if row % 1500 == 1400 { i16::MAX >> 2 } else { (row * 7919 % 11) as i16 };
            counts[Channel::GyroY as usize] = (row % 13) as i16;
            counts[Channel::Supply as usize] = if row % 2000 == 1500 { 0 } else { 2068 };
            recorder.push(TimeStamp::from_time(row as f64 / 100.0), &Burst::from_counts(&Counts::new(counts)));
        }
        recorder.finish()
    }

    /// The measurement is that of all samples at once.
    #[test]
    fn blocks_beginning_and_description_are_those_of_the_measurement() {
        let recording = recording();
        let measurement = time_base(&recording, None).expect("a time base").measurement;
        assert_eq!(measurement.dropped["gap"], 2 * (ROWS / 1000));
        assert_eq!(measurement.channels[1].refused_positions().len() as u64, ROWS / 1500);
        let usable = UsableSamples::place(&recording, None).expect("a time base");
        assert_eq!(usable.description(&recording), RecordingDescription::from(&measurement));
        for slot in [0, 1, 1000, 20_000, ROWS] {
            let mut expected = measurement.before(slot);
            // A cause without a sample is none.
            expected.channels.iter_mut().for_each(|of| of.refused.retain(|_, positions| !positions.is_empty()));
            assert_eq!(usable.before(slot, &recording), expected, "before {slot}");
        }
        assert!(RecordedBlocks::new(recording, usable).eq(measurement.blocks(BLOCK)));
    }
}
