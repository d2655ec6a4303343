//! Recordings that come through standard input or a named pipe.

use crate::program::{analysis_of, counts, imunoise, without_reading};
use std::fs::{self, File};
use std::process::{Command, Stdio};
use tempfile::tempdir;

/// The report of a file through a pipe is that of the file; the first line has the name of the recording.
#[test]
fn standard_input_is_read_like_a_file() {
    let dir = tempdir().expect("a folder");
    let file = counts(&dir);
    let direct = imunoise(&["analyze", file.to_str().expect("UTF-8")]);
    assert!(direct.status.success(), "{}", String::from_utf8_lossy(&direct.stderr));
    let piped = Command::new(env!("CARGO_BIN_EXE_imunoise"))
        .args(["analyze", "-"])
        .stdin(File::open(&file).expect("written"))
        .output()
        .expect("the program starts");
    let lines = |output: &[u8]| String::from_utf8_lossy(output).lines().map(str::to_owned).collect::<Vec<_>>();
    let (piped, direct) = (lines(&piped.stdout), lines(&direct.stdout));
    assert!(direct[0].contains("rows.csv") && piped[0].contains("standard input"), "{} {}", direct[0], piped[0]);
    assert_eq!(piped[1..], direct[1..]);
}

/// A named pipe gives its bytes once: the program that reads it again waits for a second writer.
#[test]
fn a_named_pipe_is_read_once() {
    let dir = tempdir().expect("a folder");
    let file = counts(&dir);
    let pipe = dir.path().join("pipe");
    assert!(Command::new("mkfifo").arg(&pipe).status().expect("mkfifo").success());
    for command in ["analyze", "replay"] {
        let out = dir.path().join(format!("{command}.json"));
        let mut program = Command::new(env!("CARGO_BIN_EXE_imunoise"))
            .args([command, pipe.to_str().expect("UTF-8"), "-o", out.to_str().expect("UTF-8")])
            .stdout(Stdio::null())
            .spawn()
            .expect("the program starts");
        fs::copy(&file, &pipe).expect("the program reads");
        assert!(program.wait().expect("an end").success(), "{command}");
        let piped = without_reading(&fs::read(&out).expect("a report"));
        assert!(piped == analysis_of(&dir, &[command, file.to_str().expect("UTF-8")]), "{command}");
    }
}
