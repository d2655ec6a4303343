//! Crash record: the text that a panic or fault leaves in retained RAM for the next start.

use core::fmt;
use core::sync::atomic::{AtomicU32, Ordering::Relaxed};
use link::{MAX_TEXT, TextLine, text_line};

const TEXT_WORDS: usize = MAX_TEXT / 4;
const CRC: crc::Crc<u32> = crc::Crc::<u32>::new(&crc::CRC_32_ISO_HDLC);

/// A line of text in memory that a warm reset does not clear: length, text, and the checksum of both.
pub struct CrashRecord([AtomicU32; TEXT_WORDS + 2]);

impl CrashRecord {
    /// A record without text.
    #[must_use]
    pub const fn blank() -> Self {
        Self([const { AtomicU32::new(0) }; TEXT_WORDS + 2])
    }

    /// Writes `text`, truncated to [`MAX_TEXT`] bytes.
    pub fn write(&self, text: fmt::Arguments<'_>) {
        let line = text_line(text);
        self.0[0].store(line.len() as u32, Relaxed);
        let mut bytes = line.bytes();
        for cell in &self.0[1..=TEXT_WORDS] {
            cell.store(u32::from_le_bytes(core::array::from_fn(|_| bytes.next().unwrap_or(0))), Relaxed);
        }
        self.0[TEXT_WORDS + 1].store(self.checksum(), Relaxed);
    }

    /// Returns the text and erases it; empty if there was none or it was damaged.
    pub fn take(&self) -> TextLine {
        let intact = self.0[TEXT_WORDS + 1].load(Relaxed) == self.checksum();
        let length = self.0[0].load(Relaxed) as usize;
        let bytes = self.0[1..=TEXT_WORDS].iter().flat_map(|cell| cell.load(Relaxed).to_le_bytes());
        let text: heapless::Vec<u8, { 4 * TEXT_WORDS }> = bytes.take(if intact { length } else { 0 }).collect();
        self.0[TEXT_WORDS + 1].store(!self.checksum(), Relaxed);
        core::str::from_utf8(&text).ok().and_then(|text| TextLine::try_from(text).ok()).unwrap_or_default()
    }

    fn checksum(&self) -> u32 {
        let mut digest = CRC.digest();
        for cell in &self.0[..=TEXT_WORDS] {
            digest.update(&cell.load(Relaxed).to_le_bytes());
        }
        digest.finalize()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_record_is_read_once() {
        let record = CrashRecord::blank();
        assert_eq!(record.take(), "", "zeros are no record");
        record.write(format_args!("panic at {}:{}", "app.rs", 7));
        assert_eq!(record.take(), "panic at app.rs:7");
        assert_eq!(record.take(), "");
    }

    #[test]
    fn a_damaged_record_is_not_read() {
        for cell in 0..TEXT_WORDS + 2 {
            let record = CrashRecord::blank();
            record.write(format_args!("{:>200}", "°C"));
            record.0[cell].fetch_xor(1 << 9, Relaxed);
            assert_eq!(record.take(), "", "word {cell}");
        }
    }

    #[test]
    fn a_long_text_is_cut_between_two_characters() {
        let record = CrashRecord::blank();
        record.write(format_args!("{:°>200}", ""));
        assert_eq!(record.take().len(), MAX_TEXT);
    }
}
