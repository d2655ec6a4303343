//! Recordings that other programs wrote: the angle random walk, the rate and the losses of each come out right.

use crate::program::{host_sim, json_of, write};
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use system_tests::note_skipped;
use tempfile::{TempDir, tempdir};

/// The samples that `make_samples.py` writes with the Python that `ADIS_PYTHON` names; `None`, with a note, without it.
fn samples(test: &str) -> Option<TempDir> {
    let Some(python) = std::env::var_os("ADIS_PYTHON").map(PathBuf::from).filter(|python| python.exists()) else {
        note_skipped(test, "ADIS_PYTHON names no Python with the writers of the formats");
        return None;
    };
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("recordings/tests/make_samples.py");
    let dir = tempdir().expect("a folder");
    let made = Command::new(python).arg(script).arg(dir.path()).output().expect("Python starts");
    assert!(made.status.success(), "{}", String::from_utf8_lossy(&made.stderr));
    Some(dir)
}

/// The baseline model's angle random walk of a channel.
fn angle_random_walk(report: &Value, channel: &str) -> f64 {
    let channels = report["channels"].as_array().expect("a list");
    let own = channels.iter().find(|known| known["name"] == channel).expect(channel);
    let terms = own["before"]["terms"].as_array().expect("a list");
    let term = terms.iter().find(|term| term["kind"] == "angle_random_walk").expect("N");
    term["parameters"]["value"]["value"].as_f64().expect("a number")
}

/// Every sample of every format: rows and losses to a sample; the rate within 20 ppm, which is the jitter of the stamps
/// (uniform in 2 % of a period, 0.6 % standard deviation) over √n and the length of the record with room; N within five
/// standard deviations. The model is fitted to the first half, n/2 samples, and N is at least as good as the Allan variance of
/// neighbours, whose relative standard deviation is √(3/(2·n/2)) (edf of white noise: two thirds of the samples; facts of
/// Greenhall's formula), that of N half of it: √(3/(4·n/2)).
#[test]
fn samples_of_other_programs_give_noise_rate_and_losses() {
    let Some(dir) = samples("samples_of_other_programs_give_noise_rate_and_losses") else { return };
    let truth: Value =
        serde_json::from_slice(&std::fs::read(dir.path().join("truth.json")).expect("written")).expect("JSON");
    let truth = truth.as_array().expect("a list");
    assert!(truth.len() >= 20, "{} samples", truth.len());
    for known in truth {
        let name = known["file"].as_str().expect("a name");
        let file = dir.path().join(name);
        let arguments = known["arguments"].as_array().expect("a list").iter().map(|text| text.as_str().expect("text"));
        let arguments: Vec<&str> = ["analyze", file.to_str().expect("UTF-8")].into_iter().chain(arguments).collect();
        let report: Value = serde_json::from_slice(&json_of(&dir, &arguments)).expect("JSON");
        assert_eq!(report["samples"], known["rows"], "{name}: samples");
        assert_eq!(report["dropped"]["gap"], known["missing"], "{name}: missing samples");
        let rate = report["sample_rate_hz"].as_f64().expect("a rate") / known["rate_hz"].as_f64().expect("a rate");
        assert!((rate - 1.0).abs() < 20e-6, "{name}: {rate} of the rate");
        let half = known["rows"].as_f64().expect("a number") / 2.0;
        let tolerance = 5.0 * (3.0 / (4.0 * half)).sqrt();
        for (channel, expected) in known["angle_random_walk"].as_object().expect("channels") {
            let found = angle_random_walk(&report, channel) / expected.as_f64().expect("a number");
            assert!((found - 1.0).abs() < tolerance, "{name}: {channel}: {found} of N, tolerance {tolerance}");
        }
    }
}

/// The report of a file through a pipe is that of the file, and so is that of a compressed array.
#[test]
fn standard_input_is_read_like_a_file() {
    let dir = tempdir().expect("a folder");
    let rows: String = (0..2000u64).map(|row| format!("{},{}\n", row as f64 / 100.0, row * 7919 % 101)).collect();
    let table = format!("t [s],wx [deg/s]\n{rows}");
    let file = write(&dir, "table.csv", table.as_bytes());
    let direct = host_sim(&["analyze", file.to_str().expect("UTF-8")]);
    assert!(direct.status.success(), "{}", String::from_utf8_lossy(&direct.stderr));
    let input = std::fs::File::open(&file).expect("written");
    let piped = Command::new(env!("CARGO_BIN_EXE_host-sim"))
        .args(["analyze", "-"])
        .stdin(Stdio::from(input))
        .output()
        .expect("the program starts");
    assert_eq!(piped.stdout, direct.stdout);
    let missing = host_sim(&["analyze", file.to_str().expect("UTF-8"), "--sensor", "nowhere.toml"]);
    let error = String::from_utf8_lossy(&missing.stderr).into_owned();
    assert!(error.contains("nowhere.toml") && error.contains("bmi088"), "{error}");
}

/// A gyroscope that is held at full scale of 16 bits for a while, and then sticks: both are counted and told.
#[test]
fn saturated_and_stuck_channels_are_told() {
    let dir = tempdir().expect("a folder");
    let count = |row: u64| match row {
        1000..1050 => 32_767,
        3000..3100 => 12,
        _ => (row * 7919 % 1009) as i64 - 504,
    };
    let rows: String = (0..5000u64).map(|row| format!("{},{}\n", row as f64 / 100.0, count(row))).collect();
    let file = write(&dir, "full.csv", format!("t [s],wx [deg/s]\n{rows}").as_bytes());
    let report: Value =
        serde_json::from_slice(&json_of(&dir, &["analyze", file.to_str().expect("UTF-8")])).expect("JSON");
    assert_eq!(report["flagged"]["saturated"], 50);
    assert_eq!(report["flagged"]["stuck"], 50 + 100, "the samples at full scale do not change either");
    let notes = String::from_utf8(host_sim(&["analyze", file.to_str().expect("UTF-8")]).stderr).expect("UTF-8");
    assert!(notes.contains("gyro_x: 50 samples at full scale, the first of them row 1001"), "{notes}");
}
