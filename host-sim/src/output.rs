//! Where results go: standard output, files, notes and progress on standard error.

use crate::cli::OutputArguments;
use anyhow::{Context, Result};
use indicatif::{ProgressBar, ProgressStyle};
use noise_analysis::report::Report;
use reports::{export, page, terminal};
use serde::Serialize;
use std::fmt;
use std::fs::{self, File};
use std::io::{self, BufWriter, StdoutLock, Write};
use std::path::Path;

/// Prints a report and writes the files that the arguments name.
pub(crate) fn write_report(report: &Report, output: &OutputArguments) -> Result<()> {
    write_json(report, output)?;
    if let Some(file) = &output.kalibr {
        fs::write(file, export::kalibr(report)).with_context(|| file.display().to_string())?;
    }
    let page = output.page.as_ref().map(|dir| page::write(report, dir)).transpose()?;
    print(|out| {
        terminal::write(report, out)?;
        page.map_or(Ok(()), |page| writeln!(out, "page: {}", page.display()))
    })
}

/// Writes a result to the JSON file that the arguments name, if they name one.
pub(crate) fn write_json(result: &impl Serialize, output: &OutputArguments) -> Result<()> {
    let write = |file: &Path| -> Result<()> {
        let mut out = BufWriter::new(File::create(file)?);
        serde_json::to_writer_pretty(&mut out, result)?;
        writeln!(out)?;
        Ok(out.flush()?)
    };
    output.json.as_ref().map_or(Ok(()), |file| write(file).with_context(|| file.display().to_string()))
}

/// Prints to standard output.
pub(crate) fn print(write: impl FnOnce(&mut BufWriter<StdoutLock>) -> io::Result<()>) -> Result<()> {
    let mut out = BufWriter::new(io::stdout().lock());
    write(&mut out)?;
    Ok(out.flush()?)
}

/// A progress bar on standard error, shown on a terminal only.
pub(crate) fn progress_bar(length: u64, template: &str) -> ProgressBar {
    let bar = ProgressBar::new(length);
    match ProgressStyle::with_template(template) {
        Ok(style) => bar.with_style(style),
        Err(_) => bar,
    }
}

/// Prints a note on standard error.
pub(crate) fn note(text: fmt::Arguments<'_>) {
    // The result does not depend on the note: a closed standard error is no reason to stop.
    let _ = writeln!(io::stderr(), "note: {text}");
}
