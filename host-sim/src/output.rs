//! Where results go: standard output, files, notes and progress on standard error.

use crate::cli::{ExportTarget, JsonArgument, OutputArguments};
use anyhow::{Context, Result, bail};
use indicatif::{ProgressBar, ProgressStyle};
use noise_analysis::report::Report;
use recordings::Printable;
use reports::export::{self, AxisChoice};
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
    let json = output.json.as_deref().filter(|file| !is_standard_output(file));
    // A figure that every report has stands for all of them.
    let [page, picture] = [(&output.page, page::FILE), (&output.pictures, "overview.svg")]
        .map(|(folder, file)| Some(folder.as_ref()?.join(file)));
    for folder in [&output.page, &output.pictures].into_iter().flatten() {
        fs::create_dir_all(folder).with_context(|| folder.display().to_string())?;
    }
    let exports = output.exports.iter().map(|ExportTarget { file, .. }| file.as_path());
    let files: Vec<&Path> = json.into_iter().chain(exports).chain(page.as_deref()).chain(picture.as_deref()).collect();
    for (position, file) in files.iter().enumerate() {
        check_file(file, inputs).with_context(|| file.display().to_string())?;
        if files[..position].iter().any(|other| is_same(file, other)) {
            bail!("{}: named twice as an output", file.display());
        }
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

/// Prints a report and writes the files that the arguments name; `source` is the name of the recording. A file that cannot be
/// written does not keep the others, or the report, from being written.
pub(crate) fn write_report(report: &Report, source: Option<&str>, output: &OutputArguments) -> Result<()> {
    let json = output.json.as_ref().map_or(Ok(()), |file| write_json(report, file));
    let exports = write_exports(report, output);
    let page = output.page.as_ref().map(|dir| page::write(report, dir)).transpose();
    let pictures = output.pictures.as_ref().map_or(Ok(()), |folder| write_pictures(report, folder));
    show(report, source, output, page.as_ref().ok().and_then(Option::as_deref))?;
    json.and(exports).and(pictures)?;
    page?;
    Ok(())
}

/// How a recording is called in a report: by the name of its file, without the folder.
pub(crate) fn source_name(file: &Path) -> String {
    if is_standard_output(file) {
        return "standard input".to_owned();
    }
    let name = file.file_name().unwrap_or(file.as_os_str()).to_string_lossy();
    Printable(&name).to_string()
}

/// Prints a report, and where its page is.
fn show(report: &Report, source: Option<&str>, output: &OutputArguments, page: Option<&Path>) -> Result<()> {
    // Nothing beside JSON on standard output.
    if output.quiet || output.json.as_deref().is_some_and(is_standard_output) {
        return Ok(());
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

/// Writes the noise of a report in the formats that the arguments name, each as far as the others can be written.
fn write_exports(report: &Report, output: &OutputArguments) -> Result<()> {
    if output.exports.is_empty() {
        return Ok(());
    }
    let saved = SavedReport::from(report);
    let write = |target: &ExportTarget| write_export(&saved, target, output.axis);
    output.exports.iter().map(write).fold(Ok(()), Result::and)
}

/// Writes the noise of a report in a format, and notes what the format wants and the report does not say.
pub(crate) fn write_export(report: &SavedReport, target: &ExportTarget, axis: AxisChoice) -> Result<()> {
    let ExportTarget { format, file } = target;
    let export = export::export(report, *format, axis).with_context(|| file.display().to_string())?;
    fs::write(file, export.text).with_context(|| file.display().to_string())?;
    for field in &export.missing {
        note(format_args!("{}: no {field}: the report has no channel with it", file.display()));
    }
    Ok(())
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

/// Checks that the file of a result can be written and is none of `inputs`, before any work is done.
pub(crate) fn check_result(output: &JsonArgument, inputs: &[&Path]) -> Result<()> {
    let file = output.json.as_ref().filter(|file| !is_standard_output(file));
    file.map_or(Ok(()), |file| check_file(file, inputs).with_context(|| file.display().to_string()))
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
