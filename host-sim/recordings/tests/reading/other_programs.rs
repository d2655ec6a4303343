//! Files of every format that other programs wrote, with known noise, rate and losses (`make_samples.py`).

use super::harness::{read, read_file, rows, write_array};
use recordings::file_format::{RecordedFormat, RecordedInput};
use recordings::sample_stream::StreamError;
use serde_json::Value;
use std::path::PathBuf;
use system_tests::{FlightLog, recorded_samples};

pub(crate) struct Sample {
    pub(crate) name: String,
    pub(crate) file: PathBuf,
    pub(crate) options: Vec<String>,
    truth: Value,
}

pub(crate) fn samples(test: &str) -> Option<Vec<Sample>> {
    let folder = recorded_samples(test)?;
    let text = std::fs::read(folder.join("truth.json")).expect("written");
    let truth: Vec<Value> = serde_json::from_slice(&text).expect("a list in JSON");
    assert!(truth.len() >= 20, "{} samples", truth.len());
    let sample = |truth: Value| {
        let name = truth["file"].as_str().expect("a name").to_owned();
        let options = truth["arguments"].as_array().expect("a list").iter();
        let options = options.map(|text| text.as_str().expect("text").to_owned()).collect();
        Sample { file: folder.join(&name), name, options, truth }
    };
    Some(truth.into_iter().map(sample).collect())
}

fn number(value: &Value) -> f64 {
    value.as_f64().expect("a number")
}

/// Rows and losses to a sample; the rate within 20 ppm by the jitter of the stamps. Counts for floats add a²/2 to the
/// deviation, and by chance a/√n (1 σ), with a = 10⁻² of it.
#[test]
fn samples_of_other_programs_have_their_rate_losses_and_numbers() {
    let Some(samples) = samples("samples_of_other_programs_have_their_rate_losses_and_numbers") else { return };
    for Sample { name, file, options, truth } in &samples {
        let read = read_file(file, options).unwrap_or_else(|error| panic!("{name} {options:?}: {error}"));
        assert_eq!(read.samples.len() as u64, truth["rows"], "{name}: samples");
        assert_eq!(read.missing(), truth["missing"], "{name}: missing samples");
        let rate = read.rate_hz() / number(&truth["rate_hz"]);
        assert!((rate - 1.0).abs() < 20e-6, "{name}: {rate} of the rate");
        let tolerance = 0.5e-4 + 5.0 * 1e-2 / number(&truth["rows"]).sqrt();
        for (channel, expected) in truth["neighbours"].as_object().expect("channels") {
            let ratio = read.neighbours(channel) / number(expected);
            assert!((ratio - 1.0).abs() < tolerance, "{name}: {channel}: {ratio} of the deviation of neighbours");
        }
    }
}

#[test]
fn every_format_is_converted() {
    let Some(samples) = samples("every_format_is_converted") else { return };
    let folder = tempfile::tempdir().expect("a folder");
    let [array, back] = ["back.npy", "back.csv"].map(|name| folder.path().join(name));
    for Sample { name, file, options, truth } in &samples {
        // A log of the bus has no columns.
        if RecordedInput::open(file).expect(name).format() == RecordedFormat::SpiExport {
            continue;
        }
        let lines = rows(file, options).expect(name).lines().count();
        assert_eq!(lines as u64 - 1, truth["rows"], "{name}");
    }
    let bag = &samples.iter().find(|sample| sample.name == "one.bag").expect("a bag").file;
    let columns = write_array(bag, &array).expect("a bag");
    assert_eq!(columns[..5], ["time_s", "gyro_x_rad_s", "gyro_y_rad_s", "gyro_z_rad_s", "accl_x_m_s2"]);
    let columns = "time=0,gyro_x=1,gyro_y=2,gyro_z=3,accl_x=4,accl_y=5,accl_z=6";
    let table = rows(&array, &["--columns", columns, "--units", "s,rad/s,m/s^2"]).expect("an array");
    std::fs::write(&back, table).expect("a disk");
    let [direct, converted] = [bag, &back].map(|file| read_file(file, &[""; 0]).expect("samples"));
    assert_eq!(direct.samples.slots, converted.samples.slots);
    for channel in ["gyro_x", "gyro_y", "gyro_z", "accl_x", "accl_y", "accl_z"] {
        // Counts are rounded anew in each unit: 5·√2·10⁻²/√5956.
        let ratio = direct.neighbours(channel) / converted.neighbours(channel);
        assert!((ratio - 1.0).abs() < 1e-3, "{channel}: {ratio}");
    }
}

#[test]
fn several_sensors_of_a_file_have_a_name_each() {
    let Some(samples) = samples("several_sensors_of_a_file_have_a_name_each") else { return };
    let folder = samples[0].file.parent().expect("a folder");
    for (file, expected) in [
        ("two_structures.mat", &["first", "second"][..]),
        ("two.bag", &["/imu/data", "/imu/other"]),
        ("instances.ulg", &["sensor_gyro", "sensor_gyro:1"]),
        ("structure.mat", &[]),
        ("one.bag", &[]),
        ("single.ulg", &[]),
        ("imu.bin", &[]),
        ("attributes.h5", &[]),
        ("units.csv", &[]),
    ] {
        let input = RecordedInput::open(&folder.join(file)).expect(file);
        assert_eq!(input.sensors().expect(file), expected, "{file}");
        let topics = input.contents().expect(file);
        for name in expected {
            assert!(topics.iter().any(|topic| topic.sensors.iter().any(|sensor| sensor == name)), "{file}: {name}");
        }
        if let [first, second] = expected {
            let error = match read_file(&folder.join(file), &[""; 0]) {
                // The usual one of several messages of a log is read.
                Ok(_) => continue,
                Err(StreamError::Input(error)) => error.to_string(),
                Err(error) => panic!("{file}: {error}"),
            };
            assert!(error.contains(first) && error.contains(second), "{file}: {error}");
        }
    }
    let topics = RecordedInput::open(&folder.join("attributes.h5")).expect("HDF5").contents().expect("HDF5");
    let acc = topics.iter().find(|topic| topic.name == "run 1/imu/acc").expect("a dataset");
    assert_eq!(acc.columns[2], ("run 1/imu/acc.2".to_owned(), Some("m/s^2")));
}

#[test]
fn a_field_without_a_number_leaves_the_others() {
    let mut log = FlightLog::empty();
    log.add(b'F', b"sensor_gyro:uint64_t timestamp;float[0] w;float x;float y;float z;");
    log.add(b'A', b"\0\0\0sensor_gyro");
    for row in 0..100u64 {
        let values = [0.1f32, 0.2, 0.3].map(|value| value * ((row * 7919) % 13) as f32).map(f32::to_le_bytes).concat();
        log.add(b'D', &[&[0, 0][..], &(row * 10_000).to_le_bytes(), &values].concat());
    }
    let read = read("empty.ulg", &log.0, &[""; 0]).expect("a log");
    assert_eq!((read.samples.len(), read.samples.channels.len()), (100, 3));
}

#[test]
fn data_that_were_appended_to_a_log_are_no_message() {
    let log = |flags: [u8; 8], has_appended: bool| {
        let mut log = FlightLog::empty();
        let at_flags = log.0.len();
        log.add(b'B', &[&[0; 8][..], &flags, &[0; 24]].concat());
        log.add(b'F', b"sensor_gyro:uint64_t timestamp;float x;float y;float z;");
        log.add(b'A', b"\0\0\0sensor_gyro");
        for row in 0..100u64 {
            let values = [1u64, 2, 3].map(|axis| (axis * row * 7919 % 13) as f32 * 0.01).map(f32::to_le_bytes).concat();
            log.add(b'D', &[&[0, 0][..], &(row * 10_000).to_le_bytes(), &values].concat());
        }
        if has_appended {
            let cut = log.0.len() + 7;
            log.add(b'D', &[&[0, 0][..], &1_000_000u64.to_le_bytes(), &[0; 12]].concat());
            log.0.truncate(cut);
            log.0[at_flags + 3 + 16..][..8].copy_from_slice(&(cut as u64).to_le_bytes());
            log.add(b'L', b"6________hardfault");
        }
        log.0
    };
    for appended in [false, true] {
        let flags = [u8::from(appended), 0, 0, 0, 0, 0, 0, 0];
        let read = read("crash.ulg", &log(flags, appended), &[""; 0]).expect("a log");
        assert_eq!(read.samples.len(), 100, "{appended}: {:?}", read.notes);
        assert!(!read.notes_contain("truncated"), "{:?}", read.notes);
    }
    // Features that a reader has to know.
    let error = read("new.ulg", &log([2, 0, 0, 0, 0, 0, 0, 0], false), &[""; 0]).err().expect("refused").to_string();
    assert!(error.contains("features"), "{error}");
}
