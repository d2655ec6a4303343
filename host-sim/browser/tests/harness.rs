//! Builds the page, and starts Node.js, which drives Chromium.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use system_tests::{note_skipped, one_at_a_time, target_folder, workspace};

/// Names of the Chromium program.
const CHROMIUM: [&str; 3] = ["chromium", "chromium-browser", "google-chrome"];

fn runs(program: &str) -> bool {
    Command::new(program).arg("--version").output().is_ok_and(|output| output.status.success())
}

/// Stands for an image of the Pico.
pub(crate) const IMAGE: &[u8] = b"the bytes of an image";

/// The folder of the page, built with [`IMAGE`] in its own folder; `BROWSER_PAGE` names an existing one.
fn page() -> PathBuf {
    if let Some(folder) = std::env::var_os("BROWSER_PAGE") {
        return folder.into();
    }
    let folder = target_folder().join("browser-test");
    let _building = one_at_a_time(&folder.with_extension("lock"));
    let image = folder.with_extension("uf2");
    std::fs::write(&image, IMAGE).expect("room");
    let mut build = Command::new(env!("CARGO_BIN_EXE_build-page"));
    let status = build.arg("--quick").args([&folder, &image]).stdout(Stdio::null()).status();
    assert!(status.expect("the program starts").success(), "the page does not build");
    folder
}

/// Runs `script` of this folder with Chromium, the page's address, a folder for saved files, and `input` on standard input. False, with a
/// note, if Chromium or Node.js is missing.
pub(crate) fn drive(test: &str, script: &str, page_file: &str, folder: &Path, input: &str) -> bool {
    let chromium = CHROMIUM.into_iter().find(|name| runs(name)).filter(|_| runs("node"));
    let Some(chromium) = chromium else {
        note_skipped(test, "no Chromium, or no Node.js");
        return false;
    };
    let script = workspace().join("host-sim/browser/tests").join(script);
    let mut node = Command::new("node")
        .arg(script)
        .arg(chromium)
        .arg(format!("file://{}", page().join(page_file).display()))
        .arg(folder)
        .stdin(Stdio::piped())
        .spawn()
        .expect("node starts");
    // A script that fails at once has closed its input.
    let _ = node.stdin.take().expect("a pipe").write_all(input.as_bytes());
    assert!(node.wait().expect("node ends").success(), "{test}: see above");
    true
}
