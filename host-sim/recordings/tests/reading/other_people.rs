//! Recordings of other sensors by other people, against the curves of other programs (`reference_curves.py`).

use super::harness::{Reading, inspect, read_file};
use serde_json::Value;
use std::f64::consts::PI;
use std::path::{Path, PathBuf};
use system_tests::{python, recording};

fn other(test: &str, file: &str) -> Option<PathBuf> {
    recording(test, &format!("others/{file}"))
}

fn reading(file: &Path, options: &[&str]) -> Reading {
    read_file(file, options).unwrap_or_else(|error| panic!("{error}"))
}

fn refusal(file: &Path, options: &[&str]) -> String {
    read_file(file, options).err().expect("refused").to_string()
}

/// Result of `reference_curves.py` with a reader and its argument.
fn reference(test: &str, reader: &str, file: &Path, argument: &str) -> Option<Value> {
    let arguments = [reader, file.to_str().expect("UTF-8"), argument];
    let output = python(test, "host-sim/recordings/tests/reference_curves.py", &arguments)?;
    Some(serde_json::from_slice(&output).expect("JSON"))
}

/// Compares the points at 1, 2, 4 and 8 samples, or with gaps the one at 1 sample; 5 σ of the rounding are 4.6e-4.
fn compare(read: &Reading, reference: &Value) {
    for (channel, expected) in reference["curves"].as_object().expect("channels") {
        for (at, expected) in expected.as_array().expect("a curve").iter().enumerate() {
            let samples = 1 << at;
            let found = if samples == 1 { read.neighbours(channel) } else { read.deviation(channel, samples) };
            let ratio = found / expected.as_f64().expect("a number");
            assert!((ratio - 1.0).abs() < 1e-3, "{channel} at {samples} samples: {ratio}");
        }
    }
}

struct Case {
    file: &'static str,
    options: &'static [&'static str],
    samples: usize,
    /// Rate in Hz by its source, and the relative tolerance.
    rate: Option<(f64, f64)>,
    /// Words of a note.
    note: &'static str,
    /// A reader of `reference_curves.py` and its argument.
    reader: Option<[&'static str; 2]>,
}

const CASE: Case = Case { file: "", options: &[], samples: 0, rate: None, note: "", reader: None };

#[test]
fn recordings_of_other_people_have_the_curves_of_other_programs() {
    let test = "recordings_of_other_people_have_the_curves_of_other_programs";
    let si = 180.0 / PI;
    let flight = format!("1:{si},2:{si},3:{si},4:{0},5:{0},6:{0}", 1.0 / 9.806_65);
    for Case { file, options, samples, rate, note, reader } in [
        // A type of message of its own: two `Vector3` in it are found by the definition that the bag has.
        Case {
            file: "vn100_nitin.bag",
            samples: 13_217,
            rate: Some((40.0, 1e-3)),
            note: "taken to be in rad/s and m/s^2",
            reader: Some(["ros1_bag", "/imu"]),
            ..CASE
        },
        // Arrays in a structure, whose names say what they are.
        Case {
            file: "mpu9250_imu1_raw.mat",
            samples: 41_671,
            rate: Some((43.05, 1e-3)),
            reader: Some(["matlab_structure", "imu1_raw"]),
            ..CASE
        },
        Case {
            file: "mpu9250_imu2_raw.mat",
            samples: 41_671,
            rate: Some((43.05, 1e-3)),
            reader: Some(["matlab_structure", "imu2_raw"]),
            ..CASE
        },
        // MATLAB 7.3, which is HDF5. Without its time stamps, which come in bursts, its samples are neighbours.
        Case {
            file: "mpu6050_accelerometer.mat",
            options: &[
                "--columns",
                "accl_x=accelBuffer.1,accl_y=accelBuffer.2,accl_z=accelBuffer.3",
                "--units",
                "g",
                "--rate",
                "99.3",
            ],
            samples: 65_067,
            reader: Some(["hdf5", "accelBuffer"]),
            ..CASE
        },
        Case { file: "px4_sample.ulg", samples: 17_070, reader: Some(["ulog", "sensor_combined"]), ..CASE },
        // Whole seconds at 5 Hz.
        Case {
            file: "phone_gyro4.txt",
            options: &["--columns", "gyro_x=2,gyro_y=3,gyro_z=4", "--units", "rad/s"],
            samples: 38_577,
            rate: Some((5.0, 1e-2)),
            ..CASE
        },
        // Counts of a converter, a sensor's own program, and a flight controller's console.
        Case {
            file: "imutk_xsens_gyro.mat",
            options: &["--columns", "time=0,gyro_x=1,gyro_y=2,gyro_z=3", "--units", "s,deg/s"],
            samples: 51_175,
            reader: Some(["text", "1:1,2:1,3:1"]),
            ..CASE
        },
        Case {
            file: "lsm6dso_static.txt",
            options: &["--rate", "100"],
            samples: 973,
            reader: Some(["text", "6:1,7:1,8:1,0:0.001,1:0.001,2:0.001"]),
            ..CASE
        },
        Case {
            file: "stampfly_fft_20260114T115628.csv",
            options: &["--units", "rad/s,m/s^2"],
            samples: 12_000,
            reader: Some(["text", ""]),
            ..CASE
        },
    ] {
        let Some(path) = other(test, file) else { return };
        let read = reading(&path, options);
        assert_eq!(read.samples.len(), samples, "{file}");
        if let Some((rate, tolerance)) = rate {
            assert!((read.rate_hz() / rate - 1.0).abs() < tolerance, "{file}: {}", read.rate_hz());
        }
        assert!(note.is_empty() || read.notes_contain(note), "{file}: {:?}", read.notes);
        let Some([reader, argument]) = reader else { continue };
        let argument = if argument.is_empty() { flight.as_str() } else { argument };
        let Some(reference) = reference(test, reader, &path, argument) else { return };
        assert_eq!(reference["rows"], samples, "{file}");
        compare(&read, &reference);
    }
}

#[test]
fn any_column_is_read_by_its_path() {
    let test = "any_column_is_read_by_its_path";
    for (file, options) in [
        (
            "vn100_nitin.bag",
            &["--columns", "gyro_x=angular_velocity.x,gyro_y=linear_acceleration.y", "--units", "rad/s"][..],
        ),
        ("mpu9250_imu1_raw.mat", &["--columns", "time=imu1_raw.t,gyro_x=imu1_raw.wb.0", "--units", "s,rad/s"]),
        (
            "px4_sample.ulg",
            &[
                "--topic",
                "vehicle_attitude",
                "--columns",
                "time=timestamp,gyro_x=rollspeed,gyro_y=pitchspeed,gyro_z=yawspeed",
                "--units",
                "rad/s",
            ],
        ),
    ] {
        let Some(path) = other(test, file) else { return };
        assert!(reading(&path, options).samples.len() > 1000, "{file}");
    }
    for (file, options, words) in [
        ("vn100_nitin.bag", &["--columns", "gyro_x=rates.x"][..], &["rates.x", "angular_velocity.x"][..]),
        ("mpu9250_imu1_raw.mat", &["--columns", "gyro_x=w"], &["imu1_raw.wb.0"]),
        ("mpu6050_accelerometer.mat", &[], &["accelBuffer.0"]),
        // A bag in SQLite without definitions names its topics and their types.
        ("vn100_emulator_0.db3", &[], &["/imu", "no definition of imu_msg/msg/IMUmsg"]),
    ] {
        let Some(path) = other(test, file) else { return };
        let error = refusal(&path, options);
        assert!(words.iter().all(|word| error.contains(word)), "{file}: {error}");
    }
}

#[test]
fn other_peoples_files_are_described() {
    let test = "other_peoples_files_are_described";
    for (file, rows, rate_hz, gaps, columns, units) in [
        ("vn100_nitin.bag", 13_217, Some(39.9999), 0, "", ""),
        ("mpu9250_imu1_raw.mat", 41_671, Some(43.05), 0, "", ""),
        ("mpu6050_accelerometer.mat", 65_067, Some(99.2976), 0, "accl_x=accelBuffer.1", "g"),
        ("px4_sample.ulg", 17_070, Some(248.55), 8, "", ""),
        ("phone_gyro4.txt", 38_577, Some(5.0), 0, "gyro_x=2,gyro_y=3,gyro_z=4", ""),
        ("imutk_xsens_gyro.mat", 51_175, Some(100.0), 0, "time=0,gyro_x=1,gyro_y=2,gyro_z=3", "deg/s"),
        ("lsm6dso_static.txt", 973, None, 0, "", ""),
        ("stampfly_fft_20260114T115628.csv", 12_000, Some(399.98), 0, "", "rad/s,m/s^2"),
    ] {
        let Some(path) = other(test, file) else { return };
        let tables = inspect(&path);
        let table = tables.iter().find(|table| table.rows == rows).unwrap_or_else(|| panic!("{file}: {tables:?}"));
        let rate = table.rate.map(|rate| rate.hz);
        match (rate, rate_hz) {
            (Some(rate), Some(expected)) => assert!((rate / expected - 1.0).abs() < 1e-2, "{file}: {rate}"),
            (rate, expected) => assert_eq!(rate, expected, "{file}"),
        }
        assert_eq!(table.gaps, gaps, "{file}");
        let [proposal, ..] = &table.proposals[..] else { panic!("{file}: no proposal") };
        assert!(proposal.columns.join(",").contains(columns), "{file}: {proposal:?}");
        assert!(proposal.units.join(",").contains(units), "{file}: {proposal:?}");
        assert_eq!(proposal.lacks_rate, rate_hz.is_none(), "{file}");
    }
}
