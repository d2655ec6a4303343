//! `simulate`, `convert` and `export`: what is described is in the file, and another format has the same samples.

use crate::program::{analysis_of, imunoise, json_of};
use serde_json::Value;
use std::path::Path;
use tempfile::{TempDir, tempdir};

fn path(dir: &TempDir, name: &str) -> String {
    dir.path().join(name).to_str().expect("UTF-8").to_owned()
}

fn run(arguments: &[&str]) -> String {
    let output = imunoise(arguments);
    let errors = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{arguments:?}: {errors}");
    errors
}

fn analyzed(dir: &TempDir, arguments: &[&str]) -> Value {
    serde_json::from_slice(&json_of(dir, arguments)).expect("JSON")
}

fn channel<'a>(report: &'a Value, name: &str) -> &'a Value {
    let channels = report["channels"].as_array().expect("channels");
    channels.iter().find(|channel| channel["name"] == name).expect("the channel")
}

/// The rows of a table without their times.
fn counts(file: &Path) -> Vec<String> {
    let text = std::fs::read_to_string(file).expect("a table");
    text.lines().skip(1).map(|line| line.split_once(',').expect("columns").1.to_owned()).collect()
}

#[test]
fn a_simulated_table_has_the_noise_the_rate_and_the_line_that_were_asked_for() {
    let dir = tempdir().expect("a folder");
    let table = path(&dir, "x.csv.gz");
    run(&[
        "simulate",
        &table,
        "--seconds",
        "300",
        "--seed",
        "7",
        "--rate",
        "100",
        "--range",
        "150",
        "--taps",
        "4",
        "--noise",
        "gyro=0.05,0,0",
        "--noise",
        "gyro_y=0.1,0,0",
        "--effect",
        "sinusoid:gyro_z:frequency=10,amplitude=0.5",
    ]);
    let report = analyzed(&dir, &["analyze", &table, "--range", "150"]);
    // 1638.4 Hz over 16 is the rate next to 100 Hz.
    assert!((report["sample_rate_hz"].as_f64().expect("a rate") - 102.4).abs() < 1e-3);
    assert_eq!(report["samples"], 30_720);
    // Behind two averages of four values the Allan variance is N²/τ·(1 − 0.7·T/τ), T the four periods of one average: at
    // n = 64 N²/τ less 4.4 %. 30,720 samples give it 700 degrees of freedom, so the deviation has a standard deviation of 2.7 %.
    for (name, n) in [("gyro_x", 0.05_f64), ("gyro_y", 0.1)] {
        let curve = channel(&report, name)["curve"].as_array().expect("a curve");
        let point = curve.iter().find(|point| point["n"] == 64).expect("an octave");
        let found =
            point["adev"].as_f64().expect("a number") * (64.0_f64 / 102.4).sqrt() / (1.0 - 0.7 * 4.0 / 64.0_f64).sqrt();
        assert!((found / n - 1.0).abs() < 4.0 * 0.027, "{name}: {found}");
    }
    let line =
        channel(&report, "gyro_z")["effects"].as_array().expect("effects").iter().find(|of| of["kind"] == "sinusoid");
    let frequency = line.expect("a line")["parameters"]["frequency"]["value"].as_f64().expect("a number");
    assert!((frequency - 10.0).abs() < 0.02, "{frequency}");
}

#[test]
fn every_format_has_the_same_samples() {
    let dir = tempdir().expect("a folder");
    let [table, frames, again, back] = ["a.csv", "b.csv.gz", "c.csv", "d.csv"].map(|name| path(&dir, name));
    let common = ["--seconds", "8", "--seed", "3", "--range", "75", "--fault", "stale:from=5,bursts=7"];
    run(&[&["simulate", &table][..], &common].concat());
    run(&[&["simulate", &frames, "--format", "frames"][..], &common].concat());
    // 75 °/s need 16 taps; the log says range and filter itself.
    run(&["convert", &frames, &again]);
    assert_eq!(counts(Path::new(&table)), counts(Path::new(&again)));
    let report = analyzed(&dir, &["replay", &frames]);
    assert_eq!(report["dropped"]["no_new_data"], 7, "{}", report["dropped"]);
    // A table as bursts, and these as a table.
    run(&["convert", &table, &frames, "--force", "--format", "frames", "--range", "75"]);
    let notes = run(&["convert", &frames, &back]);
    assert!(notes.contains("--range 75") && notes.contains("1 transactions that are no bursts"), "{notes}");
    assert_eq!(std::fs::read(&table).expect("a table"), std::fs::read(&back).expect("a table"));
    assert_eq!(
        analysis_of(&dir, &["analyze", &table, "--range", "75"]),
        analysis_of(&dir, &["replay", &frames]),
        "the log has the range"
    );
}

/// A part that is converted is the table of its rows; of an array, the names of the columns are told.
#[test]
fn a_part_is_converted_and_an_array_says_its_columns() {
    let dir = tempdir().expect("a folder");
    let [table, part, array] = ["rows.csv", "part.csv", "part.npy"].map(|name| path(&dir, name));
    let rows: String = (0..3000).map(|row| format!("{}.{:02},{}\n", row / 100, row % 100, row * 7919 % 41)).collect();
    std::fs::write(&table, format!("time_s,gyro_x [dps]\n{rows}")).expect("written");
    run(&["convert", &table, &part, "--from", "5", "--to", "10", "--format", "table"]);
    let expected: Vec<String> = (500..1000).map(|row| (row * 7919 % 41).to_string()).collect();
    assert_eq!(counts(Path::new(&part)), expected);
    let notes = run(&["convert", &table, &array]);
    assert!(notes.contains("time_s, gyro_x_rad_s"), "{notes}");
    assert!(std::fs::read(&array).expect("an array").starts_with(b"\x93NUMPY"));
}

/// The noise of a report, whether the analysis writes it or `export`; what the format wants and the report lacks is told.
#[test]
fn a_report_is_exported() {
    let dir = tempdir().expect("a folder");
    let [report, first, second, never] = ["report.json", "a.yaml", "b.yaml", "never"].map(|name| path(&dir, name));
    let table = crate::program::counts(&dir);
    let table = table.to_str().expect("UTF-8");
    let lacks = "no accelerometer_random_walk: the report has no channel with it";
    let notes = run(&["analyze", table, "--quiet", "-o", &report, "-o", &first]);
    assert!(notes.contains(lacks), "{notes}");
    let notes = run(&["export", &report, "-o", &second]);
    assert!(notes.contains(lacks), "{notes}");
    // The recording itself goes to standard output.
    let of_table = imunoise(&["export", table, "-o", "kalibr=-"]);
    assert!(String::from_utf8_lossy(&of_table.stderr).contains(lacks));
    let [first, second] = [first, second].map(|file| std::fs::read_to_string(file).expect("a file"));
    assert_eq!(first, second);
    assert_eq!(first, String::from_utf8(of_table.stdout).expect("text"));
    let output = imunoise(&["export", &report, "-o", &format!("gtsam={never}")]);
    let error = crate::program::error_line(&output);
    assert!(error.contains("gyro_y is not in the report") && !Path::new(&never).exists(), "{error}");
}

#[test]
fn completions_know_the_subcommands() {
    for shell in ["bash", "zsh", "fish", "elvish", "powershell"] {
        let output = imunoise(&["completions", shell]);
        assert!(output.status.success() && String::from_utf8_lossy(&output.stdout).contains("simulate"), "{shell}");
    }
}
