//! Where the image comes from: `OBSERVATORY_IMAGE`, or built here as one would build it to flash it.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;

const TARGET: &str = "thumbv7em-none-eabihf";
const NAME: &str = "observatory-f405";

/// The image, built at most once a run.
pub(crate) fn image() -> &'static Path {
    static IMAGE: OnceLock<PathBuf> = OnceLock::new();
    IMAGE.get_or_init(|| std::env::var_os("OBSERVATORY_IMAGE").map_or_else(build, PathBuf::from))
}

fn build() -> PathBuf {
    let workspace = Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("the tests live inside the workspace");
    let target = std::env::var_os("CARGO_TARGET_DIR").map_or_else(|| workspace.join("target"), PathBuf::from);
    // A directory of its own: the tests' own cargo may hold the lock of the other one.
    let target = workspace.join(target).join("image");
    let status = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()))
        .current_dir(workspace)
        .args(["build", "--package", "firmware", "--bin", NAME, "--features", "board-f405", "--target", TARGET])
        .args(["--profile", "image", "--locked", "--target-dir"])
        .arg(&target)
        .status()
        .expect("cargo starts");
    assert!(status.success(), "the image does not build; its target comes with `rustup target add {TARGET}`");
    target.join(TARGET).join("image").join(NAME)
}
