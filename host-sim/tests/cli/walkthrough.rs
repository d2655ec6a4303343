//! The walk through the program in `docs/ten-minutes.md`: its commands run one after the other, and what they print is generated.

use std::path::Path;
use std::process::Command;
use tempfile::tempdir;

/// A line of the page that stands for any number of lines.
const ANY_LINES: &str = "…";

/// Beginning of a line, before its first number.
fn label(line: &str) -> String {
    let words: Vec<&str> =
        line.split(|letter: char| letter.is_ascii_digit()).take(1).flat_map(str::split_whitespace).collect();
    words.join(" ")
}

/// The printed lines, with the elisions of the page: as many lines before the first and after the last one, and between two of them the
/// lines with the same labels.
fn elided(printed: &[&str], page: &[&str]) -> Vec<String> {
    let parts: Vec<&[&str]> = page.split(|line| *line == ANY_LINES).collect();
    let ([first, between @ .., last], true) = (&parts[..], parts.len() > 1) else {
        return printed.iter().map(|line| (*line).to_owned()).collect();
    };
    let missing = |lines: &[&str]| -> ! { panic!("to be edited by hand: no lines {lines:#?} in {printed:#?}") };
    let Some((head, mut rest)) = printed.split_at_checked(first.len()) else { missing(first) };
    let mut kept = head.to_vec();
    for part in between {
        kept.push(ANY_LINES);
        for line in *part {
            let Some(at) = rest.iter().position(|printed| label(printed) == label(line)) else { missing(part) };
            kept.push(rest[at]);
            rest = &rest[at + 1..];
        }
    }
    kept.push(ANY_LINES);
    let Some(skipped) = rest.len().checked_sub(last.len()) else { missing(last) };
    kept.extend(&rest[skipped..]);
    kept.into_iter().map(str::to_owned).collect()
}

#[test]
fn what_the_commands_of_ten_minutes_print_is_in_the_docs() {
    let page = std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/ten-minutes.md"))
        .expect("the page");
    let blocks: Vec<&str> = page.split("```console\n$ ").skip(1).filter_map(|rest| rest.split("```").next()).collect();
    assert!(blocks.len() >= 5, "{} blocks", blocks.len());
    let folder = tempdir().expect("a folder");
    let programs = Path::new(env!("CARGO_BIN_EXE_imunoise")).parent().expect("a folder").display().to_string();
    let path = format!("{programs}:{}", std::env::var("PATH").unwrap_or_default());
    for (number, block) in (1..).zip(blocks) {
        let mut text = "```console\n".to_owned();
        for step in block.split("\n$ ") {
            let (command, lines) = step.split_once('\n').unwrap_or((step, ""));
            let mut shell = Command::new("sh");
            let output =
                shell.args(["-c", &format!("{command} 2>&1")]).env("PATH", &path).current_dir(&folder).output();
            let output = output.expect("a shell");
            let printed = String::from_utf8(output.stdout).expect("UTF-8");
            assert!(output.status.success(), "$ {command}\n{printed}");
            let printed: Vec<&str> = printed.lines().map(str::trim_end).collect();
            text += &format!("$ {command}\n");
            for line in elided(&printed, &lines.lines().collect::<Vec<_>>()) {
                text += &format!("{line}\n");
            }
        }
        system_tests::generated("docs/ten-minutes.md", &format!("block-{number}"), &format!("{text}```"));
    }
}

#[test]
fn elisions_stay_where_they_are_while_the_figures_change() {
    let printed = ["head", "a 7", "b 8", "c 9", "d 10", "e 11"];
    assert_eq!(elided(&printed, &["head", "a 1"]), printed);
    assert_eq!(elided(&printed, &["head", "a 1", "…", "d 4", "…"]), ["head", "a 7", "…", "d 10", "…"]);
    assert_eq!(elided(&printed, &["head", "…", "c 1", "d 2", "…", "e 5"]), ["head", "…", "c 9", "d 10", "…", "e 11"]);
}
