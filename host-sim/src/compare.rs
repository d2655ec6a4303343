//! `compare`: recordings with each other or with one recorded while motors run, and a report with another or with the
//! data sheet.

use crate::analyze::SeveralReadings;
use crate::cli::CompareArguments;
use crate::input_file::{Reports, is_report};
use crate::output::{self, Incomplete, print, write_json};
use crate::output_files::{OutputFiles, is_standard_stream};
use crate::several_recordings::write_several;
use anyhow::{Context, Result, bail};
use measurement::Measurement;
use recordings::Printable;
use reports::comparison;
use std::path::{Path, PathBuf};

/// Compares the recordings or the reports of the arguments, and prints the differences.
pub(crate) fn run(arguments: &CompareArguments) -> Result<()> {
    let CompareArguments { recording, more, running, data_sheet, result } = arguments;
    let files: Vec<&Path> = [&recording.input.file].into_iter().chain(more).map(PathBuf::as_path).collect();
    let sensor = recording.input.sensor.as_deref().map(Path::new);
    let inputs = files.iter().copied().chain(running.as_deref()).chain(sensor);
    let outputs = OutputFiles::new(inputs, result.force);
    output::check(&result.output, &outputs)?;
    if *data_sheet || files.iter().any(|file| is_report(file)) {
        return compare_reports(&files, arguments, &outputs);
    }
    let mut reading = SeveralReadings::default();
    let still: Vec<Measurement> =
        files.iter().map(|file| reading.read(&recording.of_file(file))).collect::<Result<_>>()?;
    let running = running.as_deref().map(|file| reading.read(&recording.of_file(file))).transpose()?;
    write_several(&still, running.as_ref(), result.file(), false, &outputs)?;
    Incomplete::check(reading.are_complete())
}

/// Compares the last report with the first, or with the data sheet, and prints the table. A recording is analysed
/// first.
fn compare_reports(files: &[&Path], arguments: &CompareArguments, outputs: &OutputFiles) -> Result<()> {
    let CompareArguments { recording, running, result, .. } = arguments;
    if running.is_some() {
        bail!("--running compares recordings, and not reports");
    }
    let mut reports = Reports::default();
    let mut read = |file: &Path| reports.read(&recording.of_file(file));
    let (comparison, before, after) = match *files {
        [first, second] => (comparison::of_reports(&read(first)?, &read(second)?)?, name(first), name(second)),
        [first] => {
            let comparison = comparison::with_data_sheet(&read(first)?).with_context(|| first.display().to_string())?;
            (comparison, "data sheet".to_owned(), name(first))
        }
        _ => bail!("{} reports: two are compared", files.len()),
    };
    result.file().map_or(Ok(()), |file| write_json(&comparison, file, outputs))?;
    if !result.file().is_some_and(is_standard_stream) {
        print(|out| comparison.write(&before, &after, out))?;
    }
    reports.check_complete()
}

fn name(file: &Path) -> String {
    Printable(&file.display().to_string()).to_string()
}
