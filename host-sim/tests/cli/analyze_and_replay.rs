//! A recording gives the same report whether its counts are read or its bursts are replayed over the emulated bus.

use crate::program::{self, gzip, host_sim, json_of, write};
use recordings::frame_log::{Frame, FrameLogReader, FrameLogWriter};
use serde_json::Value;
use std::fmt::Write;
use std::path::Path;
use tempfile::tempdir;

/// A table of pseudo-random counts that fill their register fields, from a linear congruential generator.
fn noise(rows: usize, clock: &str, columns: &[&str]) -> String {
    let mut text = format!("{clock}{}\n", columns.join(","));
    let mut state = 12_345u64;
    for row in 0..rows {
        match clock {
            "" => {}
            "sample," => write!(text, "{},", row + row / 100).expect("a string"),
            _ => write!(text, "{},", row as f64 / 819.2).expect("a string"),
        }
        for column in columns {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            let count = match *column {
                "supply_counts" => 2060 + (state >> 60) as i32,
                "aux_adc_counts" => (state >> 52) as i32,
                "temp_counts" => (state >> 52) as i32 - 2048,
                _ => (state >> 50) as i32 - 8192,
            };
            write!(text, "{count}").expect("a string");
            text.push(if Some(column) == columns.last() { '\n' } else { ',' });
        }
    }
    text
}

/// The JSON report of `analyze`, after checking that `replay` prints and writes the same.
fn same_both_ways(file: &Path, rate: &[&str]) -> Vec<u8> {
    let dir = tempdir().expect("a folder");
    let report = |command: &str| {
        let out = dir.path().join(format!("{command}.json"));
        let files = [command, file.to_str().expect("UTF-8"), "--json", out.to_str().expect("UTF-8")];
        let output = host_sim(&[&files, rate].concat());
        assert!(output.status.success(), "{command}: {}", String::from_utf8_lossy(&output.stderr));
        (output.stdout, std::fs::read(out).expect("a report"))
    };
    let (analyzed, replayed) = (report("analyze"), report("replay"));
    assert!(analyzed.0 == replayed.0, "{}: the terminal differs", file.display());
    assert!(analyzed.1 == replayed.1, "{}: the reports differ", file.display());
    analyzed.1
}

#[test]
fn tables_of_any_columns_compression_and_line_ends_give_the_same_report() {
    // Enough for a curve of six octaves; the reports are equal or not whatever their length.
    const ROWS: usize = 400;
    let dir = tempdir().expect("a folder");
    let all = "supply,gyro_x,gyro_y,gyro_z,accl_x,accl_y,accl_z,magn_x,magn_y,magn_z,temp,aux_adc";
    let all: Vec<String> = all.split(',').map(|c| format!("{c}_counts")).collect();
    let all: Vec<&str> = all.iter().map(String::as_str).collect();
    let backwards: Vec<&str> = all.iter().rev().copied().collect();
    for (name, text, rate) in [
        ("timed.csv", noise(ROWS, "time_s,", &all), &[][..]),
        ("timed_rate.csv", noise(ROWS, "time_s,", &all), &["--rate", "800"]),
        ("index.csv", noise(ROWS, "sample,", &backwards), &["--rate", "100"]),
        ("one.csv", noise(ROWS, "", &["accl_y_counts"]), &["--rate", "100"]),
        ("pair.csv", noise(ROWS, "time_s,", &["temp_counts", "gyro_z_counts"]), &[]),
    ] {
        let plain = same_both_ways(&write(&dir, name, text.as_bytes()), rate);
        let packed = same_both_ways(&write(&dir, &format!("{name}.gz"), &gzip(text.as_bytes())), rate);
        assert!(plain == packed, "{name}: compression changes the report");
        let quoted = text.replacen("gyro_z_counts", "\"gyro_z_counts\"", 1).replace('\n', "\r\n");
        assert!(plain == same_both_ways(&write(&dir, name, quoted.as_bytes()), rate), "{name}: line ends change it");
    }
}

#[test]
fn a_recorded_simulation_replays_to_the_same_report() {
    let dir = tempdir().expect("a folder");
    for name in ["log.csv", "log.csv.gz"] {
        let log = dir.path().join(name);
        let log = log.to_str().expect("UTF-8");
        let recorded = json_of(&dir, &["record", log, "--seconds", "5", "--seed", "7"]);
        assert!(recorded == json_of(&dir, &["replay", log]), "{name}");
        let report: Value = serde_json::from_slice(&recorded).expect("JSON");
        // 5 s at 204.8 samples per second.
        assert_eq!(report["samples"].as_u64().expect("a number") + dropped(&report), 1024);
        assert_eq!(report["dropped"]["gap"], 0);
        let rate = report["sample_rate_hz"].as_f64().expect("a number");
        // Data-ready times are rounded to 1 ns.
        assert!((rate - 204.8).abs() < 1e-6, "{rate}");
        assert_eq!(std::fs::read(log).expect("a log")[0] == 0x1f, name.ends_with(".gz"));
    }
}

/// Of more samples than are analysed without being condensed. The log is condensed from memory, the table as it is read: two rates, both
/// least-squares slopes, whose sums of 3·10⁵ stamps are rounded to 3·10⁻¹¹ of them. Figures may follow the rate with a factor of 10⁴,
/// as where a fit ends.
#[test]
fn a_long_simulation_has_the_report_of_its_table() {
    const TOLERANCE: f64 = 1e-6;
    let dir = tempdir().expect("a folder");
    let [log, table] = ["log.csv", "table.csv"].map(|name| dir.path().join(name).display().to_string());
    let recorded = json_of(&dir, &["record", &log, "--seconds", "1400", "--seed", "3"]);
    let converted = host_sim(&["convert", &log, &table]);
    assert!(converted.status.success(), "{}", String::from_utf8_lossy(&converted.stderr));
    let read = json_of(&dir, &["analyze", &table]);
    let parsed = |bytes: Vec<u8>| serde_json::from_slice::<Value>(&bytes).expect("JSON");
    let [recorded, read] = [recorded, read].map(parsed);
    assert!(recorded["samples"].as_u64() > Some(1 << 18), "{}", recorded["samples"]);
    assert_same(&recorded, &read, TOLERANCE, "");
}

/// Checks that all is equal, numbers that are no integers to within the relative `tolerance`.
fn assert_same(one: &Value, other: &Value, tolerance: f64, path: &str) {
    match (one, other) {
        (Value::Object(one), Value::Object(other)) => {
            assert!(one.keys().eq(other.keys()), "{path}: {:?} {:?}", one.keys(), other.keys());
            one.iter().for_each(|(key, value)| assert_same(value, &other[key], tolerance, &format!("{path}/{key}")));
        }
        (Value::Array(one), Value::Array(other)) => {
            assert_eq!(one.len(), other.len(), "{path}");
            for (at, (one, other)) in one.iter().zip(other).enumerate() {
                assert_same(one, other, tolerance, &format!("{path}/{at}"));
            }
        }
        (Value::Number(number), Value::Number(of_other)) if number.is_f64() && of_other.is_f64() => {
            let [one, other] = [number, of_other].map(|number| number.as_f64().expect("a number"));
            assert!((one - other).abs() <= tolerance * one.abs().max(other.abs()), "{path}: {one} {other}");
        }
        _ => assert_eq!(one, other, "{path}"),
    }
}

fn dropped(report: &Value) -> u64 {
    report["dropped"].as_object().expect("causes").values().filter_map(Value::as_u64).sum()
}

#[test]
fn frames_are_read_back_as_written() {
    let dir = tempdir().expect("a folder");
    let frames: Vec<Frame> = [0.0, 1e-9, 0.1 + 0.2, 1.0 / 3.0, 123_456_789.123_456_79, 1e300]
        .into_iter()
        .enumerate()
        .map(|(at, time_s)| Frame {
            time_s,
            mosi: (0..=255u8).skip(at).take(2 * at + 2).collect(),
            miso: (0..=255u8).rev().take(2 * at + 2).collect(),
        })
        .collect();
    for name in ["frames", "frames.gz"] {
        let file = dir.path().join(name);
        let mut log = FrameLogWriter::create(&file).expect("created");
        for frame in &frames {
            log.write(frame).expect("written");
        }
        log.finish().expect("closed");
        let mut reader = FrameLogReader::open(&file).expect("opened");
        for frame in &frames {
            assert_eq!(reader.next().expect("a line").as_ref(), Some(frame));
        }
        assert_eq!(reader.next().expect("the end"), None);
    }
}

#[test]
fn the_gyro_range_is_read_from_the_log() {
    // SENS_AVG is at 0x38, its upper byte at 0x39; 0b001 is ±75 deg/s (data sheet).
    let dir = tempdir().expect("a folder");
    let burst = |count: u16| {
        let data: String = (0..11).map(|_| format!("{:04X}", 0x8000 | count)).collect();
        format!("3E00{0},00008814{data}", "0".repeat(48))
    };
    let rows: String = (0..8).map(|i| format!("{}.5,{}\n", i + 1, burst(i * i))).collect();
    let log = |write: &str| format!("time_s,mosi,miso\n{write}{rows}");
    let adev = |text: &str| {
        let file = program::write(&dir, "log.csv", text.as_bytes());
        let report = json_of(&dir, &["replay", file.to_str().expect("UTF-8")]);
        let report: Value = serde_json::from_slice(&report).expect("JSON");
        let gyro = report["channels"][1].clone();
        assert_eq!(gyro["name"], "gyro_x");
        gyro["curve"][0]["adev"].as_f64().expect("a deviation")
    };
    let ratio = adev(&log("")) / adev(&log("0.5,B901,0000\n"));
    assert!((ratio - 4.0).abs() < 1e-12, "0.05 over 0.0125 deg/s: {ratio}");
}

/// As [`docs/own-logger.md`] has it: register counts with a logger's own names.
#[test]
fn counts_of_other_names_have_the_stated_range() {
    let dir = tempdir().expect("a folder");
    let rows: String = (0..64).map(|i| format!("{},{}\n", 4883 * i, i * i % 7)).collect();
    let file = program::write(&dir, "log.csv", format!("t_us,wx\n{rows}").as_bytes());
    let adev = |range: &str| {
        let columns = ["--sensor", "adis16405", "--columns", "gyro_x=wx,time=t_us", "--units", "counts,us"];
        let file = file.to_str().expect("UTF-8");
        let report = json_of(&dir, &[&["analyze", file, "--range", range][..], &columns].concat());
        let report: Value = serde_json::from_slice(&report).expect("JSON");
        report["channels"][0]["curve"][0]["adev"].as_f64().expect("a deviation")
    };
    let ratio = adev("300") / adev("75");
    assert!((ratio - 4.0).abs() < 1e-12, "0.05 over 0.0125 deg/s: {ratio}");
}
