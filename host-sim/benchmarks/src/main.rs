//! The program `benchmarks`: runs a benchmark and writes its result as JSON, of which `tables.py` makes tables.

use anyhow::{Context, Result};
use benchmarks::contradictions::ContradictionPlan;
use benchmarks::filtered_noise::{FilteredNoisePlan, READ_EVERY, TAPS};
use benchmarks::losses::LossPlan;
use benchmarks::reproduction::Reproduction;
use benchmarks::undeclared::{
    EffectKind, MeasuredNoisePlan, NoiseRecording, SEEDS_PER_GROUP, StretchLength, UndeclaredPlan,
};
use clap::{Args, Parser, Subcommand, value_parser};
use indicatif::{ProgressBar, ProgressStyle};
use serde::Serialize;
use std::fs::OpenOptions;
use std::io::{self, Write};
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Most recordings of a benchmark. Each has its own seed, and its result is kept until the end.
const MOST_RECORDINGS: u64 = 100_000;

/// Benchmarks of the noise analysis, on recordings whose noise or whose effects are known.
#[derive(Debug, Parser)]
#[command(version)]
struct Cli {
    #[command(subcommand)]
    benchmark: Benchmark,
    /// Where the result goes as JSON, of which tables.py makes tables [default: standard output].
    #[arg(short, long, global = true, value_name = "FILE")]
    output: Option<PathBuf>,
}

#[derive(Debug, Subcommand)]
enum Benchmark {
    /// Hide random effects in recordings and score how well the analysis names them.
    Undeclared(UndeclaredArguments),
    /// Hide effects in the measured noise of recordings and score how well the analysis names them.
    Measured(MeasuredArguments),
    /// Count the sentences under "Contradicted" in the reports of noise with nothing hidden.
    Contradictions(ContradictionArguments),
    /// Compare N, B and K behind the part's filter with their truth, nothing else hidden.
    Filters(FilterArguments),
    /// Repeat the published characterisation on simulated hours: slope method beside the fit.
    Paper(PaperArguments),
    /// Take samples out of records and compare variance and coefficients with those of the complete records.
    Losses(LossArguments),
}

#[derive(Debug, Args)]
struct UndeclaredArguments {
    /// Kind that is hidden alone; may be repeated [default: all].
    #[arg(long, value_enum)]
    kind: Vec<EffectKind>,
    /// Recordings a kind.
    #[arg(long, default_value_t = 40, value_parser = value_parser!(u64).range(..=MOST_RECORDINGS))]
    per_kind: u64,
    /// Recordings with nothing hidden.
    #[arg(long, default_value_t = 200, value_parser = value_parser!(u64).range(..=MOST_RECORDINGS))]
    nothing: u64,
    /// Recordings with two effects.
    #[arg(long, default_value_t = 200, value_parser = value_parser!(u64).range(..=MOST_RECORDINGS))]
    pairs: u64,
    /// Recordings with three effects.
    #[arg(long, default_value_t = 100, value_parser = value_parser!(u64).range(..=MOST_RECORDINGS))]
    triples: u64,
    /// Recordings of each kind of effect that no kind of the report describes.
    #[arg(long, value_name = "PER_KIND", default_value_t = 20, value_parser = value_parser!(u64).range(..=MOST_RECORDINGS))]
    outside: u64,
    /// Length of a recording, s.
    #[arg(long, default_value_t = 1800.0)]
    seconds: f64,
    /// Samples that are lost at random in every recording, %.
    #[arg(long, value_name = "PERCENT", default_value_t = 0.0, value_parser = loss_percent)]
    loss: f64,
    /// Recordings that are examined at a time [default: one a core].
    #[arg(long)]
    jobs: Option<NonZeroUsize>,
    /// First seed of each group of recordings.
    #[arg(long, default_value_t = 0, value_parser = value_parser!(u64).range(..SEEDS_PER_GROUP / 2))]
    seed: u64,
    /// Take the seeds that are kept for the end.
    #[arg(long)]
    sealed: bool,
}

#[derive(Debug, Args)]
struct MeasuredArguments {
    /// Recordings of any format that `analyze` reads; of those that are no register counts, the longest part at rest.
    #[arg(required = true)]
    recordings: Vec<PathBuf>,
    /// Sample rate of those without time stamps, Hz.
    #[arg(long)]
    rate: Option<f64>,
    /// Stretches, in each of which every kind of effect is hidden alone; they are taken from the recordings in turn.
    #[arg(long, default_value_t = 6, value_parser = value_parser!(u64).range(1..=MOST_RECORDINGS))]
    stretches: u64,
    /// Length of a stretch, s; a shorter recording is one stretch.
    #[arg(long, default_value_t = 600.0, value_parser = positive)]
    seconds: f64,
    /// The same in samples, for recordings of different rates.
    #[arg(long, conflicts_with = "seconds", value_parser = value_parser!(u64).range(1..))]
    samples: Option<u64>,
    /// Size of each effect over the detection limit in the noise of its channel.
    #[arg(long, default_value_t = 3.0, value_parser = positive)]
    strength: f64,
    /// Seed of the first stretch.
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Stretches that are examined at a time [default: one a core].
    #[arg(long)]
    jobs: Option<NonZeroUsize>,
}

#[derive(Debug, Args)]
struct ContradictionArguments {
    /// Records.
    #[arg(long, default_value_t = 200, value_parser = value_parser!(u64).range(1..=MOST_RECORDINGS))]
    records: u64,
    /// Length of a record, s.
    #[arg(long, default_value_t = 900.0, value_parser = positive)]
    seconds: f64,
    /// Seed of the first record.
    #[arg(long, default_value_t = 0, value_parser = value_parser!(u64).range(..SEEDS_PER_GROUP / 2))]
    seed: u64,
    /// Records that are examined at a time [default: one a core].
    #[arg(long)]
    jobs: Option<NonZeroUsize>,
}

#[derive(Debug, Args)]
struct FilterArguments {
    /// Taps of each of the two averages.
    #[arg(long, value_delimiter = ',', default_values_t = TAPS, value_parser = in_filter)]
    taps: Vec<usize>,
    /// Which of the values are read: 1 for every one, 2 for every second.
    #[arg(long, value_delimiter = ',', default_values_t = READ_EVERY, value_parser = in_filter)]
    every: Vec<usize>,
    /// Records of three gyros behind each filter.
    #[arg(long, default_value_t = 300, value_parser = value_parser!(u64).range(1..=MOST_RECORDINGS))]
    records: u64,
    /// Length of a record, s.
    #[arg(long, default_value_t = 1800.0, value_parser = positive)]
    seconds: f64,
    /// Seed of the first record.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Records that are examined at a time [default: one a core].
    #[arg(long)]
    jobs: Option<NonZeroUsize>,
}

#[derive(Debug, Args)]
struct PaperArguments {
    /// Hours to simulate; a scatter needs two.
    #[arg(long, default_value_t = 100, value_parser = value_parser!(u64).range(2..=MOST_RECORDINGS))]
    seeds: u64,
    /// Seed of the first.
    #[arg(long, default_value_t = 1)]
    first_seed: u64,
}

#[derive(Debug, Args)]
struct LossArguments {
    /// Records of each noise.
    #[arg(long, default_value_t = 100, value_parser = value_parser!(u64).range(2..=MOST_RECORDINGS))]
    records: u64,
    /// Binary logarithm of the number of samples of a record, at 204.8 SPS; 20 is 1.4 hours.
    #[arg(long, default_value_t = 20, value_parser = value_parser!(u32).range(14..=24))]
    samples_log2: u32,
    /// Seed of the first record.
    #[arg(long, default_value_t = 1)]
    first_seed: u64,
    /// Threads [default: as many as the machine has cores].
    #[arg(long)]
    jobs: Option<NonZeroUsize>,
}

fn loss_percent(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(percent) if (0.0..=50.0).contains(&percent) => Ok(percent),
        _ => Err("not a percentage from 0 to 50".to_owned()),
    }
}

fn positive(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if value > 0.0 && value.is_finite() => Ok(value),
        _ => Err("not a number above 0".to_owned()),
    }
}

/// Taps or decimation of a filter.
fn in_filter(text: &str) -> Result<usize, String> {
    match text.parse::<usize>() {
        Ok(value @ 1..=128) => Ok(value),
        _ => Err("not a whole number from 1 to 128".to_owned()),
    }
}

/// The number of threads. The default is the number of cores, or 1 if the machine does not report it.
fn threads(jobs: Option<NonZeroUsize>) -> usize {
    jobs.or_else(|| std::thread::available_parallelism().ok()).map_or(1, NonZeroUsize::get)
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
    match benchmark {
        Benchmark::Undeclared(arguments) => {
            let plan = UndeclaredPlan {
                kinds: if arguments.kind.is_empty() { EffectKind::ALL.to_vec() } else { arguments.kind },
                per_kind: arguments.per_kind,
                empty: arguments.nothing,
                pairs: arguments.pairs,
                triples: arguments.triples,
                outside: arguments.outside,
                seconds: arguments.seconds,
                loss_percent: arguments.loss,
                seed: arguments.seed,
                sealed: arguments.sealed,
                jobs: threads(arguments.jobs),
            };
            let table = plan.run(progress)?;
            bar.finish_and_clear();
            write("undeclared", &table, output)
        }
        Benchmark::Measured(arguments) => {
            let MeasuredArguments { recordings, rate, stretches, seconds, samples, strength, seed, jobs } = arguments;
            let recordings =
                recordings.iter().map(|file| NoiseRecording::read(file, rate)).collect::<Result<_, _>>()?;
            let length = samples.map_or(StretchLength::Seconds(seconds), StretchLength::Samples);
            let plan = MeasuredNoisePlan { recordings, stretches, length, strength, seed, jobs: threads(jobs) };
            let table = plan.run(progress);
            bar.finish_and_clear();
            write("measured", &table, output)
        }
        Benchmark::Contradictions(ContradictionArguments { records, seconds, seed, jobs }) => {
            let plan = ContradictionPlan { records, seconds, first_seed: seed, jobs: threads(jobs) };
            let table = plan.run(progress)?;
            bar.finish_and_clear();
            write("contradictions", &table, output)
        }
        Benchmark::Filters(FilterArguments { taps, every, records, seconds, seed, jobs }) => {
            let plan = FilteredNoisePlan { taps, every, records, seconds, first_seed: seed, jobs: threads(jobs) };
            let table = plan.run(progress);
            bar.finish_and_clear();
            write("filters", &table, output)
        }
        Benchmark::Paper(PaperArguments { seeds, first_seed }) => {
            let result = Reproduction { seeds, first_seed }.run(|done| progress(done as usize, seeds as usize));
            bar.finish_and_clear();
            write("paper", &result, output)
        }
        Benchmark::Losses(LossArguments { records, samples_log2, first_seed, jobs }) => {
            let plan = LossPlan { records, samples: 1 << samples_log2, first_seed, jobs: threads(jobs) };
            let table = plan.run(progress);
            bar.finish_and_clear();
            write("losses", &table, output)
        }
    }
}

/// The JSON that `tables.py` reads: the name of the benchmark and the fields of its result.
#[derive(Serialize)]
struct Outcome<'a, T> {
    benchmark: &'static str,
    #[serde(flatten)]
    result: &'a T,
}

fn write(benchmark: &'static str, result: &impl Serialize, file: Option<&Path>) -> Result<()> {
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
