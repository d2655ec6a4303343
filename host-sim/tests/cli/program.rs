//! Runs the program and writes its input files.

use flate2::Compression;
use flate2::write::GzEncoder;
use std::io::Write;
use std::path::PathBuf;
use std::process::{Command, Output};
use tempfile::TempDir;

/// Runs the program.
pub(crate) fn host_sim(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_host-sim")).args(arguments).output().expect("the program starts")
}

/// The program as a terminal starts it: a shell in the background lets what it starts ignore interrupts, and `nohup` hang-ups.
pub(crate) fn with_default_signals() -> Command {
    let mut command = Command::new("env");
    command.args(["--default-signal=INT,HUP,TERM", env!("CARGO_BIN_EXE_host-sim")]);
    command
}

/// Runs the program with `--json` and returns the bytes of the report.
pub(crate) fn json_of(dir: &TempDir, arguments: &[&str]) -> Vec<u8> {
    let out = dir.path().join("report.json");
    let output = host_sim(&[arguments, &["--json", out.to_str().expect("UTF-8")]].concat());
    assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
    let bytes = std::fs::read(&out).expect("a report");
    std::fs::remove_file(&out).expect("removed");
    bytes
}

/// Writes a file into a temporary folder.
pub(crate) fn write(dir: &TempDir, name: &str, bytes: &[u8]) -> PathBuf {
    let path = dir.path().join(name);
    std::fs::write(&path, bytes).expect("written");
    path
}

/// `bytes` as a gzip stream.
pub(crate) fn gzip(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::default());
    encoder.write_all(bytes).expect("memory");
    encoder.finish().expect("memory")
}
