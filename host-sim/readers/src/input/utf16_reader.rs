//! Text in UTF-16 as UTF-8. Libraries for it bring the tables of every other encoding, 130 kB of the page that a browser loads.

use std::io::{self, Cursor, Read};

/// Bytes that are read at a time; even.
const CHUNK_BYTES: u64 = 1 << 15;

/// Reads the text behind the mark of its byte order, or from its first letter. What is no character becomes U+FFFD.
pub(crate) struct Utf16Reader<R> {
    input: R,
    unit: fn([u8; 2]) -> u16,
    /// Bytes of a character that is not whole yet.
    bytes: Vec<u8>,
    text: Cursor<String>,
}

impl<R: Read> Utf16Reader<R> {
    /// Reads the mark, or the first letter, of which one byte is zero.
    ///
    /// # Errors
    /// It cannot be read.
    pub(crate) fn new(mut input: R) -> io::Result<Self> {
        let mut mark = [0; 2];
        input.read_exact(&mut mark)?;
        let unit = if mark == [0xFE, 0xFF] || mark[0] == 0 { u16::from_be_bytes } else { u16::from_le_bytes };
        let has_mark = unit(mark) == 0xFEFF;
        let bytes = if has_mark { Vec::new() } else { mark.to_vec() };
        Ok(Self { input, unit, bytes, text: Cursor::default() })
    }

    /// Reads and decodes more; false at the end of the input.
    fn decode(&mut self) -> io::Result<bool> {
        let read = self.input.by_ref().take(CHUNK_BYTES).read_to_end(&mut self.bytes)?;
        let units = self.bytes.chunks_exact(2).map(|pair| (self.unit)([pair[0], pair[1]]));
        let has_half = read > 0 && units.clone().next_back().is_some_and(|unit| (0xD800..0xDC00).contains(&unit));
        let whole = units.len() - usize::from(has_half);
        let characters = char::decode_utf16(units.take(whole));
        let mut text: String = characters.map(|character| character.unwrap_or(char::REPLACEMENT_CHARACTER)).collect();
        self.bytes.drain(..2 * whole);
        if read == 0 && !self.bytes.is_empty() {
            self.bytes.clear();
            text.push(char::REPLACEMENT_CHARACTER);
        }
        let is_more = read > 0 || !text.is_empty();
        self.text = Cursor::new(text);
        Ok(is_more)
    }
}

impl<R: Read> Read for Utf16Reader<R> {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        loop {
            let read = self.text.read(out)?;
            if read > 0 || out.is_empty() || !self.decode()? {
                return Ok(read);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::Utf16Reader;
    use std::io::{Cursor, Read};

    /// Characters of one and two units at every place of a chunk, halves of pairs alone, and a byte too many.
    #[test]
    fn text_is_what_was_written() {
        let text: String = "a°語😀\n".repeat(5000);
        for shift in 0..4 {
            let text = format!("{}{text}", "x".repeat(shift));
            for to_bytes in [u16::to_le_bytes, u16::to_be_bytes] {
                let marked: Vec<u8> = std::iter::once(0xFEFF).chain(text.encode_utf16()).flat_map(to_bytes).collect();
                for bytes in [&marked[..], &marked[2..]] {
                    let mut read = String::new();
                    Utf16Reader::new(Cursor::new(bytes)).expect("a letter").read_to_string(&mut read).expect("text");
                    assert!(read == text, "{shift}");
                }
            }
        }
        let read = |bytes: &[u8]| {
            let mut read = String::new();
            Utf16Reader::new(bytes).expect("a mark").read_to_string(&mut read).expect("text");
            read
        };
        assert_eq!(read(&[0xFF, 0xFE]), "");
        assert_eq!(read(&[0xFF, 0xFE, 0x00, 0xDC, b'a', 0]), "\u{FFFD}a");
        assert_eq!(read(&[0xFF, 0xFE, b'a', 0, 0x3D, 0xD8]), "a\u{FFFD}");
        assert_eq!(read(&[0xFE, 0xFF, 0, b'a', 0]), "a\u{FFFD}");
    }
}
