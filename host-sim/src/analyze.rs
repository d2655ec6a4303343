//! `analyze` and `replay`: the report of a recording, or of each sensor of a file.

use crate::cli::{AnalyzeArguments, InputArguments, OutputArguments, RecordingArguments, ReplayArguments};
use crate::inspect::{self, read_or_ask};
use crate::output::{self, Analysed, Incomplete, note, notes_of_file, write_noise};
use crate::output_files::OutputFiles;
use crate::output_format::{OutputFile, OutputFormat};
use crate::progress::{self, Progress};
use crate::several_recordings::write_several;
use crate::tip::UnknownSensor;
use adis16405_driver::GyroRange;
use anyhow::{Context, Result, bail};
use measurement::{Measurement, SensorProfile, profile_file};
use noise_analysis::analysis::analyze_and_release;
use noise_analysis::report::Report;
use observatory::recording_report::{
    KEPT, OpenOptions, OpenRecording, OpenStream, ReadSamples, named, reading_record, replayed, state_longest_at_rest,
};
use observatory::streaming;
use recordings::ReadOptions;
use recordings::file_format::RecordedInput;
use recordings::recording::Recording;
use recordings::sample_stream::{KeptInMemory, Reading, SampleStream, part_of};
use recordings::{ColumnSelection, FileHash, Printable, ReadMonitor, ReadingNote, count_table};
use reports::export::ExportFormat;
use reports::reading::ReadingRecord;
use reports::saved_report::SavedReport;
use std::fs::File;
use std::io::{ErrorKind, Read};
use std::path::{Path, PathBuf};

/// Most rows that a quick report keeps in memory; they give the clock of the time stamps.
const QUICK_ROWS: u64 = 1 << 17;
/// Most sensors of a file that are named in a line.
const MOST_NAMED: usize = 4;
/// Longest profile file.
const PROFILE_BYTES: u64 = 1 << 20;

/// Analyses the recording of the arguments and writes its report, or the reports of its sensors.
pub(crate) fn run(arguments: &AnalyzeArguments) -> Result<()> {
    let AnalyzeArguments { recording, each_sensor, quick, output } = arguments;
    let sensor = recording.input.sensor.as_deref().map(Path::new);
    let outputs = OutputFiles::new([recording.input.file.as_path()].into_iter().chain(sensor), output.force);
    output::check(&output.outputs, &outputs)?;
    let sensors = if *each_sensor { inspect::each_sensor(recording)? } else { vec![recording.clone()] };
    if let [recording] = sensors.as_slice() {
        let source = output::source_name(&recording.input.file);
        let report = read_or_ask(recording, |recording| watched_report(recording, *quick))?;
        return output::write_report(&report, Some(&source), output, &outputs);
    }
    let is_of_one = |output: &&OutputFile| matches!(output.format, OutputFormat::Page | OutputFormat::Figures);
    if *quick || output.full || output.outputs.iter().any(|output| is_of_one(&output)) {
        bail!(
            "several sensors have a summary and no report: leave out --quick, --full, .html and .svg, or use `batch`"
        );
    }
    let names: Vec<String> = sensors.iter().map(sensor_name).collect();
    let mut reading = SeveralReadings::default();
    let still: Vec<Measurement> = sensors.iter().map(|sensor| reading.read(sensor)).collect::<Result<_>>()?;
    match names.len() {
        0..=MOST_NAMED => note(format_args!("recordings: {}", Printable(&names.join(", ")))),
        many => note(format_args!("recordings: {many} sensors, in the order of `inspect`")),
    }
    if are_parts(&still) {
        write_parts(still, &names, output, &outputs)?;
    } else {
        let json = match output.outputs.as_slice() {
            [] => None,
            [OutputFile { format: OutputFormat::Json, file }] => Some(file.as_path()),
            _ => bail!(
                "these sensors have the same channels: one .json is written, or one of them, by --topic or --columns"
            ),
        };
        write_several(&still, None, json, output.quiet, &outputs)?;
    }
    Incomplete::check(reading.are_complete())
}

/// Reads recordings one after the other.
#[derive(Debug, Default)]
pub(crate) struct SeveralReadings {
    incomplete: usize,
    /// Notes that were printed.
    told: Vec<ReadingNote>,
}

impl SeveralReadings {
    /// Reads all samples of a recording into memory. A note is printed once.
    pub(crate) fn read(&mut self, recording: &RecordingArguments) -> Result<Measurement> {
        let OpenStream { stream: read, notes, .. } = read_or_ask(recording, open_measured)?;
        for note in notes {
            if !self.told.contains(&note) {
                notes_of_file(std::slice::from_ref(&note));
                self.told.push(note);
            }
        }
        self.incomplete += usize::from(!read.rows_read().is_complete());
        Ok(read.into_beginning())
    }

    /// True if all recordings were read to their end.
    pub(crate) fn are_complete(&self) -> bool {
        self.incomplete == 0
    }
}

/// True if recordings of one file are parts of one sensor: no two have a channel in common.
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
    let targets = |target: &OutputFile| match target.format {
        OutputFormat::Noise(format) => Ok((format, target.file.clone())),
        _ => bail!(".json: the parts of a sensor have a report each; `batch --each-sensor` writes them"),
    };
    let targets: Vec<(ExportFormat, PathBuf)> = output.outputs.iter().map(targets).collect::<Result<_>>()?;
    let mut saved = Vec::new();
    for (part, name) in parts.into_iter().zip(names) {
        let report = progress::analysing(|watch| analyze_and_release(part, watch));
        if !output.quiet && !output.prints_to_standard_output() {
            output::show_screen(&report, Some(name))?;
        }
        saved.push(SavedReport::new(&report)?);
    }
    let Some(joined) = SavedReport::joined(saved)? else { return Ok(()) };
    let write = |(format, file): (ExportFormat, PathBuf)| write_noise(&joined, format, &file, output.axis, outputs);
    targets.into_iter().map(write).fold(Ok(()), Result::and)
}

/// The name of a sensor among the others of its file: its topic, or its columns.
fn sensor_name(recording: &RecordingArguments) -> String {
    let InputArguments { topic, columns, .. } = &recording.input;
    topic.clone().unwrap_or_else(|| columns.join(" "))
}

/// Called after a recording was read and before it is analysed, with notes for the user.
type EndReading<'a> = dyn FnMut(&SampleStream, &[ReadingNote]) + 'a;

/// The report of a recording, with a progress bar. If the reading is interrupted, the report is of the samples read
/// until then.
pub(crate) fn watched_report(recording: &RecordingArguments, is_quick: bool) -> Result<Analysed> {
    let mut progress = Progress::reading(&recording.input.file);
    let monitor = progress.monitor().clone();
    let mut end_reading = |stream: &SampleStream, notes: &[ReadingNote]| {
        if progress.end_reading() {
            note(format_args!(
                "interrupted: this is the report of the first {} samples, which were read until then",
                stream.description().samples
            ));
        }
        notes_of_file(notes);
    };
    report(recording, is_quick, &monitor, &mut end_reading)
}

/// The report of a recording. If the platform moved, it is of the longest part at rest. `end_reading` is called after the recording was
/// read and before it is analysed.
pub(crate) fn report(
    recording: &RecordingArguments,
    is_quick: bool,
    monitor: &ReadMonitor,
    end_reading: &mut EndReading,
) -> Result<Analysed> {
    let mut analysed = report_of_samples(recording, is_quick, monitor, end_reading)?;
    let from_s = recording.from.unwrap_or(0.0);
    state_longest_at_rest(&mut analysed.report, from_s, || inspect::part_at_rest(recording));
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
    let file = || output::source_name(&recording.input.file);
    if is_quick {
        let estimators = streaming::curves(&mut stream)?;
        end_reading(&stream, &notes);
        let reading = reading_record(&stream, file(), recording.options(true), &notes);
        let bar = progress::fitting(stream.description().channels.len());
        let report = estimators.report(&|| bar.inc(1));
        bar.finish_and_clear();
        return Ok(Analysed { report, reading: Some(ReadingRecord { sha256: finished(hash), ..reading }) });
    }
    let mut reading = ReadingRecord::default();
    let report = analyze_stream(stream, &mut |stream| {
        end_reading(stream, &notes);
        reading = reading_record(stream, file(), recording.options(false), &notes);
    })?;
    // The hash is computed while the samples are analysed.
    Ok(Analysed { report, reading: Some(ReadingRecord { sha256: finished(hash), ..reading }) })
}

fn finished(hash: Option<FileHash>) -> Option<String> {
    hash.and_then(|hash| hash.finish().ok())
}

/// The report of all samples of `stream`. `end_reading` is called after they were read and before they are analysed.
fn analyze_stream(stream: SampleStream, end_reading: &mut dyn FnMut(&SampleStream)) -> Result<Report> {
    let samples = ReadSamples::read(stream, end_reading)?;
    Ok(progress::analysing(|watch| samples.analyze(watch)))
}

fn note_damage(damage: Option<&str>) {
    damage.into_iter().for_each(|damage| note(format_args!("{damage}")));
}

/// Opens a recording of any format, or the part of it that the arguments select.
fn open_stream(recording: &RecordingArguments, monitor: &ReadMonitor, kept: KeptInMemory) -> Result<OpenStream> {
    let reading = Reading::new(recording.rate, kept).of_part(recording.time_range());
    let opened = open(&recording.input, monitor)?.into_stream(reading);
    opened.map_err(|error| named(error, &recording.input.file))
}

/// Reads all samples of a recording into memory.
fn open_measured(recording: &RecordingArguments) -> Result<OpenStream> {
    let opened = open_stream(recording, &ReadMonitor::default(), KeptInMemory::ALL)?;
    note_damage(opened.stream.rows_read().damage.as_deref());
    Ok(opened)
}

/// Replays a table of register counts or a frame log over the emulated bus, and analyses what the driver reads; false if the
/// file ends early.
pub(crate) fn analyze_replay(arguments: &ReplayArguments) -> Result<(Report, bool)> {
    let ReplayArguments { file, rate, range, output: _ } = arguments;
    let input = RecordedInput::open(file)?;
    if !input.format().is_text() {
        bail!(
            "{}: neither register counts nor an SPI log, which are all that can be replayed",
            Printable(&file.display().to_string())
        );
    }
    let (recording, notes) = replayed(&input, (*range).into())?;
    notes_of_file(&notes);
    note_damage(recording.damage.as_deref());
    let is_complete = recording.damage.is_none();
    let report = analyze_recording(recording, *rate).with_context(|| file.display().to_string())?;
    Ok((report, is_complete))
}

/// Analyses a recording; `rate_hz` overrides the rate that its time stamps show.
pub(crate) fn analyze_recording(recording: Recording, rate_hz: Option<f64>) -> Result<Report> {
    let stream = SampleStream::recorded(recording, Reading::new(rate_hz, KEPT))?;
    analyze_stream(stream, &mut |stream| notes_of_file(stream.notes()))
}

/// Opens a file of any format.
fn open(arguments: &InputArguments, monitor: &ReadMonitor) -> Result<OpenRecording> {
    let InputArguments { range, sensor, columns, units, topic, read_by_others, .. } = arguments;
    let range = (*range).into();
    let sensor = sensor.as_deref().map(|name| sensor_profile(name, range)).transpose()?;
    let selection = ColumnSelection::parse(columns, units)?.beside(read_by_others.clone());
    let input = arguments.open(monitor)?;
    OpenRecording::new(input, OpenOptions { sensor, selection, topic: topic.clone(), range })
}

/// A recording to be written in another format.
pub(crate) enum Recorded {
    /// Register counts of an ADIS16405.
    Counts(Recording),
    /// Numbers of any sensor; they are read while they are written.
    AnySensor(RecordedInput, Box<ReadOptions>),
}

/// Opens a file of any format to write it anew. Register counts are read, or the part of them that the arguments
/// select.
pub(crate) fn open_rows(arguments: &RecordingArguments) -> Result<Recorded> {
    let (rate, part) = (arguments.rate, arguments.time_range());
    Ok(match open(&arguments.input, &ReadMonitor::default())? {
        OpenRecording::Counts(input, range) => {
            let recording = count_table::read_part(&input, range, part, rate);
            Recorded::Counts(recording.map_err(|error| named(error, &arguments.input.file))?)
        }
        OpenRecording::Replayed(recording, notes) => {
            notes_of_file(&notes);
            Recorded::Counts(match part {
                Some(part) => {
                    part_of(recording, part, rate).map_err(|error| named(error.into(), &arguments.input.file))?
                }
                None => recording,
            })
        }
        OpenRecording::AnySensor(input, options) => Recorded::AnySensor(input, options),
    })
}

/// Reads the samples of a recording of any format on their time base, and prints notes for the user.
pub(crate) fn read_measurement(arguments: &RecordingArguments) -> Result<Measurement> {
    let OpenStream { stream, notes, .. } = open_measured(arguments)?;
    notes_of_file(&notes);
    Ok(stream.into_beginning())
}

/// The profile of a known sensor, or of a profile file; `range` is the gyro range of an ADIS16405.
fn sensor_profile(name: &str, range: GyroRange) -> Result<SensorProfile> {
    if let Some(known) = profile_file::by_name(name, range.lsb()) {
        return Ok(known);
    }
    let mut text = String::new();
    let read = |file: File| file.take(PROFILE_BYTES + 1).read_to_string(&mut text);
    File::open(name).and_then(read).map_err(|error| match error.kind() {
        ErrorKind::NotFound => UnknownSensor(name.to_owned(), profile_file::sensor_names().collect()).into(),
        _ => anyhow::Error::from(error).context(format!("sensor {}", Printable(name))),
    })?;
    if text.len() as u64 > PROFILE_BYTES {
        bail!("{}: a profile is not longer than {PROFILE_BYTES} bytes", Printable(name));
    }
    profile_file::parse(&text).with_context(|| Printable(name).to_string())
}
