//! `compare`: a report with another, or with the data sheet.

use crate::cli::CompareArguments;
use crate::input_file::read_report;
use crate::output::{check_result, print, write_result};
use crate::output_files::OutputFiles;
use anyhow::{Context, Result};
use recordings::Printable;
use reports::comparison;
use std::path::{Path, PathBuf};

/// Compares the last report of the arguments with the first, or with the data sheet, and prints the table.
pub(crate) fn run(arguments: &CompareArguments) -> Result<()> {
    let CompareArguments { first, second, data_sheet: _, output } = arguments;
    let files = OutputFiles::new([first].into_iter().chain(second).map(PathBuf::as_path), output.force);
    check_result(output, &files)?;
    let (comparison, before, after) = match second {
        Some(second) => {
            let comparison = comparison::of_reports(&read_report(first)?, &read_report(second)?)?;
            (comparison, name(first), name(second))
        }
        None => {
            let comparison =
                comparison::with_data_sheet(&read_report(first)?).with_context(|| first.display().to_string())?;
            (comparison, "data sheet".to_owned(), name(first))
        }
    };
    write_result(&comparison, output, &files)?;
    print(|out| comparison.write(&before, &after, out))
}

fn name(file: &Path) -> String {
    Printable(&file.display().to_string()).to_string()
}
