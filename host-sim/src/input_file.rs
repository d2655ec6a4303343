//! A file that is not there: what its name was probably meant to be.

use anyhow::{Error, Result};
use recordings::{InputError, Reason};
use reports::saved_report::SavedReport;
use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

/// Jaro similarity above which a name is taken for a misspelt one, as the argument parser takes it for options.
const SIMILAR: f64 = 0.7;

/// Reads the JSON that `analyze --json` wrote.
///
/// # Errors
/// Names the file.
pub(crate) fn read_report(file: &Path) -> Result<SavedReport> {
    let text = fs::read_to_string(file).map_err(|error| InputError::file(file, Reason::Io(error)))?;
    SavedReport::from_json(&text).map_err(|error| Error::from(error).context(file.display().to_string()))
}

/// If `error` is that a file does not exist: the file in the same folder whose name is most similar.
pub(crate) fn similar_file(error: &Error) -> Option<PathBuf> {
    let InputError { file, reason: Reason::Io(reason), .. } = error.downcast_ref()? else { return None };
    if reason.kind() != ErrorKind::NotFound {
        return None;
    }
    let name = file.file_name()?.to_string_lossy();
    let folder = file.parent().filter(|folder| !folder.as_os_str().is_empty());
    let candidates =
        fs::read_dir(folder.unwrap_or(Path::new("."))).ok()?.filter_map(Result::ok).map(|entry| entry.file_name());
    let similarity = |candidate: &std::ffi::OsString| strsim::jaro(&name, &candidate.to_string_lossy());
    let nearest = candidates.max_by(|a, b| similarity(a).total_cmp(&similarity(b)))?;
    (similarity(&nearest) > SIMILAR).then(|| file.with_file_name(nearest))
}
