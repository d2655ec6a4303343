//! The file for Kalibr, from a sensor whose noise is known.

mod common;

use common::host_sim;
use tempfile::tempdir;

fn number(yaml: &str, key: &str) -> f64 {
    let start = format!("{key}: ");
    let line = yaml.lines().find_map(|line| line.strip_prefix(&start)).unwrap_or_else(|| panic!("{key} in {yaml}"));
    line.split_whitespace().next().and_then(|word| word.parse().ok()).unwrap_or_else(|| panic!("{key}: {line}"))
}

#[test]
fn kalibr_gets_the_noise_of_the_virtual_sensor() {
    let dir = tempdir().expect("a folder");
    let file = dir.path().join("imu.yaml");
    let page = dir.path().to_str().expect("UTF-8");
    let file_name = file.to_str().expect("UTF-8");
    let output = host_sim(&["--plain", "--seconds", "600", "--page", page, "--kalibr", file_name]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let yaml = std::fs::read_to_string(&file).expect("the file");
    // The converter's steps of 3.33 mg add white noise of a twelfth of their square.
    let rounding = 3.33e-3 * 9.80665 / (12.0_f64 * 204.8).sqrt();
    // The published gyro has 0.0368 deg/√s and 0.0013 deg/s/√s; the accelerometers have the data sheet's 0.2 m/s/√h. Five
    // minutes tell N to 1/√(2·61,440) an axis, 0.3 %, and less behind a filter: five times that. Of K they tell the order.
    for (key, expected, tolerance) in [
        ("gyroscope_noise_density", 0.0368_f64.to_radians(), 0.015),
        ("accelerometer_noise_density", rounding.hypot(0.2 / 60.0), 0.015),
        ("gyroscope_random_walk", 0.0013_f64.to_radians(), 2.0),
    ] {
        let found = number(&yaml, key);
        assert!((found / expected).ln().abs() < f64::ln_1p(tolerance), "{key}: {found}, not {expected}");
    }
    assert!(number(&yaml, "accelerometer_random_walk") > 0.0, "a bound at least");
    assert!((number(&yaml, "update_rate") - 204.8).abs() < 0.1);
    assert!(yaml.contains("rostopic: /imu0") && yaml.contains("#   gyro_z: "));
}

#[test]
fn what_is_no_noise_model_is_refused() {
    let output = host_sim(&["paper", "--seeds", "2", "--kalibr", "nowhere.yaml"]);
    assert!(!output.status.success());
    assert!(String::from_utf8_lossy(&output.stderr).contains("leave out"));
}
