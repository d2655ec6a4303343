//! Reports that `analyze --json` wrote.

use anyhow::{Error, Result};
use recordings::{InputError, Reason};
use reports::saved_report::SavedReport;
use std::fs;
use std::path::Path;

/// Reads the JSON that `analyze --json` wrote.
///
/// # Errors
/// Names the file.
pub(crate) fn read_report(file: &Path) -> Result<SavedReport> {
    let text = fs::read_to_string(file).map_err(|error| InputError::file(file, Reason::Io(error)))?;
    let checked = SavedReport::from_json(&text).and_then(|report| report.check().map(|()| report));
    checked.map_err(|error| Error::from(error).context(file.display().to_string()))
}
