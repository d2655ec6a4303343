//! What the program shows when it is run without a word: the virtual sensor hides two effects, the report finds them.

mod common;

use common::json_of;
use serde_json::Value;
use tempfile::TempDir;

fn channel<'a>(report: &'a Value, name: &str) -> &'a Value {
    let channels = report["channels"].as_array().expect("channels");
    channels.iter().find(|channel| channel["name"] == name).expect("the channel")
}

fn effect<'a>(channel: &'a Value, kind: &str) -> &'a Value {
    let effects = channel["effects"].as_array().expect("effects");
    effects.iter().find(|effect| effect["kind"] == kind).unwrap_or_else(|| panic!("no {kind} among {effects:?}"))
}

#[test]
fn the_report_finds_what_the_default_sensor_hides() {
    let dir = TempDir::new().expect("a folder");
    let page = dir.path().join("page");
    let bytes = json_of(&dir, &["--page", page.to_str().expect("UTF-8")]);
    let report: Value = serde_json::from_slice(&bytes).expect("JSON");

    // 0.2 deg/s at 20.5 Hz on gyro z: within the 95 % interval of the amplitude, or 5 % where that is narrower.
    let line = effect(channel(&report, "gyro_z"), "sinusoid");
    let frequency = line["parameters"]["frequency"]["value"].as_f64().expect("a number");
    let amplitude = line["parameters"]["amplitude"]["value"].as_f64().expect("a number");
    assert!((frequency - 20.5).abs() < 0.01, "{frequency}");
    assert!((amplitude / 0.2 - 1.0).abs() < 0.05, "{amplitude}");

    // 0.05 (deg/s)/°C on gyro x; the walk of the rate over the hour of warm-up blurs it by about a tenth.
    let warmth = effect(channel(&report, "gyro_x"), "temperature");
    let sensitivity = warmth["parameters"]["sensitivity"]["value"].as_f64().expect("a number");
    assert!((sensitivity / 0.05 - 1.0).abs() < 0.25, "{sensitivity}");

    let unseen = |name: &str, when: &str| {
        channel(&report, name)[when]["unseen"]["deviance_per_point"].as_f64().expect("a number")
    };
    assert!(unseen("gyro_z", "after") < 0.1 * unseen("gyro_z", "before"));
    // Nothing is hidden there.
    assert_eq!(channel(&report, "gyro_y")["effects"].as_array().map(Vec::len), Some(0));
}
