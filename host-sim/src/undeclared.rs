//! `undeclared`: the detection benchmark on recordings of the virtual sensor with hidden effects.

use crate::cli::JsonArgument;
use crate::output::{check_result, print, progress_bar, write_result};
use anyhow::Result;
use benchmarks::undeclared::UndeclaredPlan;

/// Runs the benchmark and prints its table.
pub(crate) fn run(plan: &UndeclaredPlan, output: &JsonArgument) -> Result<()> {
    check_result(output, &[])?;
    let bar = progress_bar(0, "{wide_bar} {pos}/{len} recordings, {eta} left");
    let table = plan.run(|done, all| {
        bar.set_length(all as u64);
        bar.set_position(done as u64);
    })?;
    bar.finish_and_clear();
    write_result(&table, output)?;
    print(|out| table.write(out))
}
