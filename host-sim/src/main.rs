//! The command `host-sim`: runs a subcommand, prints its error, sets the exit code.

#[cfg(feature = "mimalloc")]
mod allocator;
mod analyze;
mod cli;
mod compare;
mod convert;
mod export;
mod input_file;
mod inspect;
mod interrupt;
mod live;
mod many;
mod output;
mod output_files;
mod progress;
mod record;
mod recording_file;
mod simulate;
mod streaming;
mod tip;

use anyhow::{Context, Result};
use clap::{CommandFactory, Parser};
use cli::{Cli, Command, MonitorArguments, ReplayArguments};
use host_sim::monitor;
use inspect::Question;
use live::{DeviceSource, GrowingRecording};
use output::Incomplete;
use output_files::OutputFiles;
use recordings::Printable;
use std::io::{self, Write};
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::{Duration, Instant};

/// Folder of the page if none is named.
const DEFAULT_PAGE: &str = "report";

/// Exit code of a result of a recording that was not read to its end.
const INCOMPLETE: u8 = 3;

/// Exit code 0 for success, 1 for an error, 3 for a result of a recording that was not read to its end; the argument parser ends the process
/// with 2 for wrong usage.
fn main() -> ExitCode {
    let cli = Cli::try_parse().unwrap_or_else(|mut error| {
        tip::suggest(&mut error);
        error.exit()
    });
    #[cfg(feature = "mimalloc")]
    allocator::prepare(cli.command.is_none());
    match interrupt::watch().and_then(|()| run(cli)) {
        Ok(()) => ExitCode::SUCCESS,
        // The reader of standard output has closed it, as `head` does.
        Err(error) if is_broken_pipe(&error) => ExitCode::SUCCESS,
        Err(error) if error.is::<Incomplete>() => {
            let _ = writeln!(io::stderr(), "warning: {}", Printable(&error.to_string()));
            ExitCode::from(INCOMPLETE)
        }
        Err(error) => {
            // Where standard error is closed too, the exit code alone shows the error.
            let _ = writeln!(io::stderr(), "error: {}", Printable(&output::brief(&format!("{error:#}"))));
            if let Some(tip) = tip::tip(&error) {
                let _ = writeln!(io::stderr(), "  tip: {}", Printable(&tip));
            }
            if let Some(question) = error.downcast_ref::<Question>() {
                let _ = io::stderr().write_all(question.text.as_bytes());
            }
            ExitCode::FAILURE
        }
    }
}

fn run(Cli { command, simulate, mut output }: Cli) -> Result<()> {
    match command {
        None => {
            output.page.get_or_insert_with(|| PathBuf::from(DEFAULT_PAGE));
            let files = OutputFiles::new([], output.force);
            output::check(&output, &files)?;
            output::write_report(&record::simulate(&simulate.simulation(3600.0))?.into(), None, &output, &files)
        }
        Some(Command::Analyze(arguments)) => analyze::run(&arguments),
        Some(Command::Inspect(arguments)) => inspect::run(&arguments, analyze::read_measurement),
        Some(Command::Replay(arguments)) => {
            let ReplayArguments { file, output, .. } = &arguments;
            let files = OutputFiles::new([file.as_path()], output.force);
            output::check(output, &files)?;
            let report = analyze::analyze_replay(&arguments)?;
            output::write_report(&report.into(), Some(&output::source_name(file)), output, &files)
        }
        Some(Command::Bench(arguments)) => record::bench_device(&arguments),
        Some(Command::Record { out, port, baud, seconds, output }) => {
            OutputFiles::new([], output.force).check(&out)?;
            // The log is read again: nothing else is written to it.
            let files = OutputFiles::new([out.as_path()], output.force);
            output::check(&output, &files)?;
            let report = record::record_device(&out, &port, baud, seconds)?;
            output::write_report(&report.into(), Some(&output::source_name(&out)), &output, &files)
        }
        Some(Command::Export(arguments)) => export::run(&arguments),
        Some(Command::Compare(arguments)) => compare::run(&arguments),
        Some(Command::Convert(arguments)) => convert::run(&arguments),
        Some(Command::Simulate(arguments)) => simulate::run(&arguments),
        Some(Command::Completions { shell }) => {
            // Into memory first: the generator panics where its output is closed.
            let mut script = Vec::new();
            clap_complete::generate(shell, &mut Cli::command(), "host-sim", &mut script);
            output::print(|out| out.write_all(&script))
        }
        Some(Command::Monitor(arguments)) => monitor_source(&arguments),
    }
}

/// Shows a device or a recording live, or in lines where there is no terminal.
fn monitor_source(arguments: &MonitorArguments) -> Result<()> {
    let MonitorArguments { source, seconds, speed, .. } = arguments;
    let deadline = seconds
        .map(|seconds| {
            let duration = Duration::try_from_secs_f64(seconds).ok();
            let deadline = duration.and_then(|duration| Instant::now().checked_add(duration));
            deadline.with_context(|| format!("a duration of {seconds} s: it must be positive and finite, and no age"))
        })
        .transpose()?;
    if !source.is_file() && !source.is_dir() {
        return monitor_device(arguments, deadline).with_context(|| source.display().to_string());
    }
    let name = source.file_name().unwrap_or_default().to_string_lossy();
    let name = Printable(&name).to_string();
    let mut recording = GrowingRecording::new(analyze::read_measurement(&arguments.recording())?, name.clone(), *speed);
    let report = if live::has_terminal() {
        live::show(&mut recording, deadline)?;
        recording.into_report()
    } else {
        recording.write_lines(deadline, &mut io::stdout().lock())?
    };
    report.map_or(Ok(()), |report| output::show_screen(&report, Some(&name)))
}

fn monitor_device(arguments: &MonitorArguments, deadline: Option<Instant>) -> Result<()> {
    let MonitorArguments { source, baud, send, .. } = arguments;
    let port = source.to_str().context("a name of a port that is not UTF-8")?;
    let mut cable = record::open_link(port, *baud)?;
    for command in send {
        cable.send_command(command)?;
    }
    if live::has_terminal() {
        live::show(&mut DeviceSource::new(&mut cable, port.to_owned()), deadline)?;
        return output::print(|out| writeln!(out, "{}", monitor::summary(&cable.counters())));
    }
    Ok(monitor::show(&mut cable, deadline, monitor::LONG_SILENCE, &mut io::stdout().lock())?)
}

fn is_broken_pipe(error: &anyhow::Error) -> bool {
    error.downcast_ref::<io::Error>().is_some_and(|e| e.kind() == io::ErrorKind::BrokenPipe)
}
