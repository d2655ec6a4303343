//! A table of register counts, read in blocks.

use crate::counts::count_table::CountTable;
use crate::counts::recording::{RecordedSample, Recorder, Recording};
use crate::input::delimited_text::Lines;
use crate::input::input_error::InputError;
use crate::input::read_ahead::for_each_ahead;
use crate::input::read_monitor::ReadMonitor;
use crate::time_base::channels;
use crate::time_base::sample_slots::MAX_REPEATED_READ_INTERVAL;
use crate::time_base::stream_clock::{BLOCK, Placed, Stamp, StreamClock};
use crate::time_base::time_base_error::StreamError;
use adis16405_driver::{Burst, Channel, Faults, GyroRange};
use measurement::{SampleBlock, SensorProfile};
use std::collections::BTreeMap;
use std::path::Path;

/// The first rows of a table; whether these are all.
pub(crate) fn head(
    file: &Path,
    range: GyroRange,
    monitor: &ReadMonitor,
    most: u64,
) -> Result<(Recording, bool), InputError> {
    let mut table = CountTable::new(file, Lines::open_monitored(file, monitor)?)?;
    let mut recorder = Recorder::new(table.channels(), range).with_capacity(most);
    while table.rows() < most {
        let Some(row) = table.next()? else { return Ok((recorder.finish(), true)) };
        recorder.push(row.time_stamp, &Burst::from_counts(&row.counts));
    }
    Ok((recorder.finish(), false))
}

/// One pass over a table.
pub(crate) struct CountStream {
    rows: CountRows,
    /// With what was counted until now.
    pub(crate) placer: RowPlacer,
}

/// The rows of a table, read in blocks.
struct CountRows {
    table: CountTable,
    recorder: Recorder,
    /// Rows to read at most.
    most: u64,
    is_finished: bool,
}

/// Some rows that follow each other.
struct RowBlock {
    samples: Vec<RecordedSample>,
    /// Rows of the table up to the last of these.
    rows: u64,
    /// Whether no row follows.
    is_last: bool,
}

/// Gives the rows of a table their sample periods, and counts what can be used.
pub(crate) struct RowPlacer {
    channels: Vec<Channel>,
    clock: StreamClock,
    /// Shortest interval of two samples that are not one that was read twice, s; 0 where there are no time stamps.
    shortest_s: f64,
    /// Time of the last row that was read, s.
    before_s: Option<f64>,
    /// Rows that arrived and are not placed yet.
    arrived: Vec<RecordedSample>,
    /// Rows that were left out since the last usable one, of a table with an index.
    left_out: u64,
    /// Period of the first usable sample, and the periods missing before it.
    first: Option<Placed>,
    last: Placed,
    /// Usable samples so far.
    pub(crate) samples: u64,
    /// Samples that never arrived.
    pub(crate) never_arrived: u64,
    /// As [`Measurement::dropped`](measurement::Measurement::dropped), without `gap`.
    pub(crate) dropped: BTreeMap<&'static str, u64>,
    /// As [`Measurement::flagged`](measurement::Measurement::flagged), without what the stamps show.
    pub(crate) flagged: BTreeMap<&'static str, u64>,
}

impl CountStream {
    /// Of the first `most` rows; the period is that of the sample rate, if it is known, s.
    pub(crate) fn open(
        file: &Path,
        range: GyroRange,
        monitor: &ReadMonitor,
        clock: StreamClock,
        period_s: Option<f64>,
        most: u64,
    ) -> Result<Self, InputError> {
        let table = CountTable::new(file, Lines::open_monitored(file, monitor)?)?.of_any_length();
        let placer = RowPlacer {
            channels: table.channels(),
            clock,
            shortest_s: MAX_REPEATED_READ_INTERVAL * period_s.unwrap_or(0.0),
            before_s: None,
            arrived: Vec::new(),
            left_out: 0,
            first: None,
            last: Placed { period: 0, missing: 0 },
            samples: 0,
            never_arrived: 0,
            dropped: BTreeMap::new(),
            flagged: BTreeMap::new(),
        };
        let recorder = Recorder::new(table.channels(), range);
        Ok(Self { rows: CountRows { table, recorder, most, is_finished: false }, placer })
    }

    /// The next samples, of channels with the profiles of `profile`; `None` at the end.
    pub(crate) fn next(&mut self, profile: &SensorProfile) -> Result<Option<SampleBlock>, StreamError> {
        let Some(rows) = self.rows.next()? else { return Ok(None) };
        self.placer.block(rows, profile).map(Some)
    }

    /// Reads to the end, for what is counted on the way; the samples of a table that has at most `most` rows. The next rows are read
    /// while these are placed.
    pub(crate) fn survey(&mut self, most: u64, profile: &SensorProfile) -> Result<Vec<SampleBlock>, StreamError> {
        let Self { rows, placer } = self;
        let mut kept = Vec::new();
        for_each_ahead(
            || rows.next(),
            |rows| {
                if rows.rows <= most {
                    kept.push(placer.block(rows, profile)?);
                    return Ok(());
                }
                kept = Vec::new();
                placer.place(rows, |_, _| {})
            },
        )?;
        Ok(kept)
    }

    /// Rows that were read.
    pub(crate) fn rows(&self) -> u64 {
        self.rows.table.rows()
    }

    /// Whether the reading was stopped before the end of the table.
    pub(crate) fn is_stopped(&self) -> bool {
        self.rows.table.is_stopped()
    }
}

impl CountRows {
    /// The next ones; `None` at the end.
    fn next(&mut self) -> Result<Option<RowBlock>, StreamError> {
        if self.is_finished {
            return Ok(None);
        }
        let mut rows = 0;
        while rows < BLOCK && self.table.rows() < self.most {
            let Some(row) = self.table.next()? else {
                self.is_finished = true;
                break;
            };
            self.recorder.push(row.time_stamp, &Burst::from_counts(&row.counts));
            rows += 1;
        }
        self.is_finished |= self.table.rows() >= self.most;
        let samples = self.recorder.take_samples();
        Ok(Some(RowBlock { samples, rows: self.table.rows(), is_last: self.is_finished }))
    }
}

impl RowPlacer {
    /// The next samples, of channels with the profiles of `profile`.
    fn block(&mut self, rows: RowBlock, profile: &SensorProfile) -> Result<SampleBlock, StreamError> {
        let (mut slots, mut usable) = (Vec::with_capacity(BLOCK), Vec::with_capacity(BLOCK));
        let take = |slot: u64, sample: &RecordedSample| {
            slots.push(slot);
            usable.push(*sample);
        };
        self.place(rows, take)?;
        Ok(SampleBlock { channels: channels(&self.channels, profile, usable.iter().copied()), slots })
    }

    /// Calls `take` with each of the next samples that can be used, and its sample period counted from the first one.
    fn place(&mut self, rows: RowBlock, mut take: impl FnMut(u64, &RecordedSample)) -> Result<(), StreamError> {
        let before = self.arrived.len();
        for sample in rows.samples {
            let time_s = sample.time_stamp.time_s;
            let is_short =
                matches!((self.before_s, time_s), (Some(before), Some(now)) if now - before < self.shortest_s);
            self.before_s = time_s;
            if is_short && sample.faults.contains(Faults::REPEATED) {
                *self.dropped.entry(sample.cause_of_loss(true).unwrap_or_default()).or_insert(0) += 1;
                self.left_out += 1;
                continue;
            }
            self.arrived.push(sample);
        }
        let stamp =
            |sample: &RecordedSample| Stamp { time_s: sample.time_stamp.time_s, index: sample.time_stamp.index };
        let placed = self.clock.place(self.arrived[before..].iter().map(stamp), rows.is_last)?;
        let mut arrived = std::mem::take(&mut self.arrived);
        for (placed, sample) in placed.iter().zip(&arrived) {
            if self.is_usable(*placed, sample) {
                take(placed.period - self.first.map_or(0, |first| first.period), sample);
            }
        }
        arrived.drain(..placed.len());
        self.arrived = arrived;
        Ok(())
    }

    /// Counts a sample, and tells whether it can be used.
    fn is_usable(&mut self, placed: Placed, sample: &RecordedSample) -> bool {
        if let Some(cause) = sample.cause_of_loss(false) {
            *self.dropped.entry(cause).or_insert(0) += 1;
            self.left_out += 1;
            return false;
        }
        for cause in (sample.faults & Faults::WARNINGS).causes() {
            *self.flagged.entry(cause).or_insert(0) += 1;
        }
        let lost = match self.first {
            None => 0,
            // A sample that is left out has an index too.
            Some(_) if sample.time_stamp.index.is_some() => {
                (placed.period - self.last.period - 1).saturating_sub(self.left_out)
            }
            Some(_) => placed.missing - self.last.missing,
        };
        self.never_arrived = self.never_arrived.saturating_add(lost);
        self.first.get_or_insert(placed);
        (self.last, self.left_out) = (placed, 0);
        self.samples += 1;
        true
    }

    /// Sample periods from the first usable sample to the last, both included.
    pub(crate) fn periods(&self) -> u64 {
        self.first.map_or(0, |first| self.last.period - first.period + 1)
    }

    /// The clock that placed the rows.
    pub(crate) fn clock(&self) -> &StreamClock {
        &self.clock
    }
}
