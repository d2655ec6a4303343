//! What a panic or fault leaves for the next start.

use core::fmt::{self, Write};
use core::sync::atomic::{AtomicU32, Ordering::Relaxed};
use link::Line;

const WORDS: usize = link::MAX_TEXT / 4;
const CRC: crc::Crc<u32> = crc::Crc::<u32>::new(&crc::CRC_32_ISO_HDLC);

/// A line of text in memory that a warm reset leaves alone: the length, the text, the checksum of both.
pub struct LastWords([AtomicU32; WORDS + 2]);

impl LastWords {
    /// What it is where it is initialised: nothing said.
    #[must_use]
    pub const fn blank() -> Self {
        Self([const { AtomicU32::new(0) }; WORDS + 2])
    }

    /// Leaves `text`, cut to what fits.
    pub fn leave(&self, text: fmt::Arguments<'_>) {
        let mut line = Line::new();
        let _cut = Cut(&mut line).write_fmt(text);
        self.0[0].store(line.len() as u32, Relaxed);
        let mut bytes = line.bytes();
        for cell in &self.0[1..=WORDS] {
            cell.store(u32::from_le_bytes(core::array::from_fn(|_| bytes.next().unwrap_or(0))), Relaxed);
        }
        self.0[WORDS + 1].store(self.checksum(), Relaxed);
    }

    /// Takes what was left, once; empty if there was nothing or it was damaged.
    pub fn take(&self) -> Line {
        let intact = self.0[WORDS + 1].load(Relaxed) == self.checksum();
        let length = self.0[0].load(Relaxed) as usize;
        let bytes = self.0[1..=WORDS].iter().flat_map(|cell| cell.load(Relaxed).to_le_bytes());
        let text: heapless::Vec<u8, { 4 * WORDS }> = bytes.take(if intact { length } else { 0 }).collect();
        self.0[WORDS + 1].store(!self.checksum(), Relaxed);
        core::str::from_utf8(&text).ok().and_then(|text| Line::try_from(text).ok()).unwrap_or_default()
    }

    fn checksum(&self) -> u32 {
        let mut digest = CRC.digest();
        for cell in &self.0[..=WORDS] {
            digest.update(&cell.load(Relaxed).to_le_bytes());
        }
        digest.finalize()
    }
}

/// Writes as much as fits.
pub(crate) struct Cut<'a>(pub(crate) &'a mut Line);

impl Write for Cut<'_> {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        for letter in text.chars() {
            self.0.push(letter).map_err(|_| fmt::Error)?;
        }
        Ok(())
    }
}

/// A line of what is formatted, cut to what fits.
#[must_use]
pub(crate) fn line(text: fmt::Arguments<'_>) -> Line {
    let mut line = Line::new();
    let _cut = Cut(&mut line).write_fmt(text);
    line
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn last_words_are_heard_once() {
        let words = LastWords::blank();
        assert_eq!(words.take(), "", "zeros are not words");
        words.leave(format_args!("panic at {}:{}", "app.rs", 7));
        assert_eq!(words.take(), "panic at app.rs:7");
        assert_eq!(words.take(), "");
    }

    #[test]
    fn damaged_words_are_not_heard() {
        for cell in 0..WORDS + 2 {
            let words = LastWords::blank();
            words.leave(format_args!("{:>200}", "°C"));
            words.0[cell].fetch_xor(1 << 9, Relaxed);
            assert_eq!(words.take(), "", "word {cell}");
        }
    }

    #[test]
    fn long_words_are_cut_between_letters() {
        let words = LastWords::blank();
        words.leave(format_args!("{:°>200}", ""));
        assert_eq!(words.take().len(), link::MAX_TEXT);
    }
}
