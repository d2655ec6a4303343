//! Retained RAM: statistics and settings that a warm reset keeps, with checksums over content, build and settings.
//!
//! One slot is spare, so that a write never overwrites the newest version.

use crate::channels::CHANNELS;
use crate::epoch::FinishedEpoch;
use crate::epoch_record::{EPOCH_WORDS, SUMS_WORDS, visit_epoch, visit_sums};
use crate::slot::{Slot, Words};
use crate::statistics::ChannelSums;
use adis16405_driver::{Config, GyroRange, SamplePeriod};
use serde::{Deserialize, Serialize};

/// Words before the content: kind, version, generation, sensor settings.
const HEAD: usize = 4;
const BUILD: u32 = match u32::from_str_radix(env!("FIRMWARE_BUILD"), 10) {
    Ok(hash) => hash,
    Err(_) => panic!("the build script gives a number"),
};
const KINDS: usize = 1 + CHANNELS.len();
const SETTINGS: usize = 0;
/// Time in which three crashes stop the use of stored data, s.
const CRASHES_S: u32 = 600;
/// Number of crashes after which the finished epoch is dropped.
const CRASHES_OF_EPOCH: u32 = 2;

/// The memory, for a linker section that is not initialised.
pub struct RetainedMemory {
    records: [Slot<{ HEAD + SUMS_WORDS }>; KINDS + 1],
    epoch: Slot<EPOCH_WORDS>,
    crashes: Slot<3>,
}

/// A [`RetainedMemory`] without records.
pub const fn blank_memory() -> RetainedMemory {
    let records = [const { Slot::blank() }; KINDS + 1];
    RetainedMemory { records, epoch: Slot::blank(), crashes: Slot::blank() }
}

/// The user's settings, in the order of their bytes in flash.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct UserSettings {
    /// Value of SMPL_PRD.
    pub smpl_prd: u8,
    /// Value of SENS_AVG.
    pub sens_avg: u16,
    /// Length of an epoch in s, 0 for an epoch without end.
    pub epoch_s: u32,
    /// Seconds between reports, 0 for none.
    pub interval_s: u32,
    /// PROD_ID accepted for an ADIS16405; 0 for none.
    pub prod_id: u16,
}

impl UserSettings {
    /// The settings on which scale, rate and filter of the samples depend.
    pub(crate) fn of_sensor(self) -> u32 {
        u32::from(self.smpl_prd) << 16 | u32::from(self.sens_avg)
    }

    pub(crate) fn config(self) -> Option<Config> {
        let (range, period) = (GyroRange::from_sens_avg(self.sens_avg)?, SamplePeriod::from_register(self.smpl_prd)?);
        Config::new(range, self.sens_avg as u8, period).ok().filter(|config| config.sens_avg() == self.sens_avg)
    }
}

/// The settings of the application.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct RetainedSettings {
    /// The user's settings, which are also kept in flash.
    pub user: UserSettings,
    /// Number of epochs finished.
    pub epoch: u32,
    /// Starts since power-on.
    pub starts: u32,
    /// Age of the epoch at the last checkpoint, µs.
    pub epoch_age_us: u64,
}

impl RetainedSettings {
    fn visit(&mut self, words: &mut Words<'_>) {
        let UserSettings { smpl_prd, sens_avg, epoch_s, interval_s, prod_id } = &mut self.user;
        words.short(smpl_prd);
        words.short(sens_avg);
        words.short(prod_id);
        for word in [epoch_s, interval_s, &mut self.epoch, &mut self.starts] {
            words.word(word);
        }
        words.wide(&mut self.epoch_age_us);
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Crashes {
    /// Ages of the last and of the second last crash, s.
    ages_s: [u32; 2],
    /// Number of crashes before the finished epoch was learned from.
    of_epoch: u32,
}

impl Crashes {
    const NONE: Self = Self { ages_s: [u32::MAX; 2], of_epoch: 0 };

    fn visit(&mut self, words: &mut Words<'_>) {
        self.ages_s.iter_mut().chain([&mut self.of_epoch]).for_each(|word| words.word(word));
    }
}

/// The records in a [`RetainedMemory`].
pub struct RetainedRam {
    memory: &'static RetainedMemory,
    build: u32,
    generation: u32,
    version: u32,
    newest: [Option<(usize, u32)>; KINDS],
    settings: Option<RetainedSettings>,
    crashes: Crashes,
}

impl RetainedRam {
    /// Opens the memory and finds the newest valid version of every record.
    pub fn open(memory: &'static RetainedMemory) -> Self {
        Self::open_by(BUILD, memory)
    }

    fn open_by(build: u32, memory: &'static RetainedMemory) -> Self {
        let mut crashes = Crashes::NONE;
        if let Some(mut words) = memory.crashes.read(build) {
            crashes.visit(&mut words);
        }
        let mut retained =
            Self { memory, build, generation: 0, version: 0, newest: [None; KINDS], settings: None, crashes };
        for (index, slot) in memory.records.iter().enumerate() {
            let Some(mut words) = slot.read(build) else { continue };
            let [kind, version] = words.read();
            if let Some(newest) = retained.newest.get_mut(kind as usize)
                && newest.is_none_or(|(_, other)| other < version)
            {
                *newest = Some((index, version));
                retained.version = retained.version.max(version);
            }
        }
        if let Some((index, _)) = retained.newest[SETTINGS] {
            let (mut words, mut settings) = (memory.records[index].words(), RetainedSettings::default());
            [_, _, retained.generation, _] = words.read::<HEAD>();
            settings.visit(&mut words);
            retained.settings = Some(settings);
        }
        retained
    }

    /// Erases all records, as after power-on.
    pub fn clear(&mut self) {
        self.write_crashes(Crashes::NONE);
        self.clear_statistics();
    }

    pub(crate) fn clear_statistics(&mut self) {
        self.clear_epoch();
        self.memory.records.iter().for_each(Slot::clear);
        *self = Self::open_by(self.build, self.memory);
    }

    /// Notes a crash. True for the third within ten minutes, after which stored data must not be used.
    pub(crate) fn note_crash(&mut self) -> bool {
        let Crashes { ages_s: [last, before], of_epoch } = self.crashes;
        self.write_crashes(Crashes { ages_s: [0, last], of_epoch: of_epoch.saturating_add(1) });
        before <= CRASHES_S
    }

    /// Adds run time, s.
    pub(crate) fn note_time(&mut self, seconds: u32) {
        let ages_s = self.crashes.ages_s.map(|age| age.saturating_add(seconds));
        if ages_s != self.crashes.ages_s {
            self.write_crashes(Crashes { ages_s, ..self.crashes });
        }
    }

    fn write_crashes(&mut self, crashes: Crashes) {
        self.crashes = crashes;
        self.memory.crashes.write(self.build, |words| self.crashes.visit(words));
    }

    /// The settings that were written last.
    pub fn settings(&self) -> Option<RetainedSettings> {
        self.settings
    }

    /// Sums of [`CHANNELS`]`[index]`; `None` unless of the present generation and settings.
    pub fn restore(&self, index: usize) -> Option<ChannelSums> {
        let (slot, _) = self.newest.get(1 + index).copied()??;
        let (mut words, mut sums) = (self.memory.records[slot].words(), ChannelSums::EMPTY);
        let [_kind, _version, generation, of_sensor] = words.read::<HEAD>();
        visit_sums(&mut sums, &mut words);
        (generation == self.generation && of_sensor == self.of_sensor()).then_some(sums)
    }

    /// Replaces the finished epoch. A reset during the write loses it.
    pub fn write_epoch(&mut self, epoch: &mut FinishedEpoch) {
        self.write_crashes(Crashes { of_epoch: 0, ..self.crashes });
        self.memory.epoch.write(self.epoch_key(), |words| visit_epoch(epoch, words));
    }

    /// Restores the finished epoch into `epoch`. False if there is none, or after two crashes before it was learned
    /// from.
    #[must_use]
    pub fn restore_epoch(&self, epoch: &mut FinishedEpoch) -> bool {
        let words = self.memory.epoch.read(self.epoch_key()).filter(|_| self.crashes.of_epoch < CRASHES_OF_EPOCH);
        words.map(|mut words| visit_epoch(epoch, &mut words)).is_some()
    }

    /// Removes the finished epoch, after learning.
    pub fn clear_epoch(&mut self) {
        self.memory.epoch.clear();
    }

    /// Key of the epoch, which contains the sensor's settings.
    fn epoch_key(&self) -> u32 {
        self.build ^ self.of_sensor()
    }

    /// Writes the settings; `new_generation` makes the channel records outdated.
    pub fn write_settings(&mut self, mut settings: RetainedSettings, new_generation: bool) {
        self.generation = self.generation.wrapping_add(u32::from(new_generation));
        self.settings = Some(settings);
        self.write(SETTINGS, |words| settings.visit(words));
    }

    /// Writes the sums of [`CHANNELS`]`[index]`.
    pub fn checkpoint(&mut self, index: usize, sums: &mut ChannelSums) {
        if index < CHANNELS.len() {
            self.write(1 + index, |words| visit_sums(sums, words));
        }
    }

    fn of_sensor(&self) -> u32 {
        self.settings.map_or(0, |settings| settings.user.of_sensor())
    }

    fn write(&mut self, kind: usize, visit: impl FnOnce(&mut Words<'_>)) {
        // One slot is always spare.
        let is_newest = |index| self.newest.iter().flatten().any(|(newest, _)| *newest == index);
        let Some(free) = (0..=KINDS).find(|&index| !is_newest(index)) else { return };
        self.version = self.version.wrapping_add(1);
        let mut head = [kind as u32, self.version, self.generation, self.of_sensor()];
        self.memory.records[free].write(self.build, |words| {
            head.iter_mut().for_each(|word| words.word(word));
            visit(words);
        });
        self.newest[kind] = Some((free, self.version));
    }
}

#[cfg(test)]
mod tests {
    extern crate std;

    use super::*;
    use crate::channels::{ChannelEstimator, OCTAVES};
    use crate::slot::MAX_SUM;
    use allan_core::Interpolation;
    use std::boxed::Box;

    const USER: UserSettings =
        UserSettings { smpl_prd: 7, sens_avg: 0x0400, epoch_s: 3600, interval_s: 10, prod_id: 3 };
    const SETTINGS_WRITTEN: RetainedSettings =
        RetainedSettings { user: USER, epoch: 2, starts: 3, epoch_age_us: 3 << 32 | 7 };

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
            (0..CHANNELS.len()).for_each(|index| before.checkpoint(index, &mut sums(100 * round + index as i32)));
        }
        let after = RetainedRam::open(memory);
        assert_eq!(after.settings(), Some(SETTINGS_WRITTEN));
        for index in 0..CHANNELS.len() {
            assert_eq!(after.restore(index).unwrap(), sums(300 + index as i32));
        }
    }

    /// Sums of up to 96 bits are exact; larger ones saturate.
    #[test]
    fn wide_sums_are_stored_exactly() {
        let memory = memory();
        let mut retained = RetainedRam::open(memory);
        retained.write_settings(SETTINGS_WRITTEN, true);
        let octaves = core::array::from_fn(|octave| (MAX_SUM - octave as u128, u64::MAX - octave as u64));
        let gaps = core::array::from_fn(|octave| Interpolation::new(u32::MAX - octave as u32, octave as u32, MAX_SUM));
        let mut wide = ChannelSums { samples: u64::MAX, missing: 1 << 33, octaves, gaps };
        retained.checkpoint(3, &mut wide);
        assert_eq!(RetainedRam::open(memory).restore(3).unwrap(), wide);
        retained.checkpoint(3, &mut ChannelSums { octaves: [(u128::MAX, 1); OCTAVES], ..wide.clone() });
        assert_eq!(retained.restore(3).unwrap(), ChannelSums { octaves: [(MAX_SUM, 1); OCTAVES], ..wide });
    }

    #[test]
    fn statistics_under_other_settings_are_out_of_date() {
        let memory = memory();
        let mut retained = RetainedRam::open(memory);
        retained.write_settings(SETTINGS_WRITTEN, true);
        retained.checkpoint(1, &mut sums(50));
        retained
            .write_settings(RetainedSettings { user: UserSettings { epoch_s: 60, ..USER }, ..SETTINGS_WRITTEN }, false);
        assert!(RetainedRam::open(memory).restore(1).is_some());
        retained.write_settings(SETTINGS_WRITTEN, true);
        assert!(RetainedRam::open(memory).restore(1).is_none());
        retained.clear();
        assert_eq!(RetainedRam::open(memory).settings(), None);
    }

    #[test]
    fn statistics_of_another_range_or_rate_are_not_restored() {
        for other in [UserSettings { sens_avg: 0x0401, ..USER }, UserSettings { smpl_prd: 1, ..USER }] {
            let other = RetainedSettings { user: other, ..SETTINGS_WRITTEN };
            let memory = memory();
            let mut retained = RetainedRam::open(memory);
            retained.write_settings(SETTINGS_WRITTEN, true);
            retained.checkpoint(1, &mut sums(50));
            retained.write_epoch(&mut FinishedEpoch::EMPTY.clone());
            retained.write_settings(other, false);
            let mut epoch = FinishedEpoch::EMPTY;
            let opened = RetainedRam::open(memory);
            assert!(opened.restore(1).is_none() && !opened.restore_epoch(&mut epoch), "{other:?}");
            retained.write_settings(SETTINGS_WRITTEN, false);
            let opened = RetainedRam::open(memory);
            assert!(opened.restore(1).is_some() && opened.restore_epoch(&mut epoch));
        }
    }

    #[test]
    fn another_build_finds_no_record() {
        let memory = memory();
        let mut retained = RetainedRam::open_by(1, memory);
        retained.write_settings(SETTINGS_WRITTEN, true);
        retained.checkpoint(1, &mut sums(50));
        retained.write_epoch(&mut FinishedEpoch::EMPTY.clone());
        let (same, other) = (RetainedRam::open_by(1, memory), RetainedRam::open_by(2, memory));
        let mut epoch = FinishedEpoch::EMPTY;
        assert!(same.settings().is_some() && same.restore(1).is_some() && same.restore_epoch(&mut epoch));
        assert!(other.settings().is_none() && other.restore(1).is_none() && !other.restore_epoch(&mut epoch));
        assert_ne!(BUILD, 0);
    }

    #[test]
    fn damage_loses_one_version_only() {
        for word in 0..=HEAD + SUMS_WORDS {
            let memory = memory();
            let mut retained = RetainedRam::open(memory);
            retained.write_settings(SETTINGS_WRITTEN, true);
            retained.checkpoint(2, &mut sums(100));
            retained.checkpoint(2, &mut sums(200));
            let (slot, _) = retained.newest[3].unwrap();
            memory.records[slot].flip(word, 4);
            assert_eq!(RetainedRam::open(memory).restore(2).map(|sums| sums.samples), Some(100), "word {word}");
        }
    }

    #[test]
    fn a_reset_during_a_write_loses_that_version_only() {
        let memory = memory();
        let mut retained = RetainedRam::open(memory);
        retained.write_settings(SETTINGS_WRITTEN, true);
        retained.checkpoint(0, &mut sums(100));
        retained.checkpoint(0, &mut sums(200));
        let is_newest = |index| retained.newest.iter().flatten().any(|(newest, _)| *newest == index);
        let free = (0..=KINDS).find(|&index| !is_newest(index)).unwrap();
        for written in 0..=HEAD + SUMS_WORDS {
            memory.records[free].begin_to_write(written);
            assert_eq!(RetainedRam::open(memory).restore(0).map(|sums| sums.samples), Some(200), "{written} words");
        }
    }

    #[test]
    fn an_epoch_is_not_learned_from_after_two_crashes() {
        let memory = memory();
        let mut retained = RetainedRam::open(memory);
        retained.write_settings(SETTINGS_WRITTEN, true);
        retained.write_epoch(&mut FinishedEpoch::EMPTY.clone());
        let restored = || RetainedRam::open(memory).restore_epoch(&mut FinishedEpoch::EMPTY.clone());
        assert!(restored());
        retained.note_crash();
        assert!(restored(), "after one crash");
        retained.note_crash();
        assert!(!restored(), "after two");
        retained.write_epoch(&mut FinishedEpoch::EMPTY.clone());
        assert!(restored(), "the next epoch");
    }

    #[test]
    fn the_third_crash_within_ten_minutes_is_reported() {
        let memory = memory();
        let crash_after = |seconds: u32| {
            let mut retained = RetainedRam::open(memory);
            (0..seconds).for_each(|_| retained.note_time(1));
            RetainedRam::open(memory).note_crash()
        };
        assert_eq!([0, 300, 300, 301, 299].map(crash_after), [false, false, true, false, true]);
        assert!(!crash_after(u32::from(u16::MAX)));
        RetainedRam::open(memory).clear();
        assert_eq!([0, 1, 1].map(crash_after), [false, false, true], "after power-on");
    }
}
