//! Samples of any sensor as a file holds them: columns of numbers in the file's units, and time stamps.

use crate::columns::column_selection::{ChosenColumn, Role};
use crate::columns::unit::{SECOND, Unit};
use crate::counts::recording::MAX_SAMPLES;
use crate::input::budget::{Budget, Meter};
use crate::input::input_error::Reason;
use measurement::ChannelProfile;
use std::collections::BTreeMap;

/// Largest share of rows whose time stamps may go back; they are left out. More are another recording.
const MAX_BACKWARDS: f64 = 0.1;

/// Sample rates, Hz, that a time column without a unit may have.
const PLAUSIBLE_HZ: std::ops::RangeInclusive<f64> = 0.2..=40_000.0;

/// A number as a file holds it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Number {
    /// Exact: time stamps in ns since 1970 need more digits than a float has.
    Integer(i64),
    /// Any other.
    Real(f64),
}

impl Number {
    /// The nearest float.
    pub(crate) fn value(self) -> f64 {
        match self {
            Self::Integer(integer) => integer as f64,
            Self::Real(real) => real,
        }
    }

    /// How much larger it is than `origin`.
    fn since(self, origin: Self) -> f64 {
        match (self, origin) {
            (Self::Integer(now), Self::Integer(origin)) => (i128::from(now) - i128::from(origin)) as f64,
            _ => self.value() - origin.value(),
        }
    }
}

/// The samples of one channel.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct TableColumn {
    /// The channel; its LSB is not that of the values.
    pub(crate) profile: ChannelProfile,
    /// Size of 1 in the unit of the profile.
    pub(crate) factor: f64,
    /// As the file names it.
    pub(crate) label: String,
    /// One number a row; NaN where there is none.
    pub(crate) values: Vec<f64>,
}

/// The rows of a recording.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct SensorTable {
    /// Time stamps, s from the first; not decreasing.
    pub(crate) times_s: Option<Vec<f64>>,
    /// Running number of each row; increasing.
    pub(crate) indices: Option<Vec<u64>>,
    /// The channels, in the order of the sensor's profile.
    pub(crate) columns: Vec<TableColumn>,
    /// Rows that were left out, by cause.
    pub(crate) dropped: BTreeMap<&'static str, u64>,
    /// What the user should know, one sentence each.
    pub(crate) notes: Vec<String>,
    /// The sample rate that the file states beside its rows, Hz.
    pub(crate) rate_hz: Option<f64>,
}

impl SensorTable {
    /// Leaves out the rows whose flag is not set.
    pub(crate) fn retain(&mut self, kept: &[bool]) {
        fn retain<T>(values: &mut Vec<T>, kept: &[bool]) {
            let mut kept = kept.iter();
            values.retain(|_| kept.next().copied().unwrap_or(true));
        }
        self.columns.iter_mut().for_each(|column| retain(&mut column.values, kept));
        self.times_s.iter_mut().for_each(|times| retain(times, kept));
        self.indices.iter_mut().for_each(|indices| retain(indices, kept));
    }
}

/// Builds a [`SensorTable`] row by row.
#[derive(Debug)]
pub(crate) struct TableBuilder {
    chosen: Vec<ChosenColumn>,
    values: Vec<Vec<f64>>,
    /// In the unit of the file, from the first.
    times: Vec<f64>,
    origin: Option<Number>,
    indices: Vec<u64>,
    last_time: Option<f64>,
    last_index: Option<u64>,
    rows: u64,
    /// Rows that are held at most.
    most_rows: u64,
    /// What the file may cost.
    meter: Option<Meter>,
    backwards: u64,
    /// The first row whose time went back: number of the row, and by how much.
    first_backwards: Option<(u64, f64)>,
}

/// Consecutive rows.
#[derive(Debug, Clone, Default)]
pub(crate) struct RowBlock {
    /// Time stamps in the unit of the file, from the first row of the file; empty where there are none.
    pub(crate) times: Vec<f64>,
    /// Running numbers; empty where there are none.
    pub(crate) indices: Vec<u64>,
    /// The numbers of each channel, in the unit of the file.
    pub(crate) values: Vec<Vec<f64>>,
}

impl TableBuilder {
    pub(crate) fn new(chosen: Vec<ChosenColumn>) -> Self {
        let values = vec![Vec::new(); chosen.len()];
        Self {
            chosen,
            values,
            times: Vec::new(),
            origin: None,
            indices: Vec::new(),
            last_time: None,
            last_index: None,
            rows: 0,
            most_rows: MAX_SAMPLES,
            meter: None,
            backwards: 0,
            first_backwards: None,
        }
    }

    /// The same for rows of a file with this budget.
    pub(crate) fn within(self, budget: Budget) -> Self {
        Self { meter: Some(budget.meter()), ..self }
    }

    /// The same for a reader that [takes the rows](Self::take_rows) in blocks.
    pub(crate) fn of_any_length(self) -> Self {
        Self { most_rows: u64::MAX, ..self }
    }

    /// Rows that were added, those that were left out included.
    pub(crate) fn rows(&self) -> u64 {
        self.rows
    }

    /// The columns that are read.
    pub(crate) fn chosen(&self) -> &[ChosenColumn] {
        &self.chosen
    }

    /// Adds a row: one number for each of [`chosen`](Self::chosen). A row whose time goes back is left out.
    ///
    /// # Errors
    /// Too many rows, or a time or an index that is none; with the position of the column.
    pub(crate) fn push(&mut self, row: &[Number]) -> Result<(), (usize, Reason)> {
        self.rows += 1;
        if self.rows > self.most_rows {
            return Err((0, Reason::TooManySamples));
        }
        if let Some(meter) = &mut self.meter {
            meter.add_values(row.len() as u64).map_err(|reason| (0, reason))?;
        }
        for (position, (column, &number)) in self.chosen.iter().zip(row).enumerate() {
            match column.role {
                Role::Time => {
                    if !number.value().is_finite() {
                        return Err((position, Reason::NotFinite(number.value().to_string())));
                    }
                    let origin = *self.origin.get_or_insert(number);
                    let time = number.since(origin);
                    if let Some(last) = self.last_time.filter(|last| time < *last) {
                        self.backwards += 1;
                        self.first_backwards.get_or_insert((self.rows, last - time));
                        return Ok(());
                    }
                    self.last_time = Some(time);
                    self.times.push(time);
                }
                Role::Index => match number {
                    Number::Integer(index) if index >= 0 => {
                        let now = index.unsigned_abs();
                        if let Some(before) = self.last_index.filter(|before| now <= *before) {
                            return Err((position, Reason::IndexBackwards { before, now }));
                        }
                        self.last_index = Some(now);
                        self.indices.push(now);
                    }
                    other => return Err((position, Reason::NotInteger(other.value().to_string()))),
                },
                Role::Channel(_) => {}
            }
        }
        for ((column, &number), values) in self.chosen.iter().zip(row).zip(&mut self.values) {
            if matches!(column.role, Role::Channel(_)) {
                values.push(number.value());
            }
        }
        Ok(())
    }

    /// The rows that were added since they were taken last.
    pub(crate) fn take_rows(&mut self) -> RowBlock {
        let is_channel = |column: &ChosenColumn| matches!(column.role, Role::Channel(_));
        let values = self.chosen.iter().zip(&mut self.values).filter(|(column, _)| is_channel(column));
        let values: Vec<Vec<f64>> = values.map(|(_, values)| std::mem::take(values)).collect();
        RowBlock { times: std::mem::take(&mut self.times), indices: std::mem::take(&mut self.indices), values }
    }

    /// Rows whose time goes back, which are left out, and a sentence that says so; `None` without one.
    ///
    /// # Errors
    /// There is no row, or the times of many rows go back.
    pub(crate) fn backwards(&self) -> Result<Option<(u64, String)>, Reason> {
        if self.rows == self.backwards {
            return Err(Reason::NoData);
        }
        let Some((row, by)) = self.first_backwards else { return Ok(None) };
        if self.backwards as f64 > MAX_BACKWARDS * self.rows as f64 {
            return Err(Reason::ClockSetBack { row, by, rows: self.backwards });
        }
        let note = format!("{} rows whose time goes back are left out, the first of them row {row}", self.backwards);
        Ok(Some((self.backwards, note)))
    }

    /// The unit of the times, by the column or by the rows that are held, s, and what the user should know of it.
    ///
    /// # Errors
    /// The unit cannot be told.
    pub(crate) fn time_unit(&self) -> Result<(f64, Option<String>), Reason> {
        let Some(time) = self.chosen.iter().find(|column| column.role == Role::Time) else { return Ok((1.0, None)) };
        match time.unit {
            Some(unit) => Ok((unit.factor, None)),
            None => {
                let unit = usual_unit(&self.times, self.origin.map_or(0.0, Number::value))
                    .ok_or_else(|| Reason::NoTimeUnit(time.label.clone()))?;
                Ok((unit.factor, Some(format!("the column {} is taken to be in {}", time.label, unit.name))))
            }
        }
    }

    /// The columns with the numbers of all channels, in the units of the file.
    pub(crate) fn into_values(self) -> (Vec<ChosenColumn>, Vec<Vec<f64>>) {
        (self.chosen, self.values)
    }

    /// The table of all rows.
    ///
    /// # Errors
    /// There is no row, the times of many rows go back, or the unit of the times cannot be told.
    pub(crate) fn finish(self) -> Result<SensorTable, Reason> {
        let mut dropped = BTreeMap::new();
        let mut notes = Vec::new();
        if let Some((backwards, note)) = self.backwards()? {
            dropped.insert("time_backwards", backwards);
            notes.push(note);
        }
        let (factor, note) = self.time_unit()?;
        notes.extend(note);
        let mut times = self.times;
        times.iter_mut().for_each(|time| *time *= factor);
        let has_index = self.chosen.iter().any(|column| column.role == Role::Index);
        let columns = self.chosen.into_iter().zip(self.values).filter_map(|(column, values)| match column.role {
            Role::Channel(profile) => Some(TableColumn { profile, factor: column.factor, label: column.label, values }),
            _ => None,
        });
        Ok(SensorTable {
            columns: columns.collect(),
            indices: has_index.then_some(self.indices),
            times_s: (!times.is_empty()).then_some(times),
            dropped,
            notes,
            rate_hz: None,
        })
    }
}

/// The unit of times that do not say it: of a clock that counts from 1970 (2001 to 2096) the one that gives this date, else
/// seconds if they give a plausible sample rate. `None` where neither is so.
pub(crate) fn usual_unit(times: &[f64], origin: f64) -> Option<Unit> {
    let units = || ["s", "ms", "us", "ns"].into_iter().filter_map(Unit::parse);
    let by_date = units().find(|unit| (1e9..4e9).contains(&(origin * unit.factor)));
    let rows = times.len().saturating_sub(1).max(1) as f64;
    let interval = times.last().copied().unwrap_or(0.0) / rows;
    let seconds = units().next().filter(|_| PLAUSIBLE_HZ.contains(&interval.recip()));
    debug_assert!(seconds.is_none_or(|unit| unit.base == SECOND));
    by_date.or(seconds)
}
