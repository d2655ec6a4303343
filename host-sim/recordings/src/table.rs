//! Comma-separated text, line by line, with the true number of every line.
//!
//! Both formats of this project are plain numbers between commas, one row a line. The general `csv` reader is not used
//! because the line that it reports is wrong after a blank line and in files with CR LF ends, and an error here
//! promises the line that an editor shows.

use super::open::{Input, open, read_error};
use super::{InputError, Reason};
use std::io::{BufRead, Read};
use std::path::{Path, PathBuf};

/// Longest line that is read, bytes; more is not a table.
const LONGEST_LINE: u64 = 1 << 16;

/// An open file, read one line at a time.
pub(super) struct Table {
    file: PathBuf,
    input: Input,
    line: u64,
    bytes: Vec<u8>,
}

impl Table {
    /// Opens `file`, which may be gzip.
    pub(super) fn open(file: &Path) -> Result<Self, InputError> {
        Ok(Self { file: file.to_owned(), input: open(file)?, line: 0, bytes: Vec::new() })
    }

    /// The next line that is not blank, with its number from 1; `None` at the end of the file.
    pub(super) fn next(&mut self) -> Result<Option<(u64, &str)>, InputError> {
        loop {
            self.line += 1;
            self.bytes.clear();
            let read = (&mut self.input)
                .take(LONGEST_LINE)
                .read_until(b'\n', &mut self.bytes)
                .map_err(|e| read_error(&self.file, self.line, e))?;
            if read == 0 {
                return Ok(None);
            }
            if read as u64 == LONGEST_LINE && self.bytes.last() != Some(&b'\n') {
                return Err(InputError::line(&self.file, self.line, Reason::LongLine));
            }
            if !self.bytes.trim_ascii().is_empty() {
                break;
            }
        }
        match std::str::from_utf8(&self.bytes) {
            Ok(text) => Ok(Some((self.line, text.trim_start_matches('\u{feff}').trim()))),
            Err(_) => Err(InputError::line(&self.file, self.line, Reason::NotText)),
        }
    }
}

/// A field without the blanks and the quotes around it.
pub(super) fn field(raw: &str) -> &str {
    let trimmed = raw.trim();
    trimmed.strip_prefix('"').and_then(|t| t.strip_suffix('"')).unwrap_or(trimmed)
}

/// What an error quotes of a field: enough to find it.
pub(super) fn quote(text: &str) -> String {
    text.chars().take(32).collect()
}

/// A finite time in seconds.
pub(super) fn time(text: &str) -> Result<f64, Reason> {
    match text.parse::<f64>() {
        Ok(time) if time.is_finite() => Ok(time),
        Ok(_) => Err(Reason::NotFinite(quote(text))),
        Err(_) => Err(Reason::NotNumber(quote(text))),
    }
}
