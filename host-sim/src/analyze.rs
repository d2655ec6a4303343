//! `analyze` and `replay`: the report of a recording in a file, or of each of its sensors.

use crate::cli::{
    AnalyzeArguments, ExportTarget, GyroRangeArgument, InputArguments, OutputArguments, PROGRAM, RecordingArguments,
    ReplayArguments,
};
use crate::inspect::{self, read_or_ask};
use crate::output::{self, Analysed, Incomplete, note};
use crate::output_files::OutputFiles;
use crate::progress::{self, Progress};
use crate::several_recordings::write_several;
use crate::streaming;
use crate::tip::UnknownSensor;
use adis16405_driver::GyroRange;
use anyhow::{Context, Result, bail};
use measurement::{Measurement, SensorProfile, adis16405, profile_file};
use noise_analysis::analysis::{analyze_and_release, analyze_condensed};
use noise_analysis::effects::Effect;
use noise_analysis::record::long_record::{MOST_LOST, MOST_SAMPLES, MOST_SAMPLES_WITH_LOSSES};
use noise_analysis::report::{Report, Stretch};
use recordings::ReadOptions;
use recordings::file_format::{FileFormat, RecordedFormat, RecordedInput};
use recordings::recording::Recording;
use recordings::sample_stream::{KeptInMemory, Reading, SampleStream, StreamError, part_of};
use recordings::time_base::TimeRange;
use recordings::{ColumnSelection, FileHash, Printable, ReadMonitor, count_table};
use reports::reading::{ReadingRecord, rows_left_out};
use reports::saved_report::SavedReport;
use reports::summary::longest_at_rest;
use simulation::Replay;
use std::fs::File;
use std::io::{ErrorKind, Read};
use std::path::Path;

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

/// Analyses the recording of the arguments and writes its report, or what each of its sensors has.
pub(crate) fn run(arguments: &AnalyzeArguments) -> Result<()> {
    let AnalyzeArguments { recording, each_sensor, quick, output } = arguments;
    let sensor = recording.input.sensor.as_deref().map(Path::new);
    let outputs = OutputFiles::new([recording.input.file.as_path()].into_iter().chain(sensor), output.force);
    output::check(output, &outputs)?;
    let sensors = if *each_sensor { inspect::each_sensor(recording)? } else { vec![recording.clone()] };
    if let [recording] = sensors.as_slice() {
        let source = output::source_name(&recording.input.file);
        let report = read_or_ask(recording, |recording| watched_report(recording, *quick))?;
        return output::write_report(&report, Some(&source), output, &outputs);
    }
    let refused = [
        ("--quick", *quick),
        ("--page", output.page.is_some()),
        ("--pictures", output.pictures.is_some()),
        ("--full", output.full),
    ];
    let refused: Vec<&str> = refused.into_iter().filter(|(_, is_given)| *is_given).map(|(option, _)| option).collect();
    if !refused.is_empty() {
        bail!("several sensors have a summary and no report: leave out {}, or use `batch`", refused.join(", "));
    }
    let names: Vec<String> = sensors.iter().map(sensor_name).collect();
    let mut reading = SeveralReadings::default();
    let still: Vec<Measurement> = sensors.iter().map(|sensor| reading.read(sensor)).collect::<Result<_>>()?;
    note(format_args!("recordings: {}", Printable(&names.join(", "))));
    if are_parts(&still) {
        write_parts(still, &names, output, &outputs)?;
    } else if output.exports.is_empty() {
        write_several(&still, None, output.json.as_deref(), output.quiet, &outputs)?;
    } else {
        bail!("--export: these sensors have the same channels; export one of them, with --topic or --columns");
    }
    Incomplete::check(reading.are_complete())
}

/// Recordings that are read one after the other.
#[derive(Debug, Default)]
pub(crate) struct SeveralReadings {
    incomplete: usize,
}

impl SeveralReadings {
    /// All samples of a recording in memory.
    pub(crate) fn read(&mut self, recording: &RecordingArguments) -> Result<Measurement> {
        let read = read_or_ask(recording, open_measured)?;
        self.incomplete += usize::from(!read.rows_read().is_complete());
        Ok(read.into_beginning())
    }

    /// Whether all of them were read to their end.
    pub(crate) fn are_complete(&self) -> bool {
        self.incomplete == 0
    }
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
        bail!("--json: the parts of a sensor have a report each; `batch --each-sensor` writes them");
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

/// Is called with a recording that was read, and with what the user should know of it, before it is analysed.
type EndReading<'a> = dyn FnMut(&SampleStream, &[String]) + 'a;

/// The report of a recording. Shows how far the reading is, and makes the report of what was read if that is interrupted.
fn watched_report(recording: &RecordingArguments, is_quick: bool) -> Result<Analysed> {
    let mut progress = Progress::reading(&recording.input.file);
    let monitor = progress.monitor().clone();
    let mut end_reading = |stream: &SampleStream, notes: &[String]| {
        if progress.end_reading() {
            note(format_args!(
                "interrupted: this is the report of the first {} samples, which were read until then",
                stream.description().samples
            ));
        }
        note_all(notes);
    };
    report(recording, is_quick, &monitor, &mut end_reading)
}

/// The report of a recording, with the longest part at rest of its file where the platform moved; `end_reading` is called when it was
/// read, before it is analysed.
pub(crate) fn report(
    recording: &RecordingArguments,
    is_quick: bool,
    monitor: &ReadMonitor,
    end_reading: &mut EndReading,
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
    end_reading: &mut EndReading,
) -> Result<Analysed> {
    let quick = KeptInMemory { rows: QUICK_ROWS, rows_with_losses: QUICK_ROWS, most_lost: 1.0 };
    let OpenStream { mut stream, hash, notes } = open_stream(recording, monitor, if is_quick { quick } else { KEPT })?;
    if is_quick {
        let estimators = streaming::curves(&mut stream)?;
        end_reading(&stream, &notes);
        let reading = reading_record(recording, true, &stream, notes);
        let bar = progress::fitting(stream.description().channels.len());
        let report = estimators.report(&|| bar.inc(1));
        bar.finish_and_clear();
        return Ok(Analysed { report, reading: Some(ReadingRecord { sha256: finished(hash), ..reading }) });
    }
    let mut reading = ReadingRecord::default();
    let report = analyze_stream(stream, &mut |stream| {
        end_reading(stream, &notes);
        reading = reading_record(recording, false, stream, notes.clone());
    })?;
    // The hash is made while the samples are analysed.
    Ok(Analysed { report, reading: Some(ReadingRecord { sha256: finished(hash), ..reading }) })
}

/// What was read of a recording.
fn reading_record(
    recording: &RecordingArguments,
    is_quick: bool,
    stream: &SampleStream,
    notes: Vec<String>,
) -> ReadingRecord {
    let read = stream.rows_read();
    ReadingRecord {
        file: output::source_name(&recording.input.file),
        sha256: None,
        program: PROGRAM.to_owned(),
        version: env!("CARGO_PKG_VERSION").to_owned(),
        options: recording.options(is_quick),
        rows: read.rows,
        left_out: rows_left_out(&stream.description().dropped, read.outside, read.padding),
        complete: read.is_complete(),
        damage: read.damage.clone(),
        notes,
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

/// Opens a recording of any format, or the part of it that the arguments say.
fn open_stream(recording: &RecordingArguments, monitor: &ReadMonitor, kept: KeptInMemory) -> Result<OpenStream> {
    let reading = Reading::new(recording.rate, kept).of_part(recording.time_range());
    let (mut hash, mut notes) = (None, Vec::new());
    let opened = match open(&recording.input, monitor)? {
        Opened::Counts(input) => {
            hash = input.begin_hash().ok();
            SampleStream::counts(input, recording.input.range.into(), reading)
        }
        Opened::AnySensor(input, options) => {
            hash = input.begin_hash().ok();
            SampleStream::any_sensor(input, *options, reading)
        }
        Opened::Replayed(replayed, of_log) => {
            notes = of_log;
            SampleStream::recorded(replayed, reading).map_err(StreamError::from)
        }
    };
    let stream = opened.map_err(|error| named(error, &recording.input.file))?;
    notes.extend_from_slice(stream.notes());
    Ok(OpenStream { stream, hash, notes })
}

/// An open recording, the hash of its file, and what the user should know of it.
struct OpenStream {
    stream: SampleStream,
    hash: Option<FileHash>,
    notes: Vec<String>,
}

/// All samples of a recording in memory. What the user should know is noted.
fn open_measured(recording: &RecordingArguments) -> Result<SampleStream> {
    let OpenStream { stream, notes, .. } = open_stream(recording, &ReadMonitor::default(), KeptInMemory::ALL)?;
    note_all(&notes);
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
    let (recording, notes) = replayed(&input, *range)?;
    note_all(&notes);
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
    /// A log of the bus of an ADIS16405, which was read, and what the user should know of it.
    Replayed(Recording, Vec<String>),
}

/// Opens a file of any format.
fn open(arguments: &InputArguments, monitor: &ReadMonitor) -> Result<Opened> {
    let InputArguments { file, range, sensor, columns, units, topic, .. } = arguments;
    let sensor = sensor.as_deref().map(|name| sensor_profile(name, (*range).into())).transpose()?;
    let selection = ColumnSelection::parse(columns, units)?;
    let input = arguments.open(monitor)?;
    if let Some(topic) = topic
        .as_ref()
        .filter(|_| input.format().is_text() && input.format() != RecordedFormat::File(FileFormat::TextTable))
    {
        let name = file.display().to_string();
        bail!("{}: --topic {}: a file of text has no topics; leave it out", Printable(&name), Printable(topic));
    }
    let is_adis16405 = sensor.as_ref().is_none_or(|sensor| sensor.name == adis16405::NAME);
    match input.format() {
        RecordedFormat::FrameLog | RecordedFormat::SpiExport => {
            let (recording, notes) = replayed(&input, *range)?;
            Ok(Opened::Replayed(recording, notes))
        }
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
        Opened::Replayed(recording, notes) => {
            note_all(&notes);
            Recorded::Counts(match part {
                Some(part) => {
                    part_of(recording, part, *rate).map_err(|error| named(error.into(), &arguments.input.file))?
                }
                None => recording,
            })
        }
        Opened::AnySensor(input, options) => Recorded::AnySensor(input, options),
    })
}

/// The samples of a recording of any format on their time base. What the user should know is noted.
pub(crate) fn read_measurement(arguments: &RecordingArguments) -> Result<Measurement> {
    Ok(open_measured(arguments)?.into_beginning())
}

/// What the driver reads of a log or of counts, and what the user should know of it.
fn replayed(input: &RecordedInput, range: GyroRangeArgument) -> Result<(Recording, Vec<String>)> {
    let Replay { recording, other_transactions, timing } = simulation::replay(input.bytes(), range.into())?;
    let mut notes = timing.notes();
    if other_transactions > 0 {
        notes.push(format!("{other_transactions} transactions that are no bursts"));
    }
    Ok((recording, notes))
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
