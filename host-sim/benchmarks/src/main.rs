//! The program `benchmarks`: runs a benchmark and writes its result as JSON, of which `tables.py` makes tables.

use anyhow::{Context, Result};
use benchmarks::contradictions::ContradictionPlan;
use benchmarks::filtered_noise::FilteredNoisePlan;
use benchmarks::losses::LossPlan;
use benchmarks::reproduction::Reproduction;
use benchmarks::undeclared::{MeasuredNoisePlan, UndeclaredPlan};
use clap::{Parser, Subcommand};
use indicatif::{ProgressBar, ProgressStyle};
use serde::Serialize;
use std::fs::OpenOptions;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Benchmarks of the noise analysis, on recordings whose noise or whose effects are known.
#[derive(Debug, Parser)]
#[command(version)]
struct Cli {
    #[command(subcommand)]
    benchmark: Benchmark,
    /// File for the result as JSON, of which tables.py makes tables [default: standard output].
    #[arg(short, long, global = true, value_name = "FILE")]
    output: Option<PathBuf>,
}

#[derive(Debug, Subcommand)]
enum Benchmark {
    Undeclared(UndeclaredPlan),
    Measured(MeasuredNoisePlan),
    Contradictions(ContradictionPlan),
    Filters(FilteredNoisePlan),
    Paper(Reproduction),
    Losses(LossPlan),
}

/// Runs the program. The exit code is 0 for success and 1 for an error; the argument parser exits with 2 for wrong
/// usage.
fn main() -> ExitCode {
    match run(Cli::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        // The reader of standard output may close it, as `head` does.
        Err(error) if is_broken_pipe(&error) => ExitCode::SUCCESS,
        Err(error) => {
            // If standard error is closed too, only the exit code shows the error.
            let _ = writeln!(io::stderr(), "error: {error:#}");
            ExitCode::FAILURE
        }
    }
}

fn run(Cli { benchmark, output }: Cli) -> Result<()> {
    let output = output.as_deref();
    if let Some(file) = output {
        // The file is opened before hours of work; its content is kept.
        OpenOptions::new().append(true).create(true).open(file).with_context(|| file.display().to_string())?;
    }
    let bar = ProgressBar::new(0);
    if let Ok(style) = ProgressStyle::with_template("{wide_bar} {pos}/{len} recordings, {eta} left") {
        bar.set_style(style);
    }
    let progress = |done: usize, all: usize| {
        bar.set_length(all as u64);
        bar.set_position(done as u64);
    };
    let end = || bar.finish_and_clear();
    match benchmark {
        Benchmark::Undeclared(plan) => write("undeclared", &plan.run(progress)?, end, output),
        Benchmark::Measured(plan) => write("measured", &plan.run(progress)?, end, output),
        Benchmark::Contradictions(plan) => write("contradictions", &plan.run(progress)?, end, output),
        Benchmark::Filters(plan) => write("filters", &plan.run(progress), end, output),
        Benchmark::Paper(plan) => {
            let seeds = plan.seeds as usize;
            write("paper", &plan.run(|done| progress(done as usize, seeds)), end, output)
        }
        Benchmark::Losses(plan) => write("losses", &plan.run(progress), end, output),
    }
}

/// The JSON that `tables.py` reads: the name of the benchmark and the fields of its result.
#[derive(Serialize)]
struct Outcome<'a, T> {
    benchmark: &'static str,
    #[serde(flatten)]
    result: &'a T,
}

fn write(benchmark: &'static str, result: &impl Serialize, end_progress: impl Fn(), file: Option<&Path>) -> Result<()> {
    end_progress();
    let mut json = serde_json::to_vec_pretty(&Outcome { benchmark, result })?;
    json.push(b'\n');
    match file {
        Some(file) => std::fs::write(file, json).with_context(|| file.display().to_string()),
        None => Ok(io::stdout().lock().write_all(&json)?),
    }
}

fn is_broken_pipe(error: &anyhow::Error) -> bool {
    error.downcast_ref::<io::Error>().is_some_and(|error| error.kind() == io::ErrorKind::BrokenPipe)
}
