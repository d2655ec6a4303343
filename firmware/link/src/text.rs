//! Lines of plain text among the frames.

use crate::MAX_TEXT;
use heapless::{String, Vec};

/// A line without its end.
pub type Line = String<MAX_TEXT>;

/// What goes over the wire for a line: a zero byte, the text with everything but printable ASCII replaced by `?`, CR LF,
/// and a zero byte.
#[must_use]
pub fn line_bytes(line: &Line) -> Vec<u8, { MAX_TEXT + 4 }> {
    let printable = line.bytes().map(|byte| if is_printable(byte) { byte } else { b'?' });
    [0].into_iter().chain(printable).chain(*b"\r\n\0").collect()
}

/// The line that the bytes between two zero bytes are, if they are one.
pub(crate) fn line(bytes: &[u8]) -> Option<Line> {
    let text = bytes.strip_suffix(b"\r\n")?;
    if !text.iter().all(|&byte| is_printable(byte)) {
        return None;
    }
    Line::try_from(core::str::from_utf8(text).ok()?).ok()
}

fn is_printable(byte: u8) -> bool {
    (b' '..=b'~').contains(&byte)
}
