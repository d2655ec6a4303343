//! Where results go: standard output, files, notes and progress on standard error.

use crate::cli::{JsonArgument, OutputArguments};
use anyhow::{Context, Result, bail};
use indicatif::{ProgressBar, ProgressStyle};
use noise_analysis::report::Report;
use recordings::Printable;
use reports::export::{self, AxisChoice, ExportFormat};
use reports::raster::Rasterizer;
use reports::saved_report::SavedReport;
use reports::terminal::Screen;
use reports::{figure, full_tables, page};
use serde::Serialize;
use std::fmt;
use std::fs::{self, File, OpenOptions};
use std::io::{self, BufWriter, StdoutLock, Write};
use std::path::Path;

/// Columns where standard output is no terminal, or does not say how wide it is.
const USUAL_COLUMNS: usize = 80;

/// Checks that the files which the arguments name can be written and are none of `inputs`, before any work is done.
///
/// # Errors
/// Names the file.
pub(crate) fn check(output: &OutputArguments, inputs: &[&Path]) -> Result<()> {
    let json = output.json.as_ref().filter(|file| !is_standard_output(file));
    for file in [json, output.kalibr.as_ref()].into_iter().flatten() {
        check_file(file, inputs).with_context(|| file.display().to_string())?;
    }
    for folder in [&output.page, &output.pictures].into_iter().flatten() {
        fs::create_dir_all(folder).with_context(|| folder.display().to_string())?;
    }
    if let (Some(json), Some(kalibr)) = (&output.json, &output.kalibr)
        && is_same(json, kalibr)
    {
        bail!("{}: named twice as an output", json.display());
    }
    Ok(())
}

/// Whether the name of a file is that of standard output.
pub(crate) fn is_standard_output(file: &Path) -> bool {
    file.as_os_str() == "-"
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

/// Prints a report on the recording in the file `source`, if it is of one, and writes the files that the arguments name. A file that cannot be written does not keep the others, or
/// the report, from being written.
pub(crate) fn write_report(report: &Report, source: Option<&Path>, output: &OutputArguments) -> Result<()> {
    let json = output.json.as_ref().map_or(Ok(()), |file| write_json(report, file));
    let kalibr = output.kalibr.as_ref().map_or(Ok(()), |file| write_kalibr(report, file));
    let page = output.page.as_ref().map(|dir| page::write(report, dir)).transpose();
    let pictures = output.pictures.as_ref().map_or(Ok(()), |folder| write_pictures(report, folder));
    show(report, source, output, page.as_ref().ok().and_then(Option::as_deref))?;
    json.and(kalibr).and(pictures)?;
    page?;
    Ok(())
}

/// Prints a report, and where its page is.
fn show(report: &Report, source: Option<&Path>, output: &OutputArguments, page: Option<&Path>) -> Result<()> {
    // Nothing beside JSON on standard output.
    if output.quiet || output.json.as_deref().is_some_and(is_standard_output) {
        return Ok(());
    }
    if output.full {
        print(|out| full_tables::write(report, out))?;
    } else {
        let name = source.and_then(Path::file_name).map(|name| Printable(&name.to_string_lossy()).to_string());
        show_screen(report, name.as_deref())?;
    }
    match page {
        Some(page) => print(|out| writeln!(out, "page: {}", page.display())),
        None => Ok(()),
    }
}

/// Prints the screen of a report on the recording `source`.
pub(crate) fn show_screen(report: &Report, source: Option<&str>) -> Result<()> {
    // Without colour where standard output is no terminal, or NO_COLOR is set.
    let mut out = anstream::AutoStream::auto(io::stdout().lock());
    Screen { report, source, columns: columns() }.write(&mut out)?;
    Ok(out.flush()?)
}

/// Columns of the terminal.
fn columns() -> usize {
    console::Term::stdout().size_checked().map_or(USUAL_COLUMNS, |(_, columns)| usize::from(columns))
}

/// Writes every figure of a report as SVG and PNG into `folder`.
fn write_pictures(report: &Report, folder: &Path) -> Result<()> {
    let pictures = figure::pictures(report);
    let write = |name: &str, ending: &str, content: &[u8]| {
        let file = folder.join(format!("{name}.{ending}"));
        fs::write(&file, content).with_context(|| file.display().to_string())
    };
    for picture in &pictures {
        write(&picture.name, "svg", picture.svg.as_bytes())?;
    }
    let rasterizer = Rasterizer::new()?;
    pictures.iter().try_for_each(|picture| write(&picture.name, "png", &rasterizer.png(&picture.svg)?))
}

/// Writes the noise model for Kalibr, the root mean square over the axes.
fn write_kalibr(report: &Report, file: &Path) -> Result<()> {
    let write = || -> Result<()> {
        let export = export::export(&SavedReport::from(report), ExportFormat::Kalibr, AxisChoice::Rms)?;
        Ok(fs::write(file, export.text)?)
    };
    write().with_context(|| file.display().to_string())
}

/// Writes a result to a JSON file; - is standard output.
pub(crate) fn write_json(result: &impl Serialize, file: &Path) -> Result<()> {
    let write = || -> Result<()> {
        if is_standard_output(file) {
            return print(|out| {
                serde_json::to_writer_pretty(&mut *out, result)?;
                writeln!(out)
            });
        }
        let mut out = BufWriter::new(File::create(file)?);
        serde_json::to_writer_pretty(&mut out, result)?;
        writeln!(out)?;
        Ok(out.flush()?)
    };
    write().with_context(|| file.display().to_string())
}

/// Writes a result to the JSON file that the arguments name, if they name one.
pub(crate) fn write_result(result: &impl Serialize, output: &JsonArgument) -> Result<()> {
    output.json.as_ref().map_or(Ok(()), |file| write_json(result, file))
}

/// Checks that the file of a result can be written, before any work is done.
pub(crate) fn check_result(output: &JsonArgument) -> Result<()> {
    let file = output.json.as_ref().filter(|file| !is_standard_output(file));
    file.map_or(Ok(()), |file| check_file(file, &[]).with_context(|| file.display().to_string()))
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
