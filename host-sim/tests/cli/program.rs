//! Runs the program and writes its input files.

use flate2::Compression;
use flate2::write::GzEncoder;
use serde_json::Value;
use std::io::{ErrorKind, Write};
use std::path::PathBuf;
use std::process::{Child, Command, Output};
use std::thread;
use std::time::Duration;
use system_tests::FlightLog;
use tempfile::TempDir;

/// Runs the program.
pub(crate) fn imunoise(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_imunoise")).args(arguments).output().expect("the program starts")
}

/// The program as a terminal starts it: a shell in the background lets what it starts ignore interrupts, and `nohup` hang-ups.
pub(crate) fn with_default_signals() -> Command {
    let mut command = Command::new("env");
    command.args(["--default-signal=INT,HUP,TERM", env!("CARGO_BIN_EXE_imunoise")]);
    command
}

/// Runs the program with `-o report.json` and returns the bytes of the report.
pub(crate) fn json_of(dir: &TempDir, arguments: &[&str]) -> Vec<u8> {
    let out = dir.path().join("report.json");
    let output = imunoise(&[arguments, &["-o", out.to_str().expect("UTF-8")]].concat());
    assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
    let bytes = std::fs::read(&out).expect("a report");
    std::fs::remove_file(&out).expect("removed");
    bytes
}

/// A report without what was read for it: the same samples in another file have the same one.
pub(crate) fn analysis_of(dir: &TempDir, arguments: &[&str]) -> Value {
    without_reading(&json_of(dir, arguments))
}

/// The same of the bytes of a report.
pub(crate) fn without_reading(bytes: &[u8]) -> Value {
    let mut report: Value = serde_json::from_slice(bytes).expect("JSON");
    report.as_object_mut().expect("an object").remove("reading");
    report
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

/// Waits until a condition is met. The bound ends a test that hangs; no result depends on it.
pub(crate) fn wait_until(what: &str, mut condition: impl FnMut() -> bool) {
    const PATIENCE: Duration = Duration::from_secs(120);
    const LOOK: Duration = Duration::from_millis(5);
    let looks = PATIENCE.as_millis() / LOOK.as_millis();
    for _ in 0..looks {
        if condition() {
            return;
        }
        thread::sleep(LOOK);
    }
    panic!("never: {what}");
}

/// Sends a signal, such as `INT`, to a program.
pub(crate) fn signal(program: &Child, name: &str) {
    let sent = Command::new("kill").args([&format!("-{name}"), &program.id().to_string()]).status();
    assert!(sent.expect("kill starts").success(), "{name}");
}

/// The error of a command that fails with one line: `error: ` and the reason, without a report and without a character that a terminal obeys.
pub(crate) fn error_line(output: &Output) -> String {
    let error = String::from_utf8(output.stderr.clone()).expect("UTF-8");
    assert_eq!(output.status.code(), Some(1), "{error}");
    let is_line = error.starts_with("error: ") && error.lines().count() == 1 && !error.contains('\u{1b}');
    assert!(is_line && output.stdout.is_empty(), "{error:?}");
    error
}

/// A table of one gyro's counts at 100 Hz with time stamps.
pub(crate) fn counts(dir: &TempDir) -> PathBuf {
    let rows: String = (0..2000).map(|at| format!("{},{}\n", f64::from(at) / 100.0, at * 7919 % 41)).collect();
    write(dir, "rows.csv", format!("time_s,gyro_x_counts\n{rows}").as_bytes())
}

/// Writes of `unsent` what the port takes before its timeout. A port that the program has closed takes everything.
pub(crate) fn send(port: &mut impl Write, unsent: &mut Vec<u8>) {
    match port.write(unsent) {
        Ok(count) => drop(unsent.drain(..count)),
        Err(error) if error.kind() == ErrorKind::TimedOut => {}
        Err(_) => unsent.clear(),
    }
}

/// A log of PX4 whose rows are a gyroscope at 250 Hz.
pub(crate) fn flight_log(rows: u64) -> Vec<u8> {
    let mut log = FlightLog::empty();
    log.add(b'F', b"sensor_gyro:uint64_t timestamp;float x;float y;float z;");
    log.add(b'A', b"\0\0\0sensor_gyro");
    for row in 0..rows {
        let axes = [0u64, 1, 2].map(|axis| ((row + axis) * 7919 % 1009) as f32 * 1e-5 - 5e-3).map(f32::to_le_bytes);
        log.add(b'D', &[&[0, 0][..], &(row * 4000).to_le_bytes(), &axes.concat()].concat());
    }
    log.0
}
