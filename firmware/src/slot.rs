//! Words with a checksum and a key that a warm reset keeps. They are atomic, so any content is valid.

use core::sync::atomic::{AtomicU32, Ordering::Relaxed};

const CRC: crc::Crc<u32> = crc::Crc::<u32>::new(&crc::CRC_32_ISO_HDLC);

/// Largest sum that a record can hold.
pub(crate) const MAX_SUM: u128 = (1 << 96) - 1;

pub(crate) struct Slot<const WORDS: usize> {
    /// The key is checked first, since checksums take milliseconds on a Cortex-M0+.
    key: AtomicU32,
    words: [AtomicU32; WORDS],
    checksum: AtomicU32,
}

impl<const WORDS: usize> Slot<WORDS> {
    pub(crate) const fn blank() -> Self {
        Self { key: AtomicU32::new(0), words: [const { AtomicU32::new(0) }; WORDS], checksum: AtomicU32::new(0) }
    }

    /// Writes words with a key; key 0 marks an empty slot. Words that `visit` does not write stay as they are.
    pub(crate) fn write(&self, key: u32, visit: impl FnOnce(&mut Words<'_>)) {
        self.key.store(key, Relaxed);
        visit(&mut Words { is_writing: true, ..self.words() });
        self.checksum.store(self.checksum_with(key), Relaxed);
    }

    pub(crate) fn read(&self, key: u32) -> Option<Words<'_>> {
        let is_intact = self.key.load(Relaxed) == key && self.checksum.load(Relaxed) == self.checksum_with(key);
        is_intact.then(|| self.words())
    }

    pub(crate) fn words(&self) -> Words<'_> {
        Words { cells: self.words.iter(), is_writing: false }
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

/// Writes numbers to a slot, or reads them in the same order. Numbers beyond the slot's end stay as they are.
pub(crate) struct Words<'s> {
    cells: core::slice::Iter<'s, AtomicU32>,
    is_writing: bool,
}

impl Words<'_> {
    pub(crate) fn word(&mut self, word: &mut u32) {
        match self.cells.next() {
            Some(cell) if self.is_writing => cell.store(*word, Relaxed),
            Some(cell) => *word = cell.load(Relaxed),
            None => {}
        }
    }

    pub(crate) fn short<T: Copy + Into<u32> + TryFrom<u32>>(&mut self, number: &mut T) {
        let mut word = (*number).into();
        self.word(&mut word);
        *number = word.try_into().unwrap_or(*number);
    }

    pub(crate) fn wide(&mut self, wide: &mut u64) {
        let (mut low, mut high) = (*wide as u32, (*wide >> 32) as u32);
        self.word(&mut low);
        self.word(&mut high);
        *wide = u64::from(low) | u64::from(high) << 32;
    }

    /// Visits a sum of at most [`MAX_SUM`].
    pub(crate) fn sum(&mut self, sum: &mut u128) {
        let capped = (*sum).min(MAX_SUM);
        let (mut low, mut high) = (capped as u64, (capped >> 64) as u32);
        self.wide(&mut low);
        self.word(&mut high);
        *sum = u128::from(low) | u128::from(high) << 64;
    }

    pub(crate) fn float(&mut self, value: &mut f64) {
        let mut bits = value.to_bits();
        self.wide(&mut bits);
        *value = f64::from_bits(bits);
    }

    pub(crate) fn read<const N: usize>(&mut self) -> [u32; N] {
        let mut words = [0; N];
        words.iter_mut().for_each(|word| self.word(word));
        words
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_record_is_read_with_its_key_until_it_is_cleared_or_damaged() {
        let slot = Slot::<4>::blank();
        let read = |key| slot.read(key).map(|mut words| words.read::<4>());
        assert_eq!(read(7), None, "zeros are no record");
        slot.write(7, |words| [1, 2, 3].iter_mut().for_each(|word| words.word(word)));
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
