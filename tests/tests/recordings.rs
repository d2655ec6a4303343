//! Measured recordings through the whole system, compared with published figures.

use serde_json::Value;
use std::path::PathBuf;
use std::process::Command;
use system_tests::{host_sim, recording};

/// Runs the command-line program and returns its JSON report without the name, hash and options of the recording.
fn report(arguments: &[&str], recording: &PathBuf) -> Value {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let json = folder.path().join("report.json");
    let (command, options) = arguments.split_first().expect("a subcommand");
    let output = Command::new(host_sim())
        .arg(command)
        .arg(recording)
        .args(options)
        .arg("-o")
        .arg(&json)
        .arg("-o")
        .arg(folder.path().join("report.html"))
        .output()
        .expect("imunoise runs");
    assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
    but_reading(&serde_json::from_slice(&std::fs::read(json).expect("the report")).expect("JSON"))
}

/// The report without the name, hash and options of the recording.
pub(crate) fn but_reading(report: &Value) -> Value {
    let mut report = report.clone();
    report.as_object_mut().and_then(|fields| fields.remove("reading"));
    report
}

fn channel<'a>(report: &'a Value, name: &str) -> &'a Value {
    let channels = report["channels"].as_array().expect("channels");
    channels.iter().find(|channel| channel["name"] == name).expect("the channel")
}

/// Overlapping Allan deviations of gyro X at 0.02, 0.04 … s that SMAC-Group/avar publishes for this recording.
const RUN_1_GYRO_X: [f64; 15] = [
    0.2575, 0.1928, 0.1395, 0.1000, 0.07115, 0.05107, 0.03612, 0.02589, 0.01830, 0.01321, 0.01002, 0.008274, 0.007063,
    0.007641, 0.007768,
];

#[test]
fn a_static_recording_has_the_published_deviations_analyzed_and_replayed() {
    let test = "a_static_recording_has_the_published_deviations_analyzed_and_replayed";
    let Some(run_1) = recording(test, "adis16405-static/run1.csv.gz") else { return };
    let [report, replayed] = ["analyze", "replay"].map(|command| report(&[command, "--rate", "100"], &run_1));
    assert!(report == replayed, "replayed over the bus");

    assert_eq!(report["schema"], 2);
    assert_eq!(report["samples"], 1_000_000);
    assert_eq!(report["dropped"]["gap"], 0);
    assert_eq!(report["channels"].as_array().map(Vec::len), Some(6));
    let curve = channel(&report, "gyro_x")["curve"].as_array().expect("a curve");
    for (k, expected) in RUN_1_GYRO_X.into_iter().enumerate() {
        let point = &curve[k + 1];
        let (tau, adev) = (point["tau_s"].as_f64().expect("τ"), point["adev"].as_f64().expect("σ"));
        assert!((tau - 0.02 * f64::from(1 << k)).abs() < 1e-9);
        // The overlap is full up to n = 8. Beyond, the estimator takes every n/8-th window of the published ones, which
        // changes the estimate by a fraction of its uncertainty.
        let tolerance = match point["n"].as_u64() {
            Some(..=8) => 5e-5,
            _ if tau <= 1.0 => 0.01 * expected,
            _ => 0.03 * expected,
        };
        assert!((adev - expected).abs() <= tolerance, "τ = {tau} s: {adev} instead of {expected}");
    }
}

#[test]
fn a_burst_recording_with_gaps_and_re_reads_has_the_same_report_analyzed_and_replayed() {
    let test = "a_burst_recording_with_gaps_and_re_reads_has_the_same_report_analyzed_and_replayed";
    let Some(launch) = recording(test, "adis16405-burst/launch10.csv.gz") else { return };
    let [report, replayed] = ["analyze", "replay"].map(|command| report(&[command], &launch));
    assert!(report == replayed, "replayed over the bus");

    assert_eq!(report["flagged"]["repeated"], 45);
    assert_eq!(report["samples"], 49_425);
    // The median period of the recording is 1.22467 ms; the data sheet's internal rate is 819.2 SPS.
    let rate = report["sample_rate_hz"].as_f64().expect("a rate");
    assert!((rate * 1.224_67e-3 - 1.0).abs() < 0.002, "{rate} Hz");
    assert_eq!(report["dropped"]["gap"], 15, "in one stall");
    assert_eq!(report["channels"].as_array().map(Vec::len), Some(12));
}
