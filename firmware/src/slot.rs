//! Words with a checksum and key that a warm reset keeps; atomic, so any content is valid.

use core::iter::repeat;
use core::sync::atomic::{AtomicU32, Ordering::Relaxed};

const CRC: crc::Crc<u32> = crc::Crc::<u32>::new(&crc::CRC_32_ISO_HDLC);

pub(crate) struct Slot<const WORDS: usize> {
    /// Checked first: checksums take milliseconds on a Cortex-M0+.
    key: AtomicU32,
    words: [AtomicU32; WORDS],
    checksum: AtomicU32,
}

impl<const WORDS: usize> Slot<WORDS> {
    pub(crate) const fn blank() -> Self {
        Self { key: AtomicU32::new(0), words: [const { AtomicU32::new(0) }; WORDS], checksum: AtomicU32::new(0) }
    }

    /// Missing words are 0, which no key is.
    pub(crate) fn write(&self, key: u32, words: impl IntoIterator<Item = u32>) {
        self.key.store(key, Relaxed);
        for (cell, word) in self.words.iter().zip(words.into_iter().chain(repeat(0))) {
            cell.store(word, Relaxed);
        }
        self.checksum.store(self.checksum_with(key), Relaxed);
    }

    pub(crate) fn read(&self, key: u32) -> Option<Words<impl Iterator<Item = u32>>> {
        let is_intact = self.key.load(Relaxed) == key && self.checksum.load(Relaxed) == self.checksum_with(key);
        is_intact.then(|| self.words())
    }

    pub(crate) fn words(&self) -> Words<impl Iterator<Item = u32>> {
        Words(self.words.iter().map(|cell| cell.load(Relaxed)))
    }

    pub(crate) fn clear(&self) {
        self.key.store(0, Relaxed);
    }

    /// CRC-32 of key and words, little endian.
    fn checksum_with(&self, key: u32) -> u32 {
        let mut digest = CRC.digest();
        digest.update(&key.to_le_bytes());
        self.words.iter().for_each(|cell| digest.update(&cell.load(Relaxed).to_le_bytes()));
        digest.finalize()
    }

    #[cfg(test)]
    pub(crate) fn flip(&self, word: usize, bit: u32) {
        self.words.get(word).unwrap_or(&self.checksum).fetch_xor(1 << bit, Relaxed);
    }

    #[cfg(test)]
    pub(crate) fn begin_to_write(&self, words: usize) {
        self.words[..words].iter().for_each(|cell| cell.store(!cell.load(Relaxed), Relaxed));
    }
}

/// Missing ones are 0.
pub(crate) struct Words<I>(pub(crate) I);

impl<I: Iterator<Item = u32>> Words<I> {
    pub(crate) fn word(&mut self) -> u32 {
        self.0.next().unwrap_or(0)
    }

    pub(crate) fn wide(&mut self) -> u64 {
        u64::from(self.word()) | u64::from(self.word()) << 32
    }

    pub(crate) fn sum(&mut self) -> u128 {
        u128::from(self.wide()) | u128::from(self.word()) << 64
    }

    pub(crate) fn float(&mut self) -> f64 {
        f64::from_bits(self.wide())
    }
}

pub(crate) fn halves(wide: u64) -> [u32; 2] {
    [wide as u32, (wide >> 32) as u32]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_record_is_read_with_its_key_until_it_is_cleared_or_damaged() {
        let slot = Slot::<4>::blank();
        let read = |key| slot.read(key).map(|mut words| [words.word(), words.word(), words.word(), words.word()]);
        assert_eq!(read(7), None, "zeros are no record");
        slot.write(7, [1, 2, 3]);
        assert_eq!((read(7), read(8)), (Some([1, 2, 3, 0]), None));
        for word in 0..5 {
            slot.flip(word, 19);
            assert_eq!(read(7), None, "word {word}");
            slot.flip(word, 19);
        }
        slot.clear();
        assert_eq!(read(7), None);
    }
}
