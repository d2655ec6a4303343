//! Reports that `analyze` wrote as JSON, or makes of recordings.

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

/// Bytes that tell a report.
const HEAD: u64 = 64;

/// True if a file begins as the JSON of a report; a pipe is not looked at.
pub(crate) fn is_report(file: &Path) -> bool {
    let mut head = Vec::new();
    let is_file = file.is_file();
    let mut read = || File::open(file)?.take(HEAD).read_to_end(&mut head);
    is_file && read().is_ok() && head.trim_ascii_start().starts_with(b"{")
}

/// Reads the JSON that `analyze` wrote.
///
/// # Errors
/// Names the file.
fn read_report(file: &Path) -> Result<SavedReport> {
    let text = fs::read_to_string(file).map_err(|error| InputError::file(file, Reason::Io(error)))?;
    let checked = SavedReport::from_json(&text).and_then(|report| report.check().map(|()| report));
    checked.map_err(|error| Error::from(error).context(file.display().to_string()))
}

/// Reports that are read or made one after the other.
#[derive(Debug, Default)]
pub(crate) struct Reports {
    has_incomplete: bool,
}

impl Reports {
    /// The report in a file, or that of the recording in it.
    ///
    /// # Errors
    /// Names the file.
    pub(crate) fn read(&mut self, recording: &RecordingArguments) -> Result<SavedReport> {
        if is_report(&recording.input.file) {
            return read_report(&recording.input.file);
        }
        let analysed = read_or_ask(recording, |recording| watched_report(recording, false))?;
        self.has_incomplete |= !analysed.is_complete();
        Ok(SavedReport::from(&analysed.report))
    }

    /// An error if a recording was not read to its end.
    pub(crate) fn check_complete(&self) -> Result<()> {
        Incomplete::check(!self.has_incomplete)
    }
}
