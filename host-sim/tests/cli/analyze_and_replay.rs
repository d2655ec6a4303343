//! A recording gives the same report whether its counts are read or its bursts are replayed over the emulated bus.

use crate::program::{analysis_of, counts, flight_log, imunoise, json_of, write};
use serde_json::Value;
use tempfile::tempdir;

#[test]
fn a_table_has_one_report_analyzed_and_replayed() {
    let dir = tempdir().expect("a folder");
    let table = counts(&dir);
    let table = table.to_str().expect("UTF-8");
    assert!(analysis_of(&dir, &["analyze", table]) == analysis_of(&dir, &["replay", table]), "the reports differ");
    let [analyzed, replayed] = ["analyze", "replay"].map(|command| imunoise(&[command, table]).stdout);
    assert!(!analyzed.is_empty() && analyzed == replayed, "the screens differ");
}

#[test]
fn a_recorded_simulation_replays_to_the_same_report() {
    let dir = tempdir().expect("a folder");
    for name in ["log.csv", "log.csv.gz"] {
        let log = dir.path().join(name);
        let log = log.to_str().expect("UTF-8");
        let simulated = imunoise(&["simulate", log, "--format", "frames", "--seconds", "5", "--seed", "7"]);
        assert!(simulated.status.success(), "{}", String::from_utf8_lossy(&simulated.stderr));
        let report = analysis_of(&dir, &["analyze", log]);
        assert!(report == analysis_of(&dir, &["replay", log]), "{name}");
        // 5 s at 204.8 samples per second.
        let dropped = report["dropped"].as_object().expect("causes").values().filter_map(Value::as_u64);
        assert_eq!(report["samples"].as_u64().expect("a number") + dropped.sum::<u64>(), 1024);
        assert_eq!(report["dropped"]["gap"], 0);
        let rate = report["sample_rate_hz"].as_f64().expect("a number");
        // Data-ready times are rounded to 1 ns.
        assert!((rate - 204.8).abs() < 1e-6, "{rate}");
        assert_eq!(std::fs::read(log).expect("a log")[0] == 0x1f, name.ends_with(".gz"));
    }
}

/// A table or a log, plain or compressed, without its last bytes.
#[test]
fn what_was_read_of_a_text_that_is_cut_is_used_by_every_command() {
    let dir = tempdir().expect("a folder");
    let path = |name: &str| dir.path().join(name).to_str().expect("UTF-8").to_owned();
    for (format, name) in [("table", "a.csv"), ("table", "b.csv.gz"), ("frames", "c.csv"), ("frames", "d.csv.gz")] {
        let (file, converted) = (path(name), path(&format!("{name}.out.csv")));
        let simulated = imunoise(&["simulate", &file, "--format", format, "--seconds", "5", "--seed", "7"]);
        assert!(simulated.status.success(), "{}", String::from_utf8_lossy(&simulated.stderr));
        let whole = std::fs::read(&file).expect("written");
        std::fs::write(&file, &whole[..whole.len() - 12]).expect("written");
        for arguments in [&["analyze", &file][..], &["replay", &file], &["convert", &file, &converted]] {
            let output = imunoise(arguments);
            let errors = String::from_utf8_lossy(&output.stderr);
            assert_eq!(output.status.code(), Some(3), "{arguments:?}: {errors}");
            assert!(errors.contains("not read to its end"), "{arguments:?}: {errors}");
        }
    }
}

/// In the JSON, on the screen, on the page and by the exit code; in a report of many as in that of one.
#[test]
fn a_file_that_is_cut_is_told_everywhere() {
    let dir = tempdir().expect("a folder");
    let (whole, page, reports) = (flight_log(5000), dir.path().join("page.html"), dir.path().join("reports"));
    let cut = write(&dir, "cut.ulg", &whole[..whole.len() - 1010]);
    let file = cut.to_str().expect("UTF-8");
    let [json, page, reports] =
        [dir.path().join("cut.json"), page, reports].map(|path| path.to_str().expect("UTF-8").to_owned());
    let output = imunoise(&["analyze", file, "-o", &json, "-o", &page]);
    let errors = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(3), "{errors}");
    assert!(errors.contains("not read to its end"), "{errors}");
    let screen = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(screen.starts_with("Not read to its end: truncated"), "{screen}");
    let read: Value = serde_json::from_slice(&std::fs::read(&json).expect("a report")).expect("JSON");
    let reading = &read["reading"];
    assert_eq!((&reading["file"], &reading["complete"]), (&"cut.ulg".into(), &false.into()));
    assert!(reading["damage"].as_str().expect("a sentence").contains("truncated"), "{reading}");
    assert_eq!(reading["rows"], read["samples"]);
    let hash = std::process::Command::new("sha256sum").arg(&cut).output().expect("sha256sum starts").stdout;
    let hash = String::from_utf8(hash).expect("digits");
    assert_eq!(reading["sha256"].as_str(), hash.split_whitespace().next());
    let html = std::fs::read_to_string(page).expect("a page");
    assert!(html.contains("Not read to its end: truncated") && html.contains("What was read"));
    // A file of many bytes.
    let intact = write(&dir, "whole.ulg", &whole);
    let output = imunoise(&["batch", file, intact.to_str().expect("UTF-8"), "-o", &reports]);
    assert_eq!(output.status.code(), Some(3), "{}", String::from_utf8_lossy(&output.stderr));
    for (name, complete) in [("cut", false), ("whole", true)] {
        let report = std::fs::read(format!("{reports}/{name}.ulg.json")).expect("a report");
        let report: Value = serde_json::from_slice(&report).expect("JSON");
        assert_eq!(report["reading"]["complete"], complete, "{name}");
    }
    let whole = json_of(&dir, &["analyze", intact.to_str().expect("UTF-8"), "--from", "4"]);
    let whole: Value = serde_json::from_slice(&whole).expect("JSON");
    assert_eq!((&whole["reading"]["rows"], &whole["samples"]), (&5000.into(), &4000.into()));
    assert_eq!(whole["reading"]["left_out"]["outside_part"], 1000);
    assert_eq!(whole["reading"]["options"], serde_json::json!(["--from", "4"]));
}
