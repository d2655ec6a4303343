//! `compare`: recordings with each other, and with one of motors that run; a report with another, or with the data sheet.

use crate::analyze::SeveralReadings;
use crate::cli::{CompareArguments, InputArguments, RecordingArguments};
use crate::input_file::{is_report, read_report};
use crate::output::{Incomplete, check_result, print, write_result};
use crate::output_files::OutputFiles;
use crate::several_recordings::write_several;
use anyhow::{Context, Result, bail};
use measurement::Measurement;
use recordings::Printable;
use reports::comparison;
use std::path::{Path, PathBuf};

/// Compares the recordings or the reports of the arguments, and prints what differs.
pub(crate) fn run(arguments: &CompareArguments) -> Result<()> {
    let CompareArguments { recording, more, running, data_sheet, output } = arguments;
    let files: Vec<&Path> = [&recording.input.file].into_iter().chain(more).map(PathBuf::as_path).collect();
    let sensor = recording.input.sensor.as_deref().map(Path::new);
    let inputs = files.iter().copied().chain(running.as_deref()).chain(sensor);
    let outputs = OutputFiles::new(inputs, output.force);
    check_result(output, &outputs)?;
    if files.iter().any(|file| is_report(file)) {
        return compare_reports(&files, *data_sheet, arguments, &outputs);
    }
    if *data_sheet {
        bail!("--data-sheet compares a report, which `analyze --json` writes");
    }
    if files.len() == 1 && running.is_none() {
        bail!("one recording: name another, or --running FILE");
    }
    let of_file = |file: &Path| RecordingArguments {
        input: InputArguments { file: file.to_owned(), ..recording.input.clone() },
        ..recording.clone()
    };
    let mut reading = SeveralReadings::default();
    let still: Vec<Measurement> = files.iter().map(|file| reading.read(&of_file(file))).collect::<Result<_>>()?;
    let running = running.as_deref().map(|file| reading.read(&of_file(file))).transpose()?;
    write_several(&still, running.as_ref(), output.json.as_deref(), false, &outputs)?;
    Incomplete::check(reading.are_complete())
}

/// Compares the last report with the first, or with the data sheet, and prints the table.
fn compare_reports(
    files: &[&Path],
    data_sheet: bool,
    arguments: &CompareArguments,
    outputs: &OutputFiles,
) -> Result<()> {
    let CompareArguments { running, output, .. } = arguments;
    if running.is_some() {
        bail!("--running compares recordings, and not reports");
    }
    let (comparison, before, after) = match *files {
        [first, second] => {
            let comparison = comparison::of_reports(&read_report(first)?, &read_report(second)?)?;
            (comparison, name(first), name(second))
        }
        [first] if data_sheet => {
            let comparison =
                comparison::with_data_sheet(&read_report(first)?).with_context(|| first.display().to_string())?;
            (comparison, "data sheet".to_owned(), name(first))
        }
        [_] => bail!("one report: name another, or --data-sheet"),
        _ => bail!("{} reports: two are compared", files.len()),
    };
    write_result(&comparison, output, outputs)?;
    print(|out| comparison.write(&before, &after, out))
}

fn name(file: &Path) -> String {
    Printable(&file.display().to_string()).to_string()
}
