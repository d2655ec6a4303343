//! The report of a recording in memory, as the command `imunoise` makes it.

use crate::host::{self, Task};
use crate::recording_options::RecordingOptions;
use anyhow::Result;
use measurement::Measurement;
use noise_analysis::analysis::Stage;
use noise_analysis::report::Report;
use observatory::recording_report::{
    KEPT, OpenOptions, OpenRecording, OpenStream, ReadSamples, named, reading_record, state_longest_at_rest,
};
use recordings::file_format::RecordedInput;
use recordings::recording::Recording;
use recordings::sample_stream::{KeptInMemory, Reading, SampleStream};
use recordings::{ColumnSelection, Printable, ReadMonitor};
use reports::json::ReportJson;
use reports::page;
use reports::reading::ReadingRecord;
use serde::Serialize;
use simulation::Simulation;
use std::path::Path;
use std::sync::Arc;

/// A recording in memory, with the options for reading it.
pub(crate) struct Recorded<'a> {
    /// Name of the file.
    pub(crate) name: &'a str,
    pub(crate) bytes: Arc<[u8]>,
    pub(crate) options: &'a RecordingOptions,
}

/// The files of a report that the page keeps.
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

    /// The columns and units that the options name.
    pub(crate) fn selection(&self) -> Result<ColumnSelection> {
        Ok(ColumnSelection::parse(&self.options.columns, &self.options.units)?)
    }

    /// Reads all samples onto their time base.
    pub(crate) fn measurement(&self) -> Result<Measurement> {
        Ok(self.open_stream(KeptInMemory::ALL)?.stream.into_beginning())
    }

    /// The report, for the page to show and save.
    pub(crate) fn report(&self) -> Result<String> {
        let OpenStream { stream, hash, notes } = self.open_stream(KEPT)?;
        let name = Printable(self.name).to_string();
        let mut reading = ReadingRecord::default();
        let samples = ReadSamples::read(stream, |stream| {
            reading = reading_record(stream, name.clone(), self.options.words(), &notes);
        })?;
        let mut report = samples.analyze(&watch);
        reading.sha256 = hash.and_then(|hash| hash.finish().ok());
        let tables = || self.open().ok()?.inspect(self.options.topic.as_deref(), &self.selection().ok()?).ok();
        state_longest_at_rest(&mut report, self.options.from.unwrap_or(0.0), || match tables()?.as_slice() {
            [table] => table.part_at_rest(),
            _ => None,
        });
        files(&report, Some(&name), Some(&reading))
    }

    fn open_stream(&self, kept: KeptInMemory) -> Result<OpenStream> {
        let RecordingOptions { topic, rate, .. } = self.options;
        let reading = Reading::new(*rate, kept).of_part(self.options.time_range());
        let (sensor, range) = (self.options.profile()?, self.options.gyro_range()?);
        let options = OpenOptions { sensor, selection: self.selection()?, topic: topic.clone(), range };
        let stream = OpenRecording::new(self.open()?, options)?.into_stream(reading);
        stream.map_err(|error| named(error, Path::new(self.name)))
    }
}

/// The report of a simulated recording of the virtual sensor.
pub(crate) fn simulated(simulation: &Simulation) -> Result<String> {
    let recording: Recording = simulation.run(|samples| host::progress(Task::Simulating, samples))?;
    let stream = SampleStream::recorded(recording, Reading::new(None, KEPT))?;
    files(&ReadSamples::read(stream, |_| {})?.analyze(&watch), None, None)
}

fn watch(stage: Stage) {
    host::progress(Task::Analysing, stage as u64);
}

fn files(report: &Report, source: Option<&str>, reading: Option<&ReadingRecord>) -> Result<String> {
    let files = ReportFiles {
        title: reports::summary::headline(report, source).join(" · "),
        html: page::html(report, source, reading),
        json: serde_json::to_string_pretty(&ReportJson::new(report, reading))?,
    };
    Ok(serde_json::to_string(&files)?)
}
