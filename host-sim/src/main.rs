//! The command `host-sim`: runs a subcommand, prints its error, sets the exit code.

mod analyze;
mod cli;
mod explain;
mod losses;
mod output;
mod paper;
mod record;
mod undeclared;

use anyhow::{Context, Result};
use clap::Parser;
use cli::{Cli, Command};
use host_sim::{monitor, uf2};
use recordings::serial::{self, SerialLink};
use std::fs;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::{Duration, Instant};

/// Folder of the page if none is named.
const DEFAULT_PAGE: &str = "report";

/// Exit code 0 for success, 1 for an error; the argument parser ends the process with 2 for wrong usage.
fn main() -> ExitCode {
    match run(Cli::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        // The reader of standard output has closed it, as `head` does.
        Err(error) if is_broken_pipe(&error) => ExitCode::SUCCESS,
        Err(error) => {
            // Where standard error is closed too, the exit code alone shows the error.
            let _ = writeln!(io::stderr(), "error: {error:#}");
            ExitCode::FAILURE
        }
    }
}

fn run(Cli { command, simulate, mut output }: Cli) -> Result<()> {
    let report = match command {
        None => {
            output.page.get_or_insert_with(|| PathBuf::from(DEFAULT_PAGE));
            record::simulate(&simulate.simulation(3600.0))?
        }
        Some(Command::Analyze(arguments)) => analyze::analyze_table(&arguments)?,
        Some(Command::Replay(arguments)) => analyze::analyze_replay(&arguments)?,
        Some(Command::Record { out, port: Some(port), baud, simulate }) => {
            record::record_device(&out, &port, baud, simulate.seconds.unwrap_or(record::DEFAULT_S))?
        }
        Some(Command::Record { out, simulate, .. }) => {
            record::record_simulation(&out, &simulate.simulation(record::DEFAULT_S))?
        }
        Some(Command::Explain(arguments)) => return explain::run(&arguments, &output),
        Some(Command::Undeclared(arguments)) => return undeclared::run(&arguments.plan(), &output),
        Some(Command::Paper { seeds, first_seed }) => return paper::run(seeds, first_seed, &output),
        Some(Command::Losses(arguments)) => return losses::run(&arguments.plan(), &output),
        Some(Command::Monitor { port, baud, send, seconds }) => {
            return show_messages(&port, baud, &send, seconds).with_context(|| port.clone());
        }
        Some(Command::Uf2 { elf, out }) => return convert_image(&elf, &out),
    };
    output::write_report(&report, &output)
}

fn show_messages(port: &str, baud: u32, commands: &[String], seconds: Option<f64>) -> Result<()> {
    let deadline = seconds.map(Duration::try_from_secs_f64).transpose()?.map(|time| Instant::now() + time);
    let mut link = SerialLink::new(serial::open(port, baud)?);
    for command in commands {
        link.send_command(command)?;
    }
    monitor::show(&mut link, deadline, &mut io::stdout().lock())?;
    Ok(())
}

fn convert_image(elf: &Path, out: &Path) -> Result<()> {
    let image = fs::read(elf).with_context(|| elf.display().to_string())?;
    let uf2 = uf2::from_elf(&image).with_context(|| elf.display().to_string())?;
    fs::write(out, uf2).with_context(|| out.display().to_string())
}

fn is_broken_pipe(error: &anyhow::Error) -> bool {
    error.downcast_ref::<io::Error>().is_some_and(|e| e.kind() == io::ErrorKind::BrokenPipe)
}
