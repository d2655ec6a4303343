//! `compare`: a report with another, or with the data sheet.

use crate::cli::CompareArguments;
use crate::output::{check_result, print, write_result};
use adis16405_driver::GyroRange;
use anyhow::{Context, Result};
use measurement::adis16405;
use recordings::Printable;
use reports::comparison::{self, SpecifiedNoise};
use reports::saved_report::SavedReport;
use std::path::Path;

/// Compares the last report of the arguments with the first, or with the data sheet, and prints the table.
pub(crate) fn run(arguments: &CompareArguments) -> Result<()> {
    let CompareArguments { first, second, data_sheet: _, output } = arguments;
    check_result(output)?;
    let (comparison, before, after) = match second {
        Some(second) => {
            let comparison = comparison::of_reports(&read(first)?, &read(second)?)?;
            (comparison, name(first), name(second))
        }
        None => {
            let comparison = comparison::with_data_sheet(&data_sheet(), &read(first)?)?;
            (comparison, "data sheet".to_owned(), name(first))
        }
    };
    write_result(&comparison, output)?;
    print(|out| comparison.write(&before, &after, out))
}

fn read(file: &Path) -> Result<SavedReport> {
    SavedReport::read(file).with_context(|| file.display().to_string())
}

fn name(file: &Path) -> String {
    Printable(&file.display().to_string()).to_string()
}

/// The ADIS16405's; its noise does not depend on the range.
fn data_sheet() -> Vec<SpecifiedNoise> {
    let specified = |channel: measurement::ChannelProfile| SpecifiedNoise {
        channel: channel.name.to_owned(),
        angle_random_walk: channel.data_sheet.angle_random_walk,
        in_run_bias_stability: channel.data_sheet.in_run_bias_stability,
        rate_random_walk: channel.data_sheet.rate_random_walk,
    };
    adis16405::profile(GyroRange::default().lsb()).channels.into_iter().map(specified).collect()
}
