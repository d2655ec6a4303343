//! `export`: the noise of a report in the file format of another program.

use crate::cli::ExportArguments;
use crate::output::{check_file, note};
use anyhow::{Context, Result};
use reports::export;
use reports::saved_report::SavedReport;
use std::fs;

/// Reads the report, writes the file, and notes what the format wants and the report does not say.
pub(crate) fn run(arguments: &ExportArguments) -> Result<()> {
    let ExportArguments { report: from, out, format, axis } = arguments;
    check_file(out, &[from]).with_context(|| out.display().to_string())?;
    let report = SavedReport::read(from).with_context(|| from.display().to_string())?;
    let export = export::export(&report, *format, *axis).with_context(|| from.display().to_string())?;
    for field in &export.missing {
        note(format_args!("{}: no {field}: the report has no channel with it", out.display()));
    }
    fs::write(out, export.text).with_context(|| out.display().to_string())
}
