//! The walk through the program in `docs/ten-minutes.md`: its commands run one after the other, and print what the page says.

use std::path::Path;
use std::process::Command;
use tempfile::tempdir;

/// A line of the page that stands for any number of lines.
const ANY_LINES: &str = "…";

/// A command of the page, and the lines that it prints.
struct Step {
    command: String,
    printed: Vec<String>,
}

/// The steps in the blocks of console text.
fn steps(page: &str) -> Vec<Step> {
    let mut steps: Vec<Step> = Vec::new();
    let mut in_console = false;
    for line in page.lines() {
        match line {
            "```console" => in_console = true,
            "```" => in_console = false,
            _ if !in_console => {}
            _ => match line.strip_prefix("$ ") {
                Some(command) => steps.push(Step { command: command.to_owned(), printed: Vec::new() }),
                None => steps.last_mut().expect("a command before its output").printed.push(line.to_owned()),
            },
        }
    }
    steps
}

/// Whether `printed` is what `expected` says.
fn is_as_said(printed: &[&str], expected: &[String]) -> bool {
    match expected.split_first() {
        None => printed.is_empty(),
        Some((line, rest)) if line == ANY_LINES => {
            (0..=printed.len()).any(|skipped| is_as_said(&printed[skipped..], rest))
        }
        Some((line, rest)) => {
            printed.split_first().is_some_and(|(first, others)| first == line && is_as_said(others, rest))
        }
    }
}

#[test]
fn the_commands_of_ten_minutes_print_what_the_page_says() {
    let page = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/ten-minutes.md");
    let steps = steps(&std::fs::read_to_string(page).expect("the page"));
    assert!(steps.len() >= 5, "{} commands", steps.len());
    let folder = tempdir().expect("a folder");
    let programs = Path::new(env!("CARGO_BIN_EXE_host-sim")).parent().expect("a folder").display().to_string();
    let path = format!("{programs}:{}", std::env::var("PATH").unwrap_or_default());
    for Step { command, printed: expected } in steps {
        let mut shell = Command::new("sh");
        let output = shell.args(["-c", &format!("{command} 2>&1")]).env("PATH", &path).current_dir(&folder).output();
        let output = output.expect("a shell");
        let text = String::from_utf8(output.stdout).expect("UTF-8");
        let printed: Vec<&str> = text.lines().map(str::trim_end).collect();
        assert!(output.status.success() && is_as_said(&printed, &expected), "$ {command}\n{text}");
    }
}
