//! What a file is found to hold, and the command that is proposed where it does not say enough.

use crate::program::{host_sim, json_of, write};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde_json::Value;
use std::path::Path;
use std::process::Output;
use system_tests::recording;
use tempfile::tempdir;

const ROWS: u32 = 6000;

fn name(file: &Path) -> &str {
    file.to_str().expect("UTF-8")
}

/// Nearly normal noise with a standard deviation of 1.
fn normal(rng: &mut ChaCha8Rng) -> f64 {
    (0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0
}

/// What a command that fails writes to standard error; it prints nothing else.
fn refusal(output: &Output) -> String {
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.code() == Some(1) && output.stdout.is_empty(), "{text}");
    // What, where, what to do, the command: the error comes first.
    assert!(text.starts_with("error: "), "{text}");
    text
}

fn inspected(file: &Path) -> String {
    let output = host_sim(&["inspect", name(file)]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8_lossy(&output.stdout).into_owned()
}

/// The arguments of the first command that is proposed.
fn command(text: &str) -> Vec<&str> {
    let line = text.lines().find_map(|line| line.trim().strip_prefix("host-sim ")).unwrap_or_else(|| panic!("{text}"));
    line.split_whitespace().map(|word| word.trim_matches('\'')).collect()
}

/// Rows `t x y z x y z` without a heading at 100 Hz: an accelerometer at rest, and a gyroscope of 131 LSB per deg/s; between them what
/// `between` says.
fn unnamed(gravity: f64, gyro_step: f64, between: [&str; 2]) -> String {
    let mut rng = ChaCha8Rng::seed_from_u64(11);
    let row = |row: u32| {
        let force = [0.1, -0.2, 0.97].map(|part| gravity * (part + 0.002 * normal(&mut rng)));
        let rate = [3.0, -2.0, 1.0].map(|bias: f64| gyro_step * (bias + 9.0 * normal(&mut rng)).round());
        let [force, rate] = [force, rate].map(|axes| axes.map(|value| format!("{value:.9}")).join(" "));
        format!("{:.2} {}{force} {}{rate}\n\n", f64::from(row) / 100.0, between[0], between[1])
    };
    (0..ROWS).map(row).collect()
}

/// Without names, with blank lines between the rows, and with the numbers of the sensors between their values.
#[test]
fn columns_without_names_are_shown_with_the_command_that_reads_them() {
    const MPU_RAD_S: f64 = 1.0 / 131.0 * std::f64::consts::PI / 180.0;
    let dir = tempdir().expect("a folder");
    for (number, (gravity, force_unit, step, rate_unit, between, first)) in
        [(9.81, "m/s^2", MPU_RAD_S, "rad/s", ["", ""], [1, 4]), (1.0, "g", 1.0 / 131.0, "deg/s", ["3 ", "4 "], [2, 6])]
            .into_iter()
            .enumerate()
    {
        let file = write(&dir, &format!("rows{number}.txt"), unnamed(gravity, step, between).as_bytes());
        let text = refusal(&host_sim(&["analyze", name(&file)]));
        let columns = |channel: &str, first: usize| {
            ["x", "y", "z"]
                .into_iter()
                .zip(first..)
                .map(|(axis, at)| format!("{channel}_{axis}={at}"))
                .collect::<Vec<_>>()
        };
        let columns = [vec!["time=0".to_owned()], columns("gyro", first[1]), columns("accl", first[0])].concat();
        let units = format!("{rate_unit},{force_unit}");
        let expected = ["analyze", name(&file), "--columns", &columns.join(","), "--units", &units];
        assert_eq!(command(&text), expected, "{text}");
        assert!(text.contains("first values") && text.contains("131.0 LSB per deg/s"), "{text}");
        // The command opens the file, and `--yes` takes it and says so.
        let by_command = json_of(&dir, &command(&text));
        assert_eq!(by_command, json_of(&dir, &["analyze", name(&file), "--yes"]));
        let report: Value = serde_json::from_slice(&by_command).expect("JSON");
        assert_eq!((&report["samples"], &report["dropped"]["gap"]), (&Value::from(ROWS), &Value::from(0)));
        let taken = host_sim(&["analyze", name(&file), "--yes", "--quiet"]);
        assert!(String::from_utf8_lossy(&taken.stderr).contains("guessed: host-sim analyze"), "a guess is told");
        // The same without an error.
        let shown = inspected(&file);
        assert!(shown.contains("6000 rows at 100.0000 Hz") && shown.contains("no sample missing"), "{shown}");
        assert!(shown.contains("at rest all the time"), "{shown}");
        assert_eq!(command(&shown), expected, "{shown}");
    }
}

/// Without evidence nothing is taken, and a rate never is.
#[test]
fn a_guess_in_doubt_is_shown_and_not_taken() {
    let dir = tempdir().expect("a folder");
    let mut rng = ChaCha8Rng::seed_from_u64(12);
    let rows: String = (0..1000).map(|_| format!("{:.4},{:.4}\n", normal(&mut rng), normal(&mut rng))).collect();
    let file = write(&dir, "two.csv", format!("p,q\n{rows}").as_bytes());
    let text = refusal(&host_sim(&["analyze", name(&file), "--yes"]));
    assert!(text.contains("gyro_x=COLUMN"), "{text}");
    // Noise of 0.002 may be that of a rate in rad/s or of a good one in deg/s.
    let rows: String = (0..1000).map(|row| format!("{},{:.6}\n", row, 0.002 * normal(&mut rng))).collect();
    let file = write(&dir, "rate.csv", format!("t,gyro_x\n{rows}").as_bytes());
    let text = refusal(&host_sim(&["analyze", name(&file), "--yes"]));
    assert!(text.contains("--units rad/s") && text.contains("in doubt") && text.contains("takes no guess"), "{text}");
    // Counts of an unknown size.
    let rows: String = (0..1000).map(|row| format!("{},{:.0}\n", row, 32768.0 + 5.0 * normal(&mut rng))).collect();
    let file = write(&dir, "counts.csv", format!("t,gyro_x\n{rows}").as_bytes());
    let text = refusal(&host_sim(&["analyze", name(&file), "--yes"]));
    assert!(text.contains("deg/s/131"), "{text}");
    assert!(host_sim(&["analyze", name(&file), "--units", "deg/s/131", "--quiet"]).status.success());
    let rows: String = (0..1000).map(|_| format!("{:.4}\n", 5.0 * normal(&mut rng))).collect();
    let file = write(&dir, "no_rate.csv", format!("gyro_x_deg_s\n{rows}").as_bytes());
    let text = refusal(&host_sim(&["analyze", name(&file), "--yes"]));
    assert!(text.contains("--rate HZ"), "{text}");
}

/// Gravity in m/s² and in g in one file would be a contradiction: the mean of a gyroscope may be 1 by its bias.
#[test]
fn a_bias_of_1_is_not_taken_for_gravity_beside_it() {
    let dir = tempdir().expect("a folder");
    let mut rng = ChaCha8Rng::seed_from_u64(13);
    let row = |row: u32| {
        let rate = [0.6, -0.7, 0.4].map(|bias| bias + 0.1 * normal(&mut rng));
        let force = [0.0, 0.0, 9.81].map(|part| part + 0.02 * normal(&mut rng));
        let values = rate.iter().chain(&force).map(|value| format!("{value:.7}")).collect::<Vec<_>>().join(",");
        format!("{},{values}\n", 1_700_000_000_000u64 + u64::from(row) * 5)
    };
    let rows: String = (0..2000).map(row).collect();
    let file = write(&dir, "rows.csv", rows.as_bytes());
    let text = refusal(&host_sim(&["analyze", name(&file)]));
    assert!(text.contains("gyro_x=1,gyro_y=2,gyro_z=3,accl_x=4,accl_y=5,accl_z=6"), "{text}");
    assert!(text.contains("at 200.0000 Hz"), "{text}");
}

/// A sensor that is moved in the middle.
#[test]
fn the_part_at_rest_is_found_and_can_be_analysed() {
    let dir = tempdir().expect("a folder");
    let mut rng = ChaCha8Rng::seed_from_u64(14);
    let row = |row: u32| {
        let moved = if (2560..3840).contains(&row) { 40.0 } else { 0.0 };
        let rate = [0, 1, 2].map(|_| format!("{:.5}", moved * normal(&mut rng) + 0.05 * normal(&mut rng)));
        format!("{:.3},{}\n", f64::from(row) * 0.01, rate.join(","))
    };
    // Blocks of 128 rows; the one beside the movement is left out.
    let rows: String = (0..10_000).map(row).collect();
    let file = write(&dir, "moved.csv", format!("time_s,gx [dps],gy [dps],gz [dps]\n{rows}").as_bytes());
    let shown = inspected(&file);
    let line = shown.lines().find(|line| line.contains("at rest")).expect(&shown);
    assert!(line.contains("--from 39.7 --to 100,"), "{line}");
    let output = host_sim(&["analyze", name(&file), "--from", "39.7", "--to", "100", "--quiet"]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
}

/// A sensor that is turned for 8 s at the beginning, of which the 5 s from 20 to 25 s are missing: `inspect` and `analyze` offer one part,
/// in the time of the stamps.
#[test]
fn the_part_at_rest_is_the_same_in_inspect_and_analyze() {
    let dir = tempdir().expect("a folder");
    let mut rng = ChaCha8Rng::seed_from_u64(16);
    let mut row = |row: u32| {
        let moved = if row < 800 { 20.0 } else { 0.0 };
        let rate = [0, 1, 2].map(|_| format!("{:.5}", moved + 0.05 * normal(&mut rng)));
        format!("{:.3},{}\n", f64::from(row) * 0.01, rate.join(","))
    };
    let rows: String = (0..10_000).filter(|row| !(2000..2500).contains(row)).map(&mut row).collect();
    let file = write(&dir, "turned.csv", format!("time_s,gx [dps],gy [dps],gz [dps]\n{rows}").as_bytes());
    // A quarter of the seventh block of 128 rows is moved, which its median does not show: it is left out as the one beside the movement.
    let offered = "--from 9 --to 100";
    let shown = inspected(&file);
    assert!(shown.contains(&format!("longest part at rest: {offered}, in s")), "{shown}");
    for part in [&[][..], &["--from", "1"]] {
        let output = host_sim(&[&["analyze", name(&file)], part].concat());
        let text = String::from_utf8(output.stdout).expect("UTF-8");
        let text = text.split_whitespace().collect::<Vec<_>>().join(" ");
        assert!(text.contains(&format!("for the longest part at rest, add {offered}.")), "{part:?}: {text}");
    }
}

/// Both programs' parts of a recorded file.
#[test]
fn the_part_at_rest_of_a_log_is_the_same_in_inspect_and_analyze() {
    let test = "the_part_at_rest_of_a_log_is_the_same_in_inspect_and_analyze";
    let Some(path) = recording(test, "others/px4_sample.ulg") else { return };
    let shown = inspected(&path);
    let part = shown.split("longest part at rest: ").nth(1).and_then(|rest| rest.split(',').next()).expect(&shown);
    let text = String::from_utf8(host_sim(&["analyze", name(&path)]).stdout).expect("UTF-8");
    let text = text.split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(text.contains(&format!("for the longest part at rest, add {part}.")), "{part}: {text}");
}

/// Names of several sensors in one table.
#[test]
fn sensors_whose_names_begin_differently_have_a_command_each() {
    let dir = tempdir().expect("a folder");
    let mut rng = ChaCha8Rng::seed_from_u64(15);
    let heading: Vec<String> = ["left", "right"]
        .iter()
        .flat_map(|side| ["x", "y", "z"].map(|axis| format!("{side}_gyro_{axis} [rad/s]")))
        .collect();
    let row = |row: u32| {
        let values: Vec<String> = (0..6).map(|_| format!("{:.6}", 0.002 * normal(&mut rng))).collect();
        format!("{:.3},{}\n", f64::from(row) * 0.01, values.join(","))
    };
    let rows: String = (0..1000).map(row).collect();
    let file = write(&dir, "both.csv", format!("time_s,{}\n{rows}", heading.join(",")).as_bytes());
    let text = refusal(&host_sim(&["analyze", name(&file)]));
    for side in ["left", "right"] {
        let columns = format!("time=time,gyro_x={side}_gyro_x,gyro_y={side}_gyro_y,gyro_z={side}_gyro_z");
        assert!(text.contains(&columns), "{text}");
        assert!(host_sim(&["analyze", name(&file), "--columns", &columns, "--quiet"]).status.success(), "{columns}");
    }
}

/// What other people's files are found to hold; their source says the units.
#[test]
fn other_peoples_files_are_described() {
    let test = "other_peoples_files_are_described";
    for (file, expected) in [
        ("vn100_nitin.bag", &["imu_driver/Vectornav", "13217 rows at 39.9999", "at rest all the time"][..]),
        ("vn100_emulator_0.db3", &["/imu imu_msg/msg/IMUmsg", "without a definition"]),
        ("mpu9250_imu1_raw.mat", &["imu1_raw.wb.0", "41671 rows at 43.0", "at rest"]),
        ("mpu6050_accelerometer.mat", &["accelBuffer.3", "65067 rows at 99.2976", "--units g"]),
        (
            "px4_sample.ulg",
            &["sensor_combined", "17070 rows at 248.55", "in 8 gaps", "other topics:", "vehicle_attitude"],
        ),
        ("betaflight_btfl_001.bbl", &["gyroADC[0]", "samples missing"]),
        ("phone_gyro4.txt", &["38577 rows at", "gyro_x=2,gyro_y=3,gyro_z=4"]),
        ("imutk_xsens_gyro.mat", &["51175 rows at 100.", "time=0,gyro_x=1,gyro_y=2,gyro_z=3", "deg/s/131"]),
        ("lsm6dso_static.txt", &["973 rows; no time stamps", "--rate HZ", "at rest all the time"]),
        ("stampfly_fft_20260114T115628.csv", &["12000 rows at 399.98", "--units 'rad/s,m/s^2'"]),
    ] {
        let Some(path) = recording(test, &format!("others/{file}")) else { return };
        let shown = inspected(&path);
        for text in expected {
            assert!(shown.contains(text), "{file}: {text:?} is not in\n{shown}");
        }
    }
}
