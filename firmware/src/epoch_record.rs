//! The finished epoch in retained RAM, so that a restart while it is being learned from does not lose it; and the words that a
//! channel's sums take there.

use crate::channels::{CHANNELS, OCTAVES};
use crate::cross_sums::{CROSS_OCTAVES, PAIRS};
use crate::epoch::FinishedEpoch;
use crate::statistics::ChannelSums;
use allan_core::Interpolation;
use core::sync::atomic::{AtomicU32, Ordering::Relaxed};

const OCTAVE_WORDS: usize = 10;
/// Words of a channel's sums: the samples, the missing ones, and for every octave a sum of 96 and a count of 64 bits, and of
/// the gaps that it bridges two numbers of samples and a sum of 96 bits.
pub(crate) const SUMS_WORDS: usize = 4 + OCTAVES * OCTAVE_WORDS;
/// Largest sum that is stored.
pub(crate) const MAX_SUM: u128 = (1 << 96) - 1;
/// Words of an epoch: the sensor's settings, its number, the measured sample rate, the sums, whether the covariances are complete, and their means and pairs of 64 bits each.
const EPOCH_WORDS: usize = 5 + CHANNELS.len() * SUMS_WORDS + 2 * (CHANNELS.len() + PAIRS.len() * CROSS_OCTAVES);
/// Marks a record, in its first word. Changes with the layout.
const MAGIC: u32 = 0xAD17_E004;

const CRC: crc::Crc<u32> = crc::Crc::<u32>::new(&crc::CRC_32_ISO_HDLC);

/// CRC-32 of the hash of a build and of words, each with its least significant byte first.
pub(crate) fn checksum(build: u32, words: &[AtomicU32]) -> u32 {
    let mut digest = CRC.digest();
    digest.update(&build.to_le_bytes());
    for word in words {
        digest.update(&word.load(Relaxed).to_le_bytes());
    }
    digest.finalize()
}

fn halves(wide: u64) -> [u32; 2] {
    [wide as u32, (wide >> 32) as u32]
}

/// The words of a channel's sums.
///
/// Differences of counts of 14 bits are within ±2¹⁴·n, and in 2⁴⁰ samples there are 2⁴³/n of them: no sum of squares
/// exceeds 2⁷¹·n ≤ 2⁹⁴.
pub(crate) fn sums_words(sums: &ChannelSums) -> impl Iterator<Item = u32> {
    let sum = |wide: u128| {
        let wide = wide.min(MAX_SUM);
        [wide as u32, (wide >> 32) as u32, (wide >> 64) as u32]
    };
    let octave = move |(&(squares, count), gaps): (&(u128, u64), &Interpolation)| {
        let numbers = [gaps.replaced(), gaps.tested()];
        sum(squares).into_iter().chain(halves(count)).chain(numbers).chain(sum(gaps.squared_error()))
    };
    let octaves = sums.octaves.iter().zip(&sums.gaps).flat_map(octave);
    [sums.samples, sums.missing].into_iter().flat_map(halves).chain(octaves)
}

/// The sums in [`SUMS_WORDS`] words.
pub(crate) fn sums_from_words(words: impl Iterator<Item = u32>) -> ChannelSums {
    let mut reader = Reader(words);
    let mut sums = ChannelSums { samples: reader.wide(), missing: reader.wide(), ..ChannelSums::EMPTY };
    for (octave, gaps) in sums.octaves.iter_mut().zip(&mut sums.gaps) {
        *octave = (reader.sum(), reader.wide());
        let (replaced, tested) = (reader.word(), reader.word());
        *gaps = Interpolation::new(replaced, tested, reader.sum());
    }
    sums
}

/// Reads words in order; missing ones are 0.
struct Reader<I>(I);

impl<I: Iterator<Item = u32>> Reader<I> {
    fn word(&mut self) -> u32 {
        self.0.next().unwrap_or(0)
    }

    fn wide(&mut self) -> u64 {
        u64::from(self.word()) | u64::from(self.word()) << 32
    }

    fn sum(&mut self) -> u128 {
        u128::from(self.wide()) | u128::from(self.word()) << 64
    }

    fn float(&mut self) -> f64 {
        f64::from_bits(self.wide())
    }
}

/// A finished epoch in memory that a warm reset does not clear: mark, payload, and the checksum of both.
pub(crate) struct EpochRecord([AtomicU32; EPOCH_WORDS + 2]);

impl EpochRecord {
    /// A record of no epoch.
    pub(crate) const fn blank() -> Self {
        Self([const { AtomicU32::new(0) }; EPOCH_WORDS + 2])
    }

    /// Writes an epoch, whose samples a sensor with these settings has taken, in the place of the one before.
    pub(crate) fn write(&self, epoch: &FinishedEpoch, build: u32, of_sensor: u32) {
        let covariances = &epoch.covariances;
        let floats = covariances.means.iter().chain(covariances.pairs.as_flattened()).map(|value| value.to_bits());
        let head = [MAGIC, of_sensor, epoch.number, u32::from(covariances.complete)];
        let rate = halves(epoch.measured_hz.unwrap_or(0.0).to_bits());
        let words =
            head.into_iter().chain(rate).chain(epoch.sums.iter().flat_map(sums_words)).chain(floats.flat_map(halves));
        for (cell, word) in self.0[..=EPOCH_WORDS].iter().zip(words) {
            cell.store(word, Relaxed);
        }
        self.0[EPOCH_WORDS + 1].store(checksum(build, &self.0[..=EPOCH_WORDS]), Relaxed);
    }

    /// Overwrites `epoch` with the one that was written last. Returns false, and leaves `epoch` alone, if there is none or it
    /// was damaged, or is of another build or of a sensor with other settings.
    pub(crate) fn restore(&self, epoch: &mut FinishedEpoch, build: u32, of_sensor: u32) -> bool {
        let mut words = self.0[..=EPOCH_WORDS].iter().map(|cell| cell.load(Relaxed));
        let intact = self.0[EPOCH_WORDS + 1].load(Relaxed) == checksum(build, &self.0[..=EPOCH_WORDS]);
        if words.next() != Some(MAGIC) || words.next() != Some(of_sensor) || !intact {
            return false;
        }
        epoch.number = words.next().unwrap_or(0);
        let complete = words.next() == Some(1);
        let rate_hz = Reader(words.by_ref()).float();
        epoch.measured_hz = (rate_hz > 0.0).then_some(rate_hz);
        for sums in &mut epoch.sums {
            *sums = sums_from_words(words.by_ref().take(SUMS_WORDS));
        }
        let mut reader = Reader(words);
        let covariances = &mut epoch.covariances;
        covariances.complete = complete;
        covariances.means = covariances.means.map(|_| reader.float());
        covariances.pairs.as_flattened_mut().fill_with(|| reader.float());
        true
    }

    /// Erases the epoch.
    pub(crate) fn clear(&self) {
        self.0[0].store(0, Relaxed);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cross_sums::AllanCovariances;

    /// An epoch in which every number differs from the others.
    fn epoch() -> FinishedEpoch {
        let mut number = 0_u64;
        let mut next = || {
            number += 0x0001_0000_0001;
            number
        };
        let mut sums = || ChannelSums {
            samples: next(),
            missing: next(),
            octaves: core::array::from_fn(|_| (u128::from(next()) << 31, next())),
            gaps: core::array::from_fn(|_| Interpolation::new(next() as u32, next() as u32, u128::from(next()) << 31)),
        };
        let sums = core::array::from_fn(|_| sums());
        let mut covariances = AllanCovariances::EMPTY;
        covariances.complete = true;
        covariances.means = covariances.means.map(|_| -(next() as f64));
        covariances.pairs.as_flattened_mut().fill_with(|| 1.0 / next() as f64);
        FinishedEpoch { number: 77, measured_hz: Some(203.9), sums, covariances }
    }

    #[test]
    fn an_epoch_is_restored_as_it_was_written() {
        let (record, written) = (EpochRecord::blank(), epoch());
        let mut restored = FinishedEpoch::EMPTY;
        assert!(!record.restore(&mut restored, 1, 2) && restored == FinishedEpoch::EMPTY, "zeros are no record");
        record.write(&written, 1, 2);
        assert!(record.restore(&mut restored, 1, 2));
        assert_eq!(restored, written);
        record.clear();
        assert!(!record.restore(&mut restored, 1, 2));
    }

    #[test]
    fn a_damaged_epoch_is_not_restored() {
        let record = EpochRecord::blank();
        record.write(&epoch(), 1, 2);
        for cell in &record.0 {
            let mut restored = FinishedEpoch::EMPTY;
            cell.fetch_xor(1 << 19, Relaxed);
            assert!(!record.restore(&mut restored, 1, 2) && restored == FinishedEpoch::EMPTY);
            cell.fetch_xor(1 << 19, Relaxed);
        }
    }
}
