//! The program `benchmarks`: limits of its arguments, and its outputs.

use crate::tables;
use std::process::{Command, Output};

fn benchmarks(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_benchmarks")).args(arguments).output().expect("the program starts")
}

#[test]
fn impossible_arguments_are_refused_and_any_number_of_jobs_is_accepted() {
    for arguments in [
        &["undeclared", "--nothing", "18446744073709551615"][..],
        &["undeclared", "--nothing", "1000000000"],
        &["undeclared", "--per-kind", "1000000000"],
        &["undeclared", "--pairs", "1000000000"],
        &["undeclared", "--triples", "1000000000"],
        &["undeclared", "--outside", "1000000000"],
        &["paper", "--seeds", "18446744073709551615"],
        &["losses", "--records", "18446744073709551615"],
        &["measured", "noise.csv", "--stretches", "1000000000"],
        &["measured", "noise.csv", "--samples", "0"],
        &["measured", "noise.csv", "--samples", "1000", "--seconds", "10"],
        &["measured"],
        &["contradictions", "--records", "1000000000"],
        &["filters", "--records", "1000000000"],
        &["filters", "--seconds", "-1"],
    ] {
        let output = benchmarks(arguments);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
    }
    // The result may be that a recording is too short.
    let few =
        ["--nothing", "2", "--per-kind", "0", "--pairs", "0", "--triples", "0", "--outside", "0", "--seconds", "1"];
    let [many, one] = ["1000000", "1"].map(|jobs| benchmarks(&[&["undeclared", "--jobs", jobs], &few[..]].concat()));
    assert_eq!((many.status, many.stdout), (one.status, one.stdout));
}

#[test]
fn the_result_goes_to_standard_output_or_to_a_file() {
    let losses = ["losses", "--records", "2", "--samples-log2", "14", "--jobs", "1"];
    let dir = tempfile::tempdir().expect("a folder");
    let file = dir.path().join("losses.json");
    let written = benchmarks(&[&losses[..], &["-o", file.to_str().expect("UTF-8")]].concat());
    let json = benchmarks(&losses).stdout;
    assert_eq!(std::fs::read(&file).expect("written"), json);
    assert!(written.stdout.is_empty());
    let value: serde_json::Value = serde_json::from_slice(&json).expect("JSON");
    assert_eq!(
        (&value["benchmark"], value["noises"].as_array().map(Vec::len), &value["samples"]),
        (&"losses".into(), Some(6), &16_384.into())
    );

    let absent = dir.path().join("absent/losses.json");
    let output = benchmarks(&[&losses[..], &["-o", absent.to_str().expect("UTF-8")]].concat());
    let error = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.code() == Some(1) && error.contains("absent/losses.json"), "{error}");
}

/// A recording without time stamps needs a rate.
#[test]
fn measured_noise_is_read_from_a_table_and_an_unusable_one_is_named() {
    let dir = tempfile::tempdir().expect("a folder");
    let file = dir.path().join("noise.csv");
    let count = |row: u32, axis: u32| (row.wrapping_mul(2_654_435_761).rotate_left(axis * 7) >> 16) % 41;
    let rows = (0..4_000).map(|row| format!("{},{},{}\n", count(row, 0), count(row, 1), count(row, 2)));
    let text = "gyro_x_counts,gyro_y_counts,gyro_z_counts\n".to_owned() + &rows.collect::<String>();
    std::fs::write(&file, text).expect("written");
    let name = file.to_str().expect("UTF-8");
    let without = benchmarks(&["measured", name]);
    let error = String::from_utf8_lossy(&without.stderr).into_owned();
    assert!(without.status.code() == Some(1) && error.contains("noise.csv") && error.contains("--rate"), "{error}");
    let with = benchmarks(&["measured", name, "--rate", "100", "--stretches", "1", "--seconds", "10", "--jobs", "1"]);
    assert_eq!(with.status.code(), Some(0), "{}", String::from_utf8_lossy(&with.stderr));
    let table = tables::of("measured", &serde_json::from_slice(&with.stdout).expect("JSON"));
    assert!(table.contains("noise.csv") && table.contains("telegraph"), "{table}");
}
