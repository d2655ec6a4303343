//! The command line: one recording in, one report out.

use adis16405_driver::GyroRange;
use anyhow::{Context, Result, bail};
use benchmarks::reproduction::Reproduction;
use benchmarks::undeclared::UndeclaredPlan;
use clap::Parser;
use host_sim::cli::{Cli, Command, Explain, Input, Output};
use host_sim::monitor;
use host_sim::uf2;
use indicatif::{ProgressBar, ProgressStyle};
use noise_analysis::analysis::analyze;
use noise_analysis::explain::{self, Explanation};
use noise_analysis::report::Report;
use recordings::recording::Recording;
use recordings::serial::{self, Cable};
use recordings::timeline::measurement;
use recordings::{csv, folder};
use reports::{export, page, terminal};
use serde::Serialize;
use simulation::Simulation;
use simulation::replay;
use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::{Duration, Instant};

/// Where the page goes when nobody says otherwise.
const DEFAULT_PAGE: &str = "report";

fn main() -> ExitCode {
    let cli = Cli::parse();
    match run(cli) {
        Ok(()) => ExitCode::SUCCESS,
        // Whoever read the report has seen enough, as `head` does.
        Err(error) if is_broken_pipe(&error) => ExitCode::SUCCESS,
        Err(error) => {
            // Nothing is left to tell if standard error is closed too.
            let _ = writeln!(io::stderr(), "error: {error:#}");
            ExitCode::FAILURE
        }
    }
}

fn run(mut cli: Cli) -> Result<()> {
    let report = match &cli.command {
        None => {
            cli.output.page.get_or_insert_with(|| PathBuf::from(DEFAULT_PAGE));
            let simulation = cli.simulate.simulation(3600.0);
            report(&simulate(simulation, None)?, None).context("virtual sensor")?
        }
        Some(Command::Record { out, port: Some(port), baud, simulate }) => {
            let replayed = record_port(out, port, *baud, simulate.seconds.unwrap_or(60.0))?;
            report(&replayed, None).with_context(|| port.clone())?
        }
        Some(Command::Uf2 { elf, out }) => {
            let image = fs::read(elf).with_context(|| elf.display().to_string())?;
            let uf2 = uf2::from_elf(&image).with_context(|| elf.display().to_string())?;
            return fs::write(out, uf2).with_context(|| out.display().to_string());
        }
        Some(Command::Monitor { port, baud, send, seconds }) => {
            return watch(port, *baud, send, *seconds).with_context(|| port.clone());
        }
        Some(Command::Record { out, simulate: arguments, .. }) => {
            let recording = simulate(arguments.simulation(60.0), Some(out))?;
            report(&recording, None).context("virtual sensor")?
        }
        Some(Command::Analyze(input)) => {
            let recording = csv::read(&input.file, input.range.into())?;
            report_of(input, &recording)?
        }
        Some(Command::Paper { seeds, first_seed }) => {
            return paper(Reproduction { seeds: *seeds, first_seed: *first_seed }, &cli.output);
        }
        Some(Command::Explain(arguments)) => return explain_all(arguments, &cli.output),
        Some(Command::Undeclared(arguments)) => return benchmark(&arguments.plan(), &cli.output),
        Some(Command::Replay(input)) => {
            let replayed = replay(&input.file, input.range.into())?;
            if replayed.other_transactions > 0 {
                note(format_args!("{} transactions that are no bursts", replayed.other_transactions));
            }
            report_of(input, &replayed.recording)?
        }
    };
    write(&report, &cli.output)
}

fn simulate(simulation: Simulation, log: Option<&Path>) -> Result<Recording> {
    let bar = ProgressBar::new(simulation.samples()?);
    if let Ok(style) = ProgressStyle::with_template("{msg} {wide_bar} {pos}/{len} samples, {eta} left") {
        bar.set_style(style);
    }
    bar.set_message("virtual ADIS16405");
    let progress = |taken| bar.set_position(taken);
    let recording = match log {
        Some(file) => simulation.run_logged(file, progress),
        None => simulation.run(progress),
    };
    bar.finish_and_clear();
    Ok(recording?)
}

fn record_port(out: &Path, port: &str, baud: u32, seconds: f64) -> Result<Recording> {
    let mut cable = Cable::new(serial::open(port, baud).with_context(|| port.to_owned())?);
    let recorded = serial::record(&mut cable, out, seconds).with_context(|| port.to_owned())?;
    note(format_args!(
        "{} bursts, {} missing between them; {}",
        recorded.bursts,
        recorded.missing,
        monitor::summary(&recorded.counters)
    ));
    Ok(replay(out, GyroRange::default())?.recording)
}

fn watch(port: &str, baud: u32, commands: &[String], seconds: Option<f64>) -> Result<()> {
    let deadline = seconds.map(Duration::try_from_secs_f64).transpose()?.map(|time| Instant::now() + time);
    let mut cable = Cable::new(serial::open(port, baud)?);
    for command in commands {
        cable.command(command)?;
    }
    monitor::show(&mut cable, deadline, &mut io::stdout().lock())?;
    Ok(())
}

fn explain_all(arguments: &Explain, output: &Output) -> Result<()> {
    if output.page.is_some() || output.json.is_some() || output.kalibr.is_some() {
        bail!("explain writes tables only: leave out --page, --json and --kalibr");
    }
    for path in &arguments.recordings {
        for file in folder::tables(path)? {
            let recording = csv::read(&file, arguments.range.into())?;
            let measurement = measurement(&recording, arguments.rate).with_context(|| file.display().to_string())?;
            let mut out = BufWriter::new(io::stdout().lock());
            writeln!(out, "\n══ {}", file.display())?;
            let explanation = explain::explain(&measurement);
            reports::explanation::write(&explanation, &mut out)?;
            out.flush()?;
            if let Some(folder) = &arguments.pictures {
                draw(&explanation, &file, folder)?;
            }
        }
    }
    Ok(())
}

/// A picture for each channel, named after the recording and the channel.
fn draw(explanation: &Explanation, recording: &Path, folder: &Path) -> Result<()> {
    let name = recording.file_name().unwrap_or_default().to_string_lossy();
    let stem = name.split('.').next().unwrap_or_default();
    std::fs::create_dir_all(folder).with_context(|| folder.display().to_string())?;
    for channel in &explanation.channels {
        let file = folder.join(format!("{stem}-{}.svg", channel.channel.name));
        std::fs::write(&file, reports::figure::explained_channel(channel)?)
            .with_context(|| file.display().to_string())?;
    }
    Ok(())
}

fn benchmark(plan: &UndeclaredPlan, output: &Output) -> Result<()> {
    if output.page.is_some() || output.kalibr.is_some() {
        bail!("undeclared is not of one sensor: leave out --page and --kalibr");
    }
    let bar = ProgressBar::new(0);
    if let Ok(style) = ProgressStyle::with_template("{wide_bar} {pos}/{len} recordings, {eta} left") {
        bar.set_style(style);
    }
    let table = plan.run(|done, all| {
        bar.set_length(all as u64);
        bar.set_position(done as u64);
    })?;
    bar.finish_and_clear();
    if let Some(file) = &output.json {
        write_json(&table, file).with_context(|| file.display().to_string())?;
    }
    let mut out = BufWriter::new(io::stdout().lock());
    table.write(&mut out)?;
    out.flush()?;
    Ok(())
}

fn paper(experiment: Reproduction, output: &Output) -> Result<()> {
    if output.page.is_some() || output.kalibr.is_some() {
        bail!("paper is not of one sensor: leave out --page and --kalibr");
    }
    let bar = ProgressBar::new(experiment.seeds);
    let outcome = experiment.run(|done| bar.set_position(done));
    bar.finish_and_clear();
    if let Some(file) = &output.json {
        write_json(&outcome, file).with_context(|| file.display().to_string())?;
    }
    let mut out = BufWriter::new(io::stdout().lock());
    outcome.write(&mut out)?;
    out.flush()?;
    Ok(())
}

fn report_of(input: &Input, recording: &Recording) -> Result<Report> {
    report(recording, input.rate).with_context(|| input.file.display().to_string())
}

fn report(recording: &Recording, rate: Option<f64>) -> Result<Report> {
    Ok(analyze(&measurement(recording, rate)?))
}

fn write(report: &Report, output: &Output) -> Result<()> {
    if let Some(file) = &output.json {
        write_json(report, file).with_context(|| file.display().to_string())?;
    }
    if let Some(file) = &output.kalibr {
        fs::write(file, export::kalibr(report)).with_context(|| file.display().to_string())?;
    }
    let page = output.page.as_ref().map(|dir| page::write(report, dir)).transpose()?;
    let mut out = BufWriter::new(io::stdout().lock());
    terminal::write(report, &mut out)?;
    if let Some(page) = page {
        writeln!(out, "page: {}", page.display())?;
    }
    out.flush()?;
    Ok(())
}

fn write_json(report: &impl Serialize, file: &Path) -> Result<()> {
    let mut out = BufWriter::new(File::create(file)?);
    serde_json::to_writer_pretty(&mut out, report)?;
    writeln!(out)?;
    out.flush()?;
    Ok(())
}

fn note(text: std::fmt::Arguments<'_>) {
    // A note that cannot be shown is no reason to stop.
    let _ = writeln!(io::stderr(), "note: {text}");
}

fn is_broken_pipe(error: &anyhow::Error) -> bool {
    error.downcast_ref::<io::Error>().is_some_and(|e| e.kind() == io::ErrorKind::BrokenPipe)
}
