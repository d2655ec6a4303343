//! Recordings of measured noise.

use adis16405_driver::GyroRange;
use measurement::{MeasuredChannel, Measurement, SensorProfile};
use recordings::ReadOptions;
use recordings::file_format::{RecordedFormat, RecordedInput};
use recordings::inspection::{InspectedTable, SteadyPart};
use recordings::sample_stream::{KeptInMemory, Reading, SampleStream, StreamError};
use recordings::time_base::{TimeBaseError, TimeRange};
use recordings::{ColumnSelection, InputError};
use std::collections::BTreeMap;
use std::ops::Range;
use std::path::Path;

#[derive(Debug, Clone, PartialEq)]
pub struct NoiseRecording {
    pub name: String,
    pub samples: Measurement,
}

#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum MeasuredNoiseError {
    #[error(transparent)]
    Input(#[from] InputError),
    #[error("{0}: the sensor is never at rest")]
    Moving(String),
    #[error("{file}: {reason}")]
    TimeBase { file: String, reason: TimeBaseError },
}

impl NoiseRecording {
    /// Reads all of a recording of register counts, or the longest part at rest of any other file. `rate_hz` is for
    /// files without time stamps. The inspection proposes missing columns and units.
    ///
    /// # Errors
    /// The file cannot be read, neither its time stamps nor `rate_hz` give the sample rate, or the sensor is never at
    /// rest.
    pub fn read(file: &Path, rate_hz: Option<f64>) -> Result<Self, MeasuredNoiseError> {
        let file_name = || file.display().to_string();
        let input = RecordedInput::open(file)?;
        let samples = if input.format() == RecordedFormat::CountTable {
            with_rate(rate_hz, |rate_hz| {
                let reading = Reading::new(rate_hz, KeptInMemory::ALL);
                SampleStream::counts(RecordedInput::open(file)?, GyroRange::Dps300, reading)
            })
        } else {
            let tables = input.inspect(None, &ColumnSelection::default())?;
            let (options, rest) = only_sensor(&tables, rate_hz);
            if rest.is_some_and(|rest| rest.to_s <= rest.from_s) {
                return Err(MeasuredNoiseError::Moving(file_name()));
            }
            with_rate(rate_hz, |rate_hz| {
                let reading = Reading::new(rate_hz, KeptInMemory::ALL).of_part(rest);
                SampleStream::any_sensor(RecordedInput::open(file)?, options.clone(), reading)
            })
        };
        let samples = samples.map_err(|error| match error {
            StreamError::Input(error) => MeasuredNoiseError::Input(error),
            StreamError::TimeBase(reason) => MeasuredNoiseError::TimeBase { file: file_name(), reason },
        })?;
        let name = file.file_name().map_or_else(file_name, |name| name.to_string_lossy().into_owned());
        Ok(Self { name, samples })
    }
}

/// The proposal for the only sensor, and its time at rest.
fn only_sensor(tables: &[InspectedTable], rate_hz: Option<f64>) -> (ReadOptions, Option<TimeRange>) {
    let mut proposals = tables.iter().flat_map(|table| table.proposals.iter().map(move |proposal| (table, proposal)));
    let (mut selection, mut topic, mut rest) = (ColumnSelection::default(), None, None);
    // With several proposals the reader's error names them.
    if let (Some((table, proposal)), None) = (proposals.next(), proposals.next()) {
        selection = ColumnSelection::parse(&proposal.columns, &proposal.units).unwrap_or_default();
        topic.clone_from(&proposal.topic);
        rest = table.steady.as_ref().filter(|steady| steady.rows.len() < table.rows).and_then(
            |SteadyPart { rows, .. }| {
                // Rows are converted at the user's rate if the file has none.
                let [from, to] = [rows.start, rows.end].map(|row| row as f64);
                let by_rate = |rate_hz: f64| TimeRange { from_s: from / rate_hz, to_s: to / rate_hz };
                table.steady_s.or_else(|| rate_hz.map(by_rate))
            },
        );
    }
    (ReadOptions { sensor: SensorProfile::generic(), selection, topic }, rest)
}

/// Sets the time base by time stamps, or at `rate_hz`.
fn with_rate(
    rate_hz: Option<f64>,
    open: impl Fn(Option<f64>) -> Result<SampleStream, StreamError>,
) -> Result<Measurement, StreamError> {
    let opened = match open(None) {
        Err(StreamError::TimeBase(TimeBaseError::NoRate)) if rate_hz.is_some() => open(rate_hz),
        opened => opened,
    };
    opened.map(SampleStream::into_beginning)
}

/// The sample periods `periods` as a recording.
pub(super) fn part(whole: &Measurement, periods: Range<u64>) -> Measurement {
    let [from, to] = [periods.start, periods.end].map(|slot| whole.slots.partition_point(|of| *of < slot));
    let first = whole.slots.get(from).copied().unwrap_or(0);
    let slots: Vec<u64> = whole.slots[from..to].iter().map(|slot| slot - first).collect();
    let missing = slots.last().map_or(0, |last| last + 1 - slots.len() as u64);
    Measurement {
        profile: whole.profile.clone(),
        sample_rate_hz: whole.sample_rate_hz,
        stated_rate_hz: whole.stated_rate_hz,
        slots,
        times_s: whole.times_s.as_ref().map(|times| times[from..to].to_vec()),
        channels: whole.channels.iter().map(|channel: &MeasuredChannel| channel.part(from..to)).collect(),
        dropped: BTreeMap::from([("gap", missing)]),
        flagged: BTreeMap::new(),
    }
}
