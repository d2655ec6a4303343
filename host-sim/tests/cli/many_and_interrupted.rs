//! `batch` of many files and folders, and the interruption of the reading.

use crate::program::{imunoise, json_of, signal, wait_until, write};
use serde_json::Value;
use std::fs::{self, File, OpenOptions};
use std::io::{Read, Write};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use tempfile::tempdir;

/// White noise of 50 s at 100 Hz in one gyro, made by a linear congruential generator.
fn table(seed: u64, rows: usize) -> String {
    let mut state = seed;
    let mut next = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 59) as i64 - 16
    };
    let rows = (0..rows).map(|_| format!("{}\n", next()));
    ["gyro_x_counts\n".to_owned()].into_iter().chain(rows).collect()
}

fn text(path: &Path) -> &str {
    path.to_str().expect("UTF-8")
}

#[test]
fn each_report_of_many_is_that_of_the_file_alone() {
    let dir = tempdir().expect("a folder");
    let files = ["a.csv", "b.csv", "c.csv"].map(|name| write(&dir, name, table(name.len() as u64, 5000).as_bytes()));
    let [a, b, c] = [&files[0], &files[1], &files[2]].map(|file| text(file));
    let damaged = write(&dir, "damaged.csv", b"gyro_x_counts\n1\nx\n");
    for quick in [&[][..], &["--quick"]] {
        let reports = dir.path().join("reports");
        let arguments = ["batch", a, text(&damaged), b, c, "--rate", "100", "-o", text(&reports)];
        let output = imunoise(&[&arguments[..], quick].concat());
        let (printed, errors) =
            (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr).into_owned());
        assert_eq!(output.status.code(), Some(1), "{errors}");
        assert!(printed.contains("3 of 4 reports"), "{printed}");
        assert!(errors.contains("damaged.csv: line 3") && errors.contains("1 of 4 recordings"), "{errors}");
        for file in [a, b, c] {
            let alone = json_of(&dir, &[&["analyze", file, "--rate", "100", "--quiet"][..], quick].concat());
            let name = Path::new(file).with_extension("json");
            let among = std::fs::read(reports.join(name.file_name().expect("a name"))).expect("a report");
            assert!(alone == among, "{file}");
        }
        assert!(!reports.join("damaged.json").exists());
        std::fs::remove_dir_all(&reports).expect("removed");
    }
}

#[test]
fn reports_of_one_name_are_refused_before_any_work() {
    let dir = tempdir().expect("a folder");
    let one = write(&dir, "imu.csv", table(1, 100).as_bytes());
    std::fs::create_dir(dir.path().join("other")).expect("a folder");
    let other = write(&dir, "other/imu.csv", table(2, 100).as_bytes());
    let reports = dir.path().join("reports");
    let arguments = ["batch", text(&one), text(&other), "--rate", "100", "-o", text(&reports)];
    let output = imunoise(&arguments);
    let error = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(!output.status.success() && error.contains("would both have the report"), "{error}");
    assert!(!reports.exists());
}

/// A folder has its reports in the same folders, and a row a coefficient; a second run leaves out what is there.
#[test]
fn the_reports_of_a_folder_mirror_it_and_are_resumed() {
    let dir = tempdir().expect("a folder");
    fs::create_dir_all(dir.path().join("fleet/one/deep")).expect("folders");
    for (seed, name) in (1..).zip(["fleet/imu.csv", "fleet/one/imu.csv", "fleet/one/deep/imu.csv", "fleet/.hidden.csv"])
    {
        write(&dir, name, table(seed, 2000).as_bytes());
    }
    let damaged = write(&dir, "fleet/damaged.csv", b"gyro_x_counts\n1\nx\n");
    let [fleet, reports, rows] = ["fleet", "reports", "rows.ndjson"].map(|name| dir.path().join(name));
    let arguments = ["batch", text(&fleet), "-o", text(&reports), "--rows", text(&rows), "--rate", "100", "-j", "1"];
    let run = |more: &[&str]| {
        let output = imunoise(&[&arguments[..], more].concat());
        let printed = [output.stdout, output.stderr].map(|bytes| String::from_utf8_lossy(&bytes).into_owned());
        (output.status.code(), printed)
    };
    let read = || -> Vec<Value> {
        let text = fs::read_to_string(&rows).expect("rows");
        text.lines().map(|line| serde_json::from_str(line).expect("a row")).collect()
    };
    let of_recordings = || -> Vec<(Value, Value)> {
        let rows = read().into_iter().filter(|row| row["row"] == "recording");
        rows.map(|row| (row["recording"].clone(), row["status"].clone())).collect()
    };
    let (code, [printed, errors]) = run(&[]);
    assert_eq!((code, printed.contains("3 of 4 reports")), (Some(1), true), "{printed}{errors}");
    for report in ["imu.json", "one/imu.json", "one/deep/imu.json"] {
        assert!(reports.join(report).is_file(), "{report}");
    }
    let status = of_recordings();
    assert_eq!(status.len(), 4, "{status:?}");
    assert!(status.contains(&(text(&damaged).into(), "failed".into())), "{status:?}");
    let walks = read().into_iter().filter(|row| row["kind"] == "angle_random_walk" && row["channel"] == "gyro_x");
    assert_eq!(walks.count(), 3);
    // Existing reports are no accident where the work is resumed; one of other bytes is made anew.
    let (code, [_, errors]) = run(&[]);
    assert!(code == Some(1) && errors.contains("exists already"), "{errors}");
    write(&dir, "fleet/damaged.csv", table(9, 2000).as_bytes());
    write(&dir, "fleet/imu.csv", table(8, 2000).as_bytes());
    let (code, [printed, errors]) = run(&["--resume"]);
    let is_resumed = printed.contains("4 of 4 reports") && printed.contains("2 of them from before");
    assert_eq!((code, is_resumed), (Some(0), true), "{printed}{errors}");
    assert_eq!(of_recordings().len(), 6, "two rows more");
}

/// The program with a named pipe as its recording, which it copies into the folder `copies`, and the open end of the pipe to write to.
fn reading(pipe: &Path, copies: &Path, arguments: &[&str]) -> (Child, File) {
    assert!(Command::new("mkfifo").arg(pipe).status().expect("mkfifo starts").success());
    let program = Command::new(env!("CARGO_BIN_EXE_imunoise"))
        .args(["analyze", text(pipe), "--rate", "100"])
        .args(arguments)
        .env("TMPDIR", copies)
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the program starts");
    // Returns when the program has opened the other end.
    (program, OpenOptions::new().write(true).open(pipe).expect("the pipe"))
}

#[test]
fn an_interrupt_while_a_pipe_is_read_gives_the_report_of_what_came() {
    for (number, quick) in [&["-o", "-"][..], &["-o", "-", "--quick"]].into_iter().enumerate() {
        let dir = tempdir().expect("a folder");
        let copies = dir.path().join("copies");
        fs::create_dir(&copies).expect("a folder");
        let (program, mut pipe) = reading(&dir.path().join(format!("pipe{number}")), &copies, quick);
        // Ten times what a pipe holds, and a row that is not complete.
        let table = table(3, 200_000);
        pipe.write_all(table.as_bytes()).and_then(|()| pipe.write_all(b"1")).expect("the program reads");
        let copied = || {
            let files = fs::read_dir(&copies).expect("the folder").filter_map(|file| file.ok()?.metadata().ok());
            files.map(|file| file.len()).sum::<u64>()
        };
        wait_until("the program has all of the pipe", || copied() == table.len() as u64 + 1);
        signal(&program, "INT");
        let output = program.wait_with_output().expect("the program ends");
        let errors = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(3), "{errors}");
        let report: Value = serde_json::from_slice(&output.stdout).expect("JSON");
        assert_eq!(report["samples"], 200_000);
        assert_eq!(report["reading"]["complete"], false);
        assert!(errors.contains("interrupted") && errors.contains("first 200000 samples"), "{errors}");
        drop(pipe);
    }
}

#[test]
fn a_second_interrupt_ends_the_program() {
    let dir = tempdir().expect("a folder");
    let (program, pipe) = reading(&dir.path().join("pipe"), dir.path(), &["--quiet"]);
    // Nothing was read when the first one comes, so that the program ends by itself with an error, or by the second one.
    signal(&program, "INT");
    signal(&program, "INT");
    let output = program.wait_with_output().expect("the program ends");
    assert!(!output.status.success() && output.stdout.is_empty());
    drop(pipe);
}

#[test]
fn a_terminal_shows_how_far_the_reading_is() {
    let dir = tempdir().expect("a folder");
    let pipe = dir.path().join("pipe");
    assert!(Command::new("mkfifo").arg(&pipe).status().expect("mkfifo starts").success());
    let command = format!("{} analyze {} --rate 100 --quick --quiet", env!("CARGO_BIN_EXE_imunoise"), pipe.display());
    let mut program = Command::new("script")
        .args(["--quiet", "--return", "--command", &command, "/dev/null"])
        .env("TERM", "xterm") // without it a terminal is taken to show no bar
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .spawn()
        .expect("script starts");
    let mut input = OpenOptions::new().write(true).open(&pipe).expect("the pipe");
    input.write_all(table(4, 5000).as_bytes()).expect("the program reads");
    // The pipe ends when the bar was seen.
    let (mut screen, mut shown, mut bytes) = (program.stdout.take().expect("a pipe"), String::new(), [0; 1024]);
    while !(shown.contains("reading") && shown.contains("KiB")) {
        let count = screen.read(&mut bytes).expect("the terminal");
        assert!(count > 0, "the program ends: {shown}");
        shown += &String::from_utf8_lossy(&bytes[..count]);
    }
    drop(input);
    screen.read_to_string(&mut shown).expect("the terminal");
    assert!(program.wait().expect("an end").success(), "{shown}");
}
