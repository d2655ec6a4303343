//! `analyze` and `replay`: the report of a recording in a file, and the summary of several.

use crate::cli::{AnalyzeArguments, RecordingArguments};
use crate::output::{self, note};
use anyhow::{Context, Result, bail};
use measurement::{Measurement, SensorProfile, adis16405, profile_file};
use noise_analysis::analysis::analyze;
use noise_analysis::report::Report;
use noise_analysis::several::{self, NoiseAgreement, NoiseInflation};
use recordings::any_sensor::ReadOptions;
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
    let inputs: Vec<&Path> = [&recording.file].into_iter().chain(more).chain(against).map(PathBuf::as_path).collect();
    output::check(output, &inputs)?;
    if more.is_empty() && against.is_none() {
        return output::write_report(&analyze(&read_measurement(recording)?), Some(&recording.file), output);
    }
    if output.page.is_some() || output.kalibr.is_some() {
        bail!("several recordings have a summary and no report: leave out --page and --kalibr");
    }
    let others = more.iter().map(|file| RecordingArguments { file: file.clone(), ..recording.clone() });
    let still: Vec<Measurement> =
        [recording.clone()].into_iter().chain(others).map(|of| read_measurement(&of)).collect::<Result<_>>()?;
    let agreement = (still.len() > 1).then(|| several::compare(&still)).transpose()?;
    let inflation = match against {
        Some(file) => {
            let running = read_measurement(&RecordingArguments { file: file.clone(), ..recording.clone() })?;
            Some(several::inflation(&still, &running)?)
        }
        None => None,
    };
    if let Some(file) = &output.json {
        output::write_json(&SeveralRecordings { agreement: agreement.as_ref(), inflation: inflation.as_ref() }, file)?;
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
pub(crate) fn analyze_replay(arguments: &RecordingArguments) -> Result<Report> {
    let input = InputFile::open(&arguments.file)?;
    if !input.format().is_text() {
        bail!(
            "{}: neither register counts nor an SPI log, which are all that can be replayed",
            Printable(&arguments.file.display().to_string())
        );
    }
    Ok(analyze(&replayed(&input, arguments)?))
}

/// Analyses a recording; `rate_hz` overrides the rate that its time stamps show.
pub(crate) fn analyze_recording(recording: &Recording, rate_hz: Option<f64>) -> Result<Report> {
    Ok(analyze(&on_time_base(recording, rate_hz)?))
}

/// The samples of a recording of any format. What the user should know is noted.
pub(crate) fn read_measurement(arguments: &RecordingArguments) -> Result<Measurement> {
    let sensor = arguments.sensor.as_deref().map(sensor_profile).transpose()?;
    let selection = ColumnSelection::parse(&arguments.columns, &arguments.units)?;
    let input = InputFile::open(&arguments.file)?;
    let is_adis16405 = sensor.as_ref().is_none_or(|sensor| sensor.name == adis16405::NAME);
    match input.format() {
        FileFormat::FrameLog | FileFormat::SpiExport => return replayed(&input, arguments),
        FileFormat::CountTable if is_adis16405 && selection.is_empty() => {
            let range = arguments.range.into();
            let recording = count_table::read(input.path(), range).map_err(|error| input.rename(error))?;
            return on_time_base(&recording, arguments.rate).with_context(|| arguments.file.display().to_string());
        }
        _ => {}
    }
    let sensor = sensor.unwrap_or_else(SensorProfile::generic);
    let recording = input.read(&ReadOptions { sensor, selection, topic: arguments.topic.clone() })?;
    let (base, notes) = recording.time_base(arguments.rate).with_context(|| arguments.file.display().to_string())?;
    for sentence in notes.into_iter().chain(base.stamps.iter().flat_map(StampQuality::notes)) {
        note(format_args!("{sentence}"));
    }
    Ok(base.measurement)
}

/// What the driver reads of a log or of counts.
fn replayed(input: &InputFile, arguments: &RecordingArguments) -> Result<Measurement> {
    let Replay { recording, other_transactions, timing } =
        simulation::replay(input.path(), arguments.range.into()).map_err(|error| input.rename(error))?;
    for sentence in timing.notes() {
        note(format_args!("{sentence}"));
    }
    if other_transactions > 0 {
        note(format_args!("{other_transactions} transactions that are no bursts"));
    }
    on_time_base(&recording, arguments.rate).with_context(|| arguments.file.display().to_string())
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
