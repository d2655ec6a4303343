//! The program `benchmarks`: the limits of its arguments, and where it writes.

use std::process::{Command, Output};

fn benchmarks(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_benchmarks")).args(arguments).output().expect("the program starts")
}

/// Without limits each of these ended with a panic, an abort, or threads without number.
#[test]
fn benchmarks_have_limits() {
    for arguments in [
        &["undeclared", "--nothing", "18446744073709551615"][..],
        &["undeclared", "--nothing", "1000000000"],
        &["undeclared", "--per-kind", "1000000000"],
        &["undeclared", "--pairs", "1000000000"],
        &["undeclared", "--triples", "1000000000"],
        &["undeclared", "--outside", "1000000000"],
        &["paper", "--seeds", "18446744073709551615"],
        &["losses", "--records", "18446744073709551615"],
    ] {
        let output = benchmarks(arguments);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
    }
    // Two recordings of a second; the second is too short to be analysed, which may be the program's answer.
    let few =
        ["--nothing", "2", "--per-kind", "0", "--pairs", "0", "--triples", "0", "--outside", "0", "--seconds", "1"];
    let [many, one] = ["1000000", "1"].map(|jobs| benchmarks(&[&["undeclared", "--jobs", jobs], &few[..]].concat()));
    assert_eq!((many.status, many.stdout), (one.status, one.stdout));
}

#[test]
fn json_goes_to_a_file_beside_the_tables_or_alone_to_standard_output() {
    let losses = ["losses", "--records", "2", "--samples-log2", "14", "--jobs", "1", "--json"];
    let dir = tempfile::tempdir().expect("a folder");
    let file = dir.path().join("losses.json");
    let beside = benchmarks(&[&losses[..], &[file.to_str().expect("UTF-8")]].concat());
    let alone = benchmarks(&[&losses[..], &["-"]].concat());
    let json = std::fs::read(&file).expect("written");
    assert_eq!(alone.stdout, json);
    let value: serde_json::Value = serde_json::from_slice(&json).expect("JSON");
    assert_eq!((&value["records"], &value["samples"]), (&2.into(), &16_384.into()));
    let tables = String::from_utf8(beside.stdout).expect("UTF-8");
    assert!(tables.contains("white and walk") && !tables.contains('{'), "{tables}");

    let absent = dir.path().join("absent/losses.json");
    let output = benchmarks(&[&losses[..], &[absent.to_str().expect("UTF-8")]].concat());
    let error = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.code() == Some(1) && error.contains("absent/losses.json"), "{error}");
    assert!(output.stdout.is_empty(), "checked before the work is done");
}
