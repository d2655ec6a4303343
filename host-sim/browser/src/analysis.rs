//! From the bytes of a recording to its report, as the command `imunoise` makes it.

use crate::host::{self, Task};
use crate::recording_options::RecordingOptions;
use anyhow::{Error, Result, bail};
use measurement::{Measurement, SensorProfile, adis16405};
use noise_analysis::analysis::{analyze_and_release, analyze_condensed};
use noise_analysis::effects::Effect;
use noise_analysis::record::long_record::{LongRecordReader, MOST_LOST, MOST_SAMPLES, MOST_SAMPLES_WITH_LOSSES};
use noise_analysis::report::{Report, Stretch};
use recordings::file_format::{FileFormat, RecordedFormat, RecordedInput};
use recordings::recording::Recording;
use recordings::sample_stream::{KeptInMemory, Reading, SampleStream, StreamError};
use recordings::time_base::TimeRange;
use recordings::{ColumnSelection, Printable, ReadMonitor, ReadOptions};
use reports::json::ReportJson;
use reports::page;
use reports::reading::{ReadingRecord, rows_left_out};
use reports::summary::longest_at_rest;
use serde::Serialize;
use simulation::{Replay, Simulation};
use std::path::Path;
use std::sync::Arc;

/// Recordings that are not condensed for their analysis, as those of the command.
const KEPT: KeptInMemory =
    KeptInMemory { rows: MOST_SAMPLES, rows_with_losses: MOST_SAMPLES_WITH_LOSSES, most_lost: MOST_LOST };
/// The command of which the report is the same, and which reads it again with the options that the report states.
const COMMAND: &str = "imunoise";

/// A recording in memory, and how it is read.
pub(crate) struct Recorded<'a> {
    /// Name of the file.
    pub(crate) name: &'a str,
    pub(crate) bytes: Arc<[u8]>,
    pub(crate) options: &'a RecordingOptions,
}

/// A report as the page keeps it.
#[derive(Serialize)]
struct ReportFiles {
    /// Headline of the report.
    title: String,
    html: String,
    json: String,
}

impl Recorded<'_> {
    /// Recognises the format.
    pub(crate) fn open(&self) -> Result<RecordedInput> {
        let monitor = ReadMonitor::watched(|bytes| host::progress(Task::Reading, bytes));
        Ok(RecordedInput::in_memory_monitored(Path::new(self.name), Arc::clone(&self.bytes), &monitor)?)
    }

    /// The columns and units that are named.
    pub(crate) fn selection(&self) -> Result<ColumnSelection> {
        Ok(ColumnSelection::parse(&self.options.columns, &self.options.units)?)
    }

    /// All samples on their time base.
    pub(crate) fn measurement(&self) -> Result<Measurement> {
        Ok(self.stream(self.open()?, KeptInMemory::ALL)?.0.into_beginning())
    }

    /// The report, as the page shows and saves it.
    pub(crate) fn report(&self) -> Result<String> {
        let input = self.open()?;
        // A log of the bus has none, as the driver reads it.
        let is_bus_log = matches!(input.format(), RecordedFormat::FrameLog | RecordedFormat::SpiExport);
        let hash = if is_bus_log { None } else { input.begin_hash().ok() };
        let (stream, notes) = self.stream(input, KEPT)?;
        let mut reading = None;
        let mut report = analysed(stream, |stream| reading = Some(self.reading_record(stream)))?;
        if let Some(reading) = &mut reading {
            reading.sha256 = hash.and_then(|hash| hash.finish().ok());
            reading.notes.splice(0..0, notes);
        }
        if report.findings.iter().any(|finding| matches!(finding.effect, Effect::MotionInterval(_))) {
            report.longest_at_rest = self.longest_at_rest(&report);
        }
        files(&report, Some(&Printable(self.name).to_string()), reading.as_ref())
    }

    /// The samples, and sentences on the log of a bus that they are from.
    fn stream(&self, input: RecordedInput, kept: KeptInMemory) -> Result<(SampleStream, Vec<String>)> {
        let RecordingOptions { topic, rate, .. } = self.options;
        let reading = Reading::new(*rate, kept).of_part(self.options.time_range());
        let (sensor, range, selection) = (self.options.profile()?, self.options.gyro_range()?, self.selection()?);
        let has_topics = !input.format().is_text() || input.format() == RecordedFormat::File(FileFormat::TextTable);
        if let Some(topic) = topic.as_ref().filter(|_| !has_topics) {
            bail!("{}: topic {}: a file of text has no topics", Printable(self.name), Printable(topic));
        }
        let is_adis16405 = sensor.as_ref().is_none_or(|sensor| sensor.name == adis16405::NAME);
        let stream = match input.format() {
            RecordedFormat::FrameLog | RecordedFormat::SpiExport => {
                let Replay { recording, other_transactions, timing } = simulation::replay(input.bytes(), range)?;
                let mut notes = timing.notes();
                if other_transactions > 0 {
                    notes.push(format!("{other_transactions} transactions that are no bursts"));
                }
                let stream = SampleStream::recorded(recording, reading).map_err(StreamError::from);
                return Ok((stream.map_err(|error| self.named(error))?, notes));
            }
            RecordedFormat::CountTable if is_adis16405 && selection.is_empty() => {
                SampleStream::counts(input, range, reading)
            }
            _ => {
                let sensor = sensor.unwrap_or_else(SensorProfile::generic);
                let options = ReadOptions { sensor, selection, topic: topic.clone() };
                SampleStream::any_sensor(input, options, reading)
            }
        };
        Ok((stream.map_err(|error| self.named(error))?, Vec::new()))
    }

    /// An error with the name of the file.
    fn named(&self, error: StreamError) -> Error {
        match error {
            // The others name the file themselves.
            StreamError::TimeBase(error) => Error::from(error).context(self.name.to_owned()),
            error => error.into(),
        }
    }

    fn reading_record(&self, stream: &SampleStream) -> ReadingRecord {
        let read = stream.rows_read();
        ReadingRecord {
            file: Printable(self.name).to_string(),
            sha256: None,
            program: COMMAND.to_owned(),
            version: env!("CARGO_PKG_VERSION").to_owned(),
            options: self.options.words(),
            rows: read.rows,
            left_out: rows_left_out(&stream.description().dropped, read.outside, read.padding),
            complete: read.is_complete(),
            damage: read.damage.clone(),
            notes: stream.notes().to_vec(),
        }
    }

    /// The longest part at rest, by the file where it shows one, else by the motions that were found.
    fn longest_at_rest(&self, report: &Report) -> Option<Stretch> {
        let tables = || self.open().ok()?.inspect(self.options.topic.as_deref(), &self.selection().ok()?).ok();
        let by_file = match tables().as_deref() {
            Some([table]) => table.part_at_rest(),
            _ => None,
        };
        let from_s = self.options.from.unwrap_or(0.0);
        let by_motions = || {
            let longest = longest_at_rest(report)?;
            Some(Stretch { from_s: from_s + longest.from_s, to_s: from_s + longest.to_s })
        };
        by_file.map(|TimeRange { from_s, to_s }| Stretch { from_s, to_s }).or_else(by_motions)
    }
}

/// The report of what the virtual sensor records.
pub(crate) fn simulated(simulation: &Simulation) -> Result<String> {
    let recording: Recording = simulation.run(|samples| host::progress(Task::Simulating, samples))?;
    let stream = SampleStream::recorded(recording, Reading::new(None, KEPT))?;
    files(&analysed(stream, |_| {})?, None, None)
}

/// The report of all samples; `end_reading` is called when they were read.
fn analysed(mut stream: SampleStream, end_reading: impl FnOnce(&SampleStream)) -> Result<Report> {
    let watch = |stage| host::progress(Task::Analysing, stage as u64);
    if stream.is_in_memory() {
        end_reading(&stream);
        return Ok(analyze_and_release(stream.into_beginning(), &watch));
    }
    let condensed = loop {
        let mut reader = LongRecordReader::new(stream.description().clone(), stream.beginning());
        if stream.read(|block| reader.push(&block))? {
            break reader.finish();
        }
    };
    end_reading(&stream);
    drop(stream);
    Ok(analyze_condensed(&condensed, &watch))
}

fn files(report: &Report, source: Option<&str>, reading: Option<&ReadingRecord>) -> Result<String> {
    let files = ReportFiles {
        title: reports::summary::headline(report, source).join(" · "),
        html: page::html_with_reading(report, source, reading),
        json: serde_json::to_string_pretty(&ReportJson::from(report).with_reading(reading))?,
    };
    Ok(serde_json::to_string(&files)?)
}
