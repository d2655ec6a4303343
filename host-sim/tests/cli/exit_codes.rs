//! Errors: exit code 1 and one line on standard error, 2 for wrong usage; nothing is written.

use crate::program::{counts, error_line, flight_log, imunoise, write};
use std::path::Path;
use tempfile::tempdir;

/// Arguments in which `DIR` stands for the folder of the test, and words of the error.
type Case = (&'static [&'static str], &'static [&'static str]);

/// Commands that end with one line of error. The words in which a file is refused are tested in `recordings`.
const ERRORS: &[Case] = &[
    (&["analyze", "DIR/missing/x.csv"], &["missing/x.csv", "No such file"]),
    (&["analyze", "DIR/bad.csv", "--rate", "100"], &["bad.csv: line 3: column gyro_x", "\"x\" is not a number"]),
    (&["replay", "DIR/bad.csv", "--rate", "100"], &["bad.csv: line 3: column gyro_x", "\"x\" is not a number"]),
    (&["convert", "DIR/bad.csv", "DIR/never"], &["bad.csv: line 3"]),
    (&["convert", "DIR/rows.csv", "DIR/never.h5"], &["never.h5: .h5 is not written", "--format"]),
    (&["analyze", "DIR/rows.csv", "--from", "500"], &["rows.csv: no sample from 500 to inf s"]),
    (&["analyze", "DIR/rows.csv", "--topic", "imu"], &["--topic imu: a file of text has no topics"]),
    (&["analyze", "DIR/rows.csv", "-o", "json=DIR"], &["DIR"]),
    (&["analyze", "DIR/rows.csv", "--sensor", "/dev/zero"], &["/dev/zero", "not longer than 1048576 bytes"]),
    (&["analyze", "DIR/rows.csv", "--sensor", "nowhere.toml"], &["nowhere.toml", "bmi088"]),
    (&["replay", "DIR/array.npy"], &["neither register counts nor an SPI log"]),
    (&["compare", "DIR/text.json", "--data-sheet"], &["no JSON report"]),
    // A text of 100 kB where the report has a number.
    (&["compare", "DIR/long.json", "--data-sheet"], &["long.json", " … "]),
    (&["monitor", "DIR/rows.csv"], &["rows.csv: is a file and no serial port; `imunoise "]),
    (&["bench", "DIR/rows.csv"], &["rows.csv: is a file and no serial port"]),
    (&["record", "DIR/missing/log.csv", "--port", "/dev/null"], &["log.csv", "No such file"]),
    (&["simulate", "DIR/never", "--noise", "gyro=1,2"], &["gyro: `1,2` is not N,B,K"]),
    (&["simulate", "DIR/never", "--taps", "3"], &["taps: `3` is not 1, 2, 4"]),
    (&["simulate", "DIR/never", "--range", "75", "--taps", "1"], &["configuration refused"]),
    (&["simulate", "DIR/never", "--rate", "nan"], &["configuration refused"]),
    (&["simulate", "DIR/never", "--fault", "stale:from=1"], &["--fault: stale needs bursts"]),
    (&["convert", "DIR/plain.csv", "DIR/never", "--format", "frames"], &["sample 0 has no time"]),
    (&["convert", "DIR/units.csv", "DIR/never", "--format", "frames"], &["register counts of an ADIS16405"]),
];

#[test]
fn an_error_is_one_line_and_exit_code_1() {
    let dir = tempdir().expect("a folder");
    counts(&dir);
    for (name, content) in [
        ("bad.csv", "gyro_x_counts\n1\nx\n"),
        ("plain.csv", "gyro_x_counts\n1\n2\n"),
        ("units.csv", "time_s,gyro_x_deg_s\n0,1\n1,2\n2,1\n3,2\n"),
        ("array.npy", "\u{93}NUMPY"),
        ("text.json", "{"),
        ("long.json", &format!("{{\"schema\": \"{}\"}}", "x".repeat(100_000))),
    ] {
        write(&dir, name, &content.chars().map(|c| c as u8).collect::<Vec<_>>());
    }
    let folder = dir.path().to_str().expect("UTF-8");
    for (arguments, words) in ERRORS {
        let arguments: Vec<String> = arguments.iter().map(|argument| argument.replace("DIR", folder)).collect();
        let output = imunoise(&arguments.iter().map(String::as_str).collect::<Vec<_>>());
        let line = error_line(&output);
        assert!(line.len() < 4000, "{arguments:?}: {} bytes", line.len());
        for word in words.iter().map(|word| word.replace("DIR", folder)) {
            assert!(line.contains(&word), "{arguments:?}: {word:?} is not in {line:?}");
        }
        assert!(!Path::new(&format!("{folder}/never")).exists(), "{arguments:?}");
    }
}

#[test]
fn wrong_usage_has_exit_code_2() {
    for (arguments, words) in [
        (&["analyze"][..], "required"),
        (&["measure"], "unrecognized subcommand"),
        (&["compare", "a.json"], ""),
        (&["analyze", "x.csv", "--rate", "fast"], "--rate"),
        (&["analyze", "x.csv", "--from=-1"], "--from"),
        (&["analyze", "x.csv", "--to", "nan"], "--to"),
        // Options of the simulation before a subcommand would be ignored.
        (&["--seed", "3", "analyze", "x.csv"], ""),
        (&["simulate", "x.csv", "--seconds", "0"], "not a time above 0 s"),
        (&["convert", "x.csv", "y.csv", "--rate", "100"], "--rate says where --from and --to are"),
        (&["simulate", "x.csv", "--noise", "0.04,0,0"], "expected CHANNEL=N,B,K"),
        (&["simulate", "x.csv", "--noise", "gyro_w=0.04,0,0"], "none of gyro, gyro_x"),
        (&["analyze", "x.csv", "-o", "x.txt"], "its ending is none of .json, .html"),
        (&["analyze", "x.csv", "-o", "kalibr="], "no file after the format"),
        (&["analyze", "x.csv", "-o", "svg=-"], "figures are several files"),
        (&["export", "report.json"], "--output"),
        (&["export", "report.json", "-o", "report.html"], "`analyze` writes it"),
        // Options are those that a subcommand uses.
        (&["monitor", "p", "-o", "x.html"], "unexpected argument"),
        (&["replay", "a", "--sensor", "generic"], "unexpected argument"),
        (&["replay", "a", "--columns", "gyro_x=0"], "unexpected argument"),
        (&["replay", "a", "--topic", "t"], "unexpected argument"),
        (&["compare", "a", "b", "-o", "x.html"], "JSON alone"),
        (&["monitor", "p", "--speed", "60"], "unexpected argument"),
    ] {
        let output = imunoise(arguments);
        let errors = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(output.status.code() == Some(2) && errors.contains(words), "{arguments:?}: {errors}");
        assert!(output.stdout.is_empty());
    }
}

/// Every verb: done, an error, wrong usage; and, of those that read recordings which may end early, done with what there was.
const CODES: &[(u8, &[&str])] = &[
    (0, &["analyze", "DIR/rows.csv", "-q"]),
    (1, &["analyze", "DIR/none.csv"]),
    (2, &["analyze", "DIR/rows.csv", "-o", "x.txt"]),
    (3, &["analyze", "DIR/cut.ulg", "-q"]),
    (3, &["analyze", "DIR/cut.ulg", "-q", "--quick"]),
    (0, &["demo", "--seconds", "5", "-q", "-o", "DIR/demo.html"]),
    (1, &["demo", "--seconds", "5", "-q", "-o", "DIR/none/demo.html"]),
    (2, &["demo", "--seconds", "-1"]),
    (0, &["inspect", "DIR/rows.csv"]),
    (1, &["inspect", "DIR/none.csv"]),
    (2, &["inspect"]),
    (3, &["inspect", "DIR/rows.csv", "DIR/cut.ulg"]),
    (0, &["batch", "DIR/rows.csv", "-f", "-o", "DIR/reports"]),
    (1, &["batch", "DIR/rows.csv", "DIR/none.csv", "-f", "-o", "DIR/reports"]),
    (2, &["batch", "DIR/rows.csv"]),
    (3, &["batch", "DIR/rows.csv", "DIR/cut.ulg", "-f", "-o", "DIR/reports"]),
    (0, &["compare", "DIR/rows.csv", "DIR/rows.csv"]),
    (1, &["compare", "DIR/rows.csv", "DIR/none.csv"]),
    (2, &["compare", "DIR/rows.csv"]),
    (3, &["compare", "DIR/whole.ulg", "DIR/cut.ulg"]),
    (0, &["export", "DIR/rows.csv", "-o", "csv=-"]),
    (1, &["export", "DIR/none.csv", "-o", "csv=-"]),
    (2, &["export", "DIR/rows.csv"]),
    (3, &["export", "DIR/cut.ulg", "-o", "csv=-"]),
    (0, &["convert", "DIR/rows.csv", "DIR/rows.npy", "-f"]),
    (1, &["convert", "DIR/none.csv", "DIR/none.npy"]),
    (2, &["convert", "DIR/rows.csv"]),
    (3, &["convert", "DIR/cut.ulg", "DIR/cut.csv", "-f"]),
    (0, &["replay", "DIR/rows.csv", "-q"]),
    (1, &["replay", "DIR/cut.ulg"]),
    (2, &["replay"]),
    (0, &["simulate", "DIR/simulated.csv", "--seconds", "1", "-f"]),
    (1, &["simulate", "DIR/none/simulated.csv", "--seconds", "1"]),
    (2, &["simulate", "DIR/simulated.csv", "--seconds", "nan"]),
    // With a device they end as `serial_device` and `bench` test it.
    (1, &["monitor", "/dev/no-such-port"]),
    (2, &["monitor"]),
    (1, &["bench", "/dev/no-such-port"]),
    (2, &["bench"]),
    (1, &["record", "DIR/device.csv", "--port", "/dev/no-such-port"]),
    (2, &["record", "DIR/device.csv"]),
    (0, &["completions", "bash"]),
    (2, &["completions", "tcsh"]),
    (0, &["help", "analyze"]),
    (2, &["help", "none"]),
];

#[test]
fn every_command_ends_with_its_exit_codes() {
    let dir = tempdir().expect("a folder");
    counts(&dir);
    let log = flight_log(2000);
    write(&dir, "whole.ulg", &log);
    write(&dir, "cut.ulg", &log[..log.len() - 1010]);
    let folder = dir.path().to_str().expect("UTF-8");
    let help = String::from_utf8(imunoise(&["-h"]).stdout).expect("UTF-8");
    let commands = help.lines().skip_while(|line| *line != "Commands:").skip(1).take_while(|line| !line.is_empty());
    for command in commands.filter_map(|line| line.split_whitespace().next()) {
        assert!(CODES.iter().any(|(_, arguments)| arguments[0] == command), "{command} has no codes");
    }
    for (code, arguments) in CODES {
        let arguments: Vec<String> = arguments.iter().map(|argument| argument.replace("DIR", folder)).collect();
        let output = imunoise(&arguments.iter().map(String::as_str).collect::<Vec<_>>());
        let errors = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(i32::from(*code)), "{arguments:?}: {errors}");
        // The last line on standard error says what is not as it should be.
        let last = errors.lines().last().unwrap_or_default();
        let is_told = match code {
            0 => !errors.contains("error:") && !errors.contains("warning:"),
            3 => last.starts_with("warning: "),
            _ => errors.lines().any(|line| line.starts_with("error: ")),
        };
        assert!(is_told, "{arguments:?}: {errors}");
    }
}

/// Characters that a terminal obeys, or that hide or turn other letters, are shown escaped, also where a tip or a table follows.
#[test]
fn names_with_control_characters_are_escaped() {
    let dir = tempdir().expect("a folder");
    // A right-to-left override in the name of a column.
    let hidden = write(&dir, "hidden.csv", "a\u{202e}b,c\n1,2\n2,3\n3,4\n4,5\n".as_bytes());
    for arguments in [
        ["analyze", "/nowhere/\u{1b}[31m.csv"],
        ["monitor", "/dev/\u{1b}[31m"],
        ["analyze", hidden.to_str().expect("UTF-8")],
        ["simulate", "--effect=\u{1b}[31m:gyro_x:amplitude=1"],
    ] {
        let output = imunoise(&arguments);
        let error = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(!output.status.success() && error.starts_with("error: "), "{error:?}");
        assert!(!error.contains(['\u{1b}', '\u{202e}']), "{error:?}");
    }
}
