//! `export`: the noise of a report in the file format of another program.

use crate::cli::{ExportArguments, ExportTarget};
use crate::input_file::read_report;
use crate::output::write_export;
use crate::output_files::OutputFiles;
use anyhow::{Context, Result, bail};

/// Reads the report and writes the file.
pub(crate) fn run(arguments: &ExportArguments) -> Result<()> {
    let ExportArguments { report: from, out, format, axis } = arguments;
    let files = OutputFiles::beside([from.as_path()]);
    files.check(out)?;
    // A pipe or a device is not read.
    if out.is_file() && read_report(out).is_ok() {
        bail!("{}: is a report, which would be overwritten; name a file for {}", out.display(), from.display());
    }
    let report = read_report(from)?;
    write_export(&report, &ExportTarget { format: *format, file: out.clone() }, *axis, &files)
        .with_context(|| from.display().to_string())
}
