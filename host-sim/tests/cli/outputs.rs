//! Files that the program writes: none is a file that it reads, under whatever name, and each is complete or as it was.

use crate::program::{host_sim, with_default_signals, write};
use std::fs::{self, File};
use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::thread;
use std::time::{Duration, Instant};
use tempfile::{TempDir, tempdir};

const PROGRAM: &str = env!("CARGO_BIN_EXE_host-sim");

fn name(file: &Path) -> &str {
    file.to_str().expect("UTF-8")
}

fn table(dir: &TempDir) -> std::path::PathBuf {
    let rows: String = (0..2000).map(|at| format!("{},{}\n", f64::from(at) / 100.0, at * 7919 % 41)).collect();
    write(dir, "rows.csv", format!("time_s,gyro_x_counts\n{rows}").as_bytes())
}

fn is_refused(output: &Output) {
    let error = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(!output.status.success() && error.contains("is an input"), "{error}");
}

#[test]
fn the_profile_of_the_sensor_is_an_input() {
    let dir = tempdir().expect("a folder");
    let rows = table(&dir);
    let profile = write(&dir, "p.toml", b"name = \"x\"\n");
    is_refused(&host_sim(&["analyze", name(&rows), "--sensor", name(&profile), "--json", name(&profile)]));
    assert_eq!(fs::read(&profile).expect("the profile"), b"name = \"x\"\n");
}

#[test]
fn another_name_of_an_input_is_the_input() {
    let dir = tempdir().expect("a folder");
    let rows = table(&dir);
    let content = fs::read(&rows).expect("rows");
    let hard = dir.path().join("hard.csv");
    fs::hard_link(&rows, &hard).expect("a link");
    is_refused(&host_sim(&["analyze", name(&rows), "--json", name(&hard)]));
    assert!(fs::read(&rows).expect("the input") == content);
}

#[test]
fn a_picture_that_leads_to_an_input_is_the_input() {
    let dir = tempdir().expect("a folder");
    let rows = table(&dir);
    let content = fs::read(&rows).expect("rows");
    let pictures = dir.path().join("pictures");
    fs::create_dir(&pictures).expect("a folder");
    std::os::unix::fs::symlink(&rows, pictures.join("gyro_x-allan.svg")).expect("a link");
    is_refused(&host_sim(&["analyze", name(&rows), "--pictures", name(&pictures)]));
    assert!(fs::read(&rows).expect("the input") == content);
}

#[test]
fn the_file_on_standard_input_is_an_input() {
    let dir = tempdir().expect("a folder");
    let rows = table(&dir);
    let content = fs::read(&rows).expect("rows");
    let output = Command::new(PROGRAM)
        .args(["analyze", "-", "--json", name(&rows)])
        .stdin(File::open(&rows).expect("rows"))
        .output()
        .expect("the program starts");
    is_refused(&output);
    assert!(fs::read(&rows).expect("the input") == content);
}

/// The program in a shell where no file may grow beyond 4 KiB, as on a full disk.
fn on_a_full_disk(arguments: &[&str]) -> Output {
    let script = "trap '' XFSZ; ulimit -f 8; exec \"$@\"";
    let shell = [&["-c", script, "sh", PROGRAM], arguments].concat();
    Command::new("sh").args(shell).output().expect("a shell")
}

#[test]
fn a_file_that_cannot_be_written_whole_stays_as_it_was() {
    let dir = tempdir().expect("a folder");
    let rows = table(&dir);
    for (command, old) in [
        (&["convert"][..], "old.csv"),
        (&["analyze", "--quiet", "--json"], "old.json"),
        (&["analyze", "--quiet", "--page"], "index.html"),
    ] {
        let old = write(&dir, old, b"an old report\n");
        let out = if command.last() == Some(&"--page") { dir.path() } else { old.as_path() };
        let arguments: Vec<&str> = match command {
            [only] => vec![only, name(&rows), name(out)],
            [first, rest @ ..] => [&[first, name(&rows)], rest, &[name(out)]].concat(),
            [] => Vec::new(),
        };
        let output = on_a_full_disk(&arguments);
        let error = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(!output.status.success() && error.contains("too large"), "{command:?}: {error}");
        assert_eq!(fs::read(&old).expect("the old file"), b"an old report\n", "{command:?}");
        fs::remove_file(&old).expect("removed");
    }
    assert_eq!(names(dir.path()), ["rows.csv"], "nothing is left beside");
}

fn names(folder: &Path) -> Vec<String> {
    let entries = fs::read_dir(folder).expect("the folder");
    let mut names: Vec<String> =
        entries.map(|entry| entry.expect("a file").file_name().to_string_lossy().into_owned()).collect();
    names.sort();
    names
}

#[test]
fn a_signal_leaves_the_old_file_and_nothing_beside_it() {
    for signal in ["-TERM", "-HUP", "-INT"] {
        let dir = tempdir().expect("a folder");
        let log = write(&dir, "log.csv", b"an old log\n");
        let mut program = with_default_signals()
            .args(["simulate", name(&log), "--format", "frames", "--seconds", "80000"])
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .expect("the program starts");
        let started = Instant::now();
        while names(dir.path()).len() < 2 && started.elapsed() < Duration::from_secs(30) {
            thread::sleep(Duration::from_millis(20));
        }
        assert_eq!(names(dir.path()).len(), 2, "a file beside the old one");
        assert!(Command::new("kill").args([signal, &program.id().to_string()]).status().expect("kill").success());
        let status = program.wait().expect("an end");
        assert!(!status.success(), "{signal}");
        assert_eq!(fs::read(&log).expect("the old log"), b"an old log\n", "{signal}");
        assert_eq!(names(dir.path()), ["log.csv"], "{signal}");
    }
}

#[test]
fn a_hang_up_that_is_ignored_ends_nothing() {
    let dir = tempdir().expect("a folder");
    let log = dir.path().join("log.csv");
    let script = "trap '' HUP; exec \"$@\"";
    let mut program = Command::new("sh")
        .args(["-c", script, "sh", PROGRAM, "simulate", name(&log), "--format", "frames", "--seconds", "80000"])
        .stderr(Stdio::null())
        .spawn()
        .expect("a shell");
    let started = Instant::now();
    while names(dir.path()).is_empty() {
        assert!(started.elapsed() < Duration::from_secs(30), "no log is begun");
        thread::sleep(Duration::from_millis(20));
    }
    assert!(Command::new("kill").args(["-HUP", &program.id().to_string()]).status().expect("kill").success());
    thread::sleep(Duration::from_millis(500));
    assert!(program.try_wait().expect("a status").is_none(), "it goes on");
    program.kill().expect("an end");
    program.wait().expect("an end");
}

#[test]
fn links_and_permissions_of_an_output_stay() {
    use std::os::unix::fs::PermissionsExt;
    let dir = tempdir().expect("a folder");
    let rows = table(&dir);
    let real = write(&dir, "real.csv", b"old");
    fs::set_permissions(&real, fs::Permissions::from_mode(0o640)).expect("permissions");
    let link = dir.path().join("link.csv");
    std::os::unix::fs::symlink(&real, &link).expect("a link");
    let output = host_sim(&["convert", name(&rows), name(&link)]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    assert!(fs::symlink_metadata(&link).expect("the link").is_symlink());
    assert!(fs::read(&real).expect("a table").starts_with(b"time_s,gyro_x_counts\n"));
    assert_eq!(fs::metadata(&real).expect("a table").permissions().mode() & 0o777, 0o640);
}
