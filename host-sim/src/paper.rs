//! `paper`: the published characterisation repeated on simulated hours.

use crate::cli::JsonArgument;
use crate::output::{check_result, print, write_result};
use anyhow::Result;
use benchmarks::reproduction::Reproduction;
use indicatif::ProgressBar;

/// Simulates `seeds` hours, the first with the seed `first_seed`, and prints the estimates.
pub(crate) fn run(seeds: u64, first_seed: u64, output: &JsonArgument) -> Result<()> {
    check_result(output, &[])?;
    let bar = ProgressBar::new(seeds);
    let outcome = Reproduction { seeds, first_seed }.run(|done| bar.set_position(done));
    bar.finish_and_clear();
    write_result(&outcome, output)?;
    print(|out| outcome.write(out))
}
