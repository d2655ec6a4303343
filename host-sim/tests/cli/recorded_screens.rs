//! The screens of measured recordings: what is said changes with the analysis, how it is said does not.

use crate::program::imunoise;
use noise_analysis::effects::Effect;
use noise_analysis::report::Report;
use reports::terminal::{MOST_LINES, Screen};
use serde_json::Value;
use system_tests::recording;
use tempfile::tempdir;

/// Columns of the screen.
const COLUMNS: usize = 80;

/// Parts of sentences that a reader did not understand or that were wrong, and names of the JSON.
const NOT_SAID: [&str; 22] = [
    "gyro_",
    "accl_",
    "magn_",
    "sigma",
    "tau =",
    " 1/h",
    "(< ",
    "generic",
    "takes",
    "does not show",
    "from above",
    "against the model",
    "what is measured",
    "Too short for ±20 %",
    "The noise changes:",
    "as recorded; the models after",
    "own curve",
    "too sure",
    "clock is not measured",
    "is not that of N, B and K",
    "lies in the part",
    "State this rate",
];

/// The screen of a report without its styles.
fn plain(screen: &str) -> String {
    let mut parts = screen.split('\u{1b}');
    let first = parts.next().unwrap_or_default().to_owned();
    first + &parts.map(|part| part.split_once('m').map_or("", |(_, text)| text)).collect::<String>()
}

/// Checks a screen of a report with so many findings that an effect explains.
fn check(name: &str, screen: &str, findings: usize) {
    let lines: Vec<&str> = screen.lines().collect();
    assert!(lines.len() <= MOST_LINES, "{name}: {} lines\n{screen}", lines.len());
    for line in &lines {
        assert!(line.chars().count() <= COLUMNS, "{name}: {line}");
        // Text is left out between words.
        let is_cut = line.split('…').rev().skip(1).any(|before| before.ends_with(char::is_alphanumeric));
        assert!(!is_cut, "{name}: {line}");
    }
    assert!(lines.last().is_some_and(|line| line.ends_with('.')), "{name}\n{screen}");
    let (_, below) = screen.split_once("\nWhat was found\n").unwrap_or_else(|| panic!("{name}\n{screen}"));
    let told = (1..).take_while(|number| below.lines().any(|line| line.starts_with(&format!("{number:>2}  ")))).count();
    let more = below.lines().find_map(|line| line.strip_prefix(" … and ")?.strip_suffix(" more: --full"));
    let more: usize = more.map_or(0, |number| number.parse().expect("a number"));
    assert_eq!(told + more, findings, "{name}\n{screen}");
    assert!(told >= findings.min(4), "{name}\n{screen}");
    for part in NOT_SAID {
        assert!(!screen.contains(part), "{name}: {part}\n{screen}");
    }
    if findings == 0 {
        assert!(below.starts_with(" Nothing") || below.starts_with("Not explained"), "{name}\n{screen}");
    }
}

/// Checks the screen of a report in memory.
pub(crate) fn check_report(name: &str, report: &Report) {
    let lines = Screen { report, source: Some(name), columns: COLUMNS }.lines();
    let is_named = |effect: &Effect| !matches!(effect, Effect::Unexplained(_));
    check(name, &plain(&lines.join("\n")), report.findings.iter().filter(|of| is_named(&of.effect)).count());
}

/// Checks the screen that the command prints, and returns it in one line.
fn screen(test: &str, file: &str, options: &[&str]) -> Option<String> {
    let path = recording(test, file)?;
    let folder = tempdir().expect("a folder");
    let json = folder.path().join("report.json");
    let arguments = [&["analyze", path.to_str()?, "-o", json.to_str()?], options].concat();
    let output = imunoise(&arguments);
    assert!(output.status.success(), "{file}: {}", String::from_utf8_lossy(&output.stderr));
    let text = String::from_utf8(output.stdout).expect("UTF-8");
    let report: Value = serde_json::from_slice(&std::fs::read(&json).expect("a report")).expect("JSON");
    let named = report["findings"].as_array()?.iter().filter(|finding| finding["kind"] != "unexplained").count();
    check(file, &text, named);
    Some(text.split_whitespace().collect::<Vec<_>>().join(" "))
}

/// The screens of `measured_recordings.rs` are checked there.
#[test]
fn the_screens_of_other_sensors_are_whole() {
    let test = "the_screens_of_other_sensors_are_whole";
    for (file, options, said) in [
        ("others/lsm6dso_static.txt", &["--rate", "100"][..], &["At rest throughout", "record at rest for hours"][..]),
        ("others/mpu6050_accelerometer.mat", &["--accept-guess"], &["N is known to ±20 %", "at 99.3 Hz"]),
        ("others/mpu9250_imu1_raw.mat", &[], &["At rest but for", "an hour"]),
        (
            "others/px4_sample.ulg",
            &[],
            &["cannot be trusted as it is. It moved for up to", "Analyse the part at rest alone: add --from"],
        ),
        ("others/stampfly_fft_20260114T115628.csv", &["--accept-guess"], &["for strong lines"]),
        ("others/vn100_nitin.bag", &[], &["so N is valid from one sample on", "Nothing"]),
        (
            "others/phone_gyro4.txt",
            &["--columns", "time=time,gyro_x=2,gyro_y=3,gyro_z=4", "--units", "rad/s"],
            &["At rest throughout"],
        ),
        ("adis16405-burst/launch10.csv.gz", &["--quick"], &["Quick report"]),
    ] {
        let Some(text) = screen(test, file, options) else { return };
        for part in said {
            assert!(text.contains(part), "{file}: {part}\n{text}");
        }
    }
}

/// No report on seconds of a record says that three coefficients describe the channels.
#[test]
fn the_screens_of_short_records_say_what_these_are_good_for() {
    let test = "the_screens_of_short_records_say_what_these_are_good_for";
    for (seconds, said) in [
        ("0.05", "50 ms: too short for N, B, K and a filter."),
        ("1", "1.0 s: good for a rough N (±"),
        ("5", "5.0 s: good for a rough N (±"),
        ("60", "60 s: good for a rough N (±"),
    ] {
        let options = ["--rate", "100", "--to", seconds];
        let Some(text) = screen(test, "adis16405-static/run1.csv.gz", &options) else { return };
        assert!(text.contains(said) && text.contains("For a filter: record at rest for hours."), "{seconds} s: {text}");
        assert!(!text.contains("N, B and K describe") && !text.contains("±20 %"), "{seconds} s: {text}");
    }
}

/// Checks that the screen has the rate by the part's clock beside the one that was stated.
pub(crate) fn check_clock(name: &str, report: &Report) {
    let sentences = reports::summary::record_sentences_in_short(report).join(" ");
    assert!(
        sentences.contains("the sample rate is the stated 100 Hz; by the part's nominal clock"),
        "{name}: {sentences}"
    );
}
