//! `analyze` and `replay`: the report of a recording in a file, and the summary of several.

use crate::cli::{
    AnalyzeArguments, ExportTarget, GyroRangeArgument, InputArguments, OutputArguments, RecordingArguments,
    ReplayArguments,
};
use crate::inspect::{self, read_or_ask};
use crate::output::{self, Analysed, Incomplete, note};
use crate::output_files::{OutputFiles, is_standard_stream};
use crate::progress::{self, Progress};
use crate::tip::UnknownSensor;
use crate::{many, streaming};
use adis16405_driver::GyroRange;
use anyhow::{Context, Result, bail};
use measurement::{Measurement, SensorProfile, adis16405, profile_file};
use noise_analysis::analysis::{analyze_and_release, analyze_condensed};
use noise_analysis::effects::Effect;
use noise_analysis::record::long_record::{MOST_LOST, MOST_SAMPLES, MOST_SAMPLES_WITH_LOSSES};
use noise_analysis::report::several::{self, NoiseAgreement, NoiseInflation};
use noise_analysis::report::{Report, Stretch};
use recordings::ReadOptions;
use recordings::file_format::{FileFormat, RecordedFormat, RecordedInput};
use recordings::recording::Recording;
use recordings::sample_stream::{KeptInMemory, Reading, SampleStream, StreamError, part_of};
use recordings::time_base::TimeRange;
use recordings::{ColumnSelection, FileHash, Printable, ReadMonitor, count_table};
use reports::reading::ReadingRecord;
use reports::saved_report::SavedReport;
use reports::summary::longest_at_rest;
use serde::Serialize;
use simulation::Replay;
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{ErrorKind, Read};
use std::path::{Path, PathBuf};

/// Name of the sensor whose register counts need no profile.
const ADIS16405: &str = "adis16405";
/// Rows that a quick report keeps in memory at most; they tell the clock of the time stamps.
const QUICK_ROWS: u64 = 1 << 17;
/// Recordings that are not condensed for their analysis.
const KEPT: KeptInMemory =
    KeptInMemory { rows: MOST_SAMPLES, rows_with_losses: MOST_SAMPLES_WITH_LOSSES, most_lost: MOST_LOST };
/// Longest profile file.
const PROFILE_BYTES: u64 = 1 << 20;
/// Name of a sensor without a data sheet.
const GENERIC: &str = "generic";

/// Analyses the recordings of the arguments and writes the report, or the summary of several.
pub(crate) fn run(arguments: &AnalyzeArguments) -> Result<()> {
    let AnalyzeArguments { recording, more, each_sensor, against, quick, reports, output } = arguments;
    let files: Vec<&Path> = [&recording.input.file].into_iter().chain(more).map(PathBuf::as_path).collect();
    let sensor = recording.input.sensor.as_deref().map(Path::new);
    let outputs = OutputFiles::new(files.iter().copied().chain(against.as_deref()).chain(sensor), output.force);
    let mut recordings: Vec<RecordingArguments> = Vec::new();
    for &file in &files {
        let of_file = of_file(recording, file);
        recordings.extend(if *each_sensor { inspect::each_sensor(&of_file)? } else { vec![of_file] });
    }
    if let Some(folder) = reports {
        let analyze = |recording: &RecordingArguments| {
            read_or_ask(recording, |recording| report(recording, *quick, &ReadMonitor::default(), &mut |_| {}))
        };
        return many::write_reports(&recordings, folder, output.quiet, &outputs, analyze);
    }
    output::check(output, &outputs)?;
    if let ([recording], None) = (recordings.as_slice(), against) {
        let source = output::source_name(&recording.input.file);
        let report = read_or_ask(recording, |recording| watched_report(recording, *quick))?;
        return output::write_report(&report, Some(&source), output, &outputs);
    }
    if *quick {
        bail!("several recordings have a summary and no report: leave out --quick, or give --reports DIR");
    }
    let refused = [
        ("--page", output.page.is_some()),
        ("--pictures", output.pictures.is_some()),
        ("--full", output.full),
        ("--export", !*each_sensor && !output.exports.is_empty()),
    ];
    let refused: Vec<&str> = refused.into_iter().filter(|(_, is_given)| *is_given).map(|(option, _)| option).collect();
    if !refused.is_empty() {
        bail!("several recordings have a summary and no report: leave out {}", refused.join(", "));
    }
    let names: Vec<String> = recordings.iter().map(sensor_name).collect();
    let mut is_complete = true;
    let mut read = |recording: &RecordingArguments| -> Result<Measurement> {
        let read = read_or_ask(recording, open_measured)?;
        is_complete &= read.rows_read().is_complete();
        Ok(read.into_beginning())
    };
    let still: Vec<Measurement> = recordings.iter().map(&mut read).collect::<Result<_>>()?;
    if *each_sensor {
        note(format_args!("recordings: {}", Printable(&names.join(", "))));
        if are_parts(&still) {
            write_parts(still, &names, output, &outputs)?;
            return Incomplete::check(is_complete);
        }
        if !output.exports.is_empty() {
            bail!("--export: these sensors have the same channels; export one of them, with --topic or --columns");
        }
    }
    let agreement = (still.len() > 1).then(|| several::compare(&still)).transpose()?;
    let inflation = match against {
        Some(file) => Some(several::inflation(&still, &read(&of_file(recording, file))?)?),
        None => None,
    };
    if let Some(file) = &output.json {
        let several = SeveralRecordings { agreement: agreement.as_ref(), inflation: inflation.as_ref() };
        output::write_json(&several, file, &outputs)?;
    }
    if output.quiet || output.json.as_deref().is_some_and(is_standard_stream) {
        return Incomplete::check(is_complete);
    }
    output::print(|out| {
        agreement.as_ref().map_or(Ok(()), |agreement| reports::several::write_agreement(agreement, out))?;
        inflation.as_ref().map_or(Ok(()), |inflation| reports::several::write_inflation(inflation, out))
    })?;
    Incomplete::check(is_complete)
}

/// Whether recordings of one file are parts of one sensor: no two have a channel in common.
fn are_parts(recordings: &[Measurement]) -> bool {
    let names = |of: &Measurement| of.channels.iter().map(|channel| channel.profile.name).collect::<Vec<_>>();
    let all: Vec<Vec<&str>> = recordings.iter().map(names).collect();
    let is_apart = |at: usize| !all[..at].iter().flatten().any(|name| all[at].contains(name));
    recordings.len() > 1 && (0..all.len()).all(is_apart)
}

/// Analyses the parts of one sensor, prints their reports one after the other, and exports them as one.
fn write_parts(
    parts: Vec<Measurement>,
    names: &[String],
    output: &OutputArguments,
    outputs: &OutputFiles,
) -> Result<()> {
    if output.json.is_some() {
        bail!("--json: the parts of a sensor have a report each; --reports DIR writes them");
    }
    let mut saved = Vec::new();
    for (part, name) in parts.into_iter().zip(names) {
        let report = progress::analysing(|watch| analyze_and_release(part, watch));
        if !output.quiet {
            output::show_screen(&report, Some(name))?;
        }
        saved.push(SavedReport::from(&report));
    }
    let Some(joined) = SavedReport::joined(saved)? else { return Ok(()) };
    let write = |target: &ExportTarget| output::write_export(&joined, target, output.axis, outputs);
    output.exports.iter().map(write).fold(Ok(()), Result::and)
}

/// What tells a sensor from the others of its file: its topic, or its columns.
fn sensor_name(recording: &RecordingArguments) -> String {
    let InputArguments { topic, columns, .. } = &recording.input;
    topic.clone().unwrap_or_else(|| columns.join(" "))
}

/// The same arguments for another file.
fn of_file(recording: &RecordingArguments, file: &Path) -> RecordingArguments {
    let input = InputArguments { file: file.to_owned(), ..recording.input.clone() };
    RecordingArguments { input, ..recording.clone() }
}

/// The report of a recording. Shows how far the reading is, and makes the report of what was read if that is interrupted.
fn watched_report(recording: &RecordingArguments, is_quick: bool) -> Result<Analysed> {
    let mut progress = Progress::reading(&recording.input.file);
    let monitor = progress.monitor().clone();
    let mut end_reading = |stream: &SampleStream| {
        if progress.end_reading() {
            note(format_args!(
                "interrupted: this is the report of the first {} samples, which were read until then",
                stream.description().samples
            ));
        }
        note_all(stream.notes());
    };
    report(recording, is_quick, &monitor, &mut end_reading)
}

/// The report of a recording, with the longest part at rest of its file where the platform moved; `end_reading` is called when it was
/// read, before it is analysed.
fn report(
    recording: &RecordingArguments,
    is_quick: bool,
    monitor: &ReadMonitor,
    end_reading: &mut dyn FnMut(&SampleStream),
) -> Result<Analysed> {
    let mut analysed = report_of_samples(recording, is_quick, monitor, end_reading)?;
    let report = &mut analysed.report;
    if report.findings.iter().any(|finding| matches!(finding.effect, Effect::MotionInterval(_))) {
        let by_motions = || {
            // From the first sample of the part that was read.
            let from_s = recording.from.unwrap_or(0.0);
            let longest = longest_at_rest(report)?;
            Some(Stretch { from_s: from_s + longest.from_s, to_s: from_s + longest.to_s })
        };
        let by_file = inspect::part_at_rest(recording).map(|TimeRange { from_s, to_s }| Stretch { from_s, to_s });
        report.longest_at_rest = by_file.or_else(by_motions);
    }
    Ok(analysed)
}

fn report_of_samples(
    recording: &RecordingArguments,
    is_quick: bool,
    monitor: &ReadMonitor,
    end_reading: &mut dyn FnMut(&SampleStream),
) -> Result<Analysed> {
    let quick = KeptInMemory { rows: QUICK_ROWS, rows_with_losses: QUICK_ROWS, most_lost: 1.0 };
    let OpenStream { mut stream, hash } = open_stream(recording, monitor, if is_quick { quick } else { KEPT })?;
    if is_quick {
        let estimators = streaming::curves(&mut stream)?;
        end_reading(&stream);
        let reading = reading_record(recording, true, &stream, hash);
        let bar = progress::fitting(stream.description().channels.len());
        let report = estimators.report(&|| bar.inc(1));
        bar.finish_and_clear();
        return Ok(Analysed { report, reading: Some(reading) });
    }
    let mut reading = None;
    let report = analyze_stream(stream, &mut |stream| {
        end_reading(stream);
        reading = Some(reading_record(recording, false, stream, None));
    })?;
    // The hash is made while the samples are analysed.
    if let Some(reading) = &mut reading {
        reading.sha256 = finished(hash);
    }
    Ok(Analysed { report, reading })
}

/// What was read of a recording.
fn reading_record(
    recording: &RecordingArguments,
    is_quick: bool,
    stream: &SampleStream,
    hash: Option<FileHash>,
) -> ReadingRecord {
    let read = stream.rows_read();
    let mut left_out: BTreeMap<String, u64> = stream
        .description()
        .dropped
        .iter()
        .filter(|(cause, _)| **cause != "gap")
        .map(|(cause, rows)| ((*cause).to_owned(), *rows))
        .collect();
    left_out.insert("outside_part".to_owned(), read.outside);
    left_out.insert("padding".to_owned(), read.padding);
    left_out.retain(|_, rows| *rows > 0);
    ReadingRecord {
        file: output::source_name(&recording.input.file),
        sha256: finished(hash),
        program: env!("CARGO_PKG_NAME").to_owned(),
        version: env!("CARGO_PKG_VERSION").to_owned(),
        options: recording.options(is_quick),
        rows: read.rows,
        left_out,
        complete: read.is_complete(),
        damage: read.damage.clone(),
        notes: stream.notes().to_vec(),
    }
}

fn finished(hash: Option<FileHash>) -> Option<String> {
    hash.and_then(|hash| hash.finish().ok())
}

/// The report of all samples of `stream`; `end_reading` is called when they were read, before they are analysed.
fn analyze_stream(mut stream: SampleStream, end_reading: &mut dyn FnMut(&SampleStream)) -> Result<Report> {
    if stream.is_in_memory() {
        end_reading(&stream);
        return Ok(progress::analysing(|watch| analyze_and_release(stream.into_beginning(), watch)));
    }
    let long = streaming::long_record(&mut stream)?;
    end_reading(&stream);
    drop(stream);
    Ok(progress::analysing(|watch| analyze_condensed(&long, watch)))
}

fn note_all(notes: &[String]) {
    notes.iter().for_each(|sentence| note(format_args!("{sentence}")));
}

/// Opens a recording of any format, or the part of it that the arguments say. What the user should know of an SPI log is noted.
fn open_stream(recording: &RecordingArguments, monitor: &ReadMonitor, kept: KeptInMemory) -> Result<OpenStream> {
    let reading = Reading::new(recording.rate, kept).of_part(recording.time_range());
    let mut hash = None;
    let opened = match open(&recording.input, monitor)? {
        Opened::Counts(input) => {
            hash = input.begin_hash().ok();
            SampleStream::counts(input, recording.input.range.into(), reading)
        }
        Opened::AnySensor(input, options) => {
            hash = input.begin_hash().ok();
            SampleStream::any_sensor(input, *options, reading)
        }
        Opened::Replayed(replayed) => SampleStream::recorded(replayed, reading).map_err(StreamError::from),
    };
    let stream = opened.map_err(|error| named(error, &recording.input.file))?;
    Ok(OpenStream { stream, hash })
}

/// An open recording, and the hash of its file.
struct OpenStream {
    stream: SampleStream,
    hash: Option<FileHash>,
}

/// All samples of a recording in memory. What the user should know is noted.
fn open_measured(recording: &RecordingArguments) -> Result<SampleStream> {
    let OpenStream { stream, .. } = open_stream(recording, &ReadMonitor::default(), KeptInMemory::ALL)?;
    note_all(stream.notes());
    note_all(stream.rows_read().damage.as_slice());
    Ok(stream)
}

/// An error with the name of the file.
pub(crate) fn named(error: StreamError, file: &Path) -> anyhow::Error {
    match error {
        // The others name the file themselves.
        StreamError::TimeBase(error) => anyhow::Error::from(error).context(file.display().to_string()),
        error => error.into(),
    }
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
    let input = RecordedInput::open(file)?;
    if !input.format().is_text() {
        bail!(
            "{}: neither register counts nor an SPI log, which are all that can be replayed",
            Printable(&file.display().to_string())
        );
    }
    let recording = replayed(&input, *range)?;
    analyze_recording(recording, *rate).with_context(|| file.display().to_string())
}

/// Analyses a recording; `rate_hz` overrides the rate that its time stamps show.
pub(crate) fn analyze_recording(recording: Recording, rate_hz: Option<f64>) -> Result<Report> {
    let stream = SampleStream::recorded(recording, Reading::new(rate_hz, KEPT))?;
    analyze_stream(stream, &mut |stream| note_all(stream.notes()))
}

/// An open file, by the way in which it is read.
enum Opened {
    /// Register counts of an ADIS16405.
    Counts(RecordedInput),
    /// Numbers of any sensor.
    AnySensor(RecordedInput, Box<ReadOptions>),
    /// A log of the bus of an ADIS16405, which was read.
    Replayed(Recording),
}

/// Opens a file of any format. What the user should know of an SPI log is noted.
fn open(arguments: &InputArguments, monitor: &ReadMonitor) -> Result<Opened> {
    let InputArguments { file, range, sensor, columns, units, topic, .. } = arguments;
    let sensor = sensor.as_deref().map(|name| sensor_profile(name, (*range).into())).transpose()?;
    let selection = ColumnSelection::parse(columns, units)?;
    let input = RecordedInput::open_monitored(file, monitor)?;
    if let Some(topic) = topic
        .as_ref()
        .filter(|_| input.format().is_text() && input.format() != RecordedFormat::File(FileFormat::TextTable))
    {
        let name = file.display().to_string();
        bail!("{}: --topic {}: a file of text has no topics; leave it out", Printable(&name), Printable(topic));
    }
    let is_adis16405 = sensor.as_ref().is_none_or(|sensor| sensor.name == adis16405::NAME);
    match input.format() {
        RecordedFormat::FrameLog | RecordedFormat::SpiExport => replayed(&input, *range).map(Opened::Replayed),
        RecordedFormat::CountTable if is_adis16405 && selection.is_empty() => Ok(Opened::Counts(input)),
        _ => {
            let sensor = sensor.unwrap_or_else(SensorProfile::generic);
            let options = ReadOptions { sensor, selection, topic: topic.clone() };
            Ok(Opened::AnySensor(input, Box::new(options)))
        }
    }
}

/// A recording to write anew.
pub(crate) enum Recorded {
    /// Register counts of an ADIS16405.
    Counts(Recording),
    /// Numbers of any sensor, which are read when they are written.
    AnySensor(RecordedInput, Box<ReadOptions>),
}

/// Opens a file of any format to write it anew; register counts are read, or the part of them that the arguments say.
pub(crate) fn open_rows(arguments: &RecordingArguments) -> Result<Recorded> {
    let RecordingArguments { input: InputArguments { range, .. }, rate, .. } = arguments;
    let part = arguments.time_range();
    Ok(match open(&arguments.input, &ReadMonitor::default())? {
        Opened::Counts(input) => {
            let recording = count_table::read_part(&input, (*range).into(), part, *rate);
            Recorded::Counts(recording.map_err(|error| named(error, &arguments.input.file))?)
        }
        Opened::Replayed(recording) => Recorded::Counts(match part {
            Some(part) => {
                part_of(recording, part, *rate).map_err(|error| named(error.into(), &arguments.input.file))?
            }
            None => recording,
        }),
        Opened::AnySensor(input, options) => Recorded::AnySensor(input, options),
    })
}

/// The samples of a recording of any format on their time base. What the user should know is noted.
pub(crate) fn read_measurement(arguments: &RecordingArguments) -> Result<Measurement> {
    Ok(open_measured(arguments)?.into_beginning())
}

/// What the driver reads of a log or of counts.
fn replayed(input: &RecordedInput, range: GyroRangeArgument) -> Result<Recording> {
    let Replay { recording, other_transactions, timing } = simulation::replay(input.bytes(), range.into())?;
    note_all(&timing.notes());
    if other_transactions > 0 {
        note(format_args!("{other_transactions} transactions that are no bursts"));
    }
    Ok(recording)
}

/// The profile of a known sensor, or of a profile file; `range` is that of an ADIS16405's gyros.
fn sensor_profile(name: &str, range: GyroRange) -> Result<SensorProfile> {
    match name.to_lowercase().as_str() {
        ADIS16405 => return Ok(adis16405::profile(range.lsb())),
        GENERIC => return Ok(SensorProfile::generic()),
        known => {
            if let Some(profile) = profile_file::included(known) {
                return Ok(profile);
            }
        }
    }
    let mut text = String::new();
    let read = |file: File| file.take(PROFILE_BYTES + 1).read_to_string(&mut text);
    File::open(name).and_then(read).map_err(|error| match error.kind() {
        ErrorKind::NotFound => {
            let known = [ADIS16405, GENERIC].into_iter().chain(profile_file::included_names());
            UnknownSensor(name.to_owned(), known.collect()).into()
        }
        _ => anyhow::Error::from(error).context(format!("sensor {}", Printable(name))),
    })?;
    if text.len() as u64 > PROFILE_BYTES {
        bail!("{}: a profile is not longer than {PROFILE_BYTES} bytes", Printable(name));
    }
    profile_file::parse(&text).with_context(|| Printable(name).to_string())
}
