//! Retained RAM: statistics and settings in memory that a warm reset does not clear, each record with a checksum.
//!
//! The checksum also covers a hash of the build, so that a program of other sources finds no record, and records of samples carry
//! the settings of the sensor that took them.
//!
//! The memory is an array of atomic words, so that any content after power-on is a valid value. There is one slot more than
//! there are records. A record is always written into a slot that is not the newest version of any record, so that a reset
//! during the write loses that version and not the one before.

use crate::epoch::FinishedEpoch;
use crate::epoch_record::{EpochRecord, SUMS_WORDS, checksum, sums_from_words, sums_words};
use crate::statistics::{CHANNELS, ChannelSums};
use core::sync::atomic::{AtomicU32, Ordering::Relaxed};

/// Words of a slot before the payload: kind, version, generation, the sensor's settings.
const HEAD: usize = 4;
/// Words of a slot: those, payload, checksum.
const SLOT_WORDS: usize = HEAD + SUMS_WORDS + 1;
/// Hash of what this program was built from.
const BUILD: u32 = match u32::from_str_radix(env!("FIRMWARE_BUILD"), 10) {
    Ok(hash) => hash,
    Err(_) => panic!("the build script gives a number"),
};
/// Kinds of records: the settings, then the channels.
const KINDS: usize = 1 + CHANNELS.len();
const SETTINGS: usize = 0;
/// Marks a record, in the upper half of a slot's first word. Changes with the layout.
const MAGIC: u32 = 0xAD17_0000;

/// The memory, to be placed in a linker section that is not initialised at the start.
pub struct RetainedMemory {
    slots: [Slot; KINDS + 1],
    epoch: EpochRecord,
}

/// A [`RetainedMemory`] without records.
#[must_use]
pub const fn blank_memory() -> RetainedMemory {
    let slots = [const { [const { AtomicU32::new(0) }; SLOT_WORDS] }; KINDS + 1];
    RetainedMemory { slots, epoch: EpochRecord::blank() }
}

/// The settings of the application.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RetainedSettings {
    /// Value of SMPL_PRD.
    pub smpl_prd: u8,
    /// Value of SENS_AVG.
    pub sens_avg: u16,
    /// Length of an epoch in s, 0 for an epoch without end.
    pub epoch_s: u32,
    /// Number of epochs finished.
    pub epoch: u32,
    /// Seconds between reports, 0 for none.
    pub interval_s: u32,
    /// Starts since power-on.
    pub starts: u32,
    /// Age of the running epoch in µs at the last checkpoint.
    pub epoch_age_us: u64,
    /// PROD_ID of a part that is to be taken for an ADIS16405 although it answers this; 0 for none.
    pub prod_id: u16,
}

impl RetainedSettings {
    /// The settings of the sensor: samples of others are of another scale, rate or filter.
    fn of_sensor(&self) -> u32 {
        u32::from(self.smpl_prd) << 16 | u32::from(self.sens_avg)
    }
}

/// The records in a [`RetainedMemory`].
pub struct RetainedRam {
    memory: &'static RetainedMemory,
    /// Hash that all checksums cover.
    build: u32,
    /// Channel records of another generation are out of date.
    generation: u32,
    version: u32,
    /// Slot of the newest version of each record.
    newest: [Option<usize>; KINDS],
    settings: Option<RetainedSettings>,
}

impl RetainedRam {
    /// Finds the newest valid version of every record.
    #[must_use]
    pub fn open(memory: &'static RetainedMemory) -> Self {
        Self::open_by(BUILD, memory)
    }

    /// As [`open`](Self::open), as a program with this hash does.
    fn open_by(build: u32, memory: &'static RetainedMemory) -> Self {
        let mut retained = Self { memory, build, generation: 0, version: 0, newest: [None; KINDS], settings: None };
        for (index, slot) in memory.slots.iter().enumerate() {
            let Some((kind, version)) = valid_record(slot, build) else { continue };
            let newer = retained.newest[kind].is_none_or(|other| word(&memory.slots[other], 1) < version);
            if newer {
                retained.newest[kind] = Some(index);
            }
            retained.version = retained.version.max(version);
        }
        if let Some(slot) = retained.newest[SETTINGS].map(|index| &memory.slots[index]) {
            retained.generation = word(slot, 2);
            let at = |index: usize| word(slot, HEAD + index);
            retained.settings = Some(RetainedSettings {
                smpl_prd: at(0) as u8,
                sens_avg: at(1) as u16,
                epoch_s: at(2),
                epoch: at(3),
                interval_s: at(4),
                starts: at(5),
                epoch_age_us: u64::from(at(6)) | u64::from(at(7)) << 32,
                prod_id: at(8) as u16,
            });
        }
        retained
    }

    /// Erases all records, as after power-on.
    pub fn clear(&mut self) {
        for slot in &self.memory.slots {
            slot[0].store(0, Relaxed);
        }
        self.memory.epoch.clear();
        *self = Self::open_by(self.build, self.memory);
    }

    /// The settings that were written last.
    #[must_use]
    pub fn settings(&self) -> Option<RetainedSettings> {
        self.settings
    }

    /// The sums of [`CHANNELS`]`[index]`; `None` without a record of the present generation and the present settings of the
    /// sensor.
    #[must_use]
    pub fn restore(&self, index: usize) -> Option<ChannelSums> {
        let slot = &self.memory.slots[self.newest.get(1 + index).copied()??];
        let words = slot[HEAD..].iter().map(|cell| cell.load(Relaxed));
        (word(slot, 2) == self.generation && word(slot, 3) == self.of_sensor()).then(|| sums_from_words(words))
    }

    /// Writes a finished epoch in the place of the one before. A reset during the write loses it.
    pub fn write_epoch(&mut self, epoch: &FinishedEpoch) {
        self.memory.epoch.write(epoch, self.build, self.of_sensor());
    }

    /// Overwrites `epoch` with the finished epoch. Returns false, and leaves `epoch` alone, if there is none.
    #[must_use]
    pub fn restore_epoch(&self, epoch: &mut FinishedEpoch) -> bool {
        self.memory.epoch.restore(epoch, self.build, self.of_sensor())
    }

    /// Erases the finished epoch: nothing is left to be learned from it.
    pub fn clear_epoch(&mut self) {
        self.memory.epoch.clear();
    }

    /// Writes the settings; with `new_generation` the channel records written before are out of date.
    pub fn write_settings(&mut self, settings: RetainedSettings, new_generation: bool) {
        self.generation = self.generation.wrapping_add(u32::from(new_generation));
        self.settings = Some(settings);
        let RetainedSettings { smpl_prd, sens_avg, epoch_s, epoch, interval_s, starts, epoch_age_us, prod_id } =
            settings;
        let (age, age_high) = (epoch_age_us as u32, (epoch_age_us >> 32) as u32);
        let sensor = [u32::from(smpl_prd), u32::from(sens_avg)];
        let words = sensor.into_iter().chain([epoch_s, epoch, interval_s, starts, age, age_high, u32::from(prod_id)]);
        self.write(SETTINGS, words);
    }

    /// Writes the sums of [`CHANNELS`]`[index]`.
    pub fn checkpoint(&mut self, index: usize, sums: &ChannelSums) {
        if index < CHANNELS.len() {
            self.write(1 + index, sums_words(sums));
        }
    }

    fn of_sensor(&self) -> u32 {
        self.settings.as_ref().map_or(0, RetainedSettings::of_sensor)
    }

    fn write(&mut self, kind: usize, words: impl IntoIterator<Item = u32>) {
        // There is one slot more than kinds, so at least one holds no newest version.
        let Some(free) = (0..self.memory.slots.len()).find(|index| !self.newest.contains(&Some(*index))) else {
            return;
        };
        let slot = &self.memory.slots[free];
        self.version = self.version.wrapping_add(1);
        slot[0].store(MAGIC | kind as u32, Relaxed);
        slot[1].store(self.version, Relaxed);
        slot[2].store(self.generation, Relaxed);
        slot[3].store(self.of_sensor(), Relaxed);
        let words = words.into_iter().chain(core::iter::repeat(0));
        for (cell, word) in slot[HEAD..SLOT_WORDS - 1].iter().zip(words) {
            cell.store(word, Relaxed);
        }
        slot[SLOT_WORDS - 1].store(checksum(self.build, &slot[..SLOT_WORDS - 1]), Relaxed);
        self.newest[kind] = Some(free);
    }
}

type Slot = [AtomicU32; SLOT_WORDS];

fn word(slot: &[AtomicU32], index: usize) -> u32 {
    slot[index].load(Relaxed)
}

/// The kind and version of the record in a slot, if its checksum is right.
fn valid_record(slot: &Slot, build: u32) -> Option<(usize, u32)> {
    let kind = (word(slot, 0) ^ MAGIC) as usize;
    let intact = kind < KINDS && word(slot, SLOT_WORDS - 1) == checksum(build, &slot[..SLOT_WORDS - 1]);
    intact.then(|| (kind, word(slot, 1)))
}

#[cfg(test)]
mod tests {
    extern crate std;

    use super::*;
    use crate::epoch_record::MAX_SUM;
    use crate::statistics::{ChannelEstimator, OCTAVES};
    use allan_core::Interpolation;
    use std::boxed::Box;

    const SETTINGS_WRITTEN: RetainedSettings = RetainedSettings {
        smpl_prd: 7,
        sens_avg: 0x0400,
        epoch_s: 3600,
        epoch: 2,
        interval_s: 10,
        starts: 3,
        epoch_age_us: 3 << 32 | 7,
        prod_id: 3,
    };

    fn memory() -> &'static RetainedMemory {
        Box::leak(Box::new(blank_memory()))
    }

    fn sums(samples: i32) -> ChannelSums {
        let mut estimator = ChannelEstimator::new();
        (0..samples).for_each(|k| estimator.push(k * k % 8191 - 4096));
        estimator.gap(5);
        ChannelSums::from_estimator(&estimator)
    }

    #[test]
    fn records_are_found_after_a_restart() {
        let memory = memory();
        let mut before = RetainedRam::open(memory);
        assert_eq!(before.settings(), None);
        assert!(before.restore(0).is_none());
        before.write_settings(SETTINGS_WRITTEN, true);
        for round in 1..4 {
            (0..CHANNELS.len()).for_each(|index| before.checkpoint(index, &sums(100 * round + index as i32)));
        }
        let after = RetainedRam::open(memory);
        assert_eq!(after.settings(), Some(SETTINGS_WRITTEN));
        for index in 0..CHANNELS.len() {
            assert_eq!(after.restore(index).unwrap(), sums(300 + index as i32));
        }
    }

    /// Sums of up to 96 bits are stored exactly; larger ones, which no counts reach, saturate.
    #[test]
    fn wide_sums_are_stored_exactly() {
        let memory = memory();
        let mut retained = RetainedRam::open(memory);
        retained.write_settings(SETTINGS_WRITTEN, true);
        let octaves = core::array::from_fn(|octave| (MAX_SUM - octave as u128, u64::MAX - octave as u64));
        let gaps = core::array::from_fn(|octave| Interpolation::new(u32::MAX - octave as u32, octave as u32, MAX_SUM));
        let wide = ChannelSums { samples: u64::MAX, missing: 1 << 33, octaves, gaps };
        retained.checkpoint(3, &wide);
        assert_eq!(RetainedRam::open(memory).restore(3).unwrap(), wide);
        retained.checkpoint(3, &ChannelSums { octaves: [(u128::MAX, 1); OCTAVES], ..wide.clone() });
        assert_eq!(retained.restore(3).unwrap(), ChannelSums { octaves: [(MAX_SUM, 1); OCTAVES], ..wide });
    }

    #[test]
    fn statistics_under_other_settings_are_out_of_date() {
        let memory = memory();
        let mut retained = RetainedRam::open(memory);
        retained.write_settings(SETTINGS_WRITTEN, true);
        retained.checkpoint(1, &sums(50));
        retained.write_settings(RetainedSettings { epoch_s: 60, ..SETTINGS_WRITTEN }, false);
        assert!(RetainedRam::open(memory).restore(1).is_some());
        retained.write_settings(SETTINGS_WRITTEN, true);
        assert!(RetainedRam::open(memory).restore(1).is_none());
        retained.clear();
        assert_eq!(RetainedRam::open(memory).settings(), None);
    }

    /// Samples of other settings of the sensor are not continued, even if the records are of one generation.
    #[test]
    fn statistics_of_another_range_or_rate_are_not_restored() {
        for other in [
            RetainedSettings { sens_avg: 0x0401, ..SETTINGS_WRITTEN },
            RetainedSettings { smpl_prd: 1, ..SETTINGS_WRITTEN },
        ] {
            let memory = memory();
            let mut retained = RetainedRam::open(memory);
            retained.write_settings(SETTINGS_WRITTEN, true);
            retained.checkpoint(1, &sums(50));
            retained.write_epoch(&FinishedEpoch::EMPTY);
            retained.write_settings(other, false);
            let mut epoch = FinishedEpoch::EMPTY;
            let opened = RetainedRam::open(memory);
            assert!(opened.restore(1).is_none() && !opened.restore_epoch(&mut epoch), "{other:?}");
            retained.write_settings(SETTINGS_WRITTEN, false);
            let opened = RetainedRam::open(memory);
            assert!(opened.restore(1).is_some() && opened.restore_epoch(&mut epoch));
        }
    }

    /// An image of other sources may give the words another meaning.
    #[test]
    fn another_build_finds_no_record() {
        let memory = memory();
        let mut retained = RetainedRam::open_by(1, memory);
        retained.write_settings(SETTINGS_WRITTEN, true);
        retained.checkpoint(1, &sums(50));
        retained.write_epoch(&FinishedEpoch::EMPTY);
        let (same, other) = (RetainedRam::open_by(1, memory), RetainedRam::open_by(2, memory));
        let mut epoch = FinishedEpoch::EMPTY;
        assert!(same.settings().is_some() && same.restore(1).is_some() && same.restore_epoch(&mut epoch));
        assert!(other.settings().is_none() && other.restore(1).is_none() && !other.restore_epoch(&mut epoch));
        assert_ne!(BUILD, 0);
    }

    /// A bit flips in any word of the slot written last: the version before is found.
    #[test]
    fn damage_loses_one_version_only() {
        for word in 0..SLOT_WORDS {
            let memory = memory();
            let mut retained = RetainedRam::open(memory);
            retained.write_settings(SETTINGS_WRITTEN, true);
            retained.checkpoint(2, &sums(100));
            retained.checkpoint(2, &sums(200));
            let slot = retained.newest[3].unwrap();
            memory.slots[slot][word].fetch_xor(0x10, Relaxed);
            assert_eq!(RetainedRam::open(memory).restore(2).map(|sums| sums.samples), Some(100), "word {word}");
        }
    }

    /// The reset comes after any number of words of the new version.
    #[test]
    fn a_reset_during_a_write_loses_that_version_only() {
        let memory = memory();
        let mut retained = RetainedRam::open(memory);
        retained.write_settings(SETTINGS_WRITTEN, true);
        retained.checkpoint(0, &sums(100));
        retained.checkpoint(0, &sums(200));
        let newest = retained.newest[1].unwrap();
        let free = (0..memory.slots.len()).find(|index| !retained.newest.contains(&Some(*index))).unwrap();
        for (written, (to, from)) in memory.slots[free].iter().zip(&memory.slots[newest]).enumerate() {
            assert_eq!(RetainedRam::open(memory).restore(0).map(|sums| sums.samples), Some(200), "{written} words");
            to.store(!from.load(Relaxed), Relaxed);
        }
    }
}
