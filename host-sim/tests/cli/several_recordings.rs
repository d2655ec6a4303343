//! `compare` of recordings and of reports, and `analyze --each-sensor`.

use crate::program::{imunoise, json_of};
use serde_json::Value;
use tempfile::tempdir;

fn text(arguments: &[&str]) -> String {
    let output = imunoise(arguments);
    assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8_lossy(&output.stdout).into_owned()
}

#[test]
fn equal_parts_agree_a_louder_axis_differs_and_is_called_worse() {
    let dir = tempdir().expect("a folder");
    let path = |name: &str| dir.path().join(name).to_str().expect("UTF-8").to_owned();
    let [one, two, three] = ["1.csv", "2.csv", "3.csv"].map(path);
    // Without slow noise, which two minutes do not determine. Gyro y of the third is 1.5 times as loud.
    let quiet = ["--seconds", "120", "--noise", "gyro=0.04,0,0", "--noise", "accl=0.004,0,0"];
    for (out, seed, gyro_y) in [(&one, "1", "0.04,0,0"), (&two, "2", "0.04,0,0"), (&three, "3", "0.06,0,0")] {
        text(&[&["simulate", out, "--seed", seed, "--noise", &format!("gyro_y={gyro_y}")][..], &quiet].concat());
    }
    let summary: Value = serde_json::from_slice(&json_of(&dir, &["compare", &one, &two, &three])).expect("JSON");
    let channels = summary["agreement"]["channels"].as_array().expect("channels");
    for channel in channels.iter().filter(|channel| {
        channel["name"].as_str().is_some_and(|name| name.starts_with("gyro") || name.starts_with("accl"))
    }) {
        let same = channel["name"] != "gyro_y";
        assert_eq!(channel["agree"], same, "{}", channel["p_value"]);
        assert_eq!(channel["joint"].as_array().map(Vec::is_empty), Some(!same));
    }
    let summary: Value =
        serde_json::from_slice(&json_of(&dir, &["compare", &one, &two, "--running", &three])).expect("JSON");
    let inflated = summary["inflation"]["channels"].as_array().expect("channels");
    let first = |name: &str| {
        let channel = inflated.iter().find(|channel| channel["name"] == name).expect("the channel");
        ["low", "factor", "high"].map(|key| channel["octaves"][0][key].as_f64().expect("a number"))
    };
    // 24,576 samples: the ratio of two deviations has a standard deviation of √(1/2·(1/16,384 + 1/32,768)) = 0.7 %; rounding
    // to 0.05 deg/s adds as much to both.
    let rounding = 0.05_f64.powi(2) / 12.0 / 204.8;
    let truth = ((0.06_f64.powi(2) + rounding) / (0.04_f64.powi(2) + rounding)).sqrt();
    let [low, factor, high] = first("gyro_y");
    assert!((factor / truth - 1.0).abs() < 0.035 && low < factor && factor < high, "{factor} [{low}, {high}]");
    assert!(text(&["compare", &one, "--running", &three]).contains("inflation"));

    let [a, b, c] = ["a.json", "b.json", "c.json"].map(path);
    text(&["analyze", &one, "-o", &a]);
    text(&["analyze", &three, "-o", &b]);
    let table = text(&["compare", &a, &b, "-o", &c]);
    assert!(table.contains("not distinguishable") && table.contains("worse"), "{table}");
    let rows: Value = serde_json::from_slice(&std::fs::read(&c).expect("a file")).expect("JSON");
    for row in rows["coefficients"].as_array().expect("rows").iter().filter(|row| row["kind"] == "angle_random_walk") {
        let expected = if row["channel"] == "gyro_y" { "worse" } else { "not_distinguishable" };
        assert_eq!(row["verdict"], expected, "{row}");
    }
    // The data sheet has 2 deg/√h, 0.0333 deg/√s: 0.06 is worse.
    let table = text(&["compare", "--data-sheet", &b]);
    let row = table.lines().find(|line| line.contains("gyro_y") && line.contains("angle random walk")).expect("a row");
    assert!(row.contains("0.03333") && row.contains("worse"), "{row}");
}

#[test]
fn wrong_sets_of_recordings_and_reports_are_refused() {
    let dir = tempdir().expect("a folder");
    let path = |name: &str| dir.path().join(name).to_str().expect("UTF-8").to_owned();
    let [one, two] = ["1.csv", "2.csv"].map(path);
    for (out, rate) in [(&one, "100"), (&two, "200")] {
        text(&["simulate", out, "--seconds", "20", "--rate", rate]);
    }
    for (arguments, expected) in [
        (&["compare", &one, &two][..], "recordings are compared at one rate"),
        (&["compare", &one, &two, "-o", &format!("json={two}")], "it would be overwritten"),
    ] {
        let output = imunoise(arguments);
        let errors = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(!output.status.success() && errors.contains(expected), "{arguments:?}: {errors}");
    }
}

/// Sensors of one file, whose rows have a label each, are analysed as several recordings are, or have a report each.
#[test]
fn each_sensor_of_a_file_is_a_recording() {
    let dir = tempdir().expect("a folder");
    let row = |row: i32| {
        let [x, y] = [7919, 104_729].map(|factor| f64::from(row * factor % 1009) / 1000.0);
        format!("left,{},{x},{y},{x}\nright,{},{y},{x},{y}\n", 10 * row, 10 * row + 3)
    };
    let rows = (0..2000).map(row).collect::<String>();
    let file = crate::program::write(&dir, "kinds.txt", rows.as_bytes());
    let columns = ["--columns", "time=1,gyro_x=2,gyro_y=3,gyro_z=4", "--units", "ms,rad/s"];
    let analyze = [&["analyze", file.to_str().expect("UTF-8"), "--each-sensor"], &columns[..]].concat();
    let several: Value = serde_json::from_slice(&json_of(&dir, &analyze)).expect("JSON");
    assert_eq!(several["agreement"]["samples"], Value::from(vec![2000, 2000]));
    let reports = dir.path().join("reports");
    let batch = [&["batch"], &analyze[1..], &["-o", reports.to_str().expect("UTF-8")]].concat();
    assert!(imunoise(&batch).status.success());
    assert_eq!(std::fs::read_dir(&reports).expect("a folder").count(), 2);
    // Each of the commands that are proposed writes a file of its own.
    let proposed =
        imunoise(&[&["analyze", file.to_str().expect("UTF-8")], &columns[..], &["-o", "page.v2.html"]].concat());
    let proposed = String::from_utf8(proposed.stderr).expect("UTF-8");
    for (topic, output) in [("left", "page-1.v2.html"), ("right", "page-2.v2.html")] {
        let command = proposed.lines().find(|line| line.contains(&format!("--topic {topic}"))).expect(&proposed);
        assert!(command.contains(&format!(" -o {output}")), "{proposed}");
    }
    let inspected = text(&["inspect", file.to_str().expect("UTF-8")]);
    assert!(inspected.contains("--topic left") && inspected.contains("--topic right"), "{inspected}");
    // That the columns are rates is in doubt, and `--each-sensor` takes no guess in doubt.
    assert!(!inspected.contains("--each-sensor"), "{inspected}");
}

/// Eleven sensors of six columns in a table, and a column that no sensor has: one note, which names no column that another sensor reads.
#[test]
fn the_columns_of_the_other_sensors_are_not_told_as_left_out() {
    let dir = tempdir().expect("a folder");
    let sensors = (0..11).flat_map(|imu| ["gyro", "accel"].map(|of| (imu, of)));
    let columns = sensors.flat_map(|(imu, of)| ["x", "y", "z"].map(|axis| (imu, of, axis)));
    let unit = |of: &str| if of == "gyro" { "rad/s" } else { "m/s^2" };
    let headings = columns.map(|(imu, of, axis)| format!(",imu{imu}_{of}_{axis} [{}]", unit(of))).collect::<String>();
    let row = |row: i32| {
        let values = (0..66).map(|column| format!(",{:.3}", f64::from((row * 7919 + column * 104_729) % 1009) / 1e4));
        format!("{:.2},0{}\n", f64::from(row) / 100.0, values.collect::<String>())
    };
    let table = format!("t [s],lamp{headings}\n{}", (0..1500).map(row).collect::<String>());
    let file = crate::program::write(&dir, "many.csv", table.as_bytes());
    let errors = |arguments: &[&str]| {
        let output = imunoise(&[&["analyze", file.to_str().expect("UTF-8"), "--quiet"], arguments].concat());
        String::from_utf8(output.stderr).expect("UTF-8")
    };
    let together = errors(&["--each-sensor"]);
    let left_out: Vec<&str> = together.lines().filter(|line| line.contains("left out")).collect();
    assert_eq!(left_out, ["note: lamp left out: --columns does not name it"], "{together}");
    assert!(together.lines().all(|line| line.chars().count() < 160), "{together}");
    let json = dir.path().join("one.json");
    let alone = errors(&["--columns", "time=t,gyro_x=imu3_gyro_x", "-o", json.to_str().expect("UTF-8")]);
    let note = "note: 66 columns left out: --columns does not name it (`inspect`, .json and .html have their names)";
    assert!(alone.lines().any(|line| line == note), "{alone}");
    let report = std::fs::read_to_string(&json).expect("a report");
    assert!(report.contains("lamp, imu0_gyro_x, ") && report.contains(", imu10_accel_z"), "{report}");
}
