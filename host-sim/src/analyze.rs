//! `analyze` and `replay`: the report of a recording in a file, and the summary of several.

use crate::cli::{AnalyzeArguments, GyroRangeArgument, InputArguments, RecordingArguments, ReplayArguments};
use crate::output::{self, note};
use anyhow::{Context, Result, bail};
use measurement::{Measurement, SensorProfile, adis16405, profile_file};
use noise_analysis::analysis::analyze;
use noise_analysis::report::Report;
use noise_analysis::several::{self, NoiseAgreement, NoiseInflation};
use recordings::any_sensor::{ReadOptions, SensorRecording};
use recordings::file_format::{FileFormat, InputFile};
use recordings::recording::Recording;
use recordings::time_base::{StampQuality, time_base};
use recordings::{ColumnSelection, Printable, count_table};
use serde::Serialize;
use simulation::Replay;
use std::fs;
use std::path::{Path, PathBuf};

/// Name of the sensor whose register counts need no profile.
const ADIS16405: &str = "adis16405";
/// Name of a sensor without a data sheet.
const GENERIC: &str = "generic";

/// Analyses the recordings of the arguments and writes the report, or the summary of several.
pub(crate) fn run(arguments: &AnalyzeArguments) -> Result<()> {
    let AnalyzeArguments { recording, more, against, output } = arguments;
    let inputs: Vec<&Path> =
        [&recording.input.file].into_iter().chain(more).chain(against).map(PathBuf::as_path).collect();
    output::check(output, &inputs)?;
    if more.is_empty() && against.is_none() {
        let source = output::source_name(&recording.input.file);
        return output::write_report(&analyze(&read_measurement(recording)?), Some(&source), output);
    }
    let refused = [
        ("--page", output.page.is_some()),
        ("--pictures", output.pictures.is_some()),
        ("--full", output.full),
        ("--export", !output.exports.is_empty()),
    ];
    let refused: Vec<&str> = refused.into_iter().filter(|(_, is_given)| *is_given).map(|(option, _)| option).collect();
    if !refused.is_empty() {
        bail!("several recordings have a summary and no report: leave out {}", refused.join(", "));
    }
    let read_other = |file: &PathBuf| {
        let input = InputArguments { file: file.clone(), ..recording.input.clone() };
        read_measurement(&RecordingArguments { input, ..recording.clone() })
    };
    let still: Vec<Measurement> =
        [&recording.input.file].into_iter().chain(more).map(read_other).collect::<Result<_>>()?;
    let agreement = (still.len() > 1).then(|| several::compare(&still)).transpose()?;
    let inflation = match against {
        Some(file) => Some(several::inflation(&still, &read_other(file)?)?),
        None => None,
    };
    if let Some(file) = &output.json {
        output::write_json(&SeveralRecordings { agreement: agreement.as_ref(), inflation: inflation.as_ref() }, file)?;
    }
    if output.quiet || output.json.as_deref().is_some_and(output::is_standard_output) {
        return Ok(());
    }
    output::print(|out| {
        agreement.as_ref().map_or(Ok(()), |agreement| reports::several::write_agreement(agreement, out))?;
        inflation.as_ref().map_or(Ok(()), |inflation| reports::several::write_inflation(inflation, out))
    })
}

/// The JSON of several recordings.
#[derive(Serialize)]
struct SeveralRecordings<'a> {
    agreement: Option<&'a NoiseAgreement>,
    inflation: Option<&'a NoiseInflation>,
}

/// Analyses what the driver reads of a table of register counts or a frame log over the emulated bus.
pub(crate) fn analyze_replay(arguments: &ReplayArguments) -> Result<Report> {
    let ReplayArguments { file, rate, range, output: _ } = arguments;
    let input = InputFile::open(file)?;
    if !input.format().is_text() {
        bail!(
            "{}: neither register counts nor an SPI log, which are all that can be replayed",
            Printable(&file.display().to_string())
        );
    }
    let recording = replayed(&input, *range)?;
    analyze_recording(&recording, *rate).with_context(|| file.display().to_string())
}

/// Analyses a recording; `rate_hz` overrides the rate that its time stamps show.
pub(crate) fn analyze_recording(recording: &Recording, rate_hz: Option<f64>) -> Result<Report> {
    Ok(analyze(&on_time_base(recording, rate_hz)?))
}

/// What a file of any format holds.
pub(crate) enum Recorded {
    /// Register counts of an ADIS16405.
    Counts(Recording),
    /// Numbers of any sensor.
    AnySensor(SensorRecording),
}

/// Reads a file of any format. What the user should know of an SPI log is noted.
pub(crate) fn read(arguments: &InputArguments) -> Result<Recorded> {
    let InputArguments { file, range, sensor, columns, units, topic } = arguments;
    let sensor = sensor.as_deref().map(sensor_profile).transpose()?;
    let selection = ColumnSelection::parse(columns, units)?;
    let input = InputFile::open(file)?;
    let is_adis16405 = sensor.as_ref().is_none_or(|sensor| sensor.name == adis16405::NAME);
    match input.format() {
        FileFormat::FrameLog | FileFormat::SpiExport => replayed(&input, *range).map(Recorded::Counts),
        FileFormat::CountTable if is_adis16405 && selection.is_empty() => {
            let recording = count_table::read(input.path(), (*range).into()).map_err(|error| input.rename(error))?;
            Ok(Recorded::Counts(recording))
        }
        _ => {
            let sensor = sensor.unwrap_or_else(SensorProfile::generic);
            Ok(Recorded::AnySensor(input.read(&ReadOptions { sensor, selection, topic: topic.clone() })?))
        }
    }
}

/// The samples of a recording of any format on their time base. What the user should know is noted.
pub(crate) fn read_measurement(arguments: &RecordingArguments) -> Result<Measurement> {
    let RecordingArguments { input, rate } = arguments;
    let name = || input.file.display().to_string();
    match read(input)? {
        Recorded::Counts(recording) => on_time_base(&recording, *rate).with_context(name),
        Recorded::AnySensor(recording) => {
            let (base, notes) = recording.time_base(*rate).with_context(name)?;
            for sentence in notes.into_iter().chain(base.stamps.iter().flat_map(StampQuality::notes)) {
                note(format_args!("{sentence}"));
            }
            Ok(base.measurement)
        }
    }
}

/// What the driver reads of a log or of counts.
fn replayed(input: &InputFile, range: GyroRangeArgument) -> Result<Recording> {
    let Replay { recording, other_transactions, timing } =
        simulation::replay(input.path(), range.into()).map_err(|error| input.rename(error))?;
    for sentence in timing.notes() {
        note(format_args!("{sentence}"));
    }
    if other_transactions > 0 {
        note(format_args!("{other_transactions} transactions that are no bursts"));
    }
    Ok(recording)
}

fn on_time_base(recording: &Recording, rate_hz: Option<f64>) -> Result<Measurement> {
    let base = time_base(recording, rate_hz)?;
    for sentence in base.stamps.iter().flat_map(StampQuality::notes) {
        note(format_args!("{sentence}"));
    }
    Ok(base.measurement)
}

/// The profile of a known sensor, or of a profile file.
fn sensor_profile(name: &str) -> Result<SensorProfile> {
    match name.to_lowercase().as_str() {
        ADIS16405 => return Ok(adis16405::profile(adis16405::GYRO_LSB_300)),
        GENERIC => return Ok(SensorProfile::generic()),
        known => {
            if let Some(profile) = profile_file::included(known) {
                return Ok(profile);
            }
        }
    }
    let text = fs::read_to_string(name).with_context(|| {
        let included: Vec<&str> = profile_file::included_names().collect();
        format!(
            "sensor {}: neither {ADIS16405}, {GENERIC}, {} nor a profile file",
            Printable(name),
            included.join(", ")
        )
    })?;
    profile_file::parse(&text).with_context(|| Printable(name).to_string())
}
