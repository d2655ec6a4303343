//! Lines of a plain or gzip file with an editor's line numbers. The crate `csv` counts blank lines and CR LF wrongly.

use crate::input::{
    Budget, Counted, FileBytes, GZIP_MAGIC, GzipMembers, InputError, Metered, ReadAhead, ReadMonitor, Reason,
    may_begin_threads,
};
use encoding_rs::{UTF_16BE, UTF_16LE};
use encoding_rs_io::DecodeReaderBytesBuilder;
use std::io::{self, BufRead, BufReader, Cursor, Read};
use std::path::PathBuf;

const MAX_LINE_BYTES: u64 = 1 << 16;

const BUFFER_BYTES: usize = 1 << 16;

/// Bytes that tell UTF-16 without a mark of its byte order.
const UTF16_BYTES: usize = 16;

/// An open file, read one line at a time.
pub struct Lines {
    file: PathBuf,
    input: BufReader<Box<dyn Read + Send>>,
    line: u64,
    /// Last byte of a line, once it is known.
    end: Option<u8>,
    bytes: Vec<u8>,
    /// If not UTF-8.
    latin: String,
    is_latin: bool,
    /// The line in `bytes` comes again.
    again: bool,
    /// True in rows: a damaged line is read as what it may be, and is no row.
    are_rows: bool,
    /// The last line, if it has no line end.
    unended: Option<Unended>,
    damage: Option<Reason>,
    /// Found in [`FileBytes`].
    early_end: Option<Reason>,
    /// As of a full disk or lost power.
    zero_bytes: u64,
    monitor: ReadMonitor,
}

impl Lines {
    /// Opens `file`; its first bytes tell compression.
    ///
    /// # Errors
    /// The file is missing, unreadable, a directory or empty.
    pub fn open(file: &FileBytes) -> Result<Self, InputError> {
        Self::open_monitored(file, &ReadMonitor::default())
    }

    pub(crate) fn open_monitored(file: &FileBytes, monitor: &ReadMonitor) -> Result<Self, InputError> {
        let fail = |reason| file.error(reason);
        let mut raw = file.open().map_err(|e| fail(Reason::Io(e)))?;
        // Without seeking: it may be a pipe.
        let mut start = Vec::with_capacity(UTF16_BYTES);
        raw.by_ref().take(UTF16_BYTES as u64).read_to_end(&mut start).map_err(|e| fail(Reason::Io(e)))?;
        if start.is_empty() {
            return Err(fail(Reason::Empty));
        }
        let compressed = start.starts_with(&GZIP_MAGIC);
        let is_utf16 = is_utf16(&start);
        monitor.begin();
        let counted = Counted::new(Cursor::new(start.clone()).chain(raw), monitor);
        let whole = BufReader::with_capacity(BUFFER_BYTES, counted);
        let bytes: Box<dyn Read + Send> = if compressed {
            let budget = Budget::of_file(file).map_err(|e| fail(Reason::Io(e)))?;
            let members = Metered::new(GzipMembers::new(whole), budget.meter());
            if may_begin_threads() {
                Box::new(ReadAhead::new(members).map_err(|e| fail(Reason::Io(e)))?)
            } else {
                Box::new(members)
            }
        } else if is_utf16 {
            // In Windows programs.
            let is_big_endian = start.starts_with(b"\xFE\xFF") || start[0] == 0;
            let encoding = if is_big_endian { UTF_16BE } else { UTF_16LE };
            Box::new(DecodeReaderBytesBuilder::new().encoding(Some(encoding)).build(whole))
        } else {
            Box::new(whole)
        };
        let input = BufReader::with_capacity(BUFFER_BYTES, bytes);
        Ok(Self {
            file: file.name().to_owned(),
            input,
            line: 0,
            end: None,
            bytes: Vec::new(),
            latin: String::new(),
            is_latin: false,
            again: false,
            are_rows: false,
            unended: None,
            damage: None,
            early_end: file.cut().map(|format| Reason::Truncated { format }),
            zero_bytes: 0,
            monitor: monitor.clone(),
        })
    }

    /// The next non-blank line, trimmed, with its number from 1; Latin-1 unless UTF-8. `None` at the end.
    ///
    /// # Errors
    /// The file cannot be read or decompressed, or a line before the rows is longer than 65536 bytes or has control characters.
    pub fn next_line(&mut self) -> Result<Option<(u64, &str)>, InputError> {
        while !std::mem::take(&mut self.again) {
            self.line += 1;
            self.bytes.clear();
            let read = match self.read_line().map_err(read_failure) {
                Ok(read) => read,
                Err(reason @ Reason::Truncated { .. }) => {
                    self.early_end = Some(reason).filter(|_| !self.monitor.is_cut());
                    0
                }
                Err(reason) => return Err(InputError::line(&self.file, self.line, reason)),
            };
            let has_end = self.bytes.last() == self.end.as_ref();
            // Stopped pipes and cut files may end within a line.
            if read == 0 || (self.monitor.is_cut() || self.early_end.is_some()) && !has_end {
                self.damage = self.early_end.take().or(self.damage.take());
                self.monitor.end();
                return Ok(None);
            }
            // A piece of a line that is too long is not the last one.
            let is_last = !has_end && (read as u64) < MAX_LINE_BYTES;
            self.unended = is_last.then(|| Unended::new(self.line, &self.bytes));
            if self.bytes.contains(&0) {
                let length = self.bytes.len();
                self.bytes.retain(|byte| *byte != 0);
                self.zero_bytes += (length - self.bytes.len()) as u64;
                // The rest of a line of zeros follows.
                self.line -= u64::from(self.bytes.is_empty());
            } else if read as u64 == MAX_LINE_BYTES && !has_end && !self.are_rows {
                return Err(InputError::line(
                    &self.file,
                    self.line,
                    Reason::other("the line is longer than 65536 bytes"),
                ));
            }
            if !self.bytes.trim_ascii().is_empty() {
                break;
            }
        }
        self.is_latin = false;
        if let Ok(text) = text(&self.bytes) {
            return Ok(Some((self.line, text)));
        }
        // Control characters are no text; bytes of other encodings may be Latin-1's.
        let latin = self.bytes.trim_ascii().iter().map(|byte| char::from(*byte));
        if !self.are_rows && latin.clone().any(|letter| letter.is_ascii_control() && letter != '\t') {
            return Err(InputError::line(&self.file, self.line, Reason::other("not text in UTF-8 or Latin-1")));
        }
        self.latin.clear();
        self.latin.extend(latin);
        self.is_latin = true;
        Ok(Some((self.line, &self.latin)))
    }

    /// Into `bytes`. A text whose first lines have no line feed has lines that end in carriage returns.
    fn read_line(&mut self) -> io::Result<usize> {
        let end = self.end.unwrap_or(b'\n');
        let read = (&mut self.input).take(MAX_LINE_BYTES).read_until(end, &mut self.bytes)?;
        let first = if self.end.is_none() { self.bytes.iter().position(|byte| *byte == b'\r') } else { None };
        match first.filter(|_| self.bytes.last() != Some(&b'\n')) {
            Some(first) => {
                self.end = Some(b'\r');
                let rest = Cursor::new(self.bytes.split_off(first + 1));
                let later = std::mem::replace(&mut self.input, BufReader::new(Box::new(io::empty())));
                self.input = BufReader::with_capacity(BUFFER_BYTES, Box::new(rest.chain(later)));
                Ok(self.bytes.len())
            }
            None => {
                self.end = Some(end);
                Ok(read)
            }
        }
    }

    /// From here on all lines are rows, or damaged ones: one that is no text, or too long, costs itself alone.
    pub(crate) fn begin_rows(&mut self) {
        self.are_rows = true;
    }

    pub(crate) fn line(&self) -> u64 {
        self.line
    }

    /// In memory; may be empty before the end.
    pub(crate) fn buffer(&self) -> &[u8] {
        if self.again { &[] } else { self.input.buffer() }
    }

    /// The last line, if it is `line` and has no line end.
    pub(crate) fn unended(&self, line: u64) -> Option<Unended> {
        self.unended.filter(|last| last.line == line)
    }

    /// True if the text ends within `line`, which is no row; that is [damage](Self::take_damage).
    pub fn ends_within(&mut self, line: u64) -> bool {
        let is_cut = self.unended(line).is_some();
        if is_cut {
            self.damage = Some(Reason::Truncated { format: "text" });
        }
        is_cut
    }

    /// The reason for an early end, at the end.
    pub fn take_damage(&mut self) -> Option<Reason> {
        self.damage.take()
    }

    /// With its end; returns its number.
    pub(crate) fn consume_line(&mut self, bytes: usize) -> u64 {
        self.input.consume(bytes);
        self.line += 1;
        self.line
    }

    /// Bytes left out.
    pub(crate) fn zero_bytes(&self) -> u64 {
        self.zero_bytes
    }

    /// The next line without consuming it; `None` for blank lines only.
    ///
    /// # Errors
    /// As [`next_line`](Self::next_line).
    pub fn header(&mut self) -> Result<Option<&str>, InputError> {
        let found = self.next_line()?.is_some();
        self.again = found;
        Ok(found.then_some(if self.is_latin { self.latin.as_str() } else { text(&self.bytes).unwrap_or_default() }))
    }
}

/// A last line without line end.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Unended {
    line: u64,
    pub(crate) first: u8,
    pub(crate) is_in_quotes: bool,
}

impl Unended {
    fn new(line: u64, text: &[u8]) -> Self {
        let first = text.trim_ascii().first().copied().unwrap_or_default();
        let marks = text.iter().filter(|byte| **byte == b'"').count();
        Self { line, first, is_in_quotes: marks % 2 == 1 }
    }
}

/// By the mark of the byte order, or letters of which each has a byte that is zero.
pub(crate) fn is_utf16(start: &[u8]) -> bool {
    let start = &start[..start.len().min(UTF16_BYTES)];
    let has_zeros = |zero: usize| start.chunks(2).all(|unit| unit.get(zero) == Some(&0) && unit[1 - zero] != 0);
    start.starts_with(b"\xFF\xFE")
        || start.starts_with(b"\xFE\xFF")
        || start.len() == UTF16_BYTES && (has_zeros(0) || has_zeros(1))
}

impl Drop for Lines {
    fn drop(&mut self) {
        self.monitor.end();
    }
}

fn text(bytes: &[u8]) -> Result<&str, std::str::Utf8Error> {
    let plain = bytes.trim_ascii();
    if let [first, .., last] = plain
        && first.is_ascii_graphic()
        && last.is_ascii_graphic()
    {
        return std::str::from_utf8(plain);
    }
    std::str::from_utf8(bytes).map(|text| text.trim_start_matches('\u{feff}').trim())
}

fn read_failure(error: io::Error) -> Reason {
    match error.kind() {
        io::ErrorKind::InvalidInput => Reason::other(format!("damaged gzip: {error}")),
        io::ErrorKind::InvalidData => Reason::other("bytes after the end of the gzip data that are no gzip data"),
        _ => Reason::ended("gzip", error),
    }
}

/// Without blanks and quotation marks of either kind.
pub fn field(raw: &str) -> &str {
    // Mostly neither.
    let is_bare = |byte: Option<&u8>| byte.is_none_or(|byte| byte.is_ascii_graphic() && !matches!(byte, b'"' | b'\''));
    if is_bare(raw.as_bytes().first()) && is_bare(raw.as_bytes().last()) {
        return raw;
    }
    let trimmed = raw.trim();
    let inner = |mark: char| trimmed.strip_prefix(mark).and_then(|inner| inner.strip_suffix(mark));
    inner('"').or_else(|| inner('\'')).unwrap_or(trimmed)
}

/// For messages.
pub fn quote(text: &str) -> String {
    text.chars().take(32).collect()
}

/// A finite time in seconds.
pub fn time(text: &str) -> Result<f64, Reason> {
    match text.parse::<f64>() {
        Ok(time) if time.is_finite() => Ok(time),
        Ok(_) => Err(Reason::NotFinite(quote(text))),
        Err(_) => Err(Reason::NotNumber(quote(text))),
    }
}

#[cfg(test)]
mod tests {
    use super::Lines;
    use crate::input::FileBytes;
    use std::path::Path;

    fn lines(bytes: &[u8]) -> Vec<String> {
        let mut lines = Lines::open(&FileBytes::in_memory(Path::new("rows.txt"), bytes)).expect("text");
        std::iter::from_fn(|| lines.next_line().expect("a line").map(|(_, text)| text.to_owned())).collect()
    }

    /// Characters of one and two units at every place of a buffer, halves of pairs alone, and a byte too many.
    #[test]
    fn text_in_utf_16_is_what_was_written() {
        for shift in 0..4 {
            let written = vec![format!("begin 1{}a°語😀", "x".repeat(shift)); 9000];
            let text = written.join("\n");
            for to_bytes in [u16::to_le_bytes, u16::to_be_bytes] {
                let marked: Vec<u8> = std::iter::once(0xFEFF).chain(text.encode_utf16()).flat_map(to_bytes).collect();
                assert!(lines(&marked) == written && lines(&marked[2..]) == written, "{shift}");
            }
        }
        assert_eq!(lines(&[0xFF, 0xFE]), [""; 0]);
        assert_eq!(lines(&[0xFF, 0xFE, 0x00, 0xDC, b'a', 0]), ["\u{FFFD}a"]);
        assert_eq!(lines(&[0xFF, 0xFE, b'a', 0, 0x3D, 0xD8]), ["a\u{FFFD}"]);
        assert_eq!(lines(&[0xFE, 0xFF, 0, b'a', 0]), ["a\u{FFFD}"]);
    }
}
