//! Reports that `analyze --json` wrote.

use anyhow::{Error, Result};
use recordings::{InputError, Reason};
use reports::saved_report::SavedReport;
use std::fs::{self, File};
use std::io::Read;
use std::path::Path;

/// Bytes that tell a report.
const HEAD: u64 = 64;

/// True if a file begins as the JSON of a report; a pipe is not looked at.
pub(crate) fn is_report(file: &Path) -> bool {
    let mut head = Vec::new();
    let is_file = file.is_file();
    let mut read = || File::open(file)?.take(HEAD).read_to_end(&mut head);
    is_file && read().is_ok() && head.trim_ascii_start().starts_with(b"{")
}

/// Reads the JSON that `analyze --json` wrote.
///
/// # Errors
/// Names the file.
pub(crate) fn read_report(file: &Path) -> Result<SavedReport> {
    let text = fs::read_to_string(file).map_err(|error| InputError::file(file, Reason::Io(error)))?;
    let checked = SavedReport::from_json(&text).and_then(|report| report.check().map(|()| report));
    checked.map_err(|error| Error::from(error).context(file.display().to_string()))
}
