//! The tables that `tables.py` makes from the JSON of the benchmarks.

use serde_json::{Value, json};
use std::io::Write;
use std::process::{Command, Stdio};

/// The text that the script prints for the result of a benchmark.
pub(crate) fn of(benchmark: &str, result: &Value) -> String {
    let mut result = result.clone();
    result["benchmark"] = benchmark.into();
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/tables.py");
    let mut python =
        Command::new("python3").arg(script).stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().expect("Python");
    python.stdin.take().expect("a pipe").write_all(result.to_string().as_bytes()).expect("a pipe");
    let output = python.wait_with_output().expect("Python");
    assert!(output.status.success(), "{benchmark}");
    String::from_utf8(output.stdout).expect("UTF-8")
}

/// The cells of the first line that begins with `title`.
fn row<'a>(text: &'a str, title: &str) -> Vec<&'a str> {
    let line = text.lines().find(|line| line.starts_with(title)).unwrap_or_else(|| panic!("{title}: {text}"));
    line[title.len()..].split("  ").map(str::trim).filter(|cell| !cell.is_empty()).collect()
}

#[test]
fn every_sentence_is_counted_once_and_an_unknown_one_is_printed() {
    let sentences = [
        "gyro z at τ = 80 s: σ is 9.0 % above the model (4.0 standard errors)",
        "gyro x at τ = 8 s: σ is 2.0 times the model (50 standard errors)",
        "a new sentence",
    ];
    let records = json!([{ "seed": 1, "sentences": [] }, { "seed": 2, "sentences": sentences }]);
    let text = of("contradictions", &json!({ "records": records }));
    assert_eq!(row(&text, "… at τ = …: σ is … the model (… standard errors)"), ["50.0 %", "(1 of 2)", "2"]);
    assert_eq!(row(&text, "a Kalman filter with the models of … claims a smaller error than it has")[2], "0");
    assert_eq!(row(&text, "any"), ["50.0 %", "(1 of 2)", "3"]);
    assert!(text.contains("not in the table: a new sentence"), "{text}");
}

#[test]
fn strong_and_weak_effects_their_wrong_names_and_their_parameters_are_counted_apart() {
    let answer = |strength: f64, named: bool, instead: Option<&str>| json!({ "kind": "markov", "strength": strength, "named": named, "shape_known": true, "instead": instead });
    let estimate = |name: &str, error: f64| {
        let (truth, value) = (1.0, 1.0 + error);
        json!({ "kind": "markov", "name": name, "truth": truth, "value": value, "low": value - 0.05, "high": value + 0.05,
            "relative_error": error })
    };
    let record = |answers: Value, alarms: Value, estimates: Value| {
        let unseen = json!({ "before": 9.0, "after": 1.4, "truth": 1.0, "refitted": 0.5 });
        json!({ "seed": 0, "answers": answers, "false_alarms": alarms, "estimates": estimates, "unseen": unseen,
            "outside": null })
    };
    let single = json!({ "single": "markov" });
    let outcomes = json!([
        [
            single,
            record(
                json!([answer(4.0, true, None)]),
                json!([]),
                json!([estimate("deviation", 0.04), estimate("frequency", 0.06)])
            )
        ],
        [single, record(json!([answer(2.5, false, Some("resonance"))]), json!(["gyro_x: resonance"]), json!([]))],
        [single, record(json!([answer(0.7, false, None)]), json!([]), json!([]))],
        ["nothing", record(json!([]), json!(["gyro_z: spikes"]), json!([]))],
        ["pair", record(json!([answer(3.0, true, None), answer(3.0, false, None)]), json!([]), json!([]))],
    ]);
    let text = of("undeclared", &json!({ "outcomes": outcomes }));
    assert_eq!(row(&text, "markov"), ["–", "0/1", "–", "1/2", "–", "2/2"]);
    assert_eq!(row(&text, "markov deviation"), ["1", "4.00 %", "4.00 %", "1/1", "1/1"]);
    // The error of 6 % is 0.01 outside of the interval, and above the 2 % allowed for a frequency.
    assert_eq!(row(&text, "markov frequency")[3..], ["0/1", "0/1"]);
    assert_eq!(row(&text, "named: single effects of twice the limit or more"), ["50.0 %", "(1 of 2)"]);
    assert_eq!(row(&text, "an effect reported although nothing was hidden"), ["100.0 %", "(1 of 1)"]);
    assert_eq!(row(&text, "both effects of a pair named"), ["0.0 %", "(0 of 1)"]);
    assert_eq!(row(&text, "wrong names, over all recordings"), ["40.0 %", "(2 of 5)"]);
    // 1.4 is within 1.5 times 1, and not within 1.5 times 0.5.
    assert_eq!(row(&text, "error on unseen data within 1.5 times the true model's"), ["100.0 %", "(2 of 2)"]);
    assert_eq!(row(&text, "… within 1.5 times that of the fitted true terms"), ["0.0 %", "(0 of 2)"]);
    assert!(text.contains("false alarm, nothing hidden: gyro_z: spikes × 1"), "{text}");
}

#[test]
fn the_bias_behind_a_filter_is_the_mean_over_the_truth_with_its_standard_error() {
    let channel = |value: f64, taps: f64, named: Value| {
        let coefficient = json!({ "truth": 2.0, "value": value, "low": value - 0.1, "high": value + 0.1 });
        json!({ "filter": [taps, 1.0], "coefficients": [coefficient, null, null], "named": named })
    };
    let channels = json!([channel(2.02, 8.0, json!([])), channel(2.22, 4.0, json!(["resonance"]))]);
    let text = of("filters", &json!({ "cells": [{ "taps": 8, "every": 2, "channels": channels }] }));
    // Errors of 1 and 11 % have the mean 6 and the standard error 7.07/√2.
    let expected = ["1/2", "+6.00 ± 5.00 %", "1/2", "–", "–", "–", "–", "1/2", "resonance × 1"];
    assert_eq!(row(&text, "8 taps, read every 2"), expected);
}
