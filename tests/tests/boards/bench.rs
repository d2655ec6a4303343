//! The image for the Feather, and its stack.

use link::Health;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use system_tests::Image;

pub(crate) use system_tests::stm32f4::{TARGET, h405_image as image, run};

/// The image for the Adafruit Feather STM32F405, built at most once per run.
pub(crate) fn feather_image() -> &'static Path {
    static IMAGE: OnceLock<PathBuf> = OnceLock::new();
    IMAGE.get_or_init(|| Image::of_board("feather", TARGET, &[]))
}

/// Asserts that at least a quarter of the stack was never used, and prints the figure.
pub(crate) fn assert_stack_suffices(health: &Health) {
    let Health { stack_bytes, stack_size, .. } = *health;
    let free_percent = 100 * (stack_size - stack_bytes) / stack_size;
    println!("stack: {stack_bytes} of {stack_size} B used, {free_percent} % free");
    assert!(free_percent >= 25, "{health:?}");
}
