//! Files that the program writes: none is a file that it reads, under whatever name, and each is complete or as it was.

use crate::program::{counts as table, error_line, host_sim, signal, wait_until, with_default_signals, write};
use recordings::frame_log::FrameLogReader;
use std::fs::{self, File};
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
use tempfile::tempdir;

const PROGRAM: &str = env!("CARGO_BIN_EXE_host-sim");

fn name(file: &Path) -> &str {
    file.to_str().expect("UTF-8")
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
    for name_of_signal in ["TERM", "HUP", "INT"] {
        let dir = tempdir().expect("a folder");
        let log = write(&dir, "log.csv", b"an old log\n");
        let mut program = with_default_signals()
            .args(["simulate", name(&log), "--format", "frames", "--seconds", "80000"])
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .expect("the program starts");
        wait_until("a file beside the old one", || names(dir.path()).len() == 2);
        signal(&program, name_of_signal);
        let status = program.wait().expect("an end");
        assert!(!status.success(), "{name_of_signal}");
        assert_eq!(fs::read(&log).expect("the old log"), b"an old log\n", "{name_of_signal}");
        assert_eq!(names(dir.path()), ["log.csv"], "{name_of_signal}");
    }
}

/// The signals of a process that are ignored or caught, where bit 0 is a hang-up.
fn signals(program: &Child, kind: &str) -> u64 {
    let status = fs::read_to_string(format!("/proc/{}/status", program.id())).expect("a process");
    let mask = status.lines().find_map(|line| line.strip_prefix(kind)).expect(kind);
    u64::from_str_radix(mask.trim_start_matches(':').trim(), 16).expect("a mask")
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
    let written = || {
        let files = fs::read_dir(dir.path()).expect("the folder").filter_map(|file| file.ok()?.metadata().ok());
        files.map(|file| file.len()).sum::<u64>()
    };
    wait_until("a log is begun", || written() > 0);
    assert_eq!((signals(&program, "SigIgn") & 1, signals(&program, "SigCgt") & 1), (1, 0), "still ignored");
    signal(&program, "HUP");
    let before = written();
    wait_until("the log grows", || written() > before);
    assert!(program.try_wait().expect("a status").is_none(), "it goes on");
    program.kill().expect("an end");
    program.wait().expect("an end");
}

/// The bursts of a log up to its end, or to the line that a kill has torn, and the error about that.
fn bursts(log: &Path) -> (u32, Option<String>) {
    let mut reader = match FrameLogReader::open(log) {
        Ok(reader) => reader,
        Err(error) => return (0, Some(error.to_string())),
    };
    let mut bursts = 0;
    loop {
        match reader.next() {
            Ok(Some(frame)) => bursts += u32::from(frame.mosi.len() == 26),
            Ok(None) => return (bursts, None),
            Err(error) => return (bursts, Some(error.to_string())),
        }
    }
}

/// A long simulation that is interrupted, hung up or killed leaves a log whose bursts can be read up to then, plain or gzip.
#[test]
fn an_interrupted_simulation_leaves_a_log_that_can_be_read() {
    let dir = tempdir().expect("a folder");
    for (name_of_signal, file) in [("INT", "a.csv.gz"), ("HUP", "b.csv.gz"), ("KILL", "c.csv")] {
        let log = dir.path().join(file);
        let mut record = with_default_signals()
            .args(["record", name(&log), "--seconds", "50000"])
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .expect("the program starts");
        wait_until("bursts are in the log", || bursts(&log).0 > 100);
        signal(&record, name_of_signal);
        assert!(!record.wait().expect("an end").success(), "{name_of_signal}: it ended by itself");
        let (bursts, torn) = bursts(&log);
        assert!(bursts > 100, "{name_of_signal}: {bursts} bursts");
        if let Some(error) = torn {
            // A kill may end the program within a write to the disk, so that its last line is torn.
            let last = fs::read_to_string(&log).map_or(0, |text| text.lines().count());
            let is_last = name_of_signal == "KILL" && error.contains(&format!("line {last}"));
            assert!(is_last, "{name_of_signal}: {error}");
        }
    }
}

#[test]
fn a_full_disk_is_named() {
    for arguments in [
        &["record", "/dev/full", "--seconds", "5"][..],
        &["simulate", "/dev/full", "--seconds", "5"],
        &["simulate", "/dev/full", "--seconds", "5", "--format", "frames"],
    ] {
        let line = error_line(&host_sim(arguments));
        assert!(line.contains("/dev/full") && line.contains("No space left"), "{arguments:?}: {line}");
    }
    // The report is printed all the same.
    let output = host_sim(&["record", "/dev/null", "--seconds", "2", "--export", "csv=/dev/full"]);
    let error = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.code() == Some(1) && error.contains("No space left"), "{error}");
    assert!(String::from_utf8_lossy(&output.stdout).contains("angle random walk"));
}

/// A simulation of hours is not begun: its log is not there.
#[test]
fn outputs_are_checked_before_the_work_and_never_overwrite_the_input() {
    let dir = tempdir().expect("a folder");
    let file = table(&dir);
    let rows = fs::read(&file).expect("rows");
    let [link, log, blocked] = ["link.csv", "log.csv", "blocked"].map(|name| dir.path().join(name));
    std::os::unix::fs::symlink(&file, &link).expect("a link");
    let nowhere = dir.path().join("missing").join("out");
    // Folders whose files cannot be written: a file is in the way, or a folder of the name of the page or of the figure.
    for inside in ["index.html", "overview.svg"] {
        fs::create_dir_all(blocked.join(inside)).expect("a folder");
    }
    for (option, prefix) in [("--json", ""), ("--export", "kalibr=")] {
        let value = |file: &Path| format!("{prefix}{}", name(file));
        for same in [&file, &link] {
            is_refused(&host_sim(&["analyze", name(&file), option, &value(same)]));
        }
        let line = error_line(&host_sim(&["record", name(&log), "--seconds", "20000", option, &value(&nowhere)]));
        assert!(line.contains("No such file") && !log.exists(), "{line}");
    }
    for (option, folder) in [("--page", &file), ("--pictures", &file), ("--page", &blocked), ("--pictures", &blocked)] {
        let line = error_line(&host_sim(&["record", name(&log), "--seconds", "20000", option, name(folder)]));
        assert!(line.contains(name(folder)) && !log.exists(), "{option}: {line}");
    }
    let twice = dir.path().join("twice");
    let export = format!("csv={}", name(&twice));
    let line = error_line(&host_sim(&["analyze", name(&file), "--json", name(&twice), "--export", &export]));
    assert!(line.contains("named twice"), "{line}");
    for command in [
        &["compare", name(&file), "--data-sheet", "--json", name(&file)][..],
        &["compare", name(&file), name(&file), "--json", name(&file)],
        &["convert", name(&file), name(&link)],
        &["export", "--format", "kalibr", name(&file), name(&link)],
    ] {
        is_refused(&host_sim(command));
    }
    assert!(fs::read(&file).expect("the input") == rows);
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

/// Two reports and no file to write: the second one stays.
#[test]
fn an_export_does_not_overwrite_a_report() {
    let dir = tempdir().expect("a folder");
    let table = table(&dir);
    let [one, other] = ["one.json", "other.json"].map(|name| dir.path().join(name));
    for report in [&one, &other] {
        let arguments = ["analyze", name(&table), "--quiet", "--json", name(report)];
        assert!(host_sim(&arguments).status.success());
    }
    let before = std::fs::read(&other).expect("a report");
    let line = error_line(&host_sim(&["export", name(&one), name(&other), "--format", "kalibr"]));
    assert!(line.contains("other.json") && line.contains("is a report"), "{line}");
    assert_eq!(std::fs::read(&other).expect("a report"), before);
}
