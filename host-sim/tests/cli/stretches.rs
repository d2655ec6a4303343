//! Parts of a recording by time.

use crate::program::{host_sim, json_of, write};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde_json::Value;
use std::path::Path;
use tempfile::tempdir;

fn name(file: &Path) -> &str {
    file.to_str().expect("UTF-8")
}

/// By an index and a stated rate, by time stamps, and by the number of the row; with samples lost before, in and after the part.
#[test]
fn a_part_is_what_a_file_of_it_would_be() {
    let dir = tempdir().expect("a folder");
    let mut rng = ChaCha8Rng::seed_from_u64(13);
    let rows: Vec<(u32, i32)> = (0..20_000)
        .map(|row| (row, (0..12).map(|_| rng.random_range(-20..=20)).sum::<i32>()))
        .filter(|(row, _)| ![100, 8000, 8001, 19_000].contains(row))
        .collect();
    let of_index: fn(&(u32, i32)) -> String = |(row, count)| format!("{row},{count}\n");
    let of_time: fn(&(u32, i32)) -> String = |(row, count)| format!("{}.{:02},{count}\n", row / 100, row % 100);
    let of_row: fn(&(u32, i32)) -> String = |(_, count)| format!("{count}\n");
    for (heading, line, rate, samples, lost) in [
        ("sample,gyro_x_counts", of_index, &["--rate", "100"][..], 9998, 2),
        ("time_s,gyro_x_counts", of_time, &[], 9998, 2),
        ("time_s,gyro_x [dps]", of_time, &[], 9998, 2),
        ("gyro_x_deg_s", of_row, &["--rate", "100"], 10_000, 0),
    ] {
        let is_inside = |(position, (row, _)): &(usize, (u32, i32))| match lost {
            0 => (5000..15_000).contains(position),
            _ => (5000..15_000).contains(row),
        };
        let all = rows.iter().copied().enumerate();
        let of = |rows: Vec<(u32, i32)>| format!("{heading}\n{}", rows.iter().map(line).collect::<String>());
        let whole = write(&dir, "whole.csv", of(rows.clone()).as_bytes());
        let part = write(&dir, "part.csv", of(all.filter(is_inside).map(|(_, row)| row).collect()).as_bytes());
        let cut = json_of(&dir, &[&["analyze", name(&whole), "--from", "50", "--to", "150"], rate].concat());
        let [cut, part]: [Value; 2] = [cut, json_of(&dir, &[&["analyze", name(&part)], rate].concat())]
            .map(|bytes| serde_json::from_slice(&bytes).expect("JSON"));
        assert_eq!((&cut["samples"], &cut["dropped"]["gap"]), (&Value::from(samples), &Value::from(lost)), "{heading}");
        let curve = |report: &Value| report["channels"][0]["curve"].clone();
        assert_eq!(curve(&cut), curve(&part), "{heading}");
    }
}

/// A part that is converted is the table of its rows.
#[test]
fn a_part_is_converted() {
    let dir = tempdir().expect("a folder");
    let rows: String = (0..3000).map(|row| format!("{}.{:02},{}\n", row / 100, row % 100, row * 7919 % 41)).collect();
    let file = write(&dir, "rows.csv", format!("time_s,gyro_x [dps]\n{rows}").as_bytes());
    let part = dir.path().join("part.csv");
    let arguments = ["convert", name(&file), name(&part), "--from", "5", "--to", "10", "--format", "table"];
    let output = host_sim(&arguments);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let text = std::fs::read_to_string(&part).expect("a table");
    let found: Vec<&str> = text.lines().skip(1).filter_map(|line| line.rsplit(',').next()).collect();
    let expected: Vec<String> = (500..1000).map(|row| (row * 7919 % 41).to_string()).collect();
    assert_eq!(found, expected);
}

#[test]
fn a_part_without_a_sample_is_refused() {
    let dir = tempdir().expect("a folder");
    let rows: String = (0..2000).map(|row| format!("{}\n", row * 7919 % 41)).collect();
    let file = write(&dir, "rows.csv", format!("gyro_x_counts\n{rows}").as_bytes());
    let error = |arguments: &[&str]| {
        let output = host_sim(&[&["analyze", name(&file)], arguments].concat());
        assert!(!output.status.success());
        String::from_utf8_lossy(&output.stderr).into_owned()
    };
    assert!(error(&["--rate", "100", "--from", "500"]).contains("the recording has 19.990 s"));
    assert!(error(&["--rate", "100", "--from", "5", "--to", "5"]).contains("no sample from 5 to 5 s"));
    assert!(error(&["--rate", "100", "--from", "5", "--to", "5.02"]).contains("record too short: 2 usable samples"));
    // Without a rate nothing says where 5 s are.
    assert!(error(&["--from", "5"]).contains("no sample rate"));
    assert_eq!(host_sim(&["analyze", name(&file), "--from", "-1"]).status.code(), Some(2));
    assert_eq!(host_sim(&["analyze", name(&file), "--to", "nan"]).status.code(), Some(2));
}
