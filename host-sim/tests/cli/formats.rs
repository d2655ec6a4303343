//! Recordings that other programs wrote: the angle random walk, the rate and the losses of each come out right.

use crate::program::{host_sim, json_of, write};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use recordings::file_format::InputFile;
use serde_json::Value;
use std::f64::consts::PI;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::sync::OnceLock;
use std::time::{Duration, Instant};
use system_tests::note_skipped;
use tempfile::tempdir;

/// The folder in which `make_samples.py` has written its samples, once for all tests, with the Python that `ADIS_PYTHON` names;
/// `None`, with a note, without it.
fn samples(test: &str) -> Option<&'static Path> {
    static FOLDER: OnceLock<PathBuf> = OnceLock::new();
    let Some(python) = std::env::var_os("ADIS_PYTHON").map(PathBuf::from).filter(|python| python.exists()) else {
        note_skipped(test, "ADIS_PYTHON names no Python with the writers of the formats");
        return None;
    };
    let folder = FOLDER.get_or_init(|| {
        let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("recordings/tests/make_samples.py");
        let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("samples");
        // The writers of bags refuse a file that exists.
        let _ = std::fs::remove_dir_all(&folder);
        let made = Command::new(python).arg(script).arg(&folder).output().expect("Python starts");
        assert!(made.status.success(), "{}", String::from_utf8_lossy(&made.stderr));
        folder
    });
    Some(folder)
}

/// The baseline model's angle random walk of a channel.
fn angle_random_walk(report: &Value, channel: &str) -> f64 {
    let channels = report["channels"].as_array().expect("a list");
    let own = channels.iter().find(|known| known["name"] == channel).expect(channel);
    let terms = own["before"]["terms"].as_array().expect("a list");
    let term = terms.iter().find(|term| term["kind"] == "angle_random_walk").expect("N");
    term["parameters"]["value"]["value"].as_f64().expect("a number")
}

/// What `make_samples.py` says of its files.
fn truth(samples: &Path) -> Vec<Value> {
    let text = std::fs::read(samples.join("truth.json")).expect("written");
    let truth: Vec<Value> = serde_json::from_slice(&text).expect("a list in JSON");
    assert!(truth.len() >= 20, "{} samples", truth.len());
    truth
}

/// The arguments of a command that reads the file of `known`.
fn reading<'a>(command: &'a str, known: &'a Value, file: &'a Path) -> Vec<&'a str> {
    let arguments = known["arguments"].as_array().expect("a list").iter().map(|text| text.as_str().expect("text"));
    [command, file.to_str().expect("UTF-8")].into_iter().chain(arguments).collect()
}

/// Every sample of every format: rows and losses to a sample; the rate within 20 ppm, which is the jitter of the stamps
/// (uniform in 2 % of a period, 0.6 % standard deviation) over √n and the length of the record with room; N within five
/// standard deviations. The model is fitted to the first half, n/2 samples, and N is at least as good as the Allan variance of
/// neighbours, whose relative standard deviation is √(3/(2·n/2)) (edf of white noise: two thirds of the samples; facts of
/// Greenhall's formula), that of N half of it: √(3/(4·n/2)).
///
/// The Allan deviation of neighbours is that which numpy computes from the samples as they were written. The counts that
/// stand for floats add noise of at most a = 10⁻² of its deviation: a²/2 to the deviation, and by chance a/√n (1 σ).
#[test]
fn samples_of_other_programs_give_noise_rate_and_losses() {
    let Some(samples) = samples("samples_of_other_programs_give_noise_rate_and_losses") else { return };
    let dir = tempdir().expect("a folder");
    for known in &truth(samples) {
        let name = known["file"].as_str().expect("a name");
        let file = samples.join(name);
        let report: Value = serde_json::from_slice(&json_of(&dir, &reading("analyze", known, &file))).expect("JSON");
        assert_eq!(report["samples"], known["rows"], "{name}: samples");
        assert_eq!(report["dropped"]["gap"], known["missing"], "{name}: missing samples");
        let rate = report["sample_rate_hz"].as_f64().expect("a rate") / known["rate_hz"].as_f64().expect("a rate");
        assert!((rate - 1.0).abs() < 20e-6, "{name}: {rate} of the rate");
        let half = known["rows"].as_f64().expect("a number") / 2.0;
        let tolerance = 5.0 * (3.0 / (4.0 * half)).sqrt();
        for (channel, expected) in known["angle_random_walk"].as_object().expect("channels") {
            let found = angle_random_walk(&report, channel) / expected.as_f64().expect("a number");
            assert!((found - 1.0).abs() < tolerance, "{name}: {channel}: {found} of N, tolerance {tolerance}");
        }
        let rounding = 0.5e-4 + 5.0 * 1e-2 / (2.0 * half).sqrt();
        for (channel, expected) in known["neighbours"].as_object().expect("channels") {
            let channels = report["channels"].as_array().expect("a list");
            let own = channels.iter().find(|known| known["name"] == channel.as_str()).expect(channel);
            let found = own["curve"][0]["adev"].as_f64().expect("a number") / expected.as_f64().expect("a number");
            assert!((found - 1.0).abs() < rounding, "{name}: {channel}: {found} of the Allan deviation of neighbours");
        }
    }
}

/// A new user's first command: from a recording to a file for Kalibr. Its noise densities are those that numpy computes from the
/// samples, sigma/sqrt(rate) in SI units and the root mean square over the axes.
///
/// For white noise that is the maximum-likelihood estimate, of relative standard deviation 1/√(2n) an axis. The fitted N has 1.4
/// times its variance (0.084 for 0.071 %, `docs/peers.md`), so that the two differ by √0.4/√(2n), and less in the mean over axes.
#[test]
fn one_command_leads_from_a_recording_to_a_file_for_kalibr() {
    let Some(samples) = samples("one_command_leads_from_a_recording_to_a_file_for_kalibr") else { return };
    let dir = tempdir().expect("a folder");
    let truth = truth(samples);
    let out = dir.path().join("imu.yaml");
    let target = format!("kalibr={}", out.display());
    for name in ["one.bag", "mcap/mcap.mcap", "single.ulg", "imu.bin", "matrix.npy", "saleae_table.csv"] {
        let known = truth.iter().find(|known| known["file"] == name).expect(name);
        let file = samples.join(name);
        let output = host_sim(&[&reading("analyze", known, &file)[..], &["--quiet", "--export", &target]].concat());
        let notes = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(output.status.success() && output.stdout.is_empty(), "{name}: {notes}");
        let yaml = std::fs::read_to_string(&out).expect("a file");
        let number = |key: &str| -> Option<f64> {
            let line = yaml.lines().find_map(|line| line.strip_prefix(key)?.strip_prefix(": "))?;
            line.split_whitespace().next()?.parse().ok()
        };
        let tolerance = 5.0 * (0.4 / (2.0 * known["rows"].as_f64().expect("a number"))).sqrt();
        let sensors = [("gyroscope", "gyro", PI / 180.0), ("accelerometer", "accl", 9.806_65)];
        for (sensor, prefix, to_si) in sensors {
            let walks = known["sample_walk"].as_object().expect("channels").iter();
            let own: Vec<f64> = walks
                .filter(|(channel, _)| channel.starts_with(prefix))
                .map(|(_, walk)| to_si * walk.as_f64().expect("a number"))
                .collect();
            let (density, walk) =
                (number(&format!("{sensor}_noise_density")), number(&format!("{sensor}_random_walk")));
            if own.is_empty() {
                assert_eq!((density, walk), (None, None), "{name}");
                assert!(notes.contains(&format!("no {sensor}_noise_density")), "{name}: {notes}");
                continue;
            }
            let expected = (own.iter().map(|walk| walk * walk).sum::<f64>() / own.len() as f64).sqrt();
            let found = density.expect(sensor) / expected;
            assert!((found - 1.0).abs() < tolerance, "{name}: {sensor}: {found} of {expected}, tolerance {tolerance}");
            assert!(walk.expect(sensor) > 0.0, "{name}: Kalibr divides by it");
        }
        let rate = number("update_rate").expect("a rate") / known["rate_hz"].as_f64().expect("a rate");
        assert!((rate - 1.0).abs() < 20e-6, "{name}: {rate}");
    }
}

/// A recording of any format as a table and as an array is the same recording.
#[test]
fn every_format_is_converted() {
    let Some(samples) = samples("every_format_is_converted") else { return };
    let dir = tempdir().expect("a folder");
    let files: Vec<Value> = truth(samples);
    let rows = |file: &Path| std::fs::read_to_string(file).expect("a table").lines().count() as u64 - 1;
    let table = dir.path().join("table.csv");
    for known in &files {
        let name = known["file"].as_str().expect("a name");
        let file = samples.join(name);
        let arguments = reading("convert", known, &file);
        // The rate is an argument of the analysis.
        let rate = arguments.iter().position(|argument| *argument == "--rate").unwrap_or(arguments.len());
        let to = table.to_str().expect("UTF-8");
        let output = host_sim(&[&arguments[..2], &[to], &arguments[2..rate]].concat());
        assert!(output.status.success(), "{name}: {}", String::from_utf8_lossy(&output.stderr));
        assert_eq!(rows(&table), known["rows"].as_u64().expect("a number"), "{name}");
    }
    // By way of an array and of a table the report of a bag is the same to the rounding of its floats.
    let paths = [samples.join("one.bag"), dir.path().join("back.npy"), dir.path().join("back.csv")];
    let paths = paths.map(|path| path.to_str().expect("UTF-8").to_owned());
    let [bag, array, back] = paths.each_ref().map(String::as_str);
    let run = |arguments: &[&str]| {
        let output = host_sim(arguments);
        let notes = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(output.status.success(), "{arguments:?}: {notes}");
        notes
    };
    let notes = run(&["convert", bag, array]);
    assert!(notes.contains("time_s, gyro_x_rad_s, gyro_y_rad_s, gyro_z_rad_s, accl_x_m_s2"), "{notes}");
    let columns = "time=0,gyro_x=1,gyro_y=2,gyro_z=3,accl_x=4,accl_y=5,accl_z=6";
    run(&["convert", array, back, "--columns", columns, "--units", "s,rad/s,m/s^2"]);
    let report = |file: &str| -> Value { serde_json::from_slice(&json_of(&dir, &["analyze", file])).expect("JSON") };
    let (direct, converted) = (report(bag), report(back));
    assert_eq!(direct["dropped"], converted["dropped"]);
    for (one, other) in
        direct["channels"].as_array().expect("a list").iter().zip(converted["channels"].as_array().expect("a list"))
    {
        assert_eq!(one["name"], other["name"]);
        let [one, other] = [one, other].map(|of| of["curve"][0]["adev"].as_f64().expect("a number"));
        // Counts are rounded anew in each unit, see above: 5·√2·10⁻²/√5956.
        assert!((one / other - 1.0).abs() < 1e-3, "{one} {other}");
    }
    let output = host_sim(&["convert", bag, back, "--format", "frames"]);
    assert!(String::from_utf8_lossy(&output.stderr).contains("register counts of an ADIS16405"));
}

/// Structures of a `.mat`, topics of a bag and publishers of a log are several sensors; one that is recorded by several messages is not.
#[test]
fn several_sensors_of_a_file_have_a_name_each() {
    let Some(samples) = samples("several_sensors_of_a_file_have_a_name_each") else { return };
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
        let input = InputFile::open(&samples.join(file)).expect(file);
        assert_eq!(input.sensors().expect(file), expected, "{file}");
        let topics = input.contents().expect(file);
        for name in expected {
            assert!(topics.iter().any(|topic| topic.sensors.iter().any(|sensor| sensor == name)), "{file}: {name}");
        }
        if expected.is_empty() {
            continue;
        }
        // They are offered by their names, and analysed in one call as several recordings are, or with a report each.
        let path = samples.join(file);
        let path = path.to_str().expect("UTF-8");
        let shown = String::from_utf8_lossy(&host_sim(&["inspect", path]).stdout).into_owned();
        for name in expected {
            assert!(shown.contains(&format!("analyze {path} --topic {name}")), "{file}: {shown}");
        }
        assert!(shown.contains("--each-sensor"), "{file}: {shown}");
        let folder = tempdir().expect("a folder");
        let several: Value =
            serde_json::from_slice(&json_of(&folder, &["analyze", path, "--each-sensor", "--yes"])).expect("JSON");
        assert_eq!(several["agreement"]["samples"].as_array().map(Vec::len), Some(expected.len()), "{file}");
        let reports = folder.path().join("reports");
        let output =
            host_sim(&["analyze", path, "--each-sensor", "--yes", "--reports", reports.to_str().expect("UTF-8")]);
        assert!(output.status.success(), "{file}: {}", String::from_utf8_lossy(&output.stderr));
        assert_eq!(std::fs::read_dir(&reports).expect("a folder").count(), expected.len(), "{file}");
    }
    let topics = InputFile::open(&samples.join("attributes.h5")).expect("HDF5").contents().expect("HDF5");
    let acc = topics.iter().find(|topic| topic.name == "run 1/imu/acc").expect("a dataset");
    assert_eq!(acc.columns[2], ("run 1/imu/acc.2".to_owned(), Some("m/s^2")));
}

/// Every format with its bytes cut off or flipped: a result, or one line of error that names the file, in bounded time and memory,
/// and nothing that a terminal obeys. Most are converted, which reads them whole; some are analysed.
#[test]
fn damaged_files_of_every_format_end_in_a_result_or_one_line() {
    let Some(samples) = samples("damaged_files_of_every_format_end_in_a_result_or_one_line") else { return };
    let dir = tempdir().expect("a folder");
    let mut rng = ChaCha8Rng::seed_from_u64(18);
    let out = dir.path().join("out.csv");
    let out = out.to_str().expect("UTF-8");
    let (mut refused, mut read) = (0, 0);
    for known in &truth(samples) {
        let name = known["file"].as_str().expect("a name");
        let whole = std::fs::read(samples.join(name)).expect("written");
        let ending = Path::new(name).extension().expect("an ending").to_str().expect("UTF-8");
        let file = dir.path().join(format!("damaged.{ending}"));
        for case in 0..12 {
            let mut bytes = whole.clone();
            let length = bytes.len();
            match case {
                0 => bytes.truncate(rng.random_range(1..length.min(200))),
                1..4 => bytes.truncate(rng.random_range(1..length)),
                // In the headers, where lengths and types are; then anywhere.
                4..9 => (0..1 << (case - 4)).for_each(|_| bytes[rng.random_range(0..length.min(2000))] = rng.random()),
                _ => (0..1 << (2 * (case - 8)))
                    .for_each(|_| bytes[rng.random_range(0..length)] ^= 1 << rng.random_range(0..8)),
            }
            std::fs::write(&file, &bytes).expect("written");
            let analyses = case == 5;
            let arguments = reading(if analyses { "analyze" } else { "convert" }, known, &file);
            let rate = arguments.iter().position(|argument| *argument == "--rate").unwrap_or(arguments.len());
            let arguments = if analyses {
                [&arguments[..], &["--quiet"]].concat()
            } else {
                [&arguments[..2], &[out], &arguments[2..rate]].concat()
            };
            let (output, took) = limited(&arguments);
            let text = String::from_utf8_lossy(&output.stderr).into_owned();
            let what = format!("{name}, case {case}: {text}");
            assert!(took.as_secs() < 60, "{what}: {took:?}");
            let errors: Vec<&str> = text.lines().filter(|line| !line.starts_with("note: ")).collect();
            match output.status.code() {
                Some(0) => {
                    assert!(errors.is_empty(), "{what}");
                    read += 1;
                }
                Some(1) => {
                    // What is left may be a table whose columns have no name: it is shown, with a command.
                    let is_asked = |rest: &[&str]| rest.iter().any(|line| line.starts_with("  host-sim analyze "));
                    assert!(
                        matches!(errors[..], [error, ref rest @ ..] if error.starts_with("error: ")
                            && error.contains("damaged.") && (rest.is_empty() || is_asked(rest))),
                        "{what}"
                    );
                    refused += 1;
                }
                other => panic!("{what}: {other:?}"),
            }
            let is_unprintable = |byte: &u8| byte.is_ascii_control() && *byte != b'\n';
            assert!(!output.stderr.iter().chain(&output.stdout).any(is_unprintable), "{what:?}");
        }
    }
    // Both occur often: damage is found, and what it leaves is used.
    assert!(refused > 50 && read > 50, "{refused} refused, {read} read");
}

/// Runs the program with 2 GiB of address space.
fn limited(arguments: &[&str]) -> (Output, Duration) {
    let started = Instant::now();
    let output = Command::new("sh")
        .args(["-c", "ulimit -v 2097152; exec \"$@\"", "sh", env!("CARGO_BIN_EXE_host-sim")])
        .args(arguments)
        .output()
        .expect("a shell");
    (output, started.elapsed())
}

/// The report of a file through a pipe is that of the file, and so is that of a compressed array.
#[test]
fn standard_input_is_read_like_a_file() {
    let dir = tempdir().expect("a folder");
    let rows: String = (0..2000u64).map(|row| format!("{},{}\n", row as f64 / 100.0, row * 7919 % 101)).collect();
    let table = format!("t [s],wx [deg/s]\n{rows}");
    let file = write(&dir, "table.csv", table.as_bytes());
    let direct = host_sim(&["analyze", file.to_str().expect("UTF-8")]);
    assert!(direct.status.success(), "{}", String::from_utf8_lossy(&direct.stderr));
    let input = std::fs::File::open(&file).expect("written");
    let piped = Command::new(env!("CARGO_BIN_EXE_host-sim"))
        .args(["analyze", "-"])
        .stdin(Stdio::from(input))
        .output()
        .expect("the program starts");
    // The first line has the name of the recording.
    let lines = |output: &[u8]| String::from_utf8_lossy(output).lines().map(str::to_owned).collect::<Vec<_>>();
    let (piped, direct) = (lines(&piped.stdout), lines(&direct.stdout));
    assert!(direct[0].contains("table.csv") && piped[0].contains("standard input"), "{} {}", direct[0], piped[0]);
    assert_eq!(piped[1..], direct[1..]);
    let missing = host_sim(&["analyze", file.to_str().expect("UTF-8"), "--sensor", "nowhere.toml"]);
    let error = String::from_utf8_lossy(&missing.stderr).into_owned();
    assert!(error.contains("nowhere.toml") && error.contains("bmi088"), "{error}");
}

/// A gyroscope that is held at full scale of 16 bits for a while, and then sticks: both are counted and told.
#[test]
fn saturated_and_stuck_channels_are_told() {
    let dir = tempdir().expect("a folder");
    let count = |row: u64| match row {
        1000..1050 => 32_767,
        3000..3100 => 12,
        _ => (row * 7919 % 1009) as i64 - 504,
    };
    let rows: String = (0..5000u64).map(|row| format!("{},{}\n", row as f64 / 100.0, count(row))).collect();
    let file = write(&dir, "full.csv", format!("t [s],wx [deg/s]\n{rows}").as_bytes());
    let report: Value =
        serde_json::from_slice(&json_of(&dir, &["analyze", file.to_str().expect("UTF-8")])).expect("JSON");
    assert_eq!(report["flagged"]["saturated"], 50);
    let findings = report["findings"].as_array().expect("findings");
    let stuck = findings.iter().find(|finding| finding["kind"] == "stuck").expect("a stuck output");
    assert_eq!(stuck["parameters"]["share"]["value"], 100.0 / 5000.0, "at full scale it is no stuck output");
    let notes = String::from_utf8(host_sim(&["analyze", file.to_str().expect("UTF-8")]).stderr).expect("UTF-8");
    assert!(notes.contains("gyro_x: 50 samples at full scale, the first of them row 1001"), "{notes}");
}
