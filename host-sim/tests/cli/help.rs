//! `--help` of every command, and suggestions for what is misspelt.

use crate::program::{imunoise, write};
use std::process::Output;

/// Lines and columns of a terminal window in which the short help is read without scrolling.
const SCREEN: (usize, usize) = (40, 80);

fn text(bytes: Vec<u8>) -> String {
    String::from_utf8(bytes).expect("UTF-8")
}

/// The help of a command by `-h` or `--help`; of the program if `command` is empty.
fn help_by(option: &str, command: &[&str]) -> String {
    let Output { status, stdout, .. } = imunoise(&[command, &[option]].concat());
    assert!(status.success(), "{command:?}");
    text(stdout)
}

fn help(command: &[&str]) -> String {
    help_by("-h", command)
}

/// The first words of the lines of a section.
fn section(help: &str, heading: &str) -> Vec<String> {
    let lines = help.lines().skip_while(|line| *line != heading).skip(1).take_while(|line| !line.is_empty());
    lines.filter_map(|line| Some(line.split_whitespace().next()?.to_owned())).collect()
}

#[test]
fn the_short_help_of_every_command_fits_one_screen_and_the_long_one_has_more() {
    let program = help(&[]);
    let commands = section(&program, "Commands:");
    assert!(commands.len() >= 10 && commands[0] == "analyze", "{commands:?}");
    for command in commands.iter().filter(|name| *name != "help").map(|name| vec![name.as_str()]).chain([Vec::new()]) {
        let (short, long) = (help(&command), help_by("--help", &command));
        assert!(short.lines().count() <= SCREEN.0, "{} lines: {short}", short.lines().count());
        assert!(long.lines().count() > short.lines().count() || command == ["completions"], "{command:?}: {long}");
        for line in short.lines().chain(long.lines()) {
            assert!(line.chars().count() <= SCREEN.1, "{command:?}: {line}");
        }
    }
    let long = help_by("--help", &["analyze"]);
    for words in ["Example: --rate 204.8", "In Hz.", "-o report.html -o imu.yaml -o openvins=chain.yaml"] {
        assert!(long.contains(words), "{words}: {long}");
    }
    assert!(help_by("--help", &[]).contains("3  done, but a recording was not read to its end"));
}

#[test]
fn options_are_grouped_and_examples_follow() {
    let commands = section(&help(&[]), "Commands:");
    for command in commands.iter().map(String::as_str).filter(|command| *command != "help") {
        let examples = section(&help(&[command]), "Examples:");
        assert!(!examples.is_empty() && examples.iter().all(|word| word == "imunoise"), "{command}: {examples:?}");
    }
    let help = help(&["analyze"]);
    for (heading, option) in [("Input:", "--rate"), ("Sensor:", "--sensor"), ("Output:", "-o,")] {
        assert!(section(&help, heading).iter().any(|name| name == option), "{heading} {option}: {help}");
    }
    // An option without a group is about the help itself.
    assert_eq!(section(&help, "Options:"), ["-h,"], "{help}");
}

#[test]
fn a_misspelt_command_option_or_file_gets_a_suggestion() {
    let dir = tempfile::tempdir().expect("a folder");
    let file = write(&dir, "hover_2.csv", b"gyro_x_counts\n1\n");
    write(&dir, "notes.txt", b"");
    let misspelt = file.to_str().expect("UTF-8").replace("hover_2", "hoover2");
    let path = file.display().to_string();
    let misspelt_folder = dir.path().join("flihgts").join("hover.csv").display().to_string();
    std::fs::create_dir(dir.path().join("flights")).expect("a folder");
    let in_folder = dir.path().join("flights/hover.csv").display().to_string();
    std::fs::write(&in_folder, "gyro_x_counts\n1\n").expect("written");
    let topics = dir.path().join("topics.csv").display().to_string();
    let rows = |row: u32| format!("gyro,{row},0.1,0.2,0.3\naccel,{row},0.1,0.2,9.8\n");
    std::fs::write(&topics, (0..50).map(rows).collect::<String>()).expect("written");
    for (arguments, status, suggestion) in [
        (vec!["analyze", &topics, "--topic", "gyros"], 1, "tip: did you mean gyro?\n".to_owned()),
        (vec!["analyze", &topics, "--topic", "gyros", "--to", "9"], 1, "tip: did you mean gyro?\n".to_owned()),
        (vec!["inspect", &topics, "--topic", "acel"], 1, "tip: did you mean accel?\n".to_owned()),
        (vec!["analize", "x.csv"], 2, "'analyze'".to_owned()),
        (vec!["analyze", "--outptu", "d", "x.csv"], 2, "'--output'".to_owned()),
        // Other names of what the program has.
        (vec!["analyze", "--html", "d", "x.csv"], 2, "'-o report.html'".to_owned()),
        (vec!["--htlm", "d"], 2, "'-o report.html'".to_owned()),
        (vec!["explain", "report.json"], 2, "'analyze FILE --full'".to_owned()),
        (vec!["analyze", &path, "-o", "kalib=x.yaml"], 2, "did you mean kalibr?".to_owned()),
        (vec!["analyze", &path, "--sensor", "bmi08"], 1, "tip: a similar sensor exists: bmi088\n".to_owned()),
        (vec!["simulate", "x.csv", "--effect", "sinusiod:gyro_x:a=1"], 1, "tip: did you mean sinusoid?\n".to_owned()),
        (vec!["simulate", "x.csv", "--fault", "stuck_lo:from=1"], 1, "tip: did you mean stuck_low?\n".to_owned()),
        (
            vec!["simulate", "x.csv", "--effect", "sinusoid:gyro_z:frequncy=1,amplitude=1"],
            1,
            "tip: `frequncy` is no parameter of it; did you mean frequency?\n".to_owned(),
        ),
        (vec!["simulate", "x.csv", "--environment", "supply:lod=1"], 1, "tip: did you mean load?\n".to_owned()),
        (vec!["simulate", "x.csv", "--effect", "rate_ramp:gyrox:slope=1"], 1, "tip: did you mean gyro_x?\n".to_owned()),
        (vec!["analyze", &misspelt], 1, format!("tip: a similar file exists: {path}\n")),
        (vec!["analyze", &misspelt_folder], 1, format!("tip: a similar file exists: {in_folder}\n")),
        (vec!["compare", &misspelt, "--data-sheet"], 1, format!("tip: a similar file exists: {path}\n")),
    ] {
        let output = imunoise(&arguments);
        let errors = text(output.stderr);
        assert!(output.status.code() == Some(status) && errors.contains(&suggestion), "{arguments:?}: {errors}");
    }
    for unlike in ["/nowhere/hover.csv", "/"] {
        let errors = text(imunoise(&["analyze", unlike]).stderr);
        assert!(!errors.contains("tip"), "{errors}");
    }
}

#[test]
fn a_port_that_is_not_there_is_answered_with_those_that_are() {
    for arguments in [&["monitor", "/dev/ttyNONE"][..], &["record", "x.csv", "--port", "/dev/ttyNONE"]] {
        let errors = text(imunoise(arguments).stderr);
        assert!(errors.contains("/dev/ttyNONE") && errors.contains("tip: serial ports of this machine: "), "{errors}");
    }
}

#[test]
fn help_is_a_command_too() {
    assert!(text(imunoise(&["help", "analyze"]).stdout).contains("--rate"));
}
