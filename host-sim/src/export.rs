//! `export`: the noise of a report or a recording, or of several that are parts of one sensor, in the file format of another program.

use crate::cli::ExportArguments;
use crate::input_file::Reports;
use crate::output::{self, write_noise};
use crate::output_files::OutputFiles;
use crate::output_format::{OutputFile, OutputFormat};
use anyhow::{Context, Result};
use reports::saved_report::SavedReport;
use std::path::{Path, PathBuf};

/// Reads the reports, analyses the recordings, and writes the files.
pub(crate) fn run(arguments: &ExportArguments) -> Result<()> {
    let ExportArguments { recording, more, outputs, axis, force } = arguments;
    let inputs: Vec<&Path> = [&recording.input.file].into_iter().chain(more).map(PathBuf::as_path).collect();
    let sensor = recording.input.sensor.as_deref().map(Path::new);
    let files = OutputFiles::new(inputs.iter().copied().chain(sensor), *force);
    output::check(outputs, &files)?;
    let names = || inputs.iter().map(|file| file.display().to_string()).collect::<Vec<_>>().join(", ");
    let mut reports = Reports::default();
    let read: Vec<SavedReport> =
        inputs.iter().map(|file| reports.read(&recording.of_file(file))).collect::<Result<_>>()?;
    let joined = SavedReport::joined(read).with_context(names)?.context("no report")?;
    let write = |OutputFile { format, file }: &OutputFile| match format {
        OutputFormat::Noise(format) => write_noise(&joined, *format, file, *axis, &files).with_context(names),
        _ => Ok(()),
    };
    outputs.iter().map(write).fold(Ok(()), Result::and)?;
    reports.check_complete()
}
