//! Starts the emulator of an STM32F405, a program of `tests/tools`, with an image.

use super::images;
use emulation::{Outcome, Scenario};
use link::Health;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::OnceLock;
use system_tests::tool;

pub(crate) const TARGET: &str = "thumbv7em-none-eabihf";

/// The image for the Olimex STM32-H405, built at most once a run; `OBSERVATORY_IMAGE` names another.
pub(crate) fn image() -> &'static Path {
    static IMAGE: OnceLock<PathBuf> = OnceLock::new();
    let build = || images::build("h405", TARGET, &[]);
    IMAGE.get_or_init(|| std::env::var_os("OBSERVATORY_IMAGE").map_or_else(build, PathBuf::from))
}

/// The image for the Adafruit Feather STM32F405, built at most once a run.
pub(crate) fn feather_image() -> &'static Path {
    static IMAGE: OnceLock<PathBuf> = OnceLock::new();
    IMAGE.get_or_init(|| images::build("feather", TARGET, &[]))
}

/// Asserts that a quarter of the stack was never used, and prints the figure.
pub(crate) fn assert_stack_suffices(health: &Health) {
    let Health { stack_bytes, stack_size, .. } = *health;
    let free_percent = 100 * (stack_size - stack_bytes) / stack_size;
    println!("stack: {stack_bytes} of {stack_size} B used, {free_percent} % free");
    assert!(free_percent >= 25, "{health:?}");
}

/// Boots the image and runs it.
pub(crate) fn run(image: &Path, scenario: Scenario) -> Outcome {
    let mut emulator = Command::new(tool("stm32f4-emulator"))
        .arg(image)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .expect("the emulator starts");
    emulator.stdin.take().expect("a pipe").write_all(&scenario.to_bytes()).expect("the emulator reads");
    let output = emulator.wait_with_output().expect("the emulator ends");
    assert!(output.status.success(), "the emulator ends with {}", output.status);
    Outcome::from_bytes(&output.stdout).expect("the results of the run")
}
