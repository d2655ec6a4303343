//! `losses`: what lost samples do to the variance and to the coefficients.

use crate::cli::OutputArguments;
use crate::output::{print, progress_bar, write_json};
use anyhow::{Result, bail};
use benchmarks::losses::LossPlan;

/// Runs the benchmark and prints its tables.
pub(crate) fn run(plan: &LossPlan, output: &OutputArguments) -> Result<()> {
    if output.page.is_some() || output.kalibr.is_some() {
        bail!("losses is not of one sensor: leave out --page and --kalibr");
    }
    let bar = progress_bar(0, "{wide_bar} {pos}/{len} records, {eta} left");
    let table = plan.run(|done, all| {
        bar.set_length(all as u64);
        bar.set_position(done as u64);
    });
    bar.finish_and_clear();
    write_json(&table, output)?;
    print(|out| table.write(out))
}
