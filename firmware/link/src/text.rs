//! Lines of plain text between the frames.

use core::fmt::{self, Write};
use heapless::{String, Vec};

/// Longest text line and longest log text in bytes.
pub const MAX_TEXT: usize = 120;

/// A line of text without its line end.
pub type TextLine = String<MAX_TEXT>;

/// Formats a text line; what exceeds [`MAX_TEXT`] bytes is cut off between two characters.
#[must_use]
pub fn text_line(text: fmt::Arguments<'_>) -> TextLine {
    let mut line = TextLine::new();
    let _cut = Truncating(&mut line).write_fmt(text);
    line
}

/// Formats a [text line](TextLine) as `format!` does a `String`.
#[macro_export]
macro_rules! text {
    ($($text:tt)*) => { $crate::text_line(format_args!($($text)*)) };
}

/// Writes as many characters as fit.
struct Truncating<'a>(&'a mut TextLine);

impl Write for Truncating<'_> {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        for character in text.chars() {
            self.0.push(character).map_err(|_| fmt::Error)?;
        }
        Ok(())
    }
}

/// A text line as it is sent: a zero byte, the text with every byte but printable ASCII replaced by `?`, CR LF, and a zero
/// byte.
#[must_use]
pub fn wire_bytes(line: &TextLine) -> Vec<u8, { MAX_TEXT + 4 }> {
    let printable = line.bytes().map(|byte| if is_printable(byte) { byte } else { b'?' });
    [0].into_iter().chain(printable).chain(*b"\r\n\0").collect()
}

/// Parses the bytes between two zero bytes; `None` if they are no text line.
pub(crate) fn parse(bytes: &[u8]) -> Option<TextLine> {
    let text = bytes.strip_suffix(b"\r\n")?;
    if !text.iter().all(|&byte| is_printable(byte)) {
        return None;
    }
    TextLine::try_from(core::str::from_utf8(text).ok()?).ok()
}

fn is_printable(byte: u8) -> bool {
    (b' '..=b'~').contains(&byte)
}
