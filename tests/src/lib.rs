//! What the tests of several crates share: the measured recordings, and how a test says that it was skipped.
//!
//! The tests of the noise observatory as a whole live in `tests/`.

use std::fs::OpenOptions;
use std::io::Write;
use std::path::PathBuf;

/// A measured recording by its path in the folder that `ADIS_RECORDINGS` names. Where it is absent the test is noted as
/// skipped: it returns without a further word.
pub fn recording(test: &str, file: &str) -> Option<PathBuf> {
    let folder = std::env::var_os("ADIS_RECORDINGS").map(PathBuf::from);
    let path = folder.map(|folder| folder.join(file)).filter(|path| path.exists());
    if path.is_none() {
        note_skipped(test, &format!("{file} is not in the folder that ADIS_RECORDINGS names"));
    }
    path
}

/// Says on standard error that a test was skipped, and appends `TEST: REASON` to the file that `SKIPPED_TESTS` names,
/// of which `run.sh` counts the tests.
pub fn note_skipped(test: &str, reason: &str) {
    // Not by a macro, whose output the test harness would capture.
    writeln!(std::io::stderr(), "skipped {test}: {reason}").expect("standard error");
    if let Some(file) = std::env::var_os("SKIPPED_TESTS") {
        let mut file = OpenOptions::new().create(true).append(true).open(file).expect("the file for skipped tests");
        // One write, so that the lines of tests that run beside each other stay whole.
        file.write_all(format!("{test}: {reason}\n").as_bytes()).expect("room");
    }
}
