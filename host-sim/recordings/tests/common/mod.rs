//! The measured recordings.

use std::io::Write;
use std::path::{Path, PathBuf};

/// A measured recording, or `None`, with a word why, where there is none.
pub(crate) fn recording(test: &str, name: &str) -> Option<PathBuf> {
    let folder = std::env::var_os("ADIS_RECORDINGS")
        .map_or_else(|| Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data"), PathBuf::from);
    let file = folder.join(name);
    if file.exists() {
        return Some(file);
    }
    // Not by a macro, which the test harness would hide.
    writeln!(std::io::stderr(), "skipped {test}: {} is absent (set ADIS_RECORDINGS)", file.display()).expect("stderr");
    None
}
