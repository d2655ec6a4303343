//! A table of numbers in any units, or an array, read in blocks.

use crate::columns::column_selection::{ChosenColumn, Role};
use crate::formats::file_format::FileFormat;
use crate::formats::numpy::NpyRows;
use crate::formats::text_table::TextTable;
use crate::input::input_error::{InputError, Reason};
use crate::input::read_monitor::ReadMonitor;
use crate::tables::any_sensor::ReadOptions;
use crate::tables::quantizer::Quantizer;
use crate::tables::sensor_measurement::{MIN_CHANNELS_OF_REPEAT, largest_value, refusal};
use crate::tables::sensor_table::{RowBlock, SensorTable, TableBuilder};
use crate::time_base::sample_slots::MAX_REPEATED_READ_INTERVAL;
use crate::time_base::stream_clock::{BLOCK, Stamp, StreamClock};
use crate::time_base::time_base_error::StreamError;
use measurement::{ChannelProfile, MeasuredChannel, SampleBlock};
use std::collections::BTreeMap;
use std::path::Path;

/// Rows of a file, one after the other.
enum RowReader {
    Text(Box<TextTable>),
    Npy(Box<NpyRows>),
}

impl RowReader {
    fn open(file: &Path, format: FileFormat, options: &ReadOptions, monitor: &ReadMonitor) -> Result<Self, InputError> {
        match format {
            FileFormat::Npy => NpyRows::open(file, options, monitor).map(|rows| Self::Npy(Box::new(rows))),
            _ => TextTable::open(file, options, monitor).map(|rows| Self::Text(Box::new(rows))),
        }
    }

    fn chosen(&self) -> &[ChosenColumn] {
        match self {
            Self::Text(rows) => rows.chosen(),
            Self::Npy(rows) => rows.chosen(),
        }
    }

    fn notes(&self) -> Vec<String> {
        match self {
            Self::Text(rows) => rows.notes(),
            Self::Npy(_) => Vec::new(),
        }
    }

    /// The rate that the file states beside its rows, Hz.
    fn rate_hz(&self) -> Option<f64> {
        match self {
            Self::Text(rows) => rows.rate_hz(),
            Self::Npy(_) => None,
        }
    }

    fn add_row(&mut self, builder: &mut TableBuilder) -> Result<bool, InputError> {
        match self {
            Self::Text(rows) => rows.add_row(builder),
            Self::Npy(rows) => rows.add_row(builder),
        }
    }

    fn is_stopped(&self) -> bool {
        match self {
            Self::Text(rows) => rows.is_stopped(),
            Self::Npy(rows) => rows.is_stopped(),
        }
    }
}

/// The first rows of a file.
pub(crate) struct ValueHead {
    pub(crate) table: SensorTable,
    /// Unit of the times of the file, s.
    pub(crate) time_unit_s: f64,
    /// Whether these are all rows.
    pub(crate) is_all: bool,
}

/// Reads the first `most` rows.
pub(crate) fn head(
    file: &Path,
    format: FileFormat,
    options: &ReadOptions,
    monitor: &ReadMonitor,
    most: u64,
) -> Result<ValueHead, InputError> {
    let fail = |reason: Reason| InputError::file(file, reason);
    let mut rows = RowReader::open(file, format, options, monitor)?;
    let mut builder = TableBuilder::new(rows.chosen().to_vec());
    let mut is_all = false;
    while !is_all && builder.rows() < most {
        is_all = !rows.add_row(&mut builder)?;
    }
    let (time_unit_s, _) = builder.time_unit().map_err(fail)?;
    let mut table = builder.finish().map_err(fail)?;
    table.notes.extend(rows.notes());
    // Time stamps say more than a stated rate.
    table.rate_hz = rows.rate_hz().filter(|_| table.times_s.is_none());
    Ok(ValueHead { table, time_unit_s, is_all })
}

/// A channel and how its numbers are read.
#[derive(Debug, Clone)]
pub(crate) struct ValueColumn {
    pub(crate) profile: ChannelProfile,
    /// Size of 1 in the unit of the profile.
    pub(crate) factor: f64,
    /// As the file names it.
    pub(crate) label: String,
}

/// Rows that are placed in time: their numbers by column, NaN where there is none that can be used.
pub(crate) struct PlacedRows {
    pub(crate) slots: Vec<u64>,
    pub(crate) values: Vec<Vec<f64>>,
    /// Positions of the numbers that are refused, by cause, for each column.
    pub(crate) refused: Vec<BTreeMap<&'static str, Vec<usize>>>,
}

/// One pass over a file.
pub(crate) struct ValueStream {
    rows: RowReader,
    builder: TableBuilder,
    pub(crate) columns: Vec<ValueColumn>,
    clock: StreamClock,
    time_unit_s: f64,
    /// Shortest interval of two equal rows that are not one that was read twice, s.
    shortest_s: f64,
    most: u64,
    /// The last row that was read: its time, s, and its numbers.
    before: Option<(f64, Vec<f64>)>,
    /// Rows that arrived and are not placed yet.
    arrived: RowBlock,
    origin: Option<u64>,
    last_slot: u64,
    is_finished: bool,
    pub(crate) samples: u64,
    /// Sample periods without a row.
    pub(crate) never_arrived: u64,
    /// Rows that were read twice.
    pub(crate) repeated: u64,
}

impl ValueStream {
    /// Of the first `most` rows; the period is that of the sample rate, if it is known, s.
    pub(crate) fn open(
        (file, format): (&Path, FileFormat),
        options: &ReadOptions,
        monitor: &ReadMonitor,
        (clock, period_s): (StreamClock, Option<f64>),
        time_unit_s: f64,
        most: u64,
    ) -> Result<Self, InputError> {
        let rows = RowReader::open(file, format, options, monitor)?;
        let builder = TableBuilder::new(rows.chosen().to_vec()).of_any_length();
        let column = |column: &ChosenColumn| match column.role {
            Role::Channel(profile) => Some(ValueColumn { profile, factor: column.factor, label: column.label.clone() }),
            Role::Time | Role::Index => None,
        };
        let columns: Vec<ValueColumn> = rows.chosen().iter().filter_map(column).collect();
        let arrived = RowBlock { values: vec![Vec::new(); columns.len()], ..RowBlock::default() };
        Ok(Self {
            rows,
            builder,
            columns,
            clock,
            time_unit_s,
            shortest_s: MAX_REPEATED_READ_INTERVAL * period_s.unwrap_or(0.0),
            most,
            before: None,
            arrived,
            origin: None,
            last_slot: 0,
            is_finished: false,
            samples: 0,
            never_arrived: 0,
            repeated: 0,
        })
    }

    /// The next rows; `None` at the end.
    pub(crate) fn next(&mut self) -> Result<Option<PlacedRows>, StreamError> {
        if self.is_finished {
            return Ok(None);
        }
        let first = self.builder.rows();
        while !self.is_finished && self.builder.rows() - first < BLOCK as u64 {
            self.is_finished = self.builder.rows() >= self.most || !self.rows.add_row(&mut self.builder)?;
        }
        let known = self.arrived.values.first().map_or(0, Vec::len);
        self.take_arrived();
        let RowBlock { times, indices, values } = &self.arrived;
        let stamps = (known..values.first().map_or(0, Vec::len))
            .map(|row| Stamp { time_s: times.get(row).copied(), index: indices.get(row).copied() });
        let placed = self.clock.place(stamps, self.is_finished)?;
        let count = placed.len();
        let RowBlock { times, indices, values } = &mut self.arrived;
        times.drain(..count.min(times.len()));
        indices.drain(..count.min(indices.len()));
        let mut values: Vec<Vec<f64>> = values.iter_mut().map(|column| column.drain(..count).collect()).collect();
        let slots: Vec<u64> = placed
            .iter()
            .map(|placed| placed.period.saturating_sub(*self.origin.get_or_insert(placed.period)))
            .collect();
        if let (Some(placed), Some(slot)) = (placed.last(), slots.last()) {
            (self.never_arrived, self.last_slot) = (placed.missing, *slot);
        }
        self.samples += count as u64;
        let refuse = |(values, column): (&mut Vec<f64>, &ValueColumn)| {
            let limit = largest_value(&column.profile);
            let mut refused: BTreeMap<&'static str, Vec<usize>> = BTreeMap::new();
            for (position, value) in values.iter_mut().enumerate() {
                if let Some(cause) = refusal(*value, column.factor, limit) {
                    refused.entry(cause).or_default().push(position);
                    *value = f64::NAN;
                }
            }
            refused
        };
        let refused = values.iter_mut().zip(&self.columns).map(refuse).collect();
        Ok(Some(PlacedRows { slots, values, refused }))
    }

    /// Takes the rows that were read, without those that were read twice.
    fn take_arrived(&mut self) {
        let RowBlock { times, indices, values } = self.builder.take_rows();
        let rows = values.first().map_or(0, Vec::len);
        for row in 0..rows {
            let time_s = times.get(row).map(|time| time * self.time_unit_s);
            let is_repeat = values.len() >= MIN_CHANNELS_OF_REPEAT
                && matches!((&self.before, time_s), (Some((before, numbers)), Some(now))
                    if now - before < self.shortest_s
                        && numbers.iter().zip(&values).all(|(before, column)| *before == column[row]));
            if let Some(time_s) = time_s {
                let (before, numbers) = self.before.get_or_insert_with(|| (time_s, Vec::new()));
                *before = time_s;
                numbers.clear();
                numbers.extend(values.iter().map(|column| column[row]));
            }
            if is_repeat {
                self.repeated += 1;
                continue;
            }
            self.arrived.times.extend(time_s);
            self.arrived.indices.extend(indices.get(row));
            for (arrived, column) in self.arrived.values.iter_mut().zip(&values) {
                arrived.push(column[row]);
            }
        }
    }

    /// Sample periods from the first row to the last, both included.
    pub(crate) fn periods(&self) -> u64 {
        if self.samples == 0 { 0 } else { self.last_slot.saturating_add(1) }
    }

    /// The clock that placed the rows.
    pub(crate) fn clock(&self) -> &StreamClock {
        &self.clock
    }

    /// Rows whose time goes back, and a sentence that says so; `None` without one.
    pub(crate) fn backwards(&self) -> Result<Option<(u64, String)>, Reason> {
        self.builder.backwards()
    }

    /// Rows that were read.
    pub(crate) fn rows(&self) -> u64 {
        self.builder.rows()
    }

    /// Whether the reading was stopped before the end of the file.
    pub(crate) fn is_stopped(&self) -> bool {
        self.rows.is_stopped()
    }
}

impl PlacedRows {
    /// The samples of the columns that have a quantizer, as counts; `off_step` is set for a column with a number that is no
    /// multiple of its step.
    pub(crate) fn into_block(
        self,
        columns: &[ValueColumn],
        quantizers: &[Option<Quantizer>],
        off_step: &mut [bool],
    ) -> SampleBlock {
        let mut channels = Vec::with_capacity(columns.len());
        let all = columns.iter().zip(quantizers).zip(self.values).zip(self.refused).zip(off_step);
        for ((((column, quantizer), values), mut refused), off_step) in all {
            let Some(quantizer) = quantizer else { continue };
            let mut counts = Vec::with_capacity(values.len());
            for (position, &value) in values.iter().enumerate() {
                *off_step |= !quantizer.is_on_step(value);
                let count = quantizer.count(value);
                if count.is_none() && value.is_finite() {
                    refused.entry("out_of_range").or_default().push(position);
                }
                counts.push(count.unwrap_or_default());
            }
            refused.values_mut().for_each(|positions| positions.sort_unstable());
            let profile = ChannelProfile { lsb: quantizer.lsb * column.factor, ..column.profile };
            channels.push(MeasuredChannel { refused, ..MeasuredChannel::new(profile, counts) });
        }
        SampleBlock { slots: self.slots, channels }
    }
}

/// Consecutive rows of a column of which all are kept or none.
const RUN: usize = 64;
/// Numbers of a column that are kept at most.
const MOST_KEPT: usize = 1 << 17;

/// Numbers of a column, evenly spread in runs of neighbours with NaN between the runs: all numbers of a column up to 2¹⁷.
pub(crate) struct ColumnSample {
    values: Vec<f64>,
    /// Numbers seen, and how many runs there are for one that is kept.
    seen: usize,
    stride: usize,
    /// Whether a number could be used.
    pub(crate) is_usable: bool,
}

impl ColumnSample {
    pub(crate) fn new() -> Self {
        Self { values: Vec::new(), seen: 0, stride: 1, is_usable: false }
    }

    pub(crate) fn extend(&mut self, values: &[f64]) {
        for &value in values {
            self.is_usable |= value.is_finite();
            if (self.seen / RUN).is_multiple_of(self.stride) {
                if self.values.len() == MOST_KEPT {
                    self.thin();
                    self.stride *= 2;
                }
                if (self.seen / RUN).is_multiple_of(self.stride) {
                    self.values.push(value);
                }
            }
            self.seen += 1;
        }
    }

    /// Drops every second run.
    fn thin(&mut self) {
        let kept = self.values.chunks(RUN).step_by(2).flatten().copied().collect();
        self.values = kept;
    }

    /// The numbers that are kept.
    pub(crate) fn values(&self) -> Vec<f64> {
        if self.stride == 1 {
            return self.values.clone();
        }
        let run = |run: &[f64]| run.iter().copied().chain([f64::NAN]).collect::<Vec<f64>>();
        self.values.chunks(RUN).flat_map(run).collect()
    }
}
