//! The command: runs a subcommand, prints its error, returns the exit code.

use crate::cli::{self, Cli, Command, MonitorArguments, ReplayArguments};
use crate::inspect::{self, Question};
use crate::output::{self, Incomplete, Misuse};
use crate::output_files::OutputFiles;
use crate::output_format::{OutputFile, OutputFormat};
use crate::{analyze, batch, compare, convert, export, interrupt, live, monitor, record, simulate, tip};
use anyhow::{Context, Result};
use clap::{CommandFactory, Parser};
use observatory::message_text::summary;
use observatory::recording_report::PROGRAM;
use recordings::Printable;
use std::ffi::OsString;
use std::io::{self, Write};
use std::time::{Duration, Instant};

/// The page that `demo` writes if no output is given.
const DEFAULT_PAGE: &str = "report.html";

/// Exit codes.
const SUCCESS: u8 = 0;
const FAILURE: u8 = 1;
const WRONG_USAGE: u8 = 2;
/// Exit code if the result is of a recording that was not read to its end.
const INCOMPLETE: u8 = 3;

/// Runs the command of `arguments`, the first of which is the name of the program. `prepare` is called before any other thread runs, with
/// true if a simulation follows.
///
/// Exit code 0 for success, 1 for an error, 2 for wrong usage, 3 for a result of a recording that was not read to its end.
#[must_use]
pub fn run(arguments: Vec<OsString>, prepare: impl FnOnce(bool)) -> u8 {
    let arguments = cli::with_subcommand(arguments);
    output::show_progress();
    cli::set_typed(&arguments);
    let cli = match Cli::try_parse_from(arguments) {
        Ok(cli) => cli,
        Err(mut error) => {
            tip::suggest(&mut error);
            // If standard error is closed too, only the exit code shows the error.
            let _ = error.print();
            return u8::try_from(error.exit_code()).unwrap_or(FAILURE);
        }
    };
    prepare(matches!(cli.command, Command::Demo { .. }));
    match interrupt::watch().and_then(|()| run_subcommand(cli)) {
        Ok(()) => SUCCESS,
        // The reader of standard output may close it, as `head` does.
        Err(error) if is_broken_pipe(&error) => SUCCESS,
        Err(error) if error.is::<Incomplete>() => {
            let _ = writeln!(io::stderr(), "warning: {}", Printable(&error.to_string()));
            INCOMPLETE
        }
        Err(error) => {
            // If standard error is closed too, only the exit code shows the error.
            let _ = writeln!(io::stderr(), "error: {}", Printable(&output::brief(&format!("{error:#}"))));
            if let Some(tip) = tip::tip(&error) {
                let _ = writeln!(io::stderr(), "  tip: {}", Printable(&tip));
            }
            if let Some(question) = error.downcast_ref::<Question>() {
                let _ = write!(io::stderr(), "{}{}", question.text, question.hint);
            }
            if error.chain().any(|cause| cause.is::<Misuse>()) { WRONG_USAGE } else { FAILURE }
        }
    }
}

fn run_subcommand(Cli { command }: Cli) -> Result<()> {
    match command {
        Command::Demo { simulate, mut output } => {
            if output.outputs.is_empty() {
                output.outputs.push(OutputFile { format: OutputFormat::Page, file: DEFAULT_PAGE.into() });
            }
            let files = OutputFiles::new([], output.force);
            output::check(&output.outputs, &files)?;
            output::write_report(&record::simulate(&simulate.simulation(3600.0))?.into(), None, &output, &files)
        }
        Command::Analyze(arguments) => analyze::run(&arguments),
        Command::Inspect(arguments) => inspect::run(&arguments, analyze::read_measurement),
        Command::Replay(arguments) => {
            let ReplayArguments { file, output, .. } = &arguments;
            let files = OutputFiles::new([file.as_path()], output.force);
            output::check(&output.outputs, &files)?;
            let (report, is_complete) = analyze::analyze_replay(&arguments)?;
            output::write_report(&report.into(), Some(&output::source_name(file)), output, &files)?;
            Incomplete::check(is_complete)
        }
        Command::Bench(arguments) => record::bench_device(&arguments),
        Command::Record { out, port, baud, seconds, output } => {
            OutputFiles::new([], output.force).check(&out)?;
            // The log is read again for the report: no other output may be written to it.
            let files = OutputFiles::new([out.as_path()], output.force);
            output::check(&output.outputs, &files)?;
            let report = record::record_device(&out, &port, baud, seconds)?;
            output::write_report(&report.into(), Some(&output::source_name(&out)), &output, &files)
        }
        Command::Export(arguments) => export::run(&arguments),
        Command::Batch(arguments) => batch::run(&arguments),
        Command::Compare(arguments) => compare::run(&arguments),
        Command::Convert(arguments) => convert::run(&arguments),
        Command::Simulate(arguments) => simulate::run(&arguments),
        Command::Completions { shell } => {
            // The script is made in memory first: the generator panics if its output is closed.
            let mut script = Vec::new();
            clap_complete::generate(shell, &mut Cli::command(), PROGRAM, &mut script);
            output::print(|out| out.write_all(&script))
        }
        Command::Monitor(arguments) => monitor_device(&arguments),
    }
}

/// Shows a device live, or as lines if there is no terminal.
fn monitor_device(arguments: &MonitorArguments) -> Result<()> {
    let MonitorArguments { port, baud, send, seconds } = arguments;
    // The end cannot be later than the clock's last time.
    let end = |seconds: f64| Instant::now().checked_add(Duration::try_from_secs_f64(seconds).ok()?);
    let deadline = seconds.and_then(end);
    let show = || -> Result<()> {
        let mut cable = record::open_link(port, *baud)?;
        for command in send {
            cable.send_command(command)?;
        }
        if live::has_terminal() {
            live::show(&mut cable, port, deadline)?;
            return output::print(|out| writeln!(out, "{}", summary(&cable.counters())));
        }
        Ok(monitor::show(&mut cable, deadline, monitor::LONG_SILENCE, &mut io::stdout().lock())?)
    };
    show().with_context(|| port.to_owned())
}

fn is_broken_pipe(error: &anyhow::Error) -> bool {
    error.downcast_ref::<io::Error>().is_some_and(|e| e.kind() == io::ErrorKind::BrokenPipe)
}
