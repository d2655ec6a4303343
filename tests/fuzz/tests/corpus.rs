//! Runs the targets on the bytes in `corpus`: those that reach most of each reader, and those of all findings of libFuzzer.

use fuzz::TARGETS;
use std::fs;
use std::path::Path;

#[test]
fn every_target_withstands_the_bytes_that_are_kept() {
    let corpus = Path::new(env!("CARGO_MANIFEST_DIR")).join("corpus");
    let mut folders: Vec<_> =
        fs::read_dir(&corpus).expect("a folder").map(|entry| entry.expect("an entry").file_name()).collect();
    folders.sort();
    let mut names: Vec<_> = TARGETS.iter().map(|(name, _)| *name).collect();
    names.sort_unstable();
    assert_eq!(folders, names, "a folder for every target");
    for (name, target) in TARGETS {
        let files = fs::read_dir(corpus.join(name)).expect("a folder").map(|entry| entry.expect("an entry").path());
        let files: Vec<_> = files.collect();
        assert!(!files.is_empty(), "{name}");
        for file in files {
            println!("{}", file.display());
            target(&fs::read(file).expect("a file"));
        }
    }
}
