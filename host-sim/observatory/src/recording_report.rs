//! An open recording of any format: its samples, and their report.

use crate::streaming;
use adis16405_driver::GyroRange;
use anyhow::{Error, Result, bail};
use measurement::{Measurement, SensorProfile, adis16405};
use noise_analysis::analysis::{Stage, analyze_and_release, analyze_condensed};
use noise_analysis::effects::Effect;
use noise_analysis::record::condensed_record::CondensedRecord;
use noise_analysis::record::long_record::{MOST_LOST, MOST_SAMPLES, MOST_SAMPLES_WITH_LOSSES};
use noise_analysis::report::{Report, Stretch};
use recordings::ReadingNote;
use recordings::file_format::{FileFormat, RecordedFormat, RecordedInput};
use recordings::recording::Recording;
use recordings::sample_stream::{KeptInMemory, Reading, SampleStream, StreamError};
use recordings::time_base::TimeRange;
use recordings::{ColumnSelection, FileHash, InputError, Printable, ReadOptions};
use reports::reading::{ReadingRecord, rows_left_out};
use reports::summary::longest_at_rest;
use simulation::Replay;
use std::path::Path;

/// Size up to which recordings are not condensed for the analysis.
pub const KEPT: KeptInMemory =
    KeptInMemory { rows: MOST_SAMPLES, rows_with_losses: MOST_SAMPLES_WITH_LOSSES, most_lost: MOST_LOST };
/// The command that a report states for reading its recording again.
pub const PROGRAM: &str = "imunoise";

/// An open recording, by the way it is read.
pub enum OpenRecording {
    /// Register counts of an ADIS16405 with this gyro range.
    Counts(RecordedInput, GyroRange),
    /// Numbers of any sensor.
    AnySensor(RecordedInput, Box<ReadOptions>),
    /// A log of the bus of an ADIS16405, already read, with notes about it.
    Replayed(Recording, Vec<ReadingNote>),
}

/// Options for opening a recording of any format.
#[derive(Debug, Default)]
pub struct OpenOptions {
    /// The sensor, if the user states it.
    pub sensor: Option<SensorProfile>,
    /// The columns to be read, and their units.
    pub selection: ColumnSelection,
    /// Topic, message or array of a file that has several.
    pub topic: Option<String>,
    /// Range of the gyros if the recording is of an ADIS16405.
    pub range: GyroRange,
}

/// The samples of a recording.
pub struct OpenStream {
    /// The samples on their time base.
    pub stream: SampleStream,
    /// Hash of the file; a log of the bus has none.
    pub hash: Option<FileHash>,
    /// Notes about the file.
    pub notes: Vec<ReadingNote>,
}

impl OpenRecording {
    /// Opens the recording in `input`. Register counts and logs of the bus belong to an ADIS16405 with the gyro range of `options`, unless
    /// `options` name another sensor or the columns.
    ///
    /// # Errors
    /// A log is damaged, or a topic was requested of a format without topics.
    pub fn new(input: RecordedInput, options: OpenOptions) -> Result<Self> {
        let OpenOptions { sensor, selection, topic, range } = options;
        let has_topics = !input.format().is_text() || input.format() == RecordedFormat::File(FileFormat::TextTable);
        if let Some(topic) = topic.as_ref().filter(|_| !has_topics) {
            let name = input.name().display().to_string();
            bail!("{}: --topic {}: a file of text has no topics; leave it out", Printable(&name), Printable(topic));
        }
        let is_adis16405 = sensor.as_ref().is_none_or(|sensor| sensor.name == adis16405::NAME);
        Ok(match input.format() {
            RecordedFormat::FrameLog | RecordedFormat::SpiExport => {
                let (recording, notes) = replayed(&input, range)?;
                Self::Replayed(recording, notes)
            }
            RecordedFormat::CountTable if is_adis16405 && selection.is_empty() => Self::Counts(input, range),
            _ => {
                let sensor = sensor.unwrap_or_else(SensorProfile::generic);
                Self::AnySensor(input, Box::new(ReadOptions { sensor, selection, topic }))
            }
        })
    }

    /// The samples of the recording.
    ///
    /// # Errors
    /// The recording is damaged, or has no time base.
    pub fn into_stream(self, reading: Reading) -> Result<OpenStream, StreamError> {
        let (hash, mut notes, stream) = match self {
            Self::Counts(input, range) => {
                (input.begin_hash().ok(), Vec::new(), SampleStream::counts(input, range, reading))
            }
            Self::AnySensor(input, options) => {
                (input.begin_hash().ok(), Vec::new(), SampleStream::any_sensor(input, *options, reading))
            }
            Self::Replayed(recording, notes) => {
                (None, notes, SampleStream::recorded(recording, reading).map_err(StreamError::from))
            }
        };
        let stream = stream?;
        notes.extend_from_slice(stream.notes());
        Ok(OpenStream { stream, hash, notes })
    }
}

/// Replays a log or counts through the driver; returns the samples, and notes about the log.
///
/// # Errors
/// Those of [`simulation::replay`].
pub fn replayed(input: &RecordedInput, range: GyroRange) -> Result<(Recording, Vec<ReadingNote>), InputError> {
    let Replay { recording, other_transactions, timing } = simulation::replay(input.bytes(), range)?;
    let mut notes: Vec<ReadingNote> = timing.notes().into_iter().map(ReadingNote::from).collect();
    if other_transactions > 0 {
        notes.push(format!("{other_transactions} transactions that are no bursts").into());
    }
    Ok((recording, notes))
}

/// An error with the name of the file.
#[must_use]
pub fn named(error: StreamError, file: &Path) -> Error {
    match error {
        // The other errors name the file themselves.
        StreamError::TimeBase(error) => Error::from(error).context(file.display().to_string()),
        error => error.into(),
    }
}

/// All samples of a recording; a long one is condensed.
#[expect(clippy::large_enum_variant, reason = "one value for an analysis")]
pub enum ReadSamples {
    /// All samples.
    Whole(Measurement),
    /// The condensed form of a long recording.
    Condensed(CondensedRecord<'static>),
}

impl ReadSamples {
    /// Reads `stream` to its end, and then calls `end_reading` with it.
    ///
    /// # Errors
    /// The recording is damaged.
    pub fn read(mut stream: SampleStream, end_reading: impl FnOnce(&SampleStream)) -> Result<Self, StreamError> {
        if stream.is_in_memory() {
            end_reading(&stream);
            return Ok(Self::Whole(stream.into_beginning()));
        }
        let condensed = streaming::long_record(&mut stream)?;
        end_reading(&stream);
        Ok(Self::Condensed(condensed))
    }

    /// The report of the samples; `watch` is called at the begin of each stage.
    #[must_use]
    pub fn analyze(self, watch: &dyn Fn(Stage)) -> Report {
        match self {
            Self::Whole(measurement) => analyze_and_release(measurement, watch),
            Self::Condensed(record) => analyze_condensed(&record, watch),
        }
    }
}

/// The record of the reading of `file`, without a hash. `options` are the words of the command line, `notes` sentences
/// for the user.
#[must_use]
pub fn reading_record(
    stream: &SampleStream,
    file: String,
    options: Vec<String>,
    notes: &[ReadingNote],
) -> ReadingRecord {
    let read = stream.rows_read();
    ReadingRecord {
        file,
        sha256: None,
        program: PROGRAM.to_owned(),
        version: env!("CARGO_PKG_VERSION").to_owned(),
        options,
        rows: read.rows,
        left_out: rows_left_out(&stream.description().dropped, read.outside, read.padding),
        complete: read.is_complete(),
        damage: read.damage.clone(),
        notes: notes.iter().map(ToString::to_string).collect(),
    }
}

/// Adds the longest part at rest to the report of a moving platform. It is `by_file` if the file shows one, else it follows from the
/// motions in the analysed part, which begins at `from_s`, s from the first sample.
pub fn state_longest_at_rest(report: &mut Report, from_s: f64, by_file: impl FnOnce() -> Option<TimeRange>) {
    if !report.findings.iter().any(|finding| matches!(finding.effect, Effect::MotionInterval(_))) {
        return;
    }
    let by_motions = |report: &Report| {
        let longest = longest_at_rest(report)?;
        Some(Stretch { from_s: from_s + longest.from_s, to_s: from_s + longest.to_s })
    };
    let by_file = by_file().map(|TimeRange { from_s, to_s }| Stretch { from_s, to_s });
    report.longest_at_rest = by_file.or_else(|| by_motions(report));
}
