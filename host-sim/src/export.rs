//! `export`: the noise of a report, or of those of the parts of one sensor, in the file format of another program.

use crate::cli::{ExportArguments, ExportTarget};
use crate::input_file::read_report;
use crate::output::write_export;
use crate::output_files::OutputFiles;
use anyhow::{Context, Result, bail};
use reports::saved_report::SavedReport;
use std::path::PathBuf;

/// Reads the reports and writes the file.
pub(crate) fn run(arguments: &ExportArguments) -> Result<()> {
    let ExportArguments { files, format, axis, force } = arguments;
    let [reports @ .., out] = files.as_slice() else { bail!("no report") };
    // A pipe or a device is not read.
    if out.is_file() && read_report(out).is_ok() {
        bail!("{}: is a report, which would be overwritten; name a file to write after the reports", out.display());
    }
    let outputs = OutputFiles::new(reports.iter().map(PathBuf::as_path), *force);
    outputs.check(out)?;
    let names = || reports.iter().map(|file| file.display().to_string()).collect::<Vec<_>>().join(", ");
    let read: Vec<SavedReport> = reports.iter().map(|file| read_report(file)).collect::<Result<_>>()?;
    let joined = SavedReport::joined(read).with_context(names)?.context("no report")?;
    write_export(&joined, &ExportTarget { format: *format, file: out.clone() }, *axis, &outputs).with_context(names)
}
