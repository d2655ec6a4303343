//! Reports, read from the JSON of `analyze` or made of recordings.

use crate::analyze::watched_report;
use crate::cli::RecordingArguments;
use crate::inspect::read_or_ask;
use crate::output::Incomplete;
use anyhow::{Error, Result};
use recordings::{InputError, Reason};
use reports::saved_report::SavedReport;
use std::fs::{self, File};
use std::io::Read;
use std::path::Path;

/// Bytes at the beginning of a file by which a report is recognised.
const HEAD: u64 = 64;

/// True if a file begins as the JSON of a report; a pipe is not read.
pub(crate) fn is_report(file: &Path) -> bool {
    let mut head = Vec::new();
    let is_file = file.is_file();
    let mut read = || File::open(file)?.take(HEAD).read_to_end(&mut head);
    is_file && read().is_ok() && head.trim_ascii_start().starts_with(b"{")
}

/// Reads the JSON that `analyze` wrote.
///
/// # Errors
/// The error names the file.
fn read_report(file: &Path) -> Result<SavedReport> {
    let text = fs::read_to_string(file).map_err(|error| InputError::file(file, Reason::Io(error)))?;
    let checked = SavedReport::from_json(&text).and_then(|report| report.check().map(|()| report));
    checked.map_err(|error| Error::from(error).context(file.display().to_string()))
}

/// Reads or makes reports one after the other.
#[derive(Debug, Default)]
pub(crate) struct Reports {
    has_incomplete: bool,
}

impl Reports {
    /// Reads the report in a file, or analyses the recording in it.
    ///
    /// # Errors
    /// The error names the file.
    pub(crate) fn read(&mut self, recording: &RecordingArguments) -> Result<SavedReport> {
        if is_report(&recording.input.file) {
            return read_report(&recording.input.file);
        }
        let analysed = read_or_ask(recording, |recording| watched_report(recording, false))?;
        self.has_incomplete |= !analysed.is_complete();
        Ok(SavedReport::new(&analysed.report)?)
    }

    /// An error if a recording was not read to its end.
    pub(crate) fn check_complete(&self) -> Result<()> {
        Incomplete::check(!self.has_incomplete)
    }
}
