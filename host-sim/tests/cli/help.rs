//! `--help` of every command, and suggestions for what is misspelt.

use crate::program::{host_sim, write};
use std::process::Output;

/// Lines and columns of a terminal window in which a help is read without scrolling.
const SCREEN: (usize, usize) = (45, 100);

fn text(bytes: Vec<u8>) -> String {
    String::from_utf8(bytes).expect("UTF-8")
}

/// The help of a command; of the program if `command` is empty.
fn help(command: &[&str]) -> String {
    let Output { status, stdout, .. } = host_sim(&[command, &["--help"]].concat());
    assert!(status.success(), "{command:?}");
    text(stdout)
}

/// The first words of the lines of a section.
fn section(help: &str, heading: &str) -> Vec<String> {
    let lines = help.lines().skip_while(|line| *line != heading).skip(1).take_while(|line| !line.is_empty());
    lines.filter_map(|line| Some(line.split_whitespace().next()?.to_owned())).collect()
}

#[test]
fn the_help_of_every_command_fits_one_screen() {
    let program = help(&[]);
    let commands = section(&program, "Commands:");
    assert!(commands.len() >= 10 && commands[0] == "analyze", "{commands:?}");
    for command in commands.iter().map(|name| vec![name.as_str()]).chain([Vec::new()]) {
        let help = help(&command);
        assert!(help.lines().count() <= SCREEN.0, "{} lines: {help}", help.lines().count());
        for line in help.lines() {
            assert!(line.chars().count() <= SCREEN.1, "{command:?}: {line}");
        }
    }
}

#[test]
fn options_are_grouped_and_three_examples_follow() {
    for command in [&[][..], &["analyze"]] {
        assert_eq!(section(&help(command), "Examples:"), ["host-sim"; 3], "{command:?}");
    }
    let help = help(&["analyze"]);
    for (heading, option) in [("Input:", "--rate"), ("Sensor:", "--sensor"), ("Output:", "--page")] {
        assert!(section(&help, heading).iter().any(|name| name == option), "{heading} {option}: {help}");
    }
    // What belongs to no group is about the help itself.
    assert_eq!(section(&help, "Options:"), ["-h,"], "{help}");
}

#[test]
fn a_misspelt_command_option_or_file_gets_a_suggestion() {
    let dir = tempfile::tempdir().expect("a folder");
    let file = write(&dir, "hover_2.csv", b"gyro_x_counts\n1\n");
    write(&dir, "notes.txt", b"");
    let misspelt = file.to_str().expect("UTF-8").replace("hover_2", "hoover2");
    let path = file.display();
    for (arguments, status, suggestion) in [
        (vec!["analize", "x.csv"], 2, "'analyze'".to_owned()),
        (vec!["analyze", "--pagge", "d", "x.csv"], 2, "'--page'".to_owned()),
        (vec!["analyze", &misspelt], 1, format!("tip: a similar file exists: {path}\n")),
        (vec!["compare", &misspelt, "--data-sheet"], 1, format!("tip: a similar file exists: {path}\n")),
    ] {
        let output = host_sim(&arguments);
        let errors = text(output.stderr);
        assert!(output.status.code() == Some(status) && errors.contains(&suggestion), "{arguments:?}: {errors}");
    }
    let errors = text(host_sim(&["analyze", "/nowhere/hover.csv"]).stderr);
    assert!(!errors.contains("tip"), "{errors}");
}
