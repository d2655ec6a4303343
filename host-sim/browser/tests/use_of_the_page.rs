//! The steps of a user on the page.

use crate::harness::drive;
use serde_json::json;
use std::process::Command;
use system_tests::{host_sim, recorded_samples};

/// `use.js` defines what is checked. Exports and the comparison of several files equal those of the command.
#[test]
fn a_user_finds_the_way_and_nothing_is_requested() {
    const TEST: &str = "use_of_the_page::a_user_finds_the_way_and_nothing_is_requested";
    let Some(samples) = recorded_samples(TEST) else { return };
    let folder = tempfile::tempdir().expect("a folder");
    let damaged = folder.path().join("damaged.mcap");
    let mut bytes = std::fs::read(samples.join("foxglove.mcap")).expect("written");
    bytes[8..64].fill(0xFF);
    std::fs::write(&damaged, bytes).expect("room");
    let run = |arguments: &[&str]| {
        let output = Command::new(host_sim()).args(arguments).output().expect("imunoise starts");
        assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
        output.stdout
    };
    let compared = ["one", "two"].map(|name| folder.path().join(format!("{name}.csv.gz")).display().to_string());
    for (seed, file) in ["1", "2"].into_iter().zip(&compared) {
        run(&["simulate", file, "--seconds", "300", "--seed", seed]);
    }
    let csv = samples.join("euroc.csv").display().to_string();
    let files = json!({
        "csv": csv,
        "npy": samples.join("records.npy"),
        "ulog": samples.join("single.ulg"),
        "bag": samples.join("one.bag"),
        "damaged": damaged,
        "compared": compared,
    });
    if !drive(TEST, "use.js", "observatory.html", folder.path(), &files.to_string()) {
        return;
    }
    let of_page = |name: &str| std::fs::read_to_string(folder.path().join(name)).expect("written");
    let agreement = run(&["compare", &compared[0], &compared[1]]);
    assert_eq!(of_page("agreement.txt"), String::from_utf8(agreement).expect("text"));
    let kalibr = folder.path().join("kalibr.yaml").display().to_string();
    run(&["analyze", &csv, "--quiet", "-o", &kalibr]);
    assert_eq!(of_page("export-kalibr"), std::fs::read_to_string(kalibr).expect("written"));
}
