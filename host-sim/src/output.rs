//! Destinations of results: standard output, files, notes and progress on standard error.

use crate::cli::OutputArguments;
use crate::output_files::{OutputFiles, is_standard_stream};
use crate::output_format::{OutputFile, OutputFormat};
use anyhow::{Context, Result, anyhow};
use indicatif::{ProgressBar, ProgressStyle};
use noise_analysis::report::Report;
use recordings::{Printable, ReadingNote};
use reports::export::{self, AxisChoice, ExportFormat};
use reports::figure::{self, Picture};
use reports::json::ReportJson;
use reports::reading::ReadingRecord;
use reports::saved_report::SavedReport;
use reports::terminal::Screen;
use reports::{full_tables, page};
use serde::Serialize;
use std::borrow::Cow;
use std::cell::LazyCell;
use std::fmt;
use std::io::{self, BufWriter, StdoutLock, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};

/// Columns if standard output is no terminal, or its width is unknown.
const USUAL_COLUMNS: usize = 80;

/// Checks before any work that the files of the arguments can be written and are not inputs.
///
/// # Errors
/// The error names the file.
pub(crate) fn check<'a>(outputs: impl IntoIterator<Item = &'a OutputFile>, files: &OutputFiles) -> Result<()> {
    // One figure that every report with gyros has stands for all figures.
    let written = |OutputFile { format, file }: &OutputFile| match format {
        OutputFormat::Figures => figure_file(file, "overview-gyros"),
        _ => file.clone(),
    };
    files.check_all(&outputs.into_iter().map(written).collect::<Vec<_>>())
}

/// The file of one figure: `run1.svg` gives `run1-gyro_x-allan.svg`.
fn figure_file(file: &Path, figure: &str) -> PathBuf {
    file.with_file_name(format!("{}-{figure}.svg", file.file_stem().unwrap_or_default().to_string_lossy()))
}

/// A report, and the record of its reading.
#[derive(Debug)]
pub struct Analysed {
    /// The report.
    pub report: Report,
    /// The record; `None` if the report is not of a recording.
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

/// The error that the result was written although the recording was not read to its end.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub(crate) struct Incomplete(pub(crate) String);

/// Wrong usage that the argument parser does not detect.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub(crate) struct Misuse(pub(crate) String);

impl Incomplete {
    /// An error if the recording was not read to its end.
    pub(crate) fn check(is_complete: bool) -> Result<()> {
        if is_complete { Ok(()) } else { Err(Self("the recording was not read to its end".to_owned()).into()) }
    }
}

/// Prints a report and writes the files of the arguments; `source` is the name of the recording. If a file cannot be written, the report
/// and the other files are still written.
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
    let (mut written, mut pages) = (Ok(()), Vec::new());
    let saved = LazyCell::new(|| SavedReport::new(report));
    for target in &output.outputs {
        let OutputFile { format, file } = target;
        let result = match format {
            OutputFormat::Json => write_json(&ReportJson::new(report, reading.as_ref()), file, files),
            OutputFormat::Page => {
                let page = page::html(report, source, reading.as_ref());
                write_text(&page, file, files).map(|()| pages.push(file))
            }
            OutputFormat::Figures => figure::pictures(report)
                .into_iter()
                .try_for_each(|Picture { name, svg }| write_text(&svg, &figure_file(file, &name), files)),
            OutputFormat::Noise(format) => match &*saved {
                Ok(saved) => write_noise(saved, *format, file, output.axis, files),
                Err(error) => Err(anyhow!("{error}")),
            },
        };
        written = written.and(result);
    }
    if !output.quiet && !output.prints_to_standard_output() {
        show(analysed, source, output.full)?;
        for page in pages {
            print(|out| writeln!(out, "page: {}", Printable(&page.display().to_string())))?;
        }
    }
    written?;
    Incomplete::check(analysed.is_complete())
}

/// The name of a recording in a report: its file name without the folder.
pub(crate) fn source_name(file: &Path) -> String {
    if is_standard_stream(file) {
        return "standard input".to_owned();
    }
    let name = file.file_name().unwrap_or(file.as_os_str()).to_string_lossy();
    Printable(&name).to_string()
}

/// Prints a report.
fn show(analysed: &Analysed, source: Option<&str>, is_full: bool) -> Result<()> {
    let Analysed { report, reading } = analysed;
    if let Some(sentence) = reading.as_ref().and_then(ReadingRecord::incomplete) {
        print(|out| writeln!(out, "{}", Printable(&sentence)))?;
    }
    if is_full { print(|out| full_tables::write(report, source, out)) } else { show_screen(report, source) }
}

/// Prints the screen of a report on the recording `source`.
pub(crate) fn show_screen(report: &Report, source: Option<&str>) -> Result<()> {
    // The stream removes colour if standard output is no terminal, or NO_COLOR is set.
    let mut out = anstream::AutoStream::auto(io::stdout().lock());
    Screen { report, source, columns: columns() }.write(&mut out)?;
    Ok(out.flush()?)
}

/// Columns of the terminal.
fn columns() -> usize {
    console::Term::stdout().size_checked().map_or(USUAL_COLUMNS, |(_, columns)| usize::from(columns))
}

/// Writes a text; - is standard output.
fn write_text(text: &str, file: &Path, files: &OutputFiles) -> Result<()> {
    if is_standard_stream(file) {
        return print(|out| out.write_all(text.as_bytes()));
    }
    files.write(file, text.as_bytes())
}

/// Writes the noise of a report in a format, and prints which values of the format the report lacks.
pub(crate) fn write_noise(
    report: &SavedReport,
    format: ExportFormat,
    file: &Path,
    axis: AxisChoice,
    files: &OutputFiles,
) -> Result<()> {
    let export = export::export(report, format, axis).with_context(|| file.display().to_string())?;
    write_text(&export.text, file, files)?;
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

/// Prints to standard output.
pub(crate) fn print(write: impl FnOnce(&mut BufWriter<StdoutLock>) -> io::Result<()>) -> Result<()> {
    let mut out = BufWriter::new(io::stdout().lock());
    write(&mut out)?;
    Ok(out.flush()?)
}

/// True if this process is the command, false if another program calls its functions.
static IS_COMMAND: AtomicBool = AtomicBool::new(false);

/// Enables progress bars in this process.
pub(crate) fn show_progress() {
    IS_COMMAND.store(true, Relaxed);
}

/// A progress bar on standard error, visible only for the command on a terminal.
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

/// Prints notes on a file, the names of many columns as a number.
pub(crate) fn notes_of_file(notes: &[ReadingNote]) {
    for of in notes {
        let names = if of.has_many_columns() { " (`inspect`, .json and .html have their names)" } else { "" };
        note(format_args!("{}{names}", of.in_short()));
    }
}

/// Prints a note on standard error.
pub(crate) fn note(text: fmt::Arguments<'_>) {
    // The result does not depend on the note, so a closed standard error is not an error.
    let _ = writeln!(io::stderr(), "note: {}", Printable(&brief(&text.to_string())));
}

/// Most characters of a message, and the characters kept at the beginning and the end of a longer one, which quotes its
/// input.
const MESSAGE: usize = 2000;
const BEGINNING: usize = 1200;
const END: usize = 600;

/// A message, without its middle if it is too long to be read.
pub(crate) fn brief(text: &str) -> Cow<'_, str> {
    let length = text.chars().count();
    if length <= MESSAGE {
        return Cow::Borrowed(text);
    }
    let beginning: String = text.chars().take(BEGINNING).collect();
    let end: String = text.chars().skip(length - END).collect();
    Cow::Owned(format!("{beginning} … {end}"))
}
