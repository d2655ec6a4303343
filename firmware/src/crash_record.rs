//! Crash record: the text that a panic or fault leaves in retained RAM for the next start.

use crate::slot::Slot;
use core::fmt;
use heapless::Vec;
use link::{MAX_TEXT, TextLine, text_line};

const TEXT_WORDS: usize = MAX_TEXT / 4;
/// The key does not depend on the build: the next image reads the record.
const KEY: u32 = 0xC4A5_4EC0;

/// Length and bytes of a text that a warm reset keeps.
pub struct CrashRecord(Slot<{ 1 + TEXT_WORDS }>);

impl CrashRecord {
    /// A record without text.
    pub const fn blank() -> Self {
        Self(Slot::blank())
    }

    /// Writes `text`, truncated to [`MAX_TEXT`] bytes, unless a text is there: a later crash is not the cause.
    pub fn write(&self, text: fmt::Arguments<'_>) {
        if self.0.read(KEY).is_none() {
            let line = text_line(text);
            self.0.write(KEY, |words| {
                words.word(&mut (line.len() as u32));
                let mut bytes = line.bytes();
                (0..TEXT_WORDS).for_each(|_| {
                    words.word(&mut u32::from_le_bytes(core::array::from_fn(|_| bytes.next().unwrap_or(0))));
                });
            });
        }
    }

    /// Returns the text and erases it; empty if there was none or it was damaged.
    pub fn take(&self) -> TextLine {
        let Some(mut words) = self.0.read(KEY) else { return TextLine::new() };
        let [length] = words.read();
        let text = words.read::<TEXT_WORDS>().into_iter().flat_map(u32::to_le_bytes).take(length as usize);
        let text: Vec<u8, { 4 * TEXT_WORDS }> = text.collect();
        self.0.clear();
        core::str::from_utf8(&text).ok().and_then(|text| TextLine::try_from(text).ok()).unwrap_or_default()
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

    /// The second text is from a panic whose report overflows the stack.
    #[test]
    fn the_first_crash_of_a_run_is_kept() {
        let record = CrashRecord::blank();
        record.write(format_args!("panic at app.rs:7"));
        record.write(format_args!("stack overflow"));
        assert_eq!(record.take(), "panic at app.rs:7");
        record.write(format_args!("stack overflow"));
        assert_eq!(record.take(), "stack overflow");
    }

    #[test]
    fn a_damaged_record_is_not_read() {
        for word in 0..TEXT_WORDS + 2 {
            let record = CrashRecord::blank();
            record.write(format_args!("{:>200}", "°C"));
            record.0.flip(word, 9);
            assert_eq!(record.take(), "", "word {word}");
        }
    }

    #[test]
    fn a_long_text_is_cut_between_two_characters() {
        let record = CrashRecord::blank();
        record.write(format_args!("{:°>200}", ""));
        assert_eq!(record.take().len(), MAX_TEXT);
    }
}
