//! Where results go: standard output, files, notes and progress on standard error.

use crate::cli::OutputArguments;
use anyhow::{Context, Result, bail};
use indicatif::{ProgressBar, ProgressStyle};
use noise_analysis::report::Report;
use recordings::Printable;
use reports::{export, page, terminal};
use serde::Serialize;
use std::fmt;
use std::fs::{self, File, OpenOptions};
use std::io::{self, BufWriter, StdoutLock, Write};
use std::path::Path;

/// Checks that the files which the arguments name can be written and are none of `inputs`, before any work is done.
///
/// # Errors
/// Names the file.
pub(crate) fn check(output: &OutputArguments, inputs: &[&Path]) -> Result<()> {
    for file in [&output.json, &output.kalibr].into_iter().flatten() {
        check_file(file, inputs).with_context(|| file.display().to_string())?;
    }
    if let Some(folder) = &output.page {
        fs::create_dir_all(folder).with_context(|| folder.display().to_string())?;
    }
    if let (Some(json), Some(kalibr)) = (&output.json, &output.kalibr)
        && is_same(json, kalibr)
    {
        bail!("{}: named twice as an output", json.display());
    }
    Ok(())
}

/// Checks that `file` can be written and is none of `inputs`. A file that exists keeps its content.
pub(crate) fn check_file(file: &Path, inputs: &[&Path]) -> Result<()> {
    if inputs.iter().any(|input| is_same(file, input)) {
        bail!("is an input; it would be overwritten");
    }
    // A pipe or a device is not opened twice.
    let existed = file.exists();
    if !existed || file.is_file() || file.is_dir() {
        OpenOptions::new().write(true).create(true).truncate(false).open(file)?;
    }
    if !existed {
        fs::remove_file(file)?;
    }
    Ok(())
}

/// Whether two names are of one file, or would be.
fn is_same(one: &Path, other: &Path) -> bool {
    let resolved = |path: &Path| {
        let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
        path.canonicalize().or_else(|_| folder.canonicalize().map(|it| it.join(path.file_name().unwrap_or_default())))
    };
    matches!((resolved(one), resolved(other)), (Ok(one), Ok(other)) if one == other)
}

/// Prints a report and writes the files that the arguments name. A file that cannot be written does not keep the others, or
/// the report, from being written.
pub(crate) fn write_report(report: &Report, output: &OutputArguments) -> Result<()> {
    let json = write_json(report, output);
    let kalibr = output
        .kalibr
        .as_ref()
        .map_or(Ok(()), |file| fs::write(file, export::kalibr(report)).with_context(|| file.display().to_string()));
    let page = output.page.as_ref().map(|dir| page::write(report, dir)).transpose();
    print(|out| {
        terminal::write(report, out)?;
        match &page {
            Ok(Some(page)) => writeln!(out, "page: {}", page.display()),
            _ => Ok(()),
        }
    })?;
    json.and(kalibr)?;
    page?;
    Ok(())
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
    let _ = writeln!(io::stderr(), "note: {}", Printable(&text.to_string()));
}
