//! Bad input ends in one line that names the place and the reason, with exit status 1 and no panic.

use crate::program::{gzip, host_sim, write};
use std::path::Path;
use std::process::Output;
use tempfile::tempdir;

const GOOD: &str = "gyro_x_counts,accl_z_counts\n1,-300\n2,-301\n3,-302\n4,-303\n5,-304\n";

fn error_line(output: &Output) -> String {
    let stderr = String::from_utf8(output.stderr.clone()).expect("UTF-8");
    assert_eq!(output.status.code(), Some(1), "{stderr}");
    assert!(!stderr.contains("panicked"), "{stderr}");
    // What is in the file comes after the error, where a column, a unit or a rate is missing.
    let is_asked = stderr.contains("first values");
    assert!(is_asked || stderr.lines().count() == 1, "one line: {stderr}");
    assert!(output.stdout.is_empty(), "a report is printed: {}", String::from_utf8_lossy(&output.stdout));
    let line = stderr.lines().next().unwrap_or_default().to_owned();
    assert!(line.starts_with("error: "), "{line}");
    line
}

/// Checks that `analyze` and `replay` both refuse `file` with a line that contains its name and each of `names`.
fn refuses(file: &Path, rate: &[&str], names: &[&str]) {
    for command in ["analyze", "replay"] {
        refuses_with(command, file, rate, names);
    }
}

/// Checks that a command refuses `file` with a line that contains its name and each of `names`.
fn refuses_with(command: &str, file: &Path, rate: &[&str], names: &[&str]) {
    let arguments = [&[command, file.to_str().expect("UTF-8")], rate].concat();
    let line = error_line(&host_sim(&arguments));
    let file = file.file_name().expect("a name").to_str().expect("UTF-8");
    for name in names.iter().chain(&[file]) {
        assert!(line.contains(name), "{command}: {name:?} is not in {line:?}");
    }
}

#[test]
fn files_that_are_no_tables_are_refused() {
    let dir = tempdir().expect("a folder");
    refuses(&dir.path().join("missing.csv"), &[], &["No such file"]);
    refuses(dir.path(), &[], &["directory"]);
    refuses(&write(&dir, "empty.csv", b""), &[], &["empty"]);
    refuses(&write(&dir, "blank.csv", b"\n\n"), &[], &["empty"]);
    refuses(&write(&dir, "header.csv", b"gyro_x_counts\n"), &[], &["no data"]);
    refuses(&write(&dir, "wide.csv", &[0xFF, 0xFE, b'1', 0x00]), &[], &["UTF-16", "iconv"]);
    refuses(&write(&dir, "binary.csv", &[0xF1, 0x02, 0x00]), &[], &["F1 02 00", "no known format"]);
    refuses(&write(&dir, "long.csv", &vec![b'1'; 100_000]), &[], &["line 1", "65536"]);
}

#[test]
fn wrong_headers_are_refused() {
    let dir = tempdir().expect("a folder");
    // A table of any sensor may have any names; what is replayed are counts.
    let none = write(&dir, "none.csv", b"a,b\n1,2\n");
    refuses_with("replay", &none, &[], &["line 1", "no known column", "gyro_x_counts"]);
    refuses_with("analyze", &none, &[], &["line 1", "no column is named like a channel", "--columns", "a, b"]);
    let clock = write(&dir, "clock.csv", b"time_s\n0\n");
    refuses_with("replay", &clock, &[], &["line 1", "no known column"]);
    refuses_with("analyze", &clock, &[], &["line 1", "no column is named like a channel"]);
    refuses(
        &write(&dir, "unknown.csv", b"gyro_x_counts,gyro_w_counts\n1,2\n"),
        &[],
        &["line 1", "column gyro_w_counts", "unknown"],
    );
    refuses(
        &write(&dir, "twice.csv", b"gyro_x_counts,gyro_x_counts\n1,2\n"),
        &[],
        &["line 1", "column gyro_x_counts", "twice"],
    );
}

#[test]
fn wrong_fields_are_refused_with_their_line_and_column() {
    let dir = tempdir().expect("a folder");
    for (name, row, reasons) in [
        ("text.csv", "abc,1", ["column gyro_x_counts", "\"abc\" is not a whole number"]),
        ("fraction.csv", "1.5,1", ["column gyro_x_counts", "\"1.5\" is not a whole number"]),
        ("nothing.csv", ",1", ["column gyro_x_counts", "\"\" is not a whole number"]),
        // Data sheet: the rates are 14-bit two's complement, −8192…8191.
        ("high.csv", "8192,1", ["column gyro_x_counts", "8192 is outside -8192..=8191"]),
        ("low.csv", "-8193,1", ["column gyro_x_counts", "-8193 is outside -8192..=8191"]),
        ("huge.csv", "99999999999999999999,1", ["column gyro_x_counts", "not a whole number"]),
        ("few.csv", "1", ["1 fields", "the header has 2"]),
        ("many.csv", "1,2,3", ["3 fields", "the header has 2"]),
    ] {
        let file = write(&dir, name, format!("{GOOD}\n{row}\n").as_bytes());
        refuses(&file, &["--rate", "100"], &[&["line 8"], reasons.as_slice()].concat());
        // CR LF line ends do not change the line number.
        let file = write(&dir, name, format!("{GOOD}\n{row}\n").replace('\n', "\r\n").as_bytes());
        refuses(&file, &["--rate", "100"], &[&["line 8"], reasons.as_slice()].concat());
    }
    let file = write(&dir, "control.csv", b"gyro_x_counts\n\x1b[31m\n");
    let line = error_line(&host_sim(&["analyze", file.to_str().expect("UTF-8")]));
    assert!(!line.contains('\x1b'), "control characters are escaped: {line:?}");
}

#[test]
fn time_stamps_that_decrease_or_are_no_numbers_are_refused() {
    let dir = tempdir().expect("a folder");
    for (name, clock, rows, reason) in [
        ("back.csv", "time_s", ["0.0", "0.2", "0.1"], "time 0.1 s is before 0.2 s"),
        ("nan.csv", "time_s", ["0.0", "0.1", "NaN"], "not a finite time"),
        ("inf.csv", "time_s", ["0.0", "0.1", "1e999"], "not a finite time"),
        ("word.csv", "time_s", ["0.0", "0.1", "noon"], "\"noon\" is not a number"),
        ("same.csv", "sample", ["0", "1", "1"], "sample 1 does not follow 1"),
        ("less.csv", "sample", ["5", "6", "4"], "sample 4 does not follow 6"),
        ("minus.csv", "sample", ["0", "1", "-2"], "\"-2\" is not a whole number"),
    ] {
        let rows = rows.map(|at| format!("{at},1\n")).concat();
        let file = write(&dir, name, format!("{clock},gyro_x_counts\n{rows}").as_bytes());
        refuses(&file, &["--rate", "10"], &["line 4", &format!("column {clock}"), reason]);
    }
}

#[test]
fn damaged_gzip_streams_are_refused() {
    let dir = tempdir().expect("a folder");
    let rows: String = (0..20_000).map(|i| format!("{}\n", i * 7919 % 8000)).collect();
    let whole = gzip(format!("gyro_x_counts\n{rows}").as_bytes());
    let cut = write(&dir, "cut.csv.gz", &whole[..whole.len() / 2]);
    refuses(&cut, &["--rate", "100"], &["line ", "truncated gzip"]);
    let no_trailer = write(&dir, "no_trailer.csv.gz", &whole[..whole.len() - 3]);
    refuses(&no_trailer, &["--rate", "100"], &["truncated gzip"]);
    let mut flipped = whole.clone();
    let middle = flipped.len() / 2;
    flipped[middle] ^= 0xFF;
    let flipped = write(&dir, "flipped.csv.gz", &flipped);
    refuses(&flipped, &["--rate", "100"], &["line "]);
    // Plain text in a file named .gz is read as plain text.
    let plain = write(&dir, "plain.csv.gz", GOOD.as_bytes());
    assert!(host_sim(&["analyze", plain.to_str().expect("UTF-8"), "--rate", "100"]).status.success());
}

#[test]
fn impossible_rates_and_short_records_are_refused() {
    let dir = tempdir().expect("a folder");
    let good = write(&dir, "good.csv", GOOD.as_bytes());
    for rate in ["0", "-100", "NaN", "inf"] {
        refuses(&good, &["--rate", rate], &["sample rate of", "positive and finite"]);
    }
    refuses(&good, &[], &["no sample rate", "--rate", "time_s"]);
    let short = write(&dir, "short.csv", b"gyro_x_counts\n1\n2\n");
    refuses(&short, &["--rate", "100"], &["record too short", "2 usable samples"]);
    let frozen = write(&dir, "frozen.csv", b"time_s,gyro_x_counts\n1,1\n1,2\n1,3\n1,4\n1,5\n");
    refuses(&frozen, &[], &["no sample period", "--rate"]);
}

#[test]
fn wrong_frame_logs_are_refused() {
    let dir = tempdir().expect("a folder");
    let burst = "3E".to_owned() + &"0".repeat(50);
    for (name, row, reasons) in [
        ("hex", format!("0.1,{burst},{}", "X".repeat(52)), ["line 2", "column miso", "hexadecimal"]),
        ("half", "0.1,3E0,000".to_owned(), ["line 2", "column mosi", "hexadecimal"]),
        ("odd", "0.1,3E,00".to_owned(), ["line 2", "1 bytes", "16-bit words"]),
        ("unequal", "0.1,3E00,00".to_owned(), ["line 2", "2 bytes out", "1 bytes in"]),
        ("time", format!("soon,{burst},{burst}"), ["line 2", "column time_s", "not a number"]),
        ("fields", "0.1,3E00".to_owned(), ["line 2", "2 fields", "has 3"]),
        ("other", "0.1,5600,0000".to_owned(), ["no burst", "26 bytes", "3E00"]),
        ("request", format!("0.1,3E01{0},3E01{0}", "0".repeat(48)), ["no burst", "26 bytes", "3E00"]),
        ("tail", format!("0.1,3E{0}1,3E{0}1", "0".repeat(49)), ["line 2", "replay over the bus", "OtherRequest"]),
    ] {
        let file = write(&dir, name, format!("time_s,mosi,miso\n{row}\n").as_bytes());
        let line = error_line(&host_sim(&["replay", file.to_str().expect("UTF-8")]));
        for reason in reasons.into_iter().chain([name]) {
            assert!(line.contains(reason), "{reason:?} is not in {line:?}");
        }
    }
    // `analyze` reads a log as `replay` does: one burst is too short for both.
    let file = write(&dir, "log.csv", format!("time_s,mosi,miso\n0,{burst},{burst}\n").as_bytes());
    refuses(&file, &[], &["record too short"]);
}

#[test]
fn impossible_durations_and_outputs_are_refused() {
    let dir = tempdir().expect("a folder");
    let log = dir.path().join("log.csv");
    let log = log.to_str().expect("UTF-8");
    for seconds in ["0", "-1", "NaN", "inf", "1e9"] {
        let line = error_line(&host_sim(&["record", log, "--seconds", seconds]));
        assert!(line.contains("duration"), "{line}");
    }
    let nowhere = dir.path().join("missing").join("log.csv");
    let line = error_line(&host_sim(&["record", nowhere.to_str().expect("UTF-8"), "--seconds", "1"]));
    assert!(line.contains("log.csv") && line.contains("No such file"), "{line}");
    let good = write(&dir, "good.csv", GOOD.as_bytes());
    let json = dir.path().to_str().expect("UTF-8");
    let line = error_line(&host_sim(&["analyze", good.to_str().expect("UTF-8"), "--rate", "1", "--json", json]));
    assert!(line.contains(json), "{line}");
}

#[test]
fn wrong_usage_has_exit_status_2() {
    assert_eq!(host_sim(&["analyze"]).status.code(), Some(2));
    assert_eq!(host_sim(&["measure"]).status.code(), Some(2));
    assert_eq!(host_sim(&["analyze", "x.csv", "--rate", "fast"]).status.code(), Some(2));
}
