//! Memory that a warm reset leaves alone: statistics, settings and last words, each with a checksum.
//!
//! The memory is an array of atomic words, so that whatever it holds after the supply came on is a valid value. There is
//! one slot more than there are records. A record is always written into the slot of which a newer version exists, or
//! none, so that a reset in the middle of it costs that version and never the one before.

use crate::estimators::CHANNELS;
use crate::summary::OCTAVES;
use crate::sums::Sums;
use core::sync::atomic::{AtomicU32, Ordering::Relaxed};

/// Words of a record: the samples, the missing ones, and for every octave a sum of 96 and a count of 64 bits.
const PAYLOAD: usize = 4 + OCTAVES * OCTAVE;
const OCTAVE: usize = 5;
/// Payload, and before it the kind, the version and the generation, after it the checksum.
const SLOT_WORDS: usize = PAYLOAD + 4;
/// Largest sum that is kept.
const MOST: u128 = (1 << 96) - 1;
/// Records: the settings, then the channels.
const KINDS: usize = 1 + CHANNELS.len();
const SETTINGS: usize = 0;
/// Told from memory that holds something else; in the upper half of a slot's first word. Changes with the layout.
const MAGIC: u32 = 0xAD17_0000;

const CRC: crc::Crc<u32> = crc::Crc::<u32>::new(&crc::CRC_32_ISO_HDLC);

/// The memory, for a section that is not initialised at the start.
pub type Memory = [Slot; KINDS + 1];

/// What [`Memory`] is where it is initialised: nothing kept.
#[must_use]
pub const fn blank() -> Memory {
    [const { [const { AtomicU32::new(0) }; SLOT_WORDS] }; KINDS + 1]
}

/// What is kept besides the statistics.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Settings {
    /// Value of SMPL_PRD.
    pub smpl_prd: u8,
    /// Value of SENS_AVG.
    pub sens_avg: u16,
    /// Length of an epoch in s.
    pub epoch_s: u32,
    /// Epochs finished.
    pub epoch: u32,
    /// Seconds between reports.
    pub interval_s: u32,
    /// Starts since the supply came on.
    pub starts: u32,
}

/// The records in a [`Memory`].
pub struct Retained {
    memory: &'static Memory,
    /// Statistics of another generation are out of date.
    generation: u32,
    version: u32,
    /// Slot of the newest version of each record.
    newest: [Option<usize>; KINDS],
    settings: Option<Settings>,
}

impl Retained {
    /// Finds the records that are whole.
    #[must_use]
    pub fn open(memory: &'static Memory) -> Self {
        let mut retained = Self { memory, generation: 0, version: 0, newest: [None; KINDS], settings: None };
        for (index, slot) in memory.iter().enumerate() {
            let Some((kind, version)) = whole(slot) else { continue };
            let newer = retained.newest[kind].is_none_or(|other| word(&memory[other], 1) < version);
            if newer {
                retained.newest[kind] = Some(index);
            }
            retained.version = retained.version.max(version);
        }
        if let Some(slot) = retained.newest[SETTINGS].map(|index| &memory[index]) {
            retained.generation = word(slot, 2);
            let at = |index: usize| word(slot, 3 + index);
            retained.settings = Some(Settings {
                smpl_prd: at(0) as u8,
                sens_avg: at(1) as u16,
                epoch_s: at(2),
                epoch: at(3),
                interval_s: at(4),
                starts: at(5),
            });
        }
        retained
    }

    /// Forgets everything, as after the supply came on.
    pub fn clear(&mut self) {
        for slot in self.memory {
            slot[0].store(0, Relaxed);
        }
        *self = Self::open(self.memory);
    }

    /// The settings that were kept.
    #[must_use]
    pub fn settings(&self) -> Option<Settings> {
        self.settings
    }

    /// The statistics of [`CHANNELS`]`[index]` that were kept under these settings.
    #[must_use]
    pub fn sums(&self, index: usize) -> Option<Sums> {
        let slot = &self.memory[self.newest.get(1 + index).copied()??];
        (word(slot, 2) == self.generation).then(|| sums(slot))
    }

    /// The records of all channels, under whatever settings. They stay until others are kept.
    #[must_use]
    pub fn records(&self) -> Records {
        Records(core::array::from_fn(|index| self.newest[1 + index].map(|slot| &self.memory[slot])))
    }

    /// Keeps the settings. Statistics that were kept under others are out of date with `fresh`.
    pub fn keep_settings(&mut self, settings: Settings, fresh: bool) {
        self.generation = self.generation.wrapping_add(u32::from(fresh));
        self.settings = Some(settings);
        let Settings { smpl_prd, sens_avg, epoch_s, epoch, interval_s, starts } = settings;
        let words = [u32::from(smpl_prd), u32::from(sens_avg), epoch_s, epoch, interval_s, starts];
        self.write(SETTINGS, words);
    }

    /// Keeps what the estimator of [`CHANNELS`]`[index]` has learnt.
    ///
    /// Differences of counts of 14 bits are within ±2¹⁴·n, and in 2⁴⁰ samples there are 2⁴³/n of them: no sum of squares
    /// passes 2⁷¹·n ≤ 2⁹⁴.
    pub fn keep_sums(&mut self, index: usize, sums: &Sums) {
        let halves = |wide: u64| [wide as u32, (wide >> 32) as u32];
        let octave = |&(squares, count): &(u128, u64)| {
            let squares = squares.min(MOST);
            let [[a, b], [d, e]] = [squares as u64, count].map(halves);
            [a, b, (squares >> 64) as u32, d, e]
        };
        let samples = [sums.samples, sums.missing].into_iter().flat_map(halves);
        if index < CHANNELS.len() {
            self.write(1 + index, samples.chain(sums.octaves.iter().flat_map(octave)));
        }
    }

    fn write(&mut self, kind: usize, words: impl IntoIterator<Item = u32>) {
        // There is one slot more than kinds, so one is nobody's newest.
        let Some(free) = (0..self.memory.len()).find(|index| !self.newest.contains(&Some(*index))) else { return };
        let slot = &self.memory[free];
        self.version = self.version.wrapping_add(1);
        slot[0].store(MAGIC | kind as u32, Relaxed);
        slot[1].store(self.version, Relaxed);
        slot[2].store(self.generation, Relaxed);
        let words = words.into_iter().chain(core::iter::repeat(0));
        for (cell, word) in slot[3..SLOT_WORDS - 1].iter().zip(words) {
            cell.store(word, Relaxed);
        }
        slot[SLOT_WORDS - 1].store(checksum(&slot[..SLOT_WORDS - 1]), Relaxed);
        self.newest[kind] = Some(free);
    }
}

/// The channels' records of one moment, where they are kept.
#[derive(Clone)]
pub struct Records([Option<&'static Slot>; CHANNELS.len()]);

impl Records {
    /// None at all.
    pub const NONE: Self = Self([None; CHANNELS.len()]);

    /// The statistics of [`CHANNELS`]`[index]`; none of a channel that was not kept.
    #[must_use]
    pub fn sums(&self, index: usize) -> Sums {
        self.slot(index).map_or(Sums::NONE, sums)
    }

    /// Samples of [`CHANNELS`]`[index]`.
    #[must_use]
    pub fn samples(&self, index: usize) -> u64 {
        self.slot(index).map_or(0, |slot| wide(slot, 0))
    }

    fn slot(&self, index: usize) -> Option<&'static Slot> {
        self.0.get(index).copied().flatten()
    }
}

type Slot = [AtomicU32; SLOT_WORDS];

/// Two words of the payload.
fn wide(slot: &Slot, at: usize) -> u64 {
    u64::from(word(slot, 3 + at)) | u64::from(word(slot, 4 + at)) << 32
}

fn sums(slot: &Slot) -> Sums {
    let octaves = core::array::from_fn(|octave| {
        let at = 4 + OCTAVE * octave;
        (u128::from(wide(slot, at)) | u128::from(word(slot, 5 + at)) << 64, wide(slot, at + 3))
    });
    Sums { samples: wide(slot, 0), missing: wide(slot, 2), octaves }
}

fn word(slot: &[AtomicU32], index: usize) -> u32 {
    slot[index].load(Relaxed)
}

fn checksum(words: &[AtomicU32]) -> u32 {
    let mut digest = CRC.digest();
    for word in words {
        digest.update(&word.load(Relaxed).to_le_bytes());
    }
    digest.finalize()
}

/// The kind and version of the record in a slot, if it is whole.
fn whole(slot: &Slot) -> Option<(usize, u32)> {
    let kind = (word(slot, 0) ^ MAGIC) as usize;
    let intact = kind < KINDS && word(slot, SLOT_WORDS - 1) == checksum(&slot[..SLOT_WORDS - 1]);
    intact.then(|| (kind, word(slot, 1)))
}

#[cfg(test)]
#[path = "retained_tests.rs"]
mod tests;
