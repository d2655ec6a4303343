//! The numbers of a report in other programs, read back by their parsers.

use clap::ValueEnum;
use reports::export::{AxisChoice, Export, ExportFormat, export};
use reports::saved_report::SavedReport;
use serde_json::{Value, json};
use std::f64::consts::{LN_2, PI};
use std::path::Path;
use std::process::Command;

const RATE_HZ: f64 = 100.0;
/// N, B and K of the axes x, y and z: deg/√s, deg/s, deg/s/√s.
const GYRO: [[f64; 3]; 3] = [[0.0368, 0.0093, 0.0013], [0.05, 0.0093, 0.0], [0.03, 0.0, 0.002]];
/// g/√Hz, g, g/√s.
const ACCL: [[f64; 3]; 3] = [[340e-6, 0.2e-3, 1e-5], [300e-6, 0.1e-3, 2e-5], [400e-6, 0.3e-3, 0.0]];
/// Upper bound of the K that is 0.
const GYRO_Y_BOUND: f64 = 0.0007;
const ACCL_Z_BOUND: f64 = 3e-6;
const GRAVITY: f64 = 9.806_65;
/// Four digits, squared.
const FOUR_DIGITS: f64 = 1.1e-3;

/// IEEE Std 952.
fn avar([n, b, k]: [f64; 3], tau: f64) -> f64 {
    n * n / tau + 2.0 * LN_2 / PI * b * b + k * k * tau / 3.0
}

fn channel(name: &str, unit: &str, coefficients: [f64; 3], bound: f64) -> Value {
    let factors: Vec<u64> = (0..16).map(|octave| 1 << octave).collect();
    let adev: Vec<f64> = factors.iter().map(|n| avar(coefficients, *n as f64 / RATE_HZ).sqrt()).collect();
    let point = |(n, adev): (&u64, &f64)| json!({"n": n, "tau_s": *n as f64 / RATE_HZ, "adev": adev, "low": 0.9 * adev, "high": 1.1 * adev, "edf": 1.5e6 / *n as f64});
    let term = |(kind, value): (&str, f64)| {
        let high = if value > 0.0 { 1.1 * value } else { bound };
        json!({"kind": kind, "parameters": {"value": {"value": value, "low": 0.9 * value, "high": high, "unit": "irrelevant"}}})
    };
    let kinds = ["angle_random_walk", "bias_instability", "rate_random_walk"];
    json!({
        "name": name, "unit": unit,
        "curve": factors.iter().zip(&adev).map(point).collect::<Vec<_>>(),
        "final": {"terms": kinds.into_iter().zip(coefficients).map(term).collect::<Vec<_>>(), "adev": adev},
    })
}

fn report() -> Value {
    let axes = ["x", "y", "z"].into_iter();
    let gyro = axes.clone().zip(GYRO).map(|(axis, of)| channel(&format!("gyro_{axis}"), "deg/s", of, GYRO_Y_BOUND));
    let accl = axes.zip(ACCL).map(|(axis, of)| channel(&format!("accl_{axis}"), "g", of, ACCL_Z_BOUND));
    json!({"schema": 2, "sample_rate_hz": RATE_HZ, "channels": gyro.chain(accl).collect::<Vec<_>>()})
}

fn si(sensor: [[f64; 3]; 3], index: usize) -> [f64; 3] {
    let (factor, bound) = if sensor == GYRO { (PI / 180.0, GYRO_Y_BOUND) } else { (GRAVITY, ACCL_Z_BOUND) };
    sensor.map(|axis| factor * if index == 2 && axis[2] == 0.0 { bound } else { axis[index] })
}

fn rms(values: [f64; 3]) -> f64 {
    (values.iter().map(|value| value * value).sum::<f64>() / 3.0).sqrt()
}

fn worst(values: [f64; 3]) -> f64 {
    values.into_iter().fold(0.0, f64::max)
}

fn written(report: &Value, format: &str, axis: AxisChoice) -> Result<Export, String> {
    let report = SavedReport::from_json(&report.to_string()).map_err(|error| error.to_string())?;
    let format = ExportFormat::from_str(format, false).expect(format);
    export(&report, format, axis).map_err(|error| error.to_string())
}

fn exported(report: &Value, format: &str) -> String {
    written(report, format, AxisChoice::Rms).unwrap_or_else(|error| panic!("{format}: {error}")).text
}

/// An array also has its first number under its key.
fn numbers(text: &str) -> Vec<(String, Vec<f64>)> {
    let line = |line: &str| {
        let (key, rest) = line.split_once([':', '='])?;
        let rest = rest.split('#').next()?.replace(['[', ']', ','], " ").replace("np.array(", "").replace(')', "");
        let values: Option<Vec<f64>> = rest.split_whitespace().map(|word| word.parse().ok()).collect();
        values.filter(|values| !values.is_empty()).map(|values| (key.trim().to_owned(), values))
    };
    text.lines().filter(|line| !line.trim_start().starts_with('#')).filter_map(line).collect()
}

/// 7 digits are written.
fn assert_close(found: &[f64], expected: &[f64], what: &str) {
    assert_eq!(found.len(), expected.len(), "{what}");
    for (found, expected) in found.iter().zip(expected) {
        assert!((found / expected - 1.0).abs() < FOUR_DIGITS, "{what}: {found}, not {expected}");
    }
}

fn assert_number(file: &str, key: &str, expected: &[f64]) {
    let all = numbers(file);
    let found = all.iter().find(|(name, _)| name == key).unwrap_or_else(|| panic!("{key} in {all:?}"));
    assert_close(&found.1, expected, key);
}

/// VINS has N·√f and K·√f.
fn one_number_a_sensor(of: fn([f64; 3]) -> f64) -> [(&'static str, Vec<(&'static str, f64)>); 4] {
    let [gyro_n, gyro_k, accl_n, accl_k] = [of(si(GYRO, 0)), of(si(GYRO, 2)), of(si(ACCL, 0)), of(si(ACCL, 2))];
    let kalibr = vec![
        ("gyroscope_noise_density", gyro_n),
        ("gyroscope_random_walk", gyro_k),
        ("accelerometer_noise_density", accl_n),
        ("accelerometer_random_walk", accl_k),
        ("update_rate", RATE_HZ),
    ];
    [
        ("kalibr", kalibr.clone()),
        ("openvins", kalibr),
        (
            "vins",
            vec![
                ("gyr_n", 10.0 * gyro_n),
                ("gyr_w", 10.0 * gyro_k),
                ("acc_n", 10.0 * accl_n),
                ("acc_w", 10.0 * accl_k),
            ],
        ),
        (
            "orbslam3",
            vec![
                ("IMU.NoiseGyro", gyro_n),
                ("IMU.GyroWalk", gyro_k),
                ("IMU.NoiseAcc", accl_n),
                ("IMU.AccWalk", accl_k),
                ("IMU.Frequency", RATE_HZ),
            ],
        ),
    ]
}

#[test]
fn one_number_a_sensor_is_the_root_mean_square_or_the_worst_axis() {
    for (axis, of) in [(AxisChoice::Rms, rms as fn([f64; 3]) -> f64), (AxisChoice::Worst, worst)] {
        for (format, expected) in one_number_a_sensor(of) {
            let file = written(&report(), format, axis).expect(format).text;
            for (key, value) in expected {
                assert_number(&file, key, &[value]);
            }
        }
    }
}

/// Milligal are 1e-5 m/s², KF-GINS's times are hours.
fn kf_gins() -> [(&'static str, [f64; 3]); 2] {
    [("arw", GYRO.map(|axis| axis[0] * 60.0)), ("vrw", ACCL.map(|axis| axis[0] * GRAVITY * 60.0))]
}

fn gtsam() -> [(&'static str, &'static str, [f64; 3]); 4] {
    [
        ("ACCELEROMETER_NOISE_DENSITY", "AccelerometerCovariance", si(ACCL, 0)),
        ("GYROSCOPE_NOISE_DENSITY", "GyroscopeCovariance", si(GYRO, 0)),
        ("ACCELEROMETER_RANDOM_WALK", "BiasAccCovariance", si(ACCL, 2)),
        ("GYROSCOPE_RANDOM_WALK", "BiasOmegaCovariance", si(GYRO, 2)),
    ]
}

#[test]
fn formats_with_a_number_for_each_axis_have_their_units() {
    let file = exported(&report(), "kf-gins");
    for (key, expected) in kf_gins() {
        assert_number(&file, key, &expected);
    }
    let file = exported(&report(), "gtsam");
    for (key, _, expected) in gtsam() {
        assert_number(&file, key, &expected);
    }
    let basalt: Value = serde_json::from_str(&exported(&report(), "basalt")).expect("JSON");
    // `Calibration` multiplies the first two by sqrt(imu_update_rate).
    for (key, expected) in [
        ("accel_noise_std", si(ACCL, 0)),
        ("gyro_noise_std", si(GYRO, 0)),
        ("accel_bias_std", si(ACCL, 2)),
        ("gyro_bias_std", si(GYRO, 2)),
    ] {
        let found = basalt["value0"][key].as_array().expect(key).iter();
        assert_close(&found.map(|value| value.as_f64().expect("a number")).collect::<Vec<_>>(), &expected, key);
    }
    assert_eq!(basalt["value0"]["imu_update_rate"], RATE_HZ);
    let comment = basalt["value0"]["comment"].as_str().expect("a text");
    assert!(comment.starts_with("continuous") && comment.contains("gyro_y") && comment.contains("bound"), "{comment}");
    let matlab = exported(&report(), "matlab");
    for (sensor, class) in [(GYRO, "gyroparams"), (ACCL, "accelparams")] {
        let block = matlab.split_once(class).expect(class).1;
        for (index, property) in ["NoiseDensity", "BiasInstability", "RandomWalk"].into_iter().enumerate() {
            let vector = block.split_once(property).and_then(|(_, rest)| rest.split_once('[')?.1.split_once(']'));
            let found: Vec<f64> =
                vector.expect(property).0.split(' ').map(|word| word.parse().expect("a number")).collect();
            // No noise if none was found.
            let factor = if sensor == GYRO { PI / 180.0 } else { GRAVITY };
            for (found, axis) in found.iter().zip(sensor) {
                assert!(
                    (found - factor * axis[index]).abs() <= FOUR_DIGITS * factor * axis[index],
                    "{class} {property}: {found}"
                );
            }
        }
    }
    let csv = exported(&report(), "csv");
    let row = csv.lines().find(|line| line.starts_with("gyro_y,rate_random_walk,value,")).expect("a row");
    let bounds: Vec<f64> = row.split(',').skip(3).take(3).map(|word| word.parse().expect("a number")).collect();
    assert_eq!(bounds, [0.0, 0.0, GYRO_Y_BOUND]);
    assert_eq!(csv.lines().count(), 1 + 6 * 3);
}

/// Deviation in deg/h and mGal; driving density `s·√(2/T)`.
#[test]
fn a_gauss_markov_process_is_exported_as_it_is() {
    let (deviation, time) = (0.01, 50.0);
    let gauss_markov = |tau: f64| {
        let x = tau / time;
        2.0 * deviation * deviation / x * (1.0 - (3.0 - 4.0 * (-x).exp() + (-2.0 * x).exp()) / (2.0 * x))
    };
    let mut report = report();
    for channel in report["channels"].as_array_mut().expect("channels") {
        let white = 0.03_f64;
        let terms = [("angle_random_walk", "value", white)];
        let parameter = |value: f64| json!({"value": value, "low": value, "high": value, "unit": ""});
        let mut terms: Vec<Value> =
            terms.map(|(kind, name, value)| json!({"kind": kind, "parameters": {name: parameter(value)}})).into();
        terms.push(json!({"kind": "markov", "parameters": {"deviation": parameter(deviation), "time_constant": parameter(time)}}));
        let tau = |n: u32| f64::from(n) / RATE_HZ;
        let adev: Vec<f64> =
            (0..16).map(|octave| (white * white / tau(1 << octave) + gauss_markov(tau(1 << octave))).sqrt()).collect();
        channel["final"] = json!({"terms": terms, "adev": adev});
    }
    let found = numbers(&exported(&report, "kf-gins"));
    let of = |key: &str| found.iter().find(|(name, _)| name == key).expect(key).1.clone();
    for (key, expected) in [
        ("gbstd", vec![deviation * 3600.0; 3]),
        ("abstd", vec![deviation * GRAVITY / 1e-5; 3]),
        ("corrtime", vec![time / 3600.0]),
    ] {
        for (found, expected) in of(key).iter().zip(expected) {
            // The closed form is that of continuous time.
            assert!((found / expected - 1.0).abs() < 5e-3, "{key}: {found}, not {expected}");
        }
    }
    let sdf = exported(&report, "gazebo");
    let first = |element: &str| -> f64 {
        let start = format!("<{element}>");
        sdf.split_once(&start).and_then(|(_, rest)| rest.split_once('<')?.0.parse().ok()).expect(element)
    };
    let expected = (deviation * PI / 180.0) * (2.0 / time).sqrt();
    assert!((first("dynamic_bias_stddev") / expected - 1.0).abs() < 5e-3);
    assert!((first("dynamic_bias_correlation_time") / time - 1.0).abs() < 5e-3);
    assert_close(&[first("stddev")], &[0.03 * PI / 180.0 * RATE_HZ.sqrt()], "stddev");
}

#[test]
fn the_parsers_of_the_programs_read_the_same_numbers() {
    let Some(python) = std::env::var_os("ADIS_PYTHON") else {
        let reason = "ADIS_PYTHON names no Python with PyYAML, OpenCV and GTSAM";
        return system_tests::note_skipped("the_parsers_of_the_programs_read_the_same_numbers", reason);
    };
    let folder = tempfile::tempdir().expect("a folder");
    let loader = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/exports/load_export.py");
    let load = |format: &str| -> Value {
        let file = folder.path().join("out.txt");
        std::fs::write(&file, exported(&report(), format)).expect("written");
        let output = Command::new(&python).arg(&loader).arg(format).arg(file).output().expect("Python starts");
        assert!(output.status.success(), "{format}: {}", String::from_utf8_lossy(&output.stderr));
        serde_json::from_slice(&output.stdout).expect("JSON")
    };
    let number = |value: &Value| value.as_f64().unwrap_or_else(|| panic!("{value} is no number"));
    let list = |value: &Value| -> Vec<f64> { value.as_array().expect("a list").iter().map(number).collect() };
    for (format, expected) in one_number_a_sensor(rms) {
        let read = load(format);
        for (key, value) in expected {
            assert_close(&[number(&read[key])], &[value], key);
        }
    }
    let read = load("kf-gins");
    for (key, expected) in kf_gins() {
        assert_close(&list(&read[key]), &expected, key);
    }
    assert!(number(&read["corrtime"]) > 0.0 && list(&read["gbstd"]).iter().all(|deviation| *deviation > 0.0));
    let read = load("gtsam");
    for (_, key, densities) in gtsam() {
        assert_close(&list(&read[key]), &densities.map(|density| density * density), key);
    }
    let read = load("gazebo");
    for (sensor, of) in [("angular_velocity", GYRO), ("linear_acceleration", ACCL)] {
        assert_close(&list(&read[&format!("{sensor}/stddev")]), &si(of, 0).map(|n| 10.0 * n), sensor);
    }
}

#[test]
fn what_a_format_lacks_is_named() {
    let error = |report: &Value, format: &str| written(report, format, AxisChoice::Rms).expect_err(format);
    let mut partial = report();
    partial["channels"].as_array_mut().expect("channels").remove(1);
    assert!(error(&partial, "gtsam").contains("gyro_y is not in the report"));
    partial["channels"].as_array_mut().expect("channels").clear();
    assert!(error(&partial, "kalibr").contains("no gyroscope and no accelerometer"));
    partial["channels"] = json!([{"name": "gyro_x"}]);
    assert!(error(&partial, "kalibr").contains("channels[0]: missing field `unit`"));
    partial["schema"] = json!(7);
    assert!(error(&partial, "kalibr").contains("schema 7"));
    let mut gyros = report();
    gyros["channels"].as_array_mut().expect("channels").truncate(3);
    let missing = written(&gyros, "kalibr", AxisChoice::Rms).expect("gyros").missing;
    assert!(missing.iter().any(|field| field == "accelerometer_random_walk"), "{missing:?}");
}
