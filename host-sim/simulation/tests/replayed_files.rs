//! A replayed file gives the same recording as a read one, or is refused with its line.

use adis16405_driver::GyroRange;
use recordings::InputError;
use recordings::count_table;
use recordings::time_base::time_base;
use simulation::{Replay, replay};
use std::fmt::Write;

/// Replays a file with this content.
fn replayed(text: &str) -> Result<Replay, InputError> {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("file.csv");
    std::fs::write(&file, text).expect("written");
    replay(&file, GyroRange::default())
}

fn refusal(text: &str) -> String {
    replayed(text).expect_err("refused").to_string()
}

/// A table of pseudo-random counts that fill their register fields, from a linear congruential generator.
fn table(clock: &str, columns: &[&str]) -> String {
    let mut text = format!("{clock}{}\n", columns.join(","));
    let mut state = 12_345u64;
    for row in 0..400 {
        match clock {
            "" => {}
            "sample," => write!(text, "{},", row + row / 100).expect("a string"),
            _ => write!(text, "{},", f64::from(row) / 819.2).expect("a string"),
        }
        let counts = columns.iter().map(|column| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            match *column {
                "supply_counts" | "aux_adc_counts" => (state >> 52) as i32,
                "temp_counts" => (state >> 52) as i32 - 2048,
                _ => (state >> 50) as i32 - 8192,
            }
            .to_string()
        });
        text += &counts.collect::<Vec<_>>().join(",");
        text.push('\n');
    }
    text
}

#[test]
fn a_table_is_replayed_to_the_recording_that_is_read() {
    let all = "supply,gyro_x,gyro_y,gyro_z,accl_x,accl_y,accl_z,magn_x,magn_y,magn_z,temp,aux_adc";
    let all: Vec<String> = all.split(',').map(|channel| format!("{channel}_counts")).collect();
    let all: Vec<&str> = all.iter().map(String::as_str).collect();
    let backwards: Vec<&str> = all.iter().rev().copied().collect();
    for (clock, columns) in [
        ("time_s,", &all[..]),
        ("sample,", &backwards),
        ("", &["accl_y_counts"]),
        ("time_s,", &["temp_counts", "gyro_z_counts"]),
    ] {
        let plain = table(clock, columns);
        for text in [plain.clone(), plain.replacen("gyro_z_counts", "\"gyro_z_counts\"", 1).replace('\n', "\r\n")] {
            let folder = tempfile::tempdir().expect("a folder");
            let file = folder.path().join("table.csv");
            std::fs::write(&file, &text).expect("written");
            let read = count_table::read(&file, GyroRange::default()).expect("a table");
            assert_eq!(replayed(&text).expect("a table").recording, read, "{clock} {columns:?}");
        }
    }
}

/// A log of bursts with the squares of their numbers, and a write before each burst of the given numbers.
fn log(writes: &[(u32, &str)]) -> String {
    let mut text = String::from("time_s,mosi,miso\n");
    for i in 0..=60_u32 {
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

/// SENS_AVG is at 0x38, its upper byte at 0x39; 0b001 is ±75 deg/s (data sheet).
#[test]
fn the_gyro_range_is_that_of_the_last_write_before_the_bursts() {
    let plain = replayed(&log(&[])).expect("a log");
    assert_eq!((plain.recording.range, plain.recording.samples.len()), (GyroRange::Dps300, 60));
    let range = |writes: &[(u32, &str)]| replayed(&log(writes)).expect("a log").recording.range;
    assert_eq!(range(&[(0, "B901")]), GyroRange::Dps75);
    assert_eq!(range(&[(0, "B901"), (30, "B901")]), GyroRange::Dps75, "the same range twice");
    assert_eq!(replayed(&log(&[(60, "B901")])).expect("a log").recording, plain.recording, "after the last burst");
    let error = refusal(&log(&[(30, "B901")]));
    assert!(error.contains("line 33") && error.contains("from 300 to 75 deg/s"), "{error}");
}

#[test]
fn a_log_is_read_behind_a_byte_order_mark_or_blank_lines() {
    let plain = replayed(&log(&[])).expect("a log").recording;
    for start in ["\u{feff}", "\n", "\r\n \n"] {
        assert_eq!(replayed(&format!("{start}{}", log(&[]))).expect("a log").recording, plain, "{start:?}");
    }
}

#[test]
fn a_transaction_that_is_no_burst_of_the_driver_is_refused() {
    let zeros = |digits: usize| "0".repeat(digits);
    for (text, words) in [
        ("a,b\n1,2\n".to_owned(), &["line 1", "no known column", "gyro_x_counts"][..]),
        ("time_s\n0\n".to_owned(), &["line 1", "no known column"]),
        ("time_s,mosi,miso\n0.1,5600,0000\n".to_owned(), &["no burst", "26 bytes", "3E00"]),
        (format!("time_s,mosi,miso\n0.1,3E01{0},3E01{0}\n", zeros(48)), &["no burst", "26 bytes", "3E00"]),
        (
            format!("time_s,mosi,miso\n0.1,3E{0}1,3E{0}1\n", zeros(49)),
            &["line 2", "replay over the bus", "OtherRequest"],
        ),
    ] {
        let error = refusal(&text);
        assert!(words.iter().all(|word| error.contains(word)), "{text}: {error}");
    }
}

#[test]
fn a_record_of_refused_samples_names_the_causes() {
    let rows: String =
        (1..=10).map(|second| format!("{second}.5,3E00{},{}\n", "0".repeat(48), "F".repeat(52))).collect();
    let stuck = replayed(&format!("time_s,mosi,miso\n{rows}")).expect("a log").recording;
    let error = time_base(&stuck, None).expect_err("no sample").to_string();
    assert!(error.contains("0 usable samples") && error.contains("stuck_high 10"), "{error}");
}
