//! Destinations of results: standard output, files, notes and progress on standard error.

use crate::cli::{ExportTarget, JsonArgument, OutputArguments};
use crate::output_files::{OutputFiles, is_standard_stream};
use anyhow::{Context, Result};
use indicatif::{ProgressBar, ProgressStyle};
use noise_analysis::report::Report;
use recordings::Printable;
use reports::export::{self, AxisChoice};
use reports::figure::{self, Picture};
use reports::json::ReportJson;
use reports::reading::ReadingRecord;
use reports::saved_report::SavedReport;
use reports::terminal::Screen;
use reports::{full_tables, page};
use serde::Serialize;
use std::borrow::Cow;
use std::fmt;
use std::fs;
use std::io::{self, BufWriter, StdoutLock, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};

/// Columns where standard output is no terminal, or does not say how wide it is.
const USUAL_COLUMNS: usize = 80;

/// Checks that the files which the arguments name can be written and are no inputs, before any work is done.
///
/// # Errors
/// Names the file.
pub(crate) fn check(output: &OutputArguments, files: &OutputFiles) -> Result<()> {
    let json = output.json.as_deref().filter(|file| !is_standard_stream(file));
    for (folder, endings) in [(&output.page, &["html"][..]), (&output.pictures, &["svg"])] {
        if let Some(folder) = folder {
            fs::create_dir_all(folder).with_context(|| folder.display().to_string())?;
            files.check_folder(folder, endings)?;
        }
    }
    // A figure that a report with gyros has stands for all of them.
    let [page, picture] = [(&output.page, page::FILE), (&output.pictures, "overview-gyros.svg")]
        .map(|(folder, file)| Some(folder.as_ref()?.join(file)));
    let exports = output.exports.iter().map(|ExportTarget { file, .. }| file.as_path());
    let written: Vec<&Path> =
        json.into_iter().chain(exports).chain(page.as_deref()).chain(picture.as_deref()).collect();
    files.check_all(&written)
}

/// A report, and what was read for it.
#[derive(Debug)]
pub struct Analysed {
    /// The report.
    pub report: Report,
    /// `None` where it is of no recording.
    pub reading: Option<ReadingRecord>,
}

impl From<Report> for Analysed {
    fn from(report: Report) -> Self {
        Self { report, reading: None }
    }
}

impl Analysed {
    /// True if the recording was read to its end.
    #[must_use]
    pub fn is_complete(&self) -> bool {
        self.reading.as_ref().is_none_or(|reading| reading.complete)
    }
}

/// The result is written, and the recording was not read to its end.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub(crate) struct Incomplete(pub(crate) String);

impl Incomplete {
    /// An error if the recording was not read to its end.
    pub(crate) fn check(is_complete: bool) -> Result<()> {
        if is_complete { Ok(()) } else { Err(Self("the recording was not read to its end".to_owned()).into()) }
    }
}

/// Prints a report and writes the files that the arguments name; `source` is the name of the recording. A file that cannot be
/// written does not keep the others, or the report, from being written.
///
/// # Errors
/// A file cannot be written; or the recording was [not read to its end](Incomplete).
pub(crate) fn write_report(
    analysed: &Analysed,
    source: Option<&str>,
    output: &OutputArguments,
    files: &OutputFiles,
) -> Result<()> {
    let Analysed { report, reading } = analysed;
    let as_json = ReportJson::from(report).with_reading(reading.as_ref());
    let json = output.json.as_ref().map_or(Ok(()), |file| write_json(&as_json, file, files));
    let exports = write_exports(report, output, files);
    let write_page = |folder: &PathBuf| -> Result<PathBuf> {
        let file = folder.join(page::FILE);
        files.write(&file, page::html_with_reading(report, source, reading.as_ref()).as_bytes())?;
        Ok(file)
    };
    let page = output.page.as_ref().map(write_page).transpose();
    let pictures = output.pictures.as_ref().map_or(Ok(()), |folder| write_pictures(report, folder, files));
    show(analysed, source, output, page.as_ref().ok().and_then(Option::as_deref))?;
    json.and(exports).and(pictures)?;
    page?;
    Incomplete::check(analysed.is_complete())
}

/// How a recording is called in a report: by the name of its file, without the folder.
pub(crate) fn source_name(file: &Path) -> String {
    if is_standard_stream(file) {
        return "standard input".to_owned();
    }
    let name = file.file_name().unwrap_or(file.as_os_str()).to_string_lossy();
    Printable(&name).to_string()
}

/// Prints a report, and where its page is.
fn show(analysed: &Analysed, source: Option<&str>, output: &OutputArguments, page: Option<&Path>) -> Result<()> {
    let Analysed { report, reading } = analysed;
    // Nothing beside JSON on standard output.
    if output.quiet || output.json.as_deref().is_some_and(is_standard_stream) {
        return Ok(());
    }
    if let Some(sentence) = reading.as_ref().and_then(ReadingRecord::incomplete) {
        print(|out| writeln!(out, "{}", Printable(&sentence)))?;
    }
    if output.full {
        print(|out| full_tables::write(report, source, out))?;
    } else {
        show_screen(report, source)?;
    }
    match page {
        Some(page) => print(|out| writeln!(out, "page: {}", Printable(&page.display().to_string()))),
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

/// Writes every figure of a report as SVG into `folder`.
fn write_pictures(report: &Report, folder: &Path, files: &OutputFiles) -> Result<()> {
    let write = |picture: Picture| files.write(&folder.join(format!("{}.svg", picture.name)), picture.svg.as_bytes());
    figure::pictures(report).into_iter().try_for_each(write)
}

/// Writes the noise of a report in the formats that the arguments name, each as far as the others can be written.
fn write_exports(report: &Report, output: &OutputArguments, files: &OutputFiles) -> Result<()> {
    if output.exports.is_empty() {
        return Ok(());
    }
    let saved = SavedReport::from(report);
    let write = |target: &ExportTarget| write_export(&saved, target, output.axis, files);
    output.exports.iter().map(write).fold(Ok(()), Result::and)
}

/// Writes the noise of a report in a format, and notes what the format wants and the report does not say.
pub(crate) fn write_export(
    report: &SavedReport,
    target: &ExportTarget,
    axis: AxisChoice,
    files: &OutputFiles,
) -> Result<()> {
    let ExportTarget { format, file } = target;
    let export = export::export(report, *format, axis).with_context(|| file.display().to_string())?;
    files.write(file, export.text.as_bytes())?;
    for field in &export.missing {
        note(format_args!("{}: no {field}: the report has no channel with it", file.display()));
    }
    Ok(())
}

/// Writes a result to a JSON file; - is standard output.
pub(crate) fn write_json(result: &impl Serialize, file: &Path, files: &OutputFiles) -> Result<()> {
    if is_standard_stream(file) {
        return print(|out| {
            serde_json::to_writer_pretty(&mut *out, result)?;
            writeln!(out)
        });
    }
    files.write_buffered(file, |out| {
        serde_json::to_writer_pretty(&mut *out, result)?;
        Ok(writeln!(out)?)
    })
}

/// Writes a result to the JSON file that the arguments name, if they name one.
pub(crate) fn write_result(result: &impl Serialize, output: &JsonArgument, files: &OutputFiles) -> Result<()> {
    output.json.as_ref().map_or(Ok(()), |file| write_json(result, file, files))
}

/// Checks that the file of a result can be written and is no input, before any work is done.
pub(crate) fn check_result(output: &JsonArgument, files: &OutputFiles) -> Result<()> {
    let file = output.json.as_ref().filter(|file| !is_standard_stream(file));
    file.map_or(Ok(()), |file| files.check(file))
}

/// Prints to standard output.
pub(crate) fn print(write: impl FnOnce(&mut BufWriter<StdoutLock>) -> io::Result<()>) -> Result<()> {
    let mut out = BufWriter::new(io::stdout().lock());
    write(&mut out)?;
    Ok(out.flush()?)
}

/// Whether this process is the command, and not a program that calls its functions.
static IS_COMMAND: AtomicBool = AtomicBool::new(false);

/// Lets this process show progress.
pub(crate) fn show_progress() {
    IS_COMMAND.store(true, Relaxed);
}

/// A progress bar on standard error, shown by the command on a terminal only.
pub(crate) fn progress_bar(length: u64, template: &str) -> ProgressBar {
    if !IS_COMMAND.load(Relaxed) {
        return ProgressBar::hidden();
    }
    let bar = ProgressBar::new(length);
    match ProgressStyle::with_template(template) {
        Ok(style) => bar.with_style(style),
        Err(_) => bar,
    }
}

/// Prints a note on standard error.
pub(crate) fn note(text: fmt::Arguments<'_>) {
    // The result does not depend on the note: a closed standard error is no reason to stop.
    let _ = writeln!(io::stderr(), "note: {}", Printable(&brief(&text.to_string())));
}

/// Characters of a message, and those of its beginning and its end that are kept of a longer one, which quotes its input.
const MESSAGE: usize = 2000;
const BEGINNING: usize = 1200;
const END: usize = 600;

/// A message without the middle of what is too long to be read.
pub(crate) fn brief(text: &str) -> Cow<'_, str> {
    let length = text.chars().count();
    if length <= MESSAGE {
        return Cow::Borrowed(text);
    }
    let beginning: String = text.chars().take(BEGINNING).collect();
    let end: String = text.chars().skip(length - END).collect();
    Cow::Owned(format!("{beginning} … {end}"))
}
