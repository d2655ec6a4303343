//! With the feature `defmt` of allan-core, every public value can be printed by a microcontroller.

use std::path::Path;
use std::process::Command;
use system_tests::{tool, workspace};

/// The public types of the sources that have `Debug`: values, not the steps of a computation.
fn public_values(folder: &Path, names: &mut Vec<String>) {
    for entry in std::fs::read_dir(folder).expect("a folder") {
        let path = entry.expect("an entry").path();
        if path.is_dir() {
            public_values(&path, names);
            continue;
        }
        let source = std::fs::read_to_string(&path).expect("a source file");
        let mut has_debug = false;
        for line in source.lines() {
            let declared = ["pub struct ", "pub enum "].iter().find_map(|start| line.strip_prefix(start));
            if let Some(declared) = declared.filter(|_| has_debug) {
                let end = declared.find(|letter: char| !letter.is_alphanumeric()).unwrap_or(declared.len());
                names.push(declared[..end].to_owned());
            }
            has_debug = line.starts_with("#[derive(Debug") || (has_debug && line.starts_with("#["));
        }
    }
}

/// The program compiles only if each type that it prints has `defmt::Format`.
#[test]
fn every_public_value_can_be_printed_by_defmt() {
    let output = Command::new(tool("defmt-formats")).output().expect("the program starts");
    let names = String::from_utf8(output.stdout).expect("UTF-8");
    let mut formatted: Vec<&str> = names.lines().collect();
    formatted.sort_unstable();
    let mut public = Vec::new();
    public_values(&workspace().join("allan-core/src"), &mut public);
    public.sort();
    assert_eq!(formatted, public);
}
