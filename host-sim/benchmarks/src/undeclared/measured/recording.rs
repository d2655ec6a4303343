//! Recordings of measured noise, and their parts.

use adis16405_driver::GyroRange;
use measurement::{MeasuredChannel, Measurement, SensorProfile};
use recordings::any_sensor::ReadOptions;
use recordings::file_format::{FileFormat, InputFile};
use recordings::inspection::{InspectedTable, SteadyPart};
use recordings::time_base::{TimeBaseError, TimeRange, measurement};
use recordings::{ColumnSelection, InputError, count_table};
use std::collections::BTreeMap;
use std::ops::Range;
use std::path::Path;

/// A recording of a sensor at rest.
#[derive(Debug, Clone, PartialEq)]
pub struct NoiseRecording {
    /// As the table names it.
    pub name: String,
    /// All of it.
    pub samples: Measurement,
}

/// Why a recording cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum MeasuredNoiseError {
    /// It cannot be read.
    #[error(transparent)]
    Input(#[from] InputError),
    /// Its sensor always moves.
    #[error("{0}: the sensor is never at rest")]
    Moving(String),
    /// It has no time base.
    #[error("{file}: {reason}")]
    TimeBase {
        /// The file, as it was named.
        file: String,
        /// The cause.
        reason: TimeBaseError,
    },
}

impl NoiseRecording {
    /// Reads a file of any format that the reader of recordings knows: of register counts all, of other files the longest part at
    /// rest. `rate_hz` is the sample rate of a recording without time stamps. Columns and units that a file with one sensor does not
    /// say are those that its inspection proposes.
    ///
    /// # Errors
    /// The file cannot be read, neither its time stamps nor `rate_hz` tell the sample rate, or the sensor is never at rest.
    pub fn read(file: &Path, rate_hz: Option<f64>) -> Result<Self, MeasuredNoiseError> {
        let file_name = || file.display().to_string();
        let input = InputFile::open(file)?;
        let samples = if input.format() == FileFormat::CountTable {
            let recording = count_table::read(input.path(), GyroRange::Dps300).map_err(|error| input.rename(error))?;
            with_rate(rate_hz, |rate_hz| measurement(&recording, rate_hz))
        } else {
            let tables = input.inspect(None, &ColumnSelection::default())?;
            let (options, rest) = only_sensor(&tables, rate_hz);
            let recording = input.read(&options)?;
            if rest.is_some_and(|rest| rest.to_s <= rest.from_s) {
                return Err(MeasuredNoiseError::Moving(file_name()));
            }
            with_rate(rate_hz, |rate_hz| {
                let recording = recording.clone();
                let at_rest = rest.map_or(Ok(recording.clone()), |rest| recording.within(rest, rate_hz))?;
                at_rest.time_base(rate_hz).map(|(base, _)| base.measurement)
            })
        };
        let samples = samples.map_err(|reason| MeasuredNoiseError::TimeBase { file: file_name(), reason })?;
        let name = file.file_name().map_or_else(file_name, |name| name.to_string_lossy().into_owned());
        Ok(Self { name, samples })
    }
}

/// How the only sensor in `tables` is read, and when it is at rest, where that is not all the time.
fn only_sensor(tables: &[InspectedTable], rate_hz: Option<f64>) -> (ReadOptions, Option<TimeRange>) {
    let mut proposals = tables.iter().flat_map(|table| table.proposals.iter().map(move |proposal| (table, proposal)));
    let (mut selection, mut topic, mut rest) = (ColumnSelection::default(), None, None);
    // Which of several is meant, the error of the reader asks.
    if let (Some((table, proposal)), None) = (proposals.next(), proposals.next()) {
        selection = ColumnSelection::parse(&proposal.columns, &proposal.units).unwrap_or_default();
        topic.clone_from(&proposal.topic);
        rest = table.steady.as_ref().filter(|steady| steady.rows.len() < table.rows).and_then(
            |SteadyPart { rows, .. }| {
                // By a rate of the user's where the file has none.
                let [from, to] = [rows.start, rows.end].map(|row| row as f64);
                let by_rate = |rate_hz: f64| TimeRange { from_s: from / rate_hz, to_s: to / rate_hz };
                table.steady_s.or_else(|| rate_hz.map(by_rate))
            },
        );
    }
    (ReadOptions { sensor: SensorProfile::generic(), selection, topic }, rest)
}

/// The samples on the time base of their stamps; without stamps, at `rate_hz`.
fn with_rate(
    rate_hz: Option<f64>,
    on_time_base: impl Fn(Option<f64>) -> Result<Measurement, TimeBaseError>,
) -> Result<Measurement, TimeBaseError> {
    match on_time_base(None) {
        Err(TimeBaseError::NoRate) if rate_hz.is_some() => on_time_base(rate_hz),
        samples => samples,
    }
}

/// The samples in the sample periods `periods`, as a recording of their own.
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
