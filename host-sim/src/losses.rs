//! `losses`: what lost samples do to the variance and to the coefficients.

use crate::cli::JsonArgument;
use crate::output::{check_result, print, progress_bar, write_result};
use anyhow::Result;
use benchmarks::losses::LossPlan;

/// Runs the benchmark and prints its tables.
pub(crate) fn run(plan: &LossPlan, output: &JsonArgument) -> Result<()> {
    check_result(output, &[])?;
    let bar = progress_bar(0, "{wide_bar} {pos}/{len} records, {eta} left");
    let table = plan.run(|done, all| {
        bar.set_length(all as u64);
        bar.set_position(done as u64);
    });
    bar.finish_and_clear();
    write_result(&table, output)?;
    print(|out| table.write(out))
}
