//! The images, built here as one would build them to flash them.

use std::path::{Path, PathBuf};
use std::process::Command;

pub(crate) fn workspace() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("the tests live inside the workspace")
}

/// A directory of its own: the tests' own cargo may hold the lock of the other one.
pub(crate) fn folder() -> PathBuf {
    let target = std::env::var_os("CARGO_TARGET_DIR").map_or_else(|| workspace().join("target"), PathBuf::from);
    workspace().join(target).join("image")
}

/// The ELF of the image `observatory-{board}`.
pub(crate) fn image(board: &str, target: &str) -> PathBuf {
    let (bin, feature) = (format!("observatory-{board}"), format!("board-{board}"));
    let status = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()))
        .current_dir(workspace())
        .args(["build", "--package", "firmware", "--bin", &bin, "--features", &feature, "--target", target])
        .args(["--profile", "image", "--locked", "--target-dir"])
        .arg(folder())
        .status()
        .expect("cargo starts");
    assert!(status.success(), "the image does not build; its target comes with `rustup target add {target}`");
    folder().join(target).join("image").join(bin)
}
