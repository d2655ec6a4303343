//! Folders of tables.

use super::{InputError, Reason};
use std::path::{Path, PathBuf};

/// Endings of the names of tables.
const ENDINGS: [&str; 2] = [".csv", ".csv.gz"];

/// The tables in `path` by name, if it is a folder; else `path` itself.
///
/// # Errors
/// The folder cannot be read, or no name in it ends in `.csv` or `.csv.gz`.
pub fn tables(path: &Path) -> Result<Vec<PathBuf>, InputError> {
    if !path.is_dir() {
        return Ok(vec![path.to_owned()]);
    }
    let fail = |error| InputError::file(path, Reason::Io(error));
    let entries: Result<Vec<PathBuf>, _> =
        path.read_dir().map_err(fail)?.map(|entry| entry.map(|entry| entry.path())).collect();
    let named = |file: &PathBuf| ENDINGS.iter().any(|ending| file.to_string_lossy().ends_with(ending));
    let mut tables: Vec<PathBuf> = entries.map_err(fail)?.into_iter().filter(named).collect();
    tables.sort();
    if tables.is_empty() { Err(InputError::file(path, Reason::NoTables)) } else { Ok(tables) }
}
