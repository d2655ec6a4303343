//! A recording gives the same report whether its counts are read or its bursts are replayed over the emulated bus.

use crate::program::{counts, host_sim, json_of};
use serde_json::Value;
use tempfile::tempdir;

#[test]
fn a_table_has_one_report_analyzed_and_replayed() {
    let dir = tempdir().expect("a folder");
    let table = counts(&dir);
    let table = table.to_str().expect("UTF-8");
    assert!(json_of(&dir, &["analyze", table]) == json_of(&dir, &["replay", table]), "the reports differ");
    let [analyzed, replayed] = ["analyze", "replay"].map(|command| host_sim(&[command, table]).stdout);
    assert!(!analyzed.is_empty() && analyzed == replayed, "the screens differ");
}

#[test]
fn a_recorded_simulation_replays_to_the_same_report() {
    let dir = tempdir().expect("a folder");
    for name in ["log.csv", "log.csv.gz"] {
        let log = dir.path().join(name);
        let log = log.to_str().expect("UTF-8");
        let recorded = json_of(&dir, &["record", log, "--seconds", "5", "--seed", "7"]);
        assert!(recorded == json_of(&dir, &["replay", log]), "{name}");
        let report: Value = serde_json::from_slice(&recorded).expect("JSON");
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
