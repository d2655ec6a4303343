//! `export`: the noise of a report in the file format of another program.

use crate::cli::{ExportArguments, ExportTarget};
use crate::output::{check_file, write_export};
use anyhow::{Context, Result};
use reports::saved_report::SavedReport;

/// Reads the report and writes the file.
pub(crate) fn run(arguments: &ExportArguments) -> Result<()> {
    let ExportArguments { report: from, out, format, axis } = arguments;
    check_file(out, &[from]).with_context(|| out.display().to_string())?;
    let report = SavedReport::read(from).with_context(|| from.display().to_string())?;
    write_export(&report, &ExportTarget { format: *format, file: out.clone() }, *axis)
        .with_context(|| from.display().to_string())
}
