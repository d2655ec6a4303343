//! Recordings of other sensors that other people made: they open as the documentation says, and their Allan deviations are those that other
//! programs find (`reference_curves.py`).

use crate::program::{host_sim, json_of};
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::Command;
use system_tests::{note_skipped, recording};
use tempfile::tempdir;

/// A file of the folder `others`.
fn other(test: &str, file: &str) -> Option<PathBuf> {
    recording(test, &format!("others/{file}"))
}

fn name(path: &Path) -> &str {
    path.to_str().expect("UTF-8")
}

fn report(arguments: &[&str]) -> Value {
    let dir = tempdir().expect("a folder");
    serde_json::from_slice(&json_of(&dir, &[&["analyze"], arguments].concat())).expect("JSON")
}

/// What a command writes to standard error, and whether it succeeds.
fn messages(arguments: &[&str]) -> (bool, String) {
    let output = host_sim(arguments);
    (output.status.success(), String::from_utf8_lossy(&output.stderr).into_owned())
}

/// What `reference_curves.py` finds.
fn reference(test: &str, arguments: &[&str]) -> Option<Value> {
    let Some(python) = std::env::var_os("ADIS_PYTHON").map(PathBuf::from).filter(|python| python.exists()) else {
        note_skipped(test, "ADIS_PYTHON names no Python with readers of the formats");
        return None;
    };
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/cli/reference_curves.py");
    let output = Command::new(python).arg(script).args(arguments).output().expect("Python starts");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    Some(serde_json::from_slice(&output.stdout).expect("JSON"))
}

/// Compares the points of the curves at 1, 2, 4 and 8 samples.
///
/// Numbers that are no multiples of a step are rounded to counts that add at most 1e-4 to the variance, 5e-5 to the deviation, and by chance
/// 1e-2/√n (1 σ): with 13,000 samples 5 σ are 4.4e-4.
fn compare(report: &Value, reference: &Value, tolerance: f64) {
    for (channel, expected) in reference["curves"].as_object().expect("channels") {
        let channels = report["channels"].as_array().expect("a list");
        let own = channels.iter().find(|known| known["name"] == channel.as_str()).expect(channel);
        for (at, expected) in expected.as_array().expect("a curve").iter().enumerate() {
            let samples = 1 << at;
            let points = own["curve"].as_array().expect("a curve").iter();
            let tau = samples as f64 / report["sample_rate_hz"].as_f64().expect("a rate");
            let is_at = |point: &&Value| (point["tau_s"].as_f64().expect("a time") / tau - 1.0).abs() < 1e-6;
            let point = points.clone().find(is_at).unwrap_or_else(|| panic!("{channel}: no point at {tau} s"));
            let ratio = point["adev"].as_f64().expect("a number") / expected.as_f64().expect("a number");
            assert!((ratio - 1.0).abs() < tolerance, "{channel} at {samples} samples: {ratio}");
        }
    }
}

/// A bag with a type of message of its own: two `Vector3` in it are found by the definition that the bag has.
#[test]
fn a_bag_with_its_own_type_of_message_opens_without_options() {
    let test = "a_bag_with_its_own_type_of_message_opens_without_options";
    let Some(file) = other(test, "vn100_nitin.bag") else { return };
    let report = report(&[name(&file)]);
    assert_eq!(report["samples"], 13_217);
    let rate = report["sample_rate_hz"].as_f64().expect("a rate");
    assert!((rate - 40.0).abs() < 0.04, "{rate}");
    let (is_read, notes) = messages(&["analyze", name(&file), "--quiet"]);
    assert!(is_read && notes.contains("taken to be in rad/s and m/s^2"), "{notes}");
    // Any field is read by its path.
    let columns = "gyro_x=angular_velocity.x,gyro_y=linear_acceleration.y";
    let (is_read, notes) = messages(&["analyze", name(&file), "--quiet", "--columns", columns, "--units", "rad/s"]);
    assert!(is_read, "{notes}");
    let (is_read, error) = messages(&["analyze", name(&file), "--columns", "gyro_x=rates.x"]);
    assert!(!is_read && error.contains("rates.x") && error.contains("angular_velocity.x"), "{error}");
    let Some(reference) = reference(test, &["ros1_bag", name(&file), "/imu"]) else { return };
    compare(&report, &reference, 1e-3);
}

/// A bag in SQLite without definitions names its topics and their types.
#[test]
fn a_database_without_definitions_names_its_topics_and_types() {
    let test = "a_database_without_definitions_names_its_topics_and_types";
    let Some(file) = other(test, "vn100_emulator_0.db3") else { return };
    let (is_read, error) = messages(&["analyze", name(&file)]);
    assert!(!is_read && error.lines().count() == 1, "{error}");
    assert!(error.contains("/imu") && error.contains("no definition of imu_msg/msg/IMUmsg"), "{error}");
}

/// Arrays in a structure, whose names say what they are.
#[test]
fn structures_of_matlab_open_without_options() {
    let test = "structures_of_matlab_open_without_options";
    for board in ["imu1_raw", "imu2_raw"] {
        let Some(file) = other(test, &format!("mpu9250_{board}.mat")) else { return };
        let report = report(&[name(&file)]);
        assert_eq!(report["samples"], 41_671);
        let rate = report["sample_rate_hz"].as_f64().expect("a rate");
        assert!((rate / 43.05 - 1.0).abs() < 1e-3, "{rate}");
        let columns = format!("time={board}.t,gyro_x={board}.wb.0");
        let (is_read, notes) =
            messages(&["analyze", name(&file), "--quiet", "--columns", &columns, "--units", "s,rad/s"]);
        assert!(is_read, "{notes}");
        let (is_read, error) = messages(&["analyze", name(&file), "--columns", "gyro_x=w"]);
        assert!(!is_read && error.contains(&format!("{board}.wb.0")), "{error}");
        let Some(reference) = reference(test, &["matlab_structure", name(&file), board]) else { return };
        compare(&report, &reference, 1e-3);
    }
}

/// MATLAB 7.3, which is HDF5: times and forces in one matrix.
#[test]
fn hdf5_of_matlab_is_read_by_its_path() {
    let test = "hdf5_of_matlab_is_read_by_its_path";
    let Some(file) = other(test, "mpu6050_accelerometer.mat") else { return };
    let (is_read, error) = messages(&["analyze", name(&file)]);
    assert!(!is_read && error.contains("accelBuffer.0"), "{error}");
    let columns = "accl_x=accelBuffer.1,accl_y=accelBuffer.2,accl_z=accelBuffer.3";
    // Without its time stamps, which come in bursts, its samples are neighbours.
    let dir = tempdir().expect("a folder");
    let array = dir.path().join("all.csv");
    let converted = messages(&["convert", name(&file), name(&array), "--columns", columns, "--units", "g"]);
    assert!(converted.0, "{}", converted.1);
    let report = report(&[name(&array), "--rate", "99.3"]);
    assert_eq!(report["samples"], 65_067);
    let Some(reference) = reference(test, &["hdf5", name(&file), "accelBuffer"]) else { return };
    compare(&report, &reference, 1e-3);
}

/// A log of Betaflight with dropped frames.
#[test]
fn a_blackbox_log_opens_without_options() {
    let test = "a_blackbox_log_opens_without_options";
    let Some(file) = other(test, "betaflight_btfl_001.bbl") else { return };
    let report = report(&[name(&file)]);
    // A loop of 125 us, of which the controller runs every second time and every second of those is logged.
    let rate = report["sample_rate_hz"].as_f64().expect("a rate");
    assert!((rate / 2000.0 - 1.0).abs() < 1e-2, "{rate}");
    let (samples, gaps) =
        (report["samples"].as_f64().expect("a number"), report["dropped"]["gap"].as_f64().expect("a number"));
    let lost = gaps / (samples + gaps);
    assert!((0.1..0.3).contains(&lost), "{lost} lost");
    let Some(reference) = reference(test, &["blackbox", name(&file)]) else { return };
    assert_eq!(report["samples"], reference["rows"]);
    // Every value: the sums of all rows, each times its number, are those of orangebox up to the rounding of a double.
    let dir = tempdir().expect("a folder");
    let table = dir.path().join("all.csv");
    let converted = messages(&["convert", name(&file), name(&table)]);
    assert!(converted.0, "{}", converted.1);
    let text = std::fs::read_to_string(&table).expect("a table");
    let mut lines = text.lines();
    let heading: Vec<&str> = lines.next().expect("a heading").split(',').collect();
    let mut sums = vec![0.0; heading.len()];
    for (row, line) in lines.enumerate() {
        for (sum, number) in sums.iter_mut().zip(line.split(',')) {
            *sum += (row + 1) as f64 * number.parse::<f64>().expect("a number");
        }
    }
    for (channel, expected) in reference["sums"].as_object().expect("channels") {
        let at = heading.iter().position(|name| name.starts_with(channel.as_str())).expect(channel);
        let expected = expected.as_f64().expect("a number");
        assert!((sums[at] / expected - 1.0).abs() < 1e-9, "{channel}: {} and {expected}", sums[at]);
    }
}

/// A log of PX4 opens without options; any other message of it is read by its name.
#[test]
fn any_message_of_a_ulog_is_read_by_its_name() {
    let test = "any_message_of_a_ulog_is_read_by_its_name";
    let Some(file) = other(test, "px4_sample.ulg") else { return };
    let report = report(&[name(&file)]);
    assert_eq!(report["samples"], 17_070);
    let arguments = ["analyze", name(&file), "--quiet", "--topic", "vehicle_attitude"];
    let columns =
        ["--columns", "time=timestamp,gyro_x=rollspeed,gyro_y=pitchspeed,gyro_z=yawspeed", "--units", "rad/s"];
    let (is_read, notes) = messages(&[&arguments[..], &columns].concat());
    assert!(is_read, "{notes}");
    let Some(reference) = reference(test, &["ulog", name(&file), "sensor_combined"]) else { return };
    compare(&report, &reference, 1e-3);
}

/// Tables of a converter's counts, of a sensor's own program, and of a flight controller's console. Numbers that are no multiples of a step
/// have counts as in [`compare`]: 5 σ of 12,000 samples are 4.6e-4.
#[test]
fn tables_of_other_programs_have_the_curves_of_allantools() {
    let test = "tables_of_other_programs_have_the_curves_of_allantools";
    let si = 180.0 / std::f64::consts::PI;
    let flight = format!("1:{si},2:{si},3:{si},4:{0},5:{0},6:{0}", 1.0 / 9.806_65);
    for (file, samples, arguments, columns) in [
        (
            "imutk_xsens_gyro.mat",
            51_175,
            &["--columns", "time=0,gyro_x=1,gyro_y=2,gyro_z=3", "--units", "s,deg/s"][..],
            "1:1,2:1,3:1",
        ),
        ("lsm6dso_static.txt", 973, &["--rate", "100"], "6:1,7:1,8:1,0:0.001,1:0.001,2:0.001"),
        ("stampfly_fft_20260114T115628.csv", 12_000, &["--units", "rad/s,m/s^2"], flight.as_str()),
    ] {
        let Some(file) = other(test, file) else { return };
        let report = report(&[&[name(&file)], arguments].concat());
        assert_eq!(report["samples"], samples);
        let Some(reference) = reference(test, &["text", name(&file), columns]) else { return };
        assert_eq!(reference["rows"], samples);
        compare(&report, &reference, 1e-3);
    }
}
