//! Reports of the virtual sensor, whose noise and hidden effects are known.

use crate::program::{imunoise, json_of};
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
fn the_two_hidden_effects_of_the_default_sensor_are_found() {
    let dir = TempDir::new().expect("a folder");
    let page = dir.path().join("page.html");
    // A third of the default hour has both effects: the warm-up, whose time constant is a quarter of an hour, is most of it.
    let bytes = json_of(&dir, &["demo", "--seconds", "1200", "-o", page.to_str().expect("UTF-8")]);
    let report: Value = serde_json::from_slice(&bytes).expect("JSON");

    // 0.2 deg/s at 20.5 Hz on gyro z: within the 95 % interval of the amplitude, or 5 % where that is narrower.
    let line = effect(channel(&report, "gyro_z"), "sinusoid");
    let frequency = line["parameters"]["frequency"]["value"].as_f64().expect("a number");
    let amplitude = line["parameters"]["amplitude"]["value"].as_f64().expect("a number");
    assert!((frequency - 20.5).abs() < 0.01, "{frequency}");
    assert!((amplitude / 0.2 - 1.0).abs() < 0.05, "{amplitude}");

    // 0.05 (deg/s)/°C on gyro x; the rate random walk during the warm-up adds an error of about a tenth.
    let warmth = effect(channel(&report, "gyro_x"), "temperature");
    let sensitivity = warmth["parameters"]["sensitivity"]["value"].as_f64().expect("a number");
    assert!((sensitivity / 0.05 - 1.0).abs() < 0.25, "{sensitivity}");

    let unseen = |name: &str, when: &str| {
        channel(&report, name)[when]["unseen"]["deviance_per_point"].as_f64().expect("a number")
    };
    assert!(unseen("gyro_z", "after") < 0.1 * unseen("gyro_z", "before"));
    // Gyro y has no hidden effect.
    assert_eq!(channel(&report, "gyro_y")["effects"].as_array().map(Vec::len), Some(0));
}

fn number(yaml: &str, key: &str) -> f64 {
    let start = format!("{key}: ");
    let line = yaml.lines().find_map(|line| line.strip_prefix(&start)).unwrap_or_else(|| panic!("{key} in {yaml}"));
    line.split_whitespace().next().and_then(|word| word.parse().ok()).unwrap_or_else(|| panic!("{key}: {line}"))
}

#[test]
fn the_file_for_kalibr_has_the_noise_of_the_virtual_sensor() {
    let dir = TempDir::new().expect("a folder");
    let file = dir.path().join("imu.yaml");
    let file_name = file.to_str().expect("UTF-8");
    let output = imunoise(&["demo", "--plain", "--seconds", "600", "-o", file_name]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let yaml = std::fs::read_to_string(&file).expect("the file");
    // The converter's steps of 3.33 mg add white noise of a twelfth of their square.
    let rounding = 3.33e-3 * 9.80665 / (12.0_f64 * 204.8).sqrt();
    // The published gyro has 0.0368 deg/√s and 0.0013 deg/s/√s; the accelerometers have the data sheet's 0.2 m/s/√h. From
    // five minutes N has a relative standard deviation of 1/√(2·61,440) an axis, 0.3 %, and more behind a filter: the bound is
    // five times that. K is known to a factor of 3 only.
    for (key, expected, tolerance) in [
        ("gyroscope_noise_density", 0.0368_f64.to_radians(), 0.015),
        ("accelerometer_noise_density", rounding.hypot(0.2 / 60.0), 0.015),
        ("gyroscope_random_walk", 0.0013_f64.to_radians(), 2.0),
    ] {
        let found = number(&yaml, key);
        assert!((found / expected).ln().abs() < f64::ln_1p(tolerance), "{key}: {found}, not {expected}");
    }
    assert!(number(&yaml, "accelerometer_random_walk") > 0.0, "not positive");
    assert!((number(&yaml, "update_rate") - 204.8).abs() < 0.1);
    assert!(yaml.contains("rostopic: /imu0") && yaml.contains("#   gyro_z: "));
}
