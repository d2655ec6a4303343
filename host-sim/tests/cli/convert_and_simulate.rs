//! `simulate` and `convert`: what is described is in the file, and another format has the same samples.

use crate::program::{host_sim, json_of};
use serde_json::Value;
use std::path::Path;
use tempfile::{TempDir, tempdir};

fn path(dir: &TempDir, name: &str) -> String {
    dir.path().join(name).to_str().expect("UTF-8").to_owned()
}

fn run(arguments: &[&str]) -> String {
    let output = host_sim(arguments);
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
        "--gyro",
        "0.05,0,0",
        "--gyro-y",
        "0.1,0,0",
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
    run(&["convert", &table, &frames, "--format", "frames", "--range", "75"]);
    let notes = run(&["convert", &frames, &back]);
    assert!(notes.contains("--range 75") && notes.contains("1 transactions that are no bursts"), "{notes}");
    assert_eq!(std::fs::read(&table).expect("a table"), std::fs::read(&back).expect("a table"));
    assert_eq!(
        json_of(&dir, &["analyze", &table, "--range", "75"]),
        json_of(&dir, &["replay", &frames]),
        "the log has the range"
    );
}

/// The format of NumPy: magic, version, length of the header, header, doubles in the order of the rows.
#[test]
fn an_array_is_in_si_units() {
    let dir = tempdir().expect("a folder");
    let [table, array] = ["a.csv", "a.npy"].map(|name| path(&dir, name));
    run(&["simulate", &table, "--seconds", "2"]);
    let notes = run(&["convert", &table, &array]);
    assert!(notes.contains("time_s, supply_V, gyro_x_rad_s, "), "{notes}");
    let bytes = std::fs::read(&array).expect("an array");
    assert_eq!(&bytes[..6], b"\x93NUMPY");
    let header = 10 + usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
    let text = String::from_utf8_lossy(&bytes[10..header]).into_owned();
    assert!(text.contains("'<f8'") && text.contains("(410, 13"), "{text}");
    let value = |row: usize, column: usize| {
        let at = header + 8 * (13 * row + column);
        f64::from_le_bytes(bytes[at..at + 8].try_into().expect("eight bytes"))
    };
    for (row, line) in counts(Path::new(&table)).iter().enumerate() {
        let gyro_x: f64 = line.split(',').nth(1).and_then(|word| word.parse().ok()).expect("a count");
        assert!((value(row, 2) - (gyro_x * 0.05).to_radians()).abs() < 1e-12, "row {row}");
    }
}

#[test]
fn what_cannot_be_simulated_or_converted_is_refused_before_anything_is_written() {
    let dir = tempdir().expect("a folder");
    let out = path(&dir, "x.csv");
    for (arguments, expected) in [
        (&["--effect", "hum:gyro_x:amplitude=1"][..], "--effect: `hum` is none of"),
        (&["--gyro", "1,2"], "gyro: `1,2` is not N,B,K"),
        (&["--taps", "3"], "taps: `3` is not 1, 2, 4"),
        (&["--range", "75", "--taps", "1"], "configuration refused"),
        (&["--seconds", "0"], "duration must be positive"),
        (&["--rate", "nan"], "configuration refused"),
        (&["--fault", "stale:from=1"], "--fault: stale needs bursts"),
    ] {
        let output = host_sim(&[&["simulate", &out], arguments].concat());
        let errors = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(!output.status.success() && errors.contains(expected), "{arguments:?}: {errors}");
        assert!(!Path::new(&out).exists());
    }
    std::fs::write(&out, "gyro_x_counts\n1\n2\n").expect("written");
    let output = host_sim(&["convert", &out, &path(&dir, "y.csv"), "--format", "frames"]);
    assert!(String::from_utf8_lossy(&output.stderr).contains("sample 0 has no time"));
    let output = host_sim(&["convert", &out, &out]);
    assert!(String::from_utf8_lossy(&output.stderr).contains("it would be overwritten"));
}

#[test]
fn options_are_those_that_a_subcommand_uses() {
    for arguments in [
        &["monitor", "p", "--page", "d"][..],
        &["replay", "a", "--sensor", "generic"],
        &["replay", "a", "--columns", "gyro_x=0"],
        &["replay", "a", "--topic", "t"],
        &["compare", "a", "b", "--page", "d"],
    ] {
        let output = host_sim(arguments);
        let errors = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(output.status.code() == Some(2) && errors.contains("unexpected argument"), "{arguments:?}: {errors}");
    }
    let output = host_sim(&["convert", "a", "b", "--rate", "100"]);
    assert!(String::from_utf8_lossy(&output.stderr).contains("--rate says where --from and --to are"));
    let output = host_sim(&["--seed", "3", "analyze", "x.csv"]);
    assert_eq!(output.status.code(), Some(2), "options of the simulation before a subcommand would be ignored");
    for shell in ["bash", "zsh", "fish", "elvish", "powershell"] {
        let output = host_sim(&["completions", shell]);
        assert!(output.status.success() && String::from_utf8_lossy(&output.stdout).contains("simulate"), "{shell}");
    }
}
