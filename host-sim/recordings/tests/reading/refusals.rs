//! Files that are refused: one line that names the file, the place and the reason.

use super::harness::{gzip, read};
use super::tables::counts;
use adis16405_driver::GyroRange;
use recordings::file_format::{RecordedFormat, RecordedInput};
use recordings::sample_stream::StreamError;
use recordings::{InputError, count_table};
use std::fmt::Display;
use std::path::Path;

type Case<'a> = (&'a str, &'a [u8], &'a [&'a str], &'a [&'a str]);

/// Checks an error about the file `name`: one line without a character that a terminal obeys.
fn check(name: &str, error: &impl Display, words: &[&str]) {
    let line = error.to_string();
    assert!(!line.contains(char::is_control) && line.len() < 1000, "{name}: {line:?}");
    for word in words {
        assert!(line.contains(word), "{name}: {word:?} is not in {line:?}");
    }
}

fn refuses((name, content, options, words): Case) {
    let Err(error) = read(name, content, options) else { panic!("{name} {words:?} is read") };
    check(name, &error, words);
    let StreamError::Input(InputError { file, line, .. }) = &error else { return };
    assert!(file.ends_with(name), "{name}: {error}");
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join(name);
    std::fs::write(&path, content).expect("written");
    if RecordedInput::open(&path).is_ok_and(|input| input.format() == RecordedFormat::CountTable) {
        let converted = count_table::read(&path, GyroRange::default()).expect_err(name);
        assert_eq!((converted.line, converted.reason.to_string()), (*line, reason(&error)), "{name}");
    }
}

fn reason(error: &StreamError) -> String {
    match error {
        StreamError::Input(error) => error.reason.to_string(),
        StreamError::TimeBase(error) => error.to_string(),
    }
}

const RATE: &[&str] = &["--rate", "100"];

#[test]
fn files_that_are_no_recordings_are_refused() {
    let long = vec![b'1'; 100_000];
    let object = format!("{:<117}\n", "{'descr': '|O', 'fortran_order': False, 'shape': (), }");
    let object = [b"\x93NUMPY\x01\0\x76\0", object.as_bytes(), b"\x80\x04\x95"].concat();
    // Two messages of MAVLink 2 behind their times.
    let message = [&[0, 6, 10, 36, 24, 30, 64, 0, 0xFD, 4, 0, 0, 0, 1, 1, 0, 0, 0][..], &[0; 6]].concat().repeat(2);
    // As `save` of R writes it, compressed.
    let workspace = gzip(b"RDX3\nX\n\0\0\0\x03\0\x04\x02\x01");
    let cases: &[Case] = &[
        ("empty.csv", b"", &[], &["empty"]),
        ("blank.csv", b"\n\n", &[], &["empty"]),
        ("header.csv", b"gyro_x_counts\n", &[], &["no data"]),
        ("long.csv", &long, &[], &["line 1", "65536"]),
        ("workspace.rda", &workspace, &[], &["R workspace", "write.csv("]),
        ("binary.dat", b"\x01\x02\x03\x04\x05\0\0\0sensor", &[], &["01 02 03 04 05 00", "HDF5", "numpy.save"]),
        ("binary.csv", &[0xF1, 0x02, 0x00], &[], &["F1 02 00", "no known format"]),
        ("pickle.pkl", b"\x80\x05\x95\xAA\0\0\0", &[], &["pickle", "read_pickle"]),
        ("list.json", b"[{\"gx\": 1}, {\"gx\": 2}]", &[], &["JSON document", "lines=True"]),
        ("columns.json", b"{\n \"gx\": [1, 2, 3]\n}\n", &[], &["JSON document", "lines=True"]),
        (
            "report.json",
            b"{\n  \"schema\": 1,\n  \"samples\": 9\n}\n",
            &[],
            &["report of this program", "`compare` and `export`"],
        ),
        ("dict.npy", &object, &[], &["Python objects", "numpy.savez"]),
        (
            "flight.bbl",
            b"H Product:Blackbox flight data recorder by Nicholas Sherlock\nH Data version:2\n",
            &[],
            &["blackbox log", "filtered and rounded", "no Allan variance of the sensor"],
        ),
        ("telemetry.tlog", &message, &[], &["MAVLink", "mavlogdump.py"]),
    ];
    cases.iter().for_each(|case| refuses(*case));
    let folder = tempfile::tempdir().expect("a folder");
    for (file, words) in [(folder.path().join("missing.csv"), "No such file"), (folder.path().into(), "is a directory")]
    {
        let error = RecordedInput::open(&file).expect_err(words);
        check(words, &error, &[words]);
        assert_eq!(error.file, file);
    }
    let error = RecordedInput::open(Path::new("/nowhere/\u{1b}[31m.csv")).expect_err("no such file");
    check("control characters", &error, &["/nowhere/"]);
}

#[test]
fn wrong_headers_and_selections_are_refused() {
    let huge: String = (0..3000).map(|row| format!("{}.5e160\n", row * 7919 % 41 - 20)).collect();
    let huge = format!("gyro_x_deg_s\n{huge}");
    let cases: &[Case] = &[
        ("none.csv", b"a,b\n1,2\n", &[], &["line 1", "no column is named like a channel", "--columns", "a, b"]),
        ("clock.csv", b"time_s\n0\n", &[], &["line 1", "no column is named like a channel"]),
        ("twice.csv", b"gyro_x_counts,gyro_x_counts\n1,2\n", &[], &["no column is named like a channel", "0, 1"]),
        ("topic.csv", b"time_s,gyro_x_deg_s\n0,1\n1,2\n", &["--topic", "imu"], &["--topic imu", "no topics"]),
        (
            "names.csv",
            b"time_s,x,x\n0,1,2\n1,2,3\n",
            &["--columns", "gyro_x=x", "--units", "rad/s"],
            &["no column x; the file has time, 1, 2"],
        ),
        // Values that no sensor measures.
        ("huge.csv", huge.as_bytes(), RATE, &["out_of_range"]),
    ];
    cases.iter().for_each(|case| refuses(*case));
}

#[test]
fn wrong_fields_are_refused_with_their_line_and_column() {
    const GOOD: &str = "gyro_x_counts,accl_z_counts\n1,-300\n2,-301\n3,-302\n4,-303\n5,-304\n";
    const GYRO: &str = "column gyro_x";
    for (name, row, reasons) in [
        ("text.csv", "abc,1", [GYRO, "\"abc\" is not a number"]),
        ("fraction.csv", "1.5,1", [GYRO, "\"1.5\" is not a whole number"]),
        ("huge.csv", "99999999999999999999,1", [GYRO, "is outside -8192..=8191"]),
        ("control.csv", "\x1b[31m,1", [GYRO, "is not a number"]),
        // Data sheet: the rates are 14-bit two's complement, −8192…8191.
        ("high.csv", "8192,1", [GYRO, "8192 is outside -8192..=8191"]),
        ("low.csv", "-8193,1", [GYRO, "-8193 is outside -8192..=8191"]),
        ("few.csv", "1", ["1 fields", "the header has 2"]),
        ("many.csv", "1,2,3", ["3 fields", "the header has 2"]),
    ] {
        let words = [&["line 8"], &reasons[..]].concat();
        let text = format!("{GOOD}\n{row}\n");
        refuses((name, text.as_bytes(), RATE, &words));
        // CR LF line ends do not change the line number.
        refuses((name, text.replace('\n', "\r\n").as_bytes(), RATE, &words));
    }
    for (name, clock, rows, reason) in [
        ("nan.csv", "time_s", ["0.0", "0.1", "NaN"], "not a finite time"),
        ("inf.csv", "time_s", ["0.0", "0.1", "1e999"], "not a finite time"),
        ("word.csv", "time_s", ["0.0", "0.1", "noon"], "\"noon\" is not a number"),
        ("same.csv", "sample", ["0", "1", "1"], "sample 1 does not follow 1"),
        ("less.csv", "sample", ["5", "6", "4"], "sample 4 does not follow 6"),
        ("minus.csv", "sample", ["0", "1", "-2"], "\"-2\" is not a whole number"),
    ] {
        let rows = rows.map(|at| format!("{at},1\n")).concat();
        let text = format!("{clock},gyro_x_counts\n{rows}");
        refuses((
            name,
            text.as_bytes(),
            &["--rate", "10"],
            &["line 4", &format!("column {}", clock.trim_end_matches("_s")), reason],
        ));
    }
}

#[test]
fn damaged_gzip_streams_are_refused() {
    let rows: String = (0..20_000).map(|i| format!("{}\n", i * 7919 % 8000)).collect();
    let whole = gzip(format!("gyro_x_counts\n{rows}").as_bytes());
    let mut flipped = whole.clone();
    flipped[whole.len() / 2] ^= 0xFF;
    let cases: &[Case] = &[
        ("no_row.csv.gz", &whole[..20], RATE, &["truncated gzip"]),
        ("flipped.csv.gz", &flipped, RATE, &["line "]),
        ("more.csv.gz", &[&whole[..], b"more"].concat(), RATE, &["after the end of the gzip data"]),
    ];
    cases.iter().for_each(|case| refuses(*case));
}

#[test]
fn recordings_without_a_time_base_are_refused() {
    let good = counts("gyro_x_counts", 20, |_| String::new());
    let even = counts("sample,gyro_x_counts", 20_000, |i| format!("{},", 2 * i));
    let sparse = counts("sample,gyro_x_counts", 10_000, |i| format!("{},", i / 2 * 10_000 + i % 2));
    let cases: &[Case] = &[
        ("good.csv", &good, &[], &["no sample rate", "--rate", "time_s"]),
        ("good.csv", &good, &["--rate", "0"], &["sample rate of 0 Hz", "positive and finite"]),
        ("good.csv", &good, &["--rate", "-100"], &["sample rate of -100 Hz", "positive and finite"]),
        ("good.csv", &good, &["--rate", "NaN"], &["sample rate of NaN Hz", "positive and finite"]),
        ("good.csv", &good, &["--rate", "inf"], &["sample rate of inf Hz", "positive and finite"]),
        ("short.csv", b"gyro_x_counts\n1\n2\n", RATE, &["record too short", "2 usable samples"]),
        ("frozen.csv", b"time_s,gyro_x_counts\n1,1\n1,2\n1,3\n1,4\n1,5\n", &[], &["no sample period", "--rate"]),
        ("even.csv", &even, RATE, &["no two neighbouring samples"]),
        ("sparse.csv", &sparse, RATE, &["10000 samples in 49990002 sample periods"]),
    ];
    cases.iter().for_each(|case| refuses(*case));
}

#[test]
fn wrong_lines_of_frame_logs_are_refused() {
    let burst = "3E".to_owned() + &"0".repeat(50);
    for (row, words) in [
        (format!("0.1,{burst},{}", "X".repeat(52)), ["column miso", "hexadecimal"]),
        ("0.1,3E0,000".to_owned(), ["column mosi", "hexadecimal"]),
        ("0.1,3E,00".to_owned(), ["1 bytes", "16-bit words"]),
        ("0.1,3E00,00".to_owned(), ["2 bytes out", "1 bytes in"]),
        (format!("soon,{burst},{burst}"), ["column time_s", "not a number"]),
        ("0.1,3E00".to_owned(), ["2 fields", "has 3"]),
    ] {
        let log = format!("time_s,mosi,miso\n{row}\n");
        refuses(("log.csv", log.as_bytes(), &[], &[&["line 2"], &words[..]].concat()));
    }
    // One burst is too short.
    refuses(("log.csv", format!("time_s,mosi,miso\n0,{burst},{burst}\n").as_bytes(), &[], &["record too short"]));
}
