//! The report of the page equals that of the command for the same file and options.

use crate::harness::drive;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use std::process::Command;
use system_tests::{host_sim, recorded_samples};

/// Largest relative difference of two numbers in the reports of a file. The page computes elementary functions by Rust's `libm`, the
/// command by the system's library. At random arguments, 3 to 10 % of the values of `exp`, `ln`, `sin`, `cos` and `powf` differ by one unit
/// in the last place.
const TOLERANCE: f64 = 1e-6;
/// Largest relative difference of two numbers in the reports of a simulation. The baseline model is fitted in single precision, as on the
/// device. If its input differs in the last place of double precision, a squared coefficient may differ by four units of 2⁻²³, 5·10⁻⁷. A
/// deviance is quadratic in the model's error, 2.8 % of the variance of the supply, and differs by twice the ratio of the two.
pub(crate) const TOLERANCE_OF_SIMULATION: f64 = 2.0 * 4.0 * f32::EPSILON as f64 / 0.028;
/// Names of options, with the names of the page's fields.
const OPTIONS: [(&str, &str); 5] =
    [("--columns", "columns"), ("--units", "units"), ("--rate", "rate"), ("--sensor", "sensor"), ("--topic", "topic")];

/// Lists the differences of two values. Kinds, order, words and integers must be equal, numbers up to a relative `tolerance`. A small
/// probability is the exponential of a statistic, so its relative error is that of the statistic times its logarithm.
fn differences(path: &str, one: &Value, other: &Value, tolerance: f64, found: &mut Vec<String>) {
    match (one, other) {
        (Value::Object(a), Value::Object(b)) if a.keys().eq(b.keys()) => {
            a.iter()
                .for_each(|(name, value)| differences(&format!("{path}.{name}"), value, &b[name], tolerance, found));
        }
        (Value::Array(a), Value::Array(b)) if a.len() == b.len() => {
            let pairs = a.iter().zip(b).enumerate();
            pairs.for_each(|(at, (a, b))| differences(&format!("{path}[{at}]"), a, b, tolerance, found));
        }
        (Value::Number(a), Value::Number(b)) if a.is_f64() && b.is_f64() => {
            let [a, b] = [a, b].map(|number| number.as_f64().expect("a number"));
            let is_probability = ["p_value", "probability"].iter().any(|name| path.ends_with(name));
            let times = if is_probability { a.max(b).ln().abs().max(1.0) } else { 1.0 };
            if (a - b).abs() > times * tolerance * a.abs().max(b.abs()) {
                found.push(format!("{path}: {a} and {b}"));
            }
        }
        (a, b) if a == b => {}
        (a, b) => found.push(format!("{path}: {a} and {b}")),
    }
}

/// Differences of the report in the file `of_page` from that of the command with these arguments.
pub(crate) fn differences_from_command(arguments: &[String], of_page: &Path, tolerance: f64) -> Vec<String> {
    let of_command = of_page.with_extension("command.json");
    let output = Command::new(host_sim()).args(arguments).arg("--quiet").arg("-o").arg(&of_command).output();
    let output = output.expect("imunoise starts");
    assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
    let read = |file: &Path| -> Value { serde_json::from_slice(&std::fs::read(file).expect("written")).expect("JSON") };
    let mut found = Vec::new();
    differences("", &read(&of_command), &read(of_page), tolerance, &mut found);
    found
}

/// The cases are ten files of different formats, one of which has effects, and a simulation.
#[test]
fn the_page_makes_the_report_of_the_command() {
    const TEST: &str = "same_report::the_page_makes_the_report_of_the_command";
    let Some(samples) = recorded_samples(TEST) else { return };
    let folder = tempfile::tempdir().expect("a folder");
    let truth = std::fs::read(samples.join("truth.json")).expect("written");
    let truth: Vec<Value> = serde_json::from_slice(&truth).expect("a list in JSON");
    let known = |name: &str| {
        let known = truth.iter().find(|known| known["file"] == name).unwrap_or_else(|| panic!("no {name}"));
        let options =
            known["arguments"].as_array().expect("a list").iter().map(|of| of.as_str().expect("text").to_owned());
        (samples.join(name), options.collect::<Vec<String>>())
    };
    let names = [
        "euroc.csv",
        "counts.tsv",
        "transposed.npy",
        "level5.mat",
        "table.h5",
        "one.bag",
        "foxglove.mcap",
        "single.ulg",
        "imu.bin",
    ];
    let mut files: Vec<(PathBuf, Vec<String>)> = names.into_iter().map(known).collect();
    // The file has a line and a temperature effect, in the program's own format, compressed.
    let counts = folder.path().join("effects.csv.gz");
    let effects = [
        "--effect",
        "sinusoid:gyro_z:frequency=20,amplitude=0.1",
        "--environment",
        "temperature:rise=8,time_constant=300",
    ];
    let simulated =
        Command::new(host_sim()).arg("simulate").arg(&counts).args(["--seconds", "900"]).args(effects).status();
    assert!(simulated.expect("imunoise starts").success());
    files.push((counts, Vec::new()));
    assert_eq!(files.len(), 10);

    let mut jobs = Vec::new();
    for (at, (file, options)) in files.iter().enumerate() {
        let field = |(option, field): (&str, &str)| {
            let at = options.iter().position(|of| of == option);
            (field.to_owned(), at.map_or("", |at| options[at + 1].as_str()).into())
        };
        let fields: serde_json::Map<String, Value> = OPTIONS.into_iter().map(field).collect();
        jobs.push(json!({ "name": format!("page{at}.json"), "file": file, "fields": fields }));
    }
    jobs.push(json!({ "name": "page10.json", "simulate": { "seconds": 600, "seed": 1 } }));
    if !drive(TEST, "reports.js", "observatory.html", folder.path(), &Value::from(jobs).to_string()) {
        return;
    }
    let simulation = ["demo", "--seconds", "600", "--seed", "1"].map(str::to_owned);
    let mut failed = String::new();
    for at in 0..=10 {
        let (arguments, tolerance) = match files.get(at) {
            Some((file, options)) => {
                ([&["analyze".to_owned(), file.display().to_string()], options.as_slice()].concat(), TOLERANCE)
            }
            None => (simulation.to_vec(), TOLERANCE_OF_SIMULATION),
        };
        let of_page = folder.path().join(format!("page{at}.json"));
        let found = differences_from_command(&arguments, &of_page, tolerance);
        if !found.is_empty() {
            let file = files.get(at).map_or_else(|| "simulation".to_owned(), |(file, _)| file.display().to_string());
            failed +=
                &format!("{file}: {} differences, such as {}\n", found.len(), found[..found.len().min(5)].join("; "));
        }
    }
    assert!(failed.is_empty(), "{failed}");
}
