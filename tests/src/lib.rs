//! Shared by the tests of several crates: the measured recordings, the program, and the report of a skipped test.
//!
//! The tests of the noise observatory as a whole live in `tests/`.

use std::fs::OpenOptions;
use std::io::Write;
use std::path::PathBuf;
use std::process::Command;

/// The path of a measured recording in the folder that `ADIS_RECORDINGS` names. If it is absent, the test is reported as
/// skipped, and should return. Nothing else reads the variable, which a test of the architecture checks.
pub fn recording(test: &str, file: &str) -> Option<PathBuf> {
    let folder = std::env::var_os("ADIS_RECORDINGS").map(PathBuf::from);
    let path = folder.map(|folder| folder.join(file)).filter(|path| path.exists());
    if path.is_none() {
        note_skipped(test, &format!("{file} is not in the folder that ADIS_RECORDINGS names"));
    }
    path
}

/// Reports on standard error that a test was skipped, and appends `TEST: REASON` to the file that `SKIPPED_TESTS` names,
/// of which `run.sh` counts the tests.
pub fn note_skipped(test: &str, reason: &str) {
    // The output of `eprintln!` would be captured by the test harness.
    writeln!(std::io::stderr(), "skipped {test}: {reason}").expect("standard error");
    if let Some(file) = std::env::var_os("SKIPPED_TESTS") {
        let mut file = OpenOptions::new().create(true).append(true).open(file).expect("the file for skipped tests");
        // A single write keeps the lines of tests that run at the same time whole.
        file.write_all(format!("{test}: {reason}\n").as_bytes()).expect("room");
    }
}

/// The path of the program: that which `HOST_SIM` names, or built by cargo in the profile of the tests.
pub fn host_sim() -> PathBuf {
    if let Some(program) = std::env::var_os("HOST_SIM") {
        return program.into();
    }
    let build = Command::new(env!("CARGO"))
        .args(["build", "--quiet", "--locked", "--package", "host-sim", "--bin", "host-sim"])
        .status()
        .expect("cargo runs");
    assert!(build.success(), "host-sim does not build");
    let test = std::env::current_exe().expect("the path of this test");
    test.ancestors().nth(2).expect("target/debug").join("host-sim")
}
