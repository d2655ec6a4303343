//! `paper`: the published characterisation repeated on simulated hours.

use crate::cli::OutputArguments;
use crate::output::{print, write_json};
use anyhow::{Result, bail};
use benchmarks::reproduction::Reproduction;
use indicatif::ProgressBar;

/// Simulates `seeds` hours, the first with the seed `first_seed`, and prints the estimates.
pub(crate) fn run(seeds: u64, first_seed: u64, output: &OutputArguments) -> Result<()> {
    if output.page.is_some() || output.kalibr.is_some() {
        bail!("paper is not of one sensor: leave out --page and --kalibr");
    }
    let bar = ProgressBar::new(seeds);
    let outcome = Reproduction { seeds, first_seed }.run(|done| bar.set_position(done));
    bar.finish_and_clear();
    write_json(&outcome, output)?;
    print(|out| outcome.write(out))
}
