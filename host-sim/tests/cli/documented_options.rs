//! The options that the documentation uses are those that the program has, and those of a recording are all in the documentation.

use crate::program::{imunoise, write};
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// The options of a command by its own help.
fn options(command: &str) -> BTreeSet<String> {
    let output = imunoise(&[command, "--help"]);
    assert!(output.status.success(), "{command}");
    let help = String::from_utf8(output.stdout).expect("UTF-8");
    // An option begins its line; others are named within sentences.
    let is_option = |line: &&str| line.starts_with("--") || line.starts_with("-h") || line.starts_with("-V");
    let lines = help.lines().map(str::trim_start).filter(is_option);
    lines.flat_map(words).collect()
}

/// The words of a line that are options, without values.
fn words(line: &str) -> Vec<String> {
    let words = line.split_whitespace().filter_map(|word| word.strip_prefix("--"));
    let name = |word: &str| word.chars().take_while(|letter| letter.is_ascii_lowercase() || *letter == '-').collect();
    words.map(name).filter(|name: &String| !name.is_empty()).collect()
}

#[test]
fn options_of_the_documentation_are_those_of_the_program() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let mut pages = vec![root.join("README.md")];
    let docs = std::fs::read_dir(root.join("docs")).expect("a folder").filter_map(|entry| Some(entry.ok()?.path()));
    pages.extend(docs.filter(|page| page.extension().is_some_and(|ending| ending == "md")));
    let mut known: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
    let mut commands = 0;
    for page in &pages {
        let text = std::fs::read_to_string(page).expect("a page");
        for line in text.lines() {
            let command =
                ["cargo run --release -- ", "$ imunoise "].iter().find_map(|program| line.split_once(program));
            let Some((_, command)) = command else { continue };
            let command = command.split(['#', '|', '`']).next().unwrap_or_default();
            let Some(name) = command.split_whitespace().next().filter(|name| !name.starts_with('-')) else { continue };
            let known = known.entry(name.to_owned()).or_insert_with(|| options(name));
            for option in words(command) {
                assert!(known.contains(&option), "{}: {name} has no --{option}", page.display());
            }
            commands += 1;
        }
    }
    assert!(commands > 30, "{commands} commands");
    // The options of reading are described.
    let page = std::fs::read_to_string(root.join("docs/recordings.md")).expect("a page");
    for option in
        ["columns", "units", "topic", "rate", "sensor", "range", "from", "to", "accept-guess", "each-sensor", "format"]
    {
        assert!(page.contains(&format!("--{option}")), "docs/recordings.md does not have --{option}");
    }
    assert!(options("convert").is_superset(&["from", "to", "format", "rate"].map(str::to_owned).into()));
    assert!(options("inspect").contains("topic"));
}

#[test]
fn the_table_of_the_page_for_a_logger_is_read_as_register_counts() {
    let page =
        std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/own-logger.md")).expect("a page");
    let table = page.split("```\n").find(|block| block.starts_with("time_s,")).expect("a table");
    let dir = tempfile::tempdir().expect("a folder");
    let file = write(&dir, "log.csv", table.as_bytes());
    let output = imunoise(&["inspect", file.to_str().expect("UTF-8")]);
    let text = String::from_utf8(output.stdout).expect("UTF-8");
    assert!(output.status.success() && text.contains("register counts of an ADIS16405"), "{text}");
}
