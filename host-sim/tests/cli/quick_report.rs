//! `analyze --quick`: its curves are those of the whole analysis, it reads in blocks, and it says what it did not look for.
//!
//! The recordings have more rows than are held in memory, 2¹⁷, so that they are read in blocks.

use crate::program::{analysis_of, gzip, imunoise, json_of, write};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde_json::Value;
use std::fmt::Write;
use std::path::Path;
use std::process::Command;
use tempfile::{TempDir, tempdir};

/// Rows of the generated tables.
const ROWS: usize = 150_000;

/// Nearly normal noise with a standard deviation of 1: the sum of twelve uniform numbers.
fn noise(random: &mut ChaCha8Rng) -> f64 {
    (0..12).map(|_| random.random::<f64>()).sum::<f64>() - 6.0
}

/// A table of register counts at 100 Hz. `stamp` gives the time stamps of a row, as text that ends in a comma, or `None` where the row
/// is lost.
fn counts(header: &str, mut stamp: impl FnMut(usize, &mut ChaCha8Rng) -> Option<String>) -> String {
    let mut random = ChaCha8Rng::seed_from_u64(21);
    let mut table = format!("{header}gyro_x_counts,accl_z_counts,supply_counts\n");
    for row in 0..ROWS {
        let [gyro, accl] = [noise(&mut random), noise(&mut random)].map(|noise| (8.0 * noise).round() as i32);
        let Some(stamp) = stamp(row, &mut random) else { continue };
        // A damaged word of the gyro, a refused sample of that channel; a supply that is too low, a warning.
        let gyro = if row % 9973 == 77 { 8000 } else { gyro };
        let supply = if row % 7001 == 5 { 1900 } else { 2068 };
        writeln!(table, "{stamp}{gyro},{},{supply}", accl - 300).expect("memory");
    }
    table
}

/// Rows that are lost: single ones at random, a run of nine and one of four thousand.
fn is_lost(row: usize, random: &mut ChaCha8Rng) -> bool {
    random.random_bool(0.003) || (70_000..70_009).contains(&row) || (120_000..124_000).contains(&row)
}

/// The whole report and the quick one of a file.
fn both(dir: &TempDir, file: &Path, arguments: &[&str]) -> [Value; 2] {
    let file = file.to_str().expect("UTF-8");
    [&[][..], &["--quick"]].map(|quick| {
        let bytes = json_of(dir, &[&["analyze", file, "--quiet"], arguments, quick].concat());
        serde_json::from_slice(&bytes).expect("JSON")
    })
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value} is no number"))
}

/// Checks that the curves are the same; deviations may differ by the relative `tolerance`, because another sample of the numbers may
/// give the size of a count in other last digits. The rate is by sums in another order: the averaging times agree to 10⁻⁶.
fn assert_same_curves([whole, quick]: &[Value; 2], tolerance: f64) {
    assert_eq!(quick["quick"], true);
    assert_eq!(whole["quick"], Value::Null);
    for key in ["schema", "samples", "dropped"] {
        assert_eq!(whole[key], quick[key], "{key}");
    }
    let rate = number(&quick["sample_rate_hz"]) / number(&whole["sample_rate_hz"]);
    assert!((rate - 1.0).abs() < 1e-6, "{rate}");
    let channels = |report: &Value| report["channels"].as_array().expect("channels").clone();
    assert_eq!(channels(whole).len(), channels(quick).len());
    for (whole, quick) in channels(whole).iter().zip(&channels(quick)) {
        let name = &whole["name"];
        assert_eq!(name, &quick["name"]);
        assert_eq!(whole["lost"], quick["lost"], "{name}");
        let curve = |of: &Value| of["curve"].as_array().expect("a curve").clone();
        assert_eq!(curve(whole).len(), curve(quick).len(), "{name}");
        for (whole, quick) in curve(whole).iter().zip(&curve(quick)) {
            assert_eq!(whole["n"], quick["n"]);
            assert_eq!(whole["replaced_percent"], quick["replaced_percent"], "{name} {}", whole["n"]);
            let ratio = |key: &str| number(&quick[key]) / number(&whole[key]);
            let is_same = number(&whole["adev"]) == number(&quick["adev"]) || (ratio("adev") - 1.0).abs() <= tolerance;
            assert!(is_same, "{name} {}: {} {}", whole["n"], whole["adev"], quick["adev"]);
            assert!((ratio("tau_s") - 1.0).abs() < 1e-6, "{name} {}", whole["n"]);
        }
    }
}

#[test]
fn curves_and_baseline_models_without_time_stamps_are_those_of_the_whole_analysis() {
    let dir = tempdir().expect("a folder");
    let table = counts("", |_, _| Some(String::new()));
    let plain = write(&dir, "plain.csv", table.as_bytes());
    let reports = both(&dir, &plain, &["--rate", "100"]);
    assert_same_curves(&reports, 0.0);
    let [whole, quick] = &reports;
    assert_eq!(quick["dropped"]["gap"], 0);
    assert_eq!(quick["flagged"]["supply"], (ROWS - 5).div_ceil(7001));
    for (whole, quick) in
        whole["channels"].as_array().expect("channels").iter().zip(quick["channels"].as_array().expect("channels"))
    {
        // White noise has neither spikes nor covariates, so that the model of the first half as it was recorded is of the same noise: by
        // all samples there, and here by the octaves.
        let white = |report: &Value| report["before"]["terms"][0]["parameters"]["value"].clone();
        let (by_samples, by_octaves) = (white(whole), white(quick));
        let number = |of: &Value, name: &str| of[name].as_f64().expect("a number");
        for (one, other) in [(&by_samples, &by_octaves), (&by_octaves, &by_samples)] {
            let interval = number(one, "low")..=number(one, "high");
            assert!(interval.contains(&number(other, "value")), "{}: {one} {other}", whole["name"]);
        }
        assert_eq!(whole["read_off"], quick["read_off"], "{}", whole["name"]);
        for point in quick["curve"].as_array().expect("a curve") {
            assert_eq!(point["adev_by_spectrum"], Value::Null);
        }
        assert_eq!(quick["spectrum"], Value::Null);
    }
    // One row in 9973 is refused, in the gyro alone.
    let gyro =
        quick["channels"].as_array().and_then(|all| all.iter().find(|of| of["name"] == "gyro_x")).expect("gyro x");
    assert_eq!(gyro["refused"]["impossible_rate"], (ROWS - 77).div_ceil(9973));
    let zipped = write(&dir, "zipped.csv.gz", &gzip(table.as_bytes()));
    let arguments = |file: &Path| {
        let file = file.to_str().expect("UTF-8").to_owned();
        analysis_of(&dir, &["analyze", &file, "--rate", "100", "--quick", "--quiet"])
    };
    assert_eq!(arguments(&plain), arguments(&zipped));
}

/// The whole analysis condenses a recording of more than 2¹⁸ samples, whose curves are still those of all of them.
#[test]
fn curves_of_a_long_recording_are_those_of_the_whole_analysis() {
    let dir = tempdir().expect("a folder");
    let mut random = ChaCha8Rng::seed_from_u64(22);
    let mut table = "sample,gyro_x_counts\n".to_owned();
    let rows = (0..1_070_000).filter(|row| row % 401 != 7 && !(700_000..703_000).contains(row));
    for row in rows {
        writeln!(table, "{row},{}", (8.0 * noise(&mut random)).round()).expect("memory");
    }
    let file = write(&dir, "long.csv", table.as_bytes());
    let reports = both(&dir, &file, &["--rate", "100"]);
    assert_same_curves(&reports, 0.0);
    let [whole, _] = &reports;
    assert_eq!(whole["samples"], table.lines().count() - 1);
    let findings = whole["findings"].as_array().expect("findings");
    assert!(findings.iter().all(|finding| finding["kind"] == "dropped_samples"), "{findings:?}");
    assert!(whole["channels"][0]["spectrum"].is_object());
}

#[test]
fn curves_with_gaps_are_those_of_the_whole_analysis() {
    let dir = tempdir().expect("a folder");
    // An index with gaps beside times of a host that reads up to 2 ms late.
    let indexed = counts("sample,time_s,", |row, random| {
        let time = row as f64 / 100.003 + random.random_range(0.0..0.002);
        (!is_lost(row, random)).then(|| format!("{row},{time:.6},"))
    });
    let reports = both(&dir, &write(&dir, "indexed.csv", indexed.as_bytes()), &[]);
    assert_same_curves(&reports, 0.0);
    assert!(reports[1]["dropped"]["gap"].as_u64().is_some_and(|gap| gap > 4009 + 300));
    // Times alone, of a host that reads up to 2 ms late and now and then is busy for 70 ms.
    let stamped = counts("time_s,", |row, random| {
        let period = 1.0 / 100.003;
        let (time, late) = (row as f64 * period, random.random_range(0.0..0.002));
        let busy_until = (row / 20_011 * 20_011) as f64 * period + 0.07;
        let read = if row > 20_011 { (time + late).max(busy_until) } else { time + late };
        (!is_lost(row, random)).then(|| format!("{read:.6},"))
    });
    let reports = both(&dir, &write(&dir, "stamped.csv.gz", &gzip(stamped.as_bytes())), &[]);
    assert_same_curves(&reports, 0.0);
    // In each of the 7 times in which the host is busy and reads late, the last one or two are about one period late,
    // from which on they count.
    let late = reports.map(|report| number(&report["flagged"]["late_delivery"]));
    assert!((late[0] - late[1]).abs() <= 2.0 * 7.0, "{late:?}");
}

#[test]
fn curves_of_numbers_in_any_unit_are_those_of_the_whole_analysis() {
    let dir = tempdir().expect("a folder");
    let mut random = ChaCha8Rng::seed_from_u64(22);
    let mut table = "time_us,gyro_x [rad/s],gyro_y [rad/s],accl_z [m/s^2]\n".to_owned();
    for row in 0..ROWS {
        let [x, y, z] = [(); 3].map(|()| noise(&mut random));
        if is_lost(row, &mut random) {
            continue;
        }
        // Counts of 1/16.4 °/s, numbers of no step, and a field without a number.
        let x = (20.0 * x).round() / 16.4_f64 * std::f64::consts::PI / 180.0;
        let (y, z) = (1e-3 * y, 9.81 + 0.02 * z);
        let z = if row % 10_007 == 9 { String::new() } else { format!("{z}") };
        writeln!(table, "{},{x},{y},{z}", 1_700_000_000_000_000_u64 + row as u64 * 5000).expect("memory");
    }
    let text = write(&dir, "units.csv", table.as_bytes());
    let reports = both(&dir, &text, &[]);
    // 10⁻⁹: the LSB is the quotient of sums of some thousand doubles.
    assert_same_curves(&reports, 1e-9);
    assert_eq!(reports[0]["channels"][2]["refused"], reports[1]["channels"][2]["refused"]);
    let array = dir.path().join("units.npy");
    let array = array.to_str().expect("UTF-8");
    assert!(imunoise(&["convert", text.to_str().expect("UTF-8"), array]).status.success());
    let columns = ["--columns", "time=0,gyro_x=1,gyro_y=2,accl_z=3", "--units", "s,rad/s,m/s^2"];
    let reports = both(&dir, Path::new(array), &columns);
    assert_same_curves(&reports, 1e-9);
}

#[test]
fn stamps_that_are_coarser_than_the_sample_period_are_read_like_others() {
    let dir = tempdir().expect("a folder");
    let table = counts("time_s,", |row, _| Some(format!("{:.1},", row as f64 / 100.0)));
    let file = write(&dir, "coarse.csv", table.as_bytes());
    let output = imunoise(&["analyze", file.to_str().expect("UTF-8"), "--quick"]);
    let notes = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success() && notes.contains("coarser than the sample period"), "{notes}");
}

#[test]
fn the_number_of_cores_changes_no_byte_and_the_screen_says_what_is_missing() {
    let dir = tempdir().expect("a folder");
    let file = write(&dir, "x.csv", counts("", |_, _| Some(String::new())).as_bytes());
    let run = |cores: &[&str]| {
        let program = [cores, &[env!("CARGO_BIN_EXE_imunoise")]].concat();
        let output = Command::new(program[0])
            .args(&program[1..])
            .args(["analyze", file.to_str().expect("UTF-8"), "--rate", "100", "--quick", "-o", "-"])
            .output()
            .expect("the program starts");
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        output.stdout
    };
    assert_eq!(run(&[]), run(&["taskset", "-c", "0"]));
    let (page, file) = (dir.path().join("page.html"), file.to_str().expect("UTF-8"));
    let output = imunoise(&["analyze", file, "--rate", "100", "--quick", "-o", page.to_str().expect("UTF-8")]);
    let screen = String::from_utf8_lossy(&output.stdout).replace('\n', " ");
    let page = std::fs::read_to_string(page).expect("a page");
    for (text, place) in [(&screen, "screen"), (&page, "page")] {
        assert!(text.contains("Quick report, of the curves alone"), "{place}");
    }
}

#[test]
fn the_curves_of_the_measured_recordings_are_those_of_the_whole_analysis() {
    let test = "the_curves_of_the_measured_recordings_are_those_of_the_whole_analysis";
    let dir = tempdir().expect("a folder");
    for (file, rate) in
        [("adis16405-static/run3.csv.gz", &["--rate", "100"][..]), ("adis16405-burst/launch10.csv.gz", &[])]
    {
        let Some(file) = system_tests::recording(test, file) else { return };
        assert_same_curves(&both(&dir, &file, rate), 0.0);
    }
}
