//! Destinations of a report: one screen, every table, nothing, JSON on standard output, pictures.

use crate::program::imunoise;
use serde_json::Value;
use tempfile::TempDir;

/// Output of the program for half a minute of the virtual sensor.
fn run(dir: &TempDir, arguments: &[&str]) -> String {
    let log = dir.path().join("bus.csv");
    let file = log.to_str().expect("UTF-8");
    if !log.exists() {
        let simulated = imunoise(&["simulate", file, "--format", "frames", "--seconds", "30"]);
        assert!(simulated.status.success(), "{}", String::from_utf8_lossy(&simulated.stderr));
    }
    let output = imunoise(&[&["analyze", file], arguments].concat());
    assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).expect("text")
}

#[test]
fn the_arguments_choose_what_is_printed() {
    let dir = TempDir::new().expect("a folder");
    let screen = run(&dir, &[]);
    // Standard output is no terminal here: 80 columns without colour.
    assert!(screen.lines().count() <= 40 && screen.starts_with("ADIS16405   bus.csv   "), "{screen}");
    assert!(screen.lines().all(|line| line.chars().count() <= 80 && !line.contains('\u{1b}')), "{screen}");
    for heading in ["What was found", "What to do", "gyro", "accel"] {
        assert!(screen.contains(heading), "{heading}: {screen}");
    }
    let full = run(&dir, &["--full"]);
    assert!(full.contains("── supply") && full.contains("95 % interval"), "{full}");
    assert_eq!(run(&dir, &["--quiet"]), "");
    let report: Value = serde_json::from_str(&run(&dir, &["-o", "-"])).expect("JSON alone");
    assert_eq!(report["schema"], 2);
    let spectrum = &report["channels"][1]["spectrum"];
    let points = spectrum["density"].as_array().expect("a spectrum").len();
    assert!((50..=400).contains(&points), "{points}");
}

#[test]
fn every_figure_is_written_as_svg() {
    let dir = TempDir::new().expect("a folder");
    let figures = dir.path().join("run1.svg");
    run(&dir, &["-o", figures.to_str().expect("UTF-8")]);
    for name in ["overview-gyros", "gyro_x-allan", "gyro_x-spectrum", "gyro_x-bias", "accl_z-allan"] {
        let svg = std::fs::read(dir.path().join(format!("run1-{name}.svg"))).expect("an SVG");
        assert!(svg.starts_with(b"<svg "), "{name}");
    }
}
