//! The costs of the images, one row per board. Each board's test prints all rows measured so far.

use super::images;
use link::Health;
use std::path::Path;
use system_tests::image_folder;

/// The memory of a board in bytes: flash, and RAM without the stack.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Memory {
    pub(crate) flash: u32,
    pub(crate) ram: u32,
}

/// Measured costs of one board.
pub(crate) struct Costs<'a> {
    pub(crate) board: &'a str,
    pub(crate) memory: Memory,
    pub(crate) image: &'a Path,
    pub(crate) core_mhz: f64,
    /// Percentage of the time that the processor was awake while it only sampled at 819.2 SPS.
    pub(crate) awake_percent: f64,
    /// The health message at the end of an epoch, after its models were learned.
    pub(crate) health: Health,
}

const HEAD: &str = "board                    flash            RAM, static      stack, deepest   free   processor  longest interrupt: sampling, estimators";

/// Asserts the budgets: a quarter of the flash, three quarters of the RAM, three quarters of the stack, a quarter of
/// the processor, and 20 us for a sampling interrupt. Prints the table of all boards measured so far.
pub(crate) fn assert_within_budget(costs: &Costs<'_>) {
    let Costs { board, memory, image, core_mhz, awake_percent, health } = *costs;
    let size = images::size(image);
    let us = |cycles: u32| f64::from(cycles) / core_mhz;
    let of = |part: u32, whole: u32| format!("{:.1} of {:.0} kB", f64::from(part) / 1024.0, f64::from(whole) / 1024.0);
    let free_percent = 100 * (health.stack_size - health.stack_bytes) / health.stack_size;
    let row = format!(
        "{board:<24} {:<16} {:<16} {:<16} {free_percent} %   {awake_percent:.1} %      {:.1} us, {:.0} us",
        of(size.flash, memory.flash),
        of(size.statics, memory.ram),
        of(health.stack_bytes, health.stack_size),
        us(health.sampling_cycles),
        us(health.estimator_cycles),
    );
    let rows = image_folder().join("costs");
    std::fs::create_dir_all(&rows).expect("a folder");
    std::fs::write(rows.join(board), &row).expect("room");
    let mut files: Vec<_> =
        std::fs::read_dir(rows).expect("the folder").map(|entry| entry.expect("a file").path()).collect();
    files.sort();
    println!("{HEAD}");
    files.iter().for_each(|file| println!("{}", std::fs::read_to_string(file).expect("a row")));

    println!("{} B of static variables are copied from flash", size.initialised);
    assert!(size.initialised <= 2048, "{} B of static variables are copied from flash", size.initialised);
    assert!(size.flash <= memory.flash / 4, "{row}");
    assert!(size.statics <= memory.ram / 4 * 3, "{row}");
    assert!(free_percent >= 25, "{row}");
    assert!(awake_percent < 25.0, "{row}");
    assert!(us(health.sampling_cycles) < 20.0, "{row}");
}

/// The value of a counter in the answer to the key `k`.
pub(crate) fn counter(lines: &[String], name: &str) -> Option<u32> {
    lines.iter().find_map(|line| line.strip_prefix(name)?.strip_prefix(' ')?.parse().ok())
}
