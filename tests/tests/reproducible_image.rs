//! Two builds of an image from one source are equal byte for byte in any folder, so an image on a board can be compared with its source.
//! `CARGO_HOME` is the same in both, since its path is in panic messages of dependencies.

use image_file::uf2;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use tempfile::tempdir;

const TARGET: &str = "thumbv6m-none-eabi";

/// The file for the Pico's boot loader, built from a copy of the workspace in `folder` without earlier results.
fn built_in(folder: &Path) -> Vec<u8> {
    let workspace = Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("the tests are a folder of the workspace");
    let listed = Command::new("git").current_dir(workspace).args(["ls-files", "-z"]).output().expect("git");
    let files = String::from_utf8(listed.stdout).expect("names in UTF-8");
    for file in files.split_terminator('\0').map(PathBuf::from) {
        let copy = folder.join(&file);
        fs::create_dir_all(copy.parent().expect("a folder")).expect("room");
        fs::copy(workspace.join(&file), &copy).expect("a file that git knows");
    }
    let status = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()))
        .current_dir(folder)
        .args(["build", "--package", "firmware", "--bin", "observatory-pico", "--features", "board-pico"])
        .args(["--profile", "image", "--locked", "--target", TARGET, "--target-dir"])
        .arg(folder.join("target"))
        .status()
        .expect("cargo starts");
    assert!(status.success(), "the image does not build; its target comes with `rustup target add {TARGET}`");
    let elf = fs::read(folder.join("target").join(TARGET).join("image/observatory-pico")).expect("the image");
    uf2::from_elf(&elf).expect("an image")
}

#[test]
#[ignore = "long: an image is built twice from nothing; run with --long"]
fn an_image_has_the_same_bytes_wherever_it_is_built() {
    let dir = tempdir().expect("a folder");
    let here = built_in(&dir.path().join("a"));
    let there = built_in(&dir.path().join("another-folder/with-a-longer-name"));
    assert!(here.len() > 100_000, "{} bytes", here.len());
    assert!(here == there, "the images differ");
}
