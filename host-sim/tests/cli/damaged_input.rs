//! Recordings whose time stamps, gaps, formats or names mislead: the report says so, or one line refuses them.

use crate::program::{gzip, host_sim, json_of, with_default_signals, write};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use recordings::frame_log::FrameLogReader;
use std::fmt::Write as _;
use std::fs;
use std::io::Write as _;
use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};
use tempfile::tempdir;

/// A table of white noise of 20 counts (1 σ of a sum of 12 uniform values) with a stamp of each row.
fn table(header: &str, rows: usize, stamp: impl Fn(usize) -> String) -> Vec<u8> {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let mut text = format!("{header}\n");
    for row in 0..rows {
        let sum: f64 = (0..12).map(|_| rng.random_range(-0.5..0.5)).sum();
        writeln!(text, "{}{}", stamp(row), (20.0 * sum).round()).expect("a string");
    }
    text.into_bytes()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// The report and the notes of a command that succeeds.
fn report(command: &[&str]) -> (serde_json::Value, String) {
    let dir = tempdir().expect("a folder");
    let out = dir.path().join("report.json");
    let output = host_sim(&[command, &["--json", out.to_str().expect("UTF-8")]].concat());
    assert!(output.status.success(), "{command:?}: {}", text(&output.stderr));
    let report = serde_json::from_slice(&fs::read(out).expect("a report")).expect("JSON");
    (report, text(&output.stderr))
}

/// The error of a command that fails with one line.
fn refusal(command: &[&str]) -> String {
    error_line(&host_sim(command))
}

fn error_line(output: &Output) -> String {
    let error = text(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{error}");
    assert_eq!(error.lines().count(), 1, "{error}");
    error
}

fn name(path: &Path) -> &str {
    path.to_str().expect("UTF-8")
}

#[test]
fn an_index_and_times_that_contradict_each_other_give_the_rate_of_both_sides_and_a_note() {
    let dir = tempdir().expect("a folder");
    let stamp = |i: usize| format!("{i},{},", i as f64 / 100.0 + if i >= 30_000 { 600.0 } else { 0.0 });
    let file = write(&dir, "clock.csv", &table("sample,time_s,gyro_x_counts", 60_000, stamp));
    let (report, notes) = report(&["analyze", name(&file)]);
    let rate = report["sample_rate_hz"].as_f64().expect("a rate");
    assert!((rate / 100.0 - 1.0).abs() < 1e-6, "{rate}");
    assert_eq!(report["flagged"]["clock_step"], 1);
    assert!(notes.contains("contradict") && notes.contains("sample 30000") && notes.contains("+600.000 s"), "{notes}");
}

#[test]
fn millisecond_stamps_of_a_faster_part_show_its_rate_and_no_loss() {
    let dir = tempdir().expect("a folder");
    for rate_hz in [700.0, 750.0, 819.2, 900.0, 950.0] {
        let stamp = |i: usize| format!("{:.3},", (i as f64 / rate_hz * 1000.0).floor() / 1000.0);
        let file = write(&dir, "coarse.csv", &table("time_s,gyro_x_counts", 20_000, stamp));
        let (report, notes) = report(&["analyze", name(&file)]);
        let rate = report["sample_rate_hz"].as_f64().expect("a rate");
        // 20,000 samples of stamps that are off by up to a period.
        assert!((rate / rate_hz - 1.0).abs() < 1e-5, "{rate_hz}: {rate}");
        assert_eq!(report["dropped"]["gap"], 0);
        assert!(notes.contains("coarser than the sample period"), "{notes}");
    }
}

#[test]
fn a_rate_that_contradicts_the_stamps_is_refused() {
    let dir = tempdir().expect("a folder");
    let file = write(&dir, "timed.csv", &table("time_s,gyro_x_counts", 20_000, |i| format!("{},", i as f64 / 100.0)));
    for rate in ["30", "300", "819.2", "1000"] {
        let line = refusal(&["analyze", name(&file), "--rate", rate]);
        assert!(line.contains("contradicts the time stamps") && line.contains("100.0000 Hz"), "{rate}: {line}");
    }
    // A nominal rate that is a little wrong is taken.
    assert!(host_sim(&["analyze", name(&file), "--rate", "102.4"]).status.success());
    let file = write(&dir, "index.csv", &table("sample,gyro_x_counts", 20_000, |i| format!("{},", 2 * i)));
    let line = refusal(&["analyze", name(&file), "--rate", "100"]);
    assert!(line.contains("no two neighbouring samples"), "{line}");
}

#[test]
fn gaps_that_are_far_longer_than_the_record_are_refused_at_once() {
    let dir = tempdir().expect("a folder");
    let stamp = |i: usize| format!("{},", i / 2 * 10_000 + i % 2);
    let file = write(&dir, "sparse.csv", &table("sample,gyro_x_counts", 10_000, stamp));
    let line = refusal(&["analyze", name(&file), "--rate", "100"]);
    assert!(line.contains("10000 samples in 49990002 sample periods"), "{line}");
}

#[test]
fn a_record_of_refused_samples_names_the_causes() {
    let dir = tempdir().expect("a folder");
    let burst = format!("3E00{}", "0".repeat(48));
    let rows: String = (0..10).map(|i| format!("{}.5,{burst},{}\n", i + 1, "F".repeat(52))).collect();
    let file = write(&dir, "stuck.csv", format!("time_s,mosi,miso\n{rows}").as_bytes());
    let line = refusal(&["replay", name(&file)]);
    assert!(line.contains("0 usable samples") && line.contains("stuck_high 10"), "{line}");
}

/// Bursts of counts with the squares of their numbers, and a write of the upper byte of SENS_AVG before those of the given
/// numbers.
fn frame_log(writes: &[(usize, &str)]) -> String {
    let mut text = String::from("time_s,mosi,miso\n");
    for i in 0..=60_usize {
        for (_, mosi) in writes.iter().filter(|(at, _)| *at == i) {
            writeln!(text, "{i},{mosi},0000").expect("a string");
        }
        if i < 60 {
            let data = format!("{:04X}", 0x8000 | (i * i)).repeat(11);
            writeln!(text, "{i}.5,3E00{},00008814{data}", "0".repeat(48)).expect("a string");
        }
    }
    text
}

#[test]
fn a_range_write_after_the_last_burst_changes_nothing_and_one_between_bursts_is_refused() {
    let dir = tempdir().expect("a folder");
    let plain = write(&dir, "plain.csv", frame_log(&[]).as_bytes());
    let after = write(&dir, "after.csv", frame_log(&[(60, "B901")]).as_bytes());
    assert!(json_of(&dir, &["replay", name(&plain)]) == json_of(&dir, &["replay", name(&after)]));
    let again = write(&dir, "again.csv", frame_log(&[(0, "B901"), (30, "B901")]).as_bytes());
    assert!(host_sim(&["replay", name(&again)]).status.success(), "the same range twice");
    let between = write(&dir, "between.csv", frame_log(&[(30, "B901")]).as_bytes());
    let line = refusal(&["replay", name(&between)]);
    assert!(line.contains("line 33") && line.contains("from 300 to 75 deg/s"), "{line}");
}

#[test]
fn a_log_is_read_behind_a_byte_order_mark_or_blank_lines_and_from_a_pipe() {
    let dir = tempdir().expect("a folder");
    let log = frame_log(&[]);
    let plain = json_of(&dir, &["replay", name(&write(&dir, "log.csv", log.as_bytes()))]);
    for start in ["\u{feff}", "\n", "\r\n \n"] {
        let file = write(&dir, "log.csv", format!("{start}{log}").as_bytes());
        assert!(json_of(&dir, &["replay", name(&file)]) == plain, "{start:?}");
    }
    let out = dir.path().join("piped.json");
    let mut replay = Command::new(env!("CARGO_BIN_EXE_host-sim"))
        .args(["replay", "/dev/stdin", "--json", name(&out)])
        .stdin(Stdio::piped())
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the program starts");
    replay.stdin.take().expect("a pipe").write_all(log.as_bytes()).expect("written");
    let output = replay.wait_with_output().expect("an end");
    assert!(output.status.success(), "{}", text(&output.stderr));
    assert!(fs::read(&out).expect("a report") == plain);
    // A named pipe gives its bytes once.
    let pipe = dir.path().join("pipe");
    assert!(Command::new("mkfifo").arg(&pipe).status().expect("mkfifo").success());
    let mut replay = Command::new(env!("CARGO_BIN_EXE_host-sim"))
        .args(["replay", name(&pipe), "--quiet", "--json", name(&out)])
        .spawn()
        .expect("the program starts");
    fs::write(&pipe, &log).expect("the program reads");
    let started = Instant::now();
    let status = loop {
        if let Some(status) = replay.try_wait().expect("a status") {
            break status;
        }
        if started.elapsed() > Duration::from_secs(60) {
            replay.kill().expect("killed");
            panic!("the program waits for a second writer");
        }
        std::thread::sleep(Duration::from_millis(20));
    };
    assert!(status.success() && fs::read(out).expect("a report") == plain);
}

/// A long simulation that is interrupted, hung up or killed leaves a log whose bursts can be read up to then, plain or gzip.
#[test]
fn an_interrupted_simulation_leaves_a_log_that_can_be_read() {
    let dir = tempdir().expect("a folder");
    for (signal, file) in [("INT", "a.csv.gz"), ("HUP", "b.csv.gz"), ("KILL", "c.csv")] {
        let log = dir.path().join(file);
        let mut record = with_default_signals()
            .args(["record", name(&log), "--seconds", "50000"])
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .expect("the program starts");
        // What is written stays in memory for a second at most.
        std::thread::sleep(Duration::from_millis(2500));
        let id = record.id().to_string();
        assert!(Command::new("kill").args([&format!("-{signal}"), &id]).status().expect("kill").success());
        assert!(!record.wait().expect("an end").success(), "{signal}: it ended by itself");
        let mut reader = FrameLogReader::open(&log).expect("a log");
        let mut bursts = 0;
        loop {
            match reader.next() {
                Ok(Some(frame)) => bursts += u32::from(frame.mosi.len() == 26),
                Ok(None) => break,
                // A kill may end the program within a write to the disk, so that its last line is torn.
                Err(error) => {
                    let last = fs::read_to_string(&log).map_or(0, |text| text.lines().count());
                    assert!(
                        signal == "KILL" && error.to_string().contains(&format!("line {last}")),
                        "{signal}: {error}"
                    );
                    break;
                }
            }
        }
        assert!(bursts > 100, "{signal}: {bursts} bursts");
    }
}

#[test]
fn a_full_disk_is_named() {
    for arguments in [
        &["record", "/dev/full", "--seconds", "5"][..],
        &["simulate", "/dev/full", "--seconds", "5"],
        &["simulate", "/dev/full", "--seconds", "5", "--format", "frames"],
    ] {
        let line = refusal(arguments);
        assert!(line.contains("/dev/full") && line.contains("No space left"), "{arguments:?}: {line}");
    }
    // The report is printed all the same.
    let output = host_sim(&["record", "/dev/null", "--seconds", "2", "--export", "csv=/dev/full"]);
    assert!(error_line(&output).contains("No space left"));
    assert!(text(&output.stdout).contains("angle random walk"));
}

#[test]
fn separators_and_a_trailing_comma_are_named() {
    let dir = tempdir().expect("a folder");
    for (header, expected) in [
        ("time_s;gyro_x_counts", "separated by ';'"),
        ("time_s\tgyro_x_counts", "separated by '\\t'"),
        ("time_s,gyro_x_counts,", "a comma after the last column"),
    ] {
        let file = write(&dir, "table.csv", format!("{header}\n0,1\n").as_bytes());
        let line = refusal(&["analyze", name(&file)]);
        assert!(line.contains(expected) && line.contains("line 1"), "{line}");
    }
}

#[test]
fn padding_after_gzip_data_is_skipped_and_other_bytes_are_named() {
    let dir = tempdir().expect("a folder");
    let rows = table("time_s,gyro_x_counts", 2000, |i| format!("{},", i as f64 / 100.0));
    let plain = json_of(&dir, &["analyze", name(&write(&dir, "rows.csv", &rows))]);
    let (start, end) = rows.split_at(rows.len() / 2);
    for (case, bytes) in [
        ("line end", [gzip(&rows), b"\n".to_vec()].concat()),
        ("zeros", [gzip(&rows), vec![0; 512]].concat()),
        ("members", [gzip(start), gzip(end)].concat()),
    ] {
        let file = write(&dir, "rows.csv.gz", &bytes);
        assert!(json_of(&dir, &["analyze", name(&file)]) == plain, "{case}");
    }
    let file = write(&dir, "rows.csv.gz", &[gzip(&rows), b"more".to_vec()].concat());
    let line = refusal(&["analyze", name(&file)]);
    assert!(line.contains("after the end of the gzip data"), "{line}");
}

#[test]
fn too_many_rows_are_refused_and_fewer_where_a_small_file_expands_to_them() {
    let dir = tempdir().expect("a folder");
    let mut rows = b"gyro_x_counts\n".to_vec();
    rows.resize(rows.len() + 2 * ((1 << 25) + 1), b'\n');
    rows[14..].chunks_exact_mut(2).for_each(|row| row[0] = b'1');
    // `analyze` condenses it; `replay` would hold it in memory.
    let file = write(&dir, "ones.csv", &rows);
    let line = refusal(&["replay", name(&file), "--rate", "100"]);
    assert!(line.contains("more than 33554432 samples"), "{line}");
    let file = write(&dir, "ones.csv.gz", &gzip(&rows));
    let line = refusal(&["replay", name(&file), "--rate", "100"]);
    assert!(line.contains("far more than a recording of this size"), "{line}");
}

#[test]
fn outputs_are_checked_before_the_work_and_never_overwrite_the_input() {
    let dir = tempdir().expect("a folder");
    let rows = table("time_s,gyro_x_counts", 2000, |i| format!("{},", i as f64 / 100.0));
    let file = write(&dir, "rows.csv", &rows);
    let link = dir.path().join("link.csv");
    std::os::unix::fs::symlink(&file, &link).expect("a link");
    for (option, prefix) in [("--json", ""), ("--export", "kalibr=")] {
        let value = |file: &Path| format!("{prefix}{}", name(file));
        for same in [&file, &link] {
            let line = refusal(&["analyze", name(&file), option, &value(same)]);
            assert!(line.contains("is an input"), "{line}");
        }
        let nowhere = dir.path().join("missing").join("out");
        let started = Instant::now();
        let log = dir.path().join("log.csv");
        let output = host_sim(&["record", name(&log), "--seconds", "20000", option, &value(&nowhere)]);
        let line = error_line(&output);
        assert!(line.contains("No such file") && started.elapsed() < Duration::from_secs(5), "{line}");
    }
    let twice = name(&dir.path().join("twice")).to_owned();
    let line = refusal(&["analyze", name(&file), "--json", &twice, "--export", &format!("csv={twice}")]);
    assert!(line.contains("named twice"), "{line}");
    // Folders whose files cannot be written: a file is in the way, or a folder of the name of the page or of the figure.
    let blocked = dir.path().join("blocked");
    for inside in ["index.html", "overview.svg"] {
        std::fs::create_dir_all(blocked.join(inside)).expect("a folder");
    }
    let log = dir.path().join("log.csv");
    for (option, folder) in [("--page", &file), ("--pictures", &file), ("--page", &blocked), ("--pictures", &blocked)] {
        let started = Instant::now();
        let line = refusal(&["record", name(&log), "--seconds", "20000", option, name(folder)]);
        assert!(started.elapsed() < Duration::from_secs(5) && line.contains(name(folder)), "{option}: {line}");
    }
    for command in [&["compare", name(&file), "--data-sheet"][..], &["compare", name(&file), name(&file)]] {
        let line = refusal(&[command, &["--json", name(&file)]].concat());
        assert!(line.contains("is an input"), "{line}");
    }
    for command in [&["convert"][..], &["export", "--format", "kalibr"]] {
        let line = refusal(&[command, &[name(&file), name(&link)]].concat());
        assert!(line.contains("is an input"), "{command:?}: {line}");
    }
    assert!(fs::read(&file).expect("the input") == rows);
}

#[test]
fn names_with_control_characters_are_escaped() {
    let line = refusal(&["analyze", "/nowhere/\u{1b}[31m.csv"]);
    assert!(!line.contains('\u{1b}'), "{line:?}");
    // A tip follows on machines that have serial ports.
    let output = host_sim(&["monitor", "/dev/\u{1b}[31m"]);
    let error = text(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{error}");
    assert!(error.starts_with("error: ") && !error.contains('\u{1b}'), "{error:?}");
}
