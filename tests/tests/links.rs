//! Links of the documentation: each linked file exists, and each linked section has its heading.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..").canonicalize().expect("the workspace")
}

/// The pages: Markdown files of the root and of the folders with documentation.
fn pages() -> Vec<PathBuf> {
    let folders = [
        "",
        "docs",
        "adis16405-driver",
        "allan-core",
        "allan-core/guide",
        "allan-core/ffi",
        "host-sim/python",
        "host-sim/readers",
        "host-sim/time-base",
    ];
    let markdown = folders.iter().flat_map(|folder| std::fs::read_dir(root().join(folder)).expect("a folder"));
    let mut pages: Vec<PathBuf> = markdown.map(|entry| entry.expect("an entry").path()).collect();
    pages.retain(|path| path.extension().is_some_and(|ending| ending == "md"));
    pages.sort();
    pages
}

/// The lines outside of code blocks.
fn prose(text: &str) -> impl Iterator<Item = (usize, &str)> {
    let mut in_code = false;
    text.lines().enumerate().filter_map(move |(number, line)| {
        let is_fence = line.trim_start().starts_with("```");
        in_code ^= is_fence;
        (!in_code && !is_fence).then_some((number + 1, line))
    })
}

/// The anchor of a heading: lower case, a hyphen for each space, no punctuation.
fn anchor(heading: &str) -> String {
    let kept = heading.trim().to_lowercase();
    let kept = kept.chars().filter(|c| c.is_alphanumeric() || [' ', '-', '_'].contains(c));
    kept.map(|c| if c == ' ' { '-' } else { c }).collect()
}

fn anchors(text: &str) -> Vec<String> {
    let headings = prose(text).filter(|(_, line)| line.starts_with('#'));
    headings.map(|(_, line)| anchor(line.trim_start_matches('#'))).collect()
}

/// Destinations of the links and pictures in a line.
fn destinations(line: &str) -> impl Iterator<Item = &str> {
    line.split("](").skip(1).filter_map(|rest| rest.split(')').next())
}

/// Broken links of a page.
fn broken(page: &Path, read: &mut HashMap<PathBuf, Vec<String>>) -> Vec<String> {
    let text = std::fs::read_to_string(page).expect("UTF-8");
    let mut wrong = Vec::new();
    for (line, destination) in
        prose(&text).flat_map(|(number, line)| destinations(line).map(move |found| (number, found)))
    {
        // Addresses are not checked; rustdoc checks links to items of a crate.
        if destination.contains("://") || destination.contains("::") {
            continue;
        }
        let (file, section) = destination.split_once('#').unwrap_or((destination, ""));
        let target = if file.is_empty() { page.to_owned() } else { page.with_file_name(file) };
        let place = format!("{}:{line}: {destination}", page.display());
        if !target.exists() {
            wrong.push(format!("{place}: no such file"));
        } else if !section.is_empty() {
            let known = read
                .entry(target.clone())
                .or_insert_with(|| anchors(&std::fs::read_to_string(&target).expect("a page with sections")));
            if !known.iter().any(|known| known == section) {
                wrong.push(format!("{place}: no such section"));
            }
        }
    }
    wrong
}

#[test]
fn every_link_of_the_documentation_has_its_file_and_its_section() {
    let mut read = HashMap::new();
    let wrong: Vec<String> = pages().iter().flat_map(|page| broken(page, &mut read)).collect();
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn every_page_of_the_documentation_is_in_its_table_of_contents() {
    let contents = std::fs::read_to_string(root().join("docs/README.md")).expect("the contents");
    let listed: Vec<&str> = contents.lines().flat_map(destinations).collect();
    for page in pages().iter().filter(|page| page.starts_with(root().join("docs"))) {
        let name = page.file_name().and_then(|name| name.to_str()).expect("UTF-8");
        assert!(name == "README.md" || listed.contains(&name), "{name} is not in docs/README.md");
    }
}

#[test]
fn a_wrong_file_and_a_wrong_section_are_found() {
    let folder = tempfile::tempdir().expect("a folder");
    let page = folder.path().join("page.md");
    let text = "# A page, of *mine*\n[here](#a-page-of-mine) [gone](#gone) [no](no.md)\n```\n[code](code.md)\n```\n";
    std::fs::write(&page, text).expect("written");
    let wrong = broken(&page, &mut HashMap::new());
    let told: Vec<&str> = wrong.iter().filter_map(|text| Some(text.split_once("page.md:")?.1)).collect();
    assert_eq!(told, ["2: #gone: no such section", "2: no.md: no such file"]);
}
