//! Recordings of other people on their time base.

use measurement::SensorProfile;
use recordings::ColumnSelection;
use recordings::any_sensor::ReadOptions;
use recordings::file_format::InputFile;
use system_tests::recording;

fn options(columns: &[&str]) -> ReadOptions {
    let columns: Vec<String> = columns.iter().map(|&text| text.to_owned()).collect();
    let selection = ColumnSelection::parse(&columns, &[]).expect("columns");
    ReadOptions { sensor: SensorProfile::generic(), selection, topic: None }
}

/// A loop of 125 us (`looptime`), of which the controller runs every second time (`pid_process_denom`) and every second of those is logged
/// (`P interval`): 2 kHz, by the clock of a gyroscope, which is within 1 %. A sixth of the frames was dropped.
#[test]
fn frames_that_a_blackbox_dropped_are_gaps() {
    let Some(file) = recording("frames_that_a_blackbox_dropped_are_gaps", "others/betaflight_btfl_001.bbl") else {
        return;
    };
    let recording = InputFile::open(&file).expect("a file").read(&options(&[])).expect("a log");
    let (base, _) = recording.time_base(None).expect("a time base");
    let measured = base.measurement;
    assert!((measured.sample_rate_hz / 2000.0 - 1.0).abs() < 1e-2, "{}", measured.sample_rate_hz);
    // As many frames as orangebox decodes.
    assert_eq!(measured.len(), 24_060);
    let gaps = measured.dropped["gap"] as f64;
    let lost = gaps / (gaps + measured.len() as f64);
    assert!((0.15..0.21).contains(&lost), "{lost}");
}

/// An error about a column names those of the only sensor in the file.
#[test]
fn a_column_that_a_bag_does_not_have_names_those_that_it_has() {
    let test = "a_column_that_a_bag_does_not_have_names_those_that_it_has";
    let Some(file) = recording(test, "others/vn100_nitin.bag") else { return };
    let error =
        InputFile::open(&file).expect("a file").read(&options(&["gyro_x=rates.x"])).expect_err("no such column");
    let error = error.to_string();
    assert!(error.contains("rates.x") && error.contains("angular_velocity.x"), "{error}");
}
