//! Tables of register counts: one row a sample, one column a channel.

use super::table::{self, Table};
use super::{InputError, Reason, frame_log};
use crate::recording::{Clock, NOT_RECORDED, Recorder, Recording};
use adis16405_driver::{Burst, Channel, Counts, GyroRange};
use std::path::{Path, PathBuf};

/// Suffix of every column that holds counts.
const COUNTS: &str = "_counts";

/// What a column of the header holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Column {
    Index,
    Time,
    Counts(Channel),
}

/// Reads a table, plain or gzip, into a recording whose rates were taken in `range`.
///
/// The header names the columns: `<channel>_counts` for any of the twelve channels in any order, and the optional clocks
/// `sample` (an index that grows by one a sample) and `time_s`.
///
/// # Errors
/// The file cannot be read, or does not hold what its header promises.
pub fn read(file: &Path, range: GyroRange) -> Result<Recording, InputError> {
    let mut rows = Rows::open(file)?;
    let mut recorder = Recorder::new(rows.channels(), range);
    while let Some(row) = rows.next()? {
        recorder.push(row.clock, &Burst::from_counts(&row.counts));
    }
    Ok(recorder.finish())
}

/// One row of a table.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Row {
    /// When it was taken.
    pub clock: Clock,
    /// Inside their fields; channels that the table lacks are as in [`NOT_RECORDED`].
    pub counts: Counts,
}

/// An open table, read row by row.
pub struct Rows {
    file: PathBuf,
    table: Table,
    columns: Vec<Column>,
    line: u64,
    last: Option<Clock>,
}

impl Rows {
    /// Opens a table and reads its header.
    ///
    /// # Errors
    /// As [`read`].
    pub fn open(file: &Path) -> Result<Self, InputError> {
        let mut table = Table::open(file)?;
        let Some((line, header)) = table.next()? else {
            return Err(InputError::file(file, Reason::Empty));
        };
        let columns = columns(file, line, header)?;
        Ok(Self { file: file.to_owned(), table, columns, line, last: None })
    }

    /// The channels that the table has, in the order of the burst.
    pub fn channels(&self) -> Vec<Channel> {
        let mut channels: Vec<Channel> = self.columns.iter().filter_map(|c| c.channel()).collect();
        channels.sort();
        channels
    }

    /// Line of the row that was read last, from 1.
    pub fn line(&self) -> u64 {
        self.line
    }

    /// The next row; `None` at the end of the table.
    ///
    /// # Errors
    /// As [`read`].
    #[expect(clippy::should_implement_trait, reason = "fallible: an iterator would yield errors for ever")]
    pub fn next(&mut self) -> Result<Option<Row>, InputError> {
        let Some((line, text)) = self.table.next()? else {
            return match self.last {
                Some(_) => Ok(None),
                None => Err(InputError::file(&self.file, Reason::NoData)),
            };
        };
        let checked =
            row(&self.columns, text).and_then(|row| follows(self.last.unwrap_or_default(), row.clock).map(|()| row));
        match checked {
            Ok(row) => {
                self.line = line;
                self.last = Some(row.clock);
                Ok(Some(row))
            }
            Err((Some(column), reason)) => Err(InputError::field(&self.file, line, &column.name(), reason)),
            Err((None, reason)) => Err(InputError::line(&self.file, line, reason)),
        }
    }
}

/// A column, where one is at fault, and the reason.
type Fault = (Option<Column>, Reason);

impl Column {
    fn of(name: &str) -> Option<Self> {
        match name {
            "sample" => Some(Self::Index),
            "time_s" => Some(Self::Time),
            _ => {
                let channel = name.strip_suffix(COUNTS)?;
                Channel::ALL.into_iter().find(|c| c.name() == channel).map(Self::Counts)
            }
        }
    }

    fn name(self) -> String {
        match self {
            Self::Index => "sample".to_owned(),
            Self::Time => "time_s".to_owned(),
            Self::Counts(channel) => format!("{}{COUNTS}", channel.name()),
        }
    }

    fn channel(self) -> Option<Channel> {
        match self {
            Self::Counts(channel) => Some(channel),
            Self::Index | Self::Time => None,
        }
    }
}

fn columns(file: &Path, line: u64, header: &str) -> Result<Vec<Column>, InputError> {
    if header == frame_log::HEADER {
        return Err(InputError::line(file, line, Reason::FrameLog));
    }
    let names: Vec<&str> = header.split(',').map(table::field).collect();
    if !names.iter().any(|name| Column::of(name).is_some_and(|c| c.channel().is_some())) {
        return Err(InputError::line(file, line, Reason::NoChannel));
    }
    let mut columns = Vec::with_capacity(names.len());
    for name in names {
        let fail = |reason| InputError::field(file, line, &table::quote(name), reason);
        let column = Column::of(name).ok_or_else(|| fail(Reason::UnknownColumn))?;
        if columns.contains(&column) {
            return Err(fail(Reason::DuplicateColumn));
        }
        columns.push(column);
    }
    Ok(columns)
}

fn row(columns: &[Column], text: &str) -> Result<Row, Fault> {
    let mut clock = Clock::default();
    let mut counts = NOT_RECORDED;
    let mut fields = text.split(',').map(table::field);
    for (position, &column) in columns.iter().enumerate() {
        let Some(field) = fields.next() else {
            return Err((None, Reason::FieldCount { found: position, expected: columns.len() }));
        };
        let fail = |reason| (Some(column), reason);
        match column {
            Column::Index => clock.index = Some(index(field).map_err(fail)?),
            Column::Time => clock.time_s = Some(table::time(field).map_err(fail)?),
            Column::Counts(channel) => counts[channel as usize] = count(channel, field).map_err(fail)?,
        }
    }
    let surplus = fields.count();
    if surplus > 0 {
        let found = columns.len() + surplus;
        return Err((None, Reason::FieldCount { found, expected: columns.len() }));
    }
    Ok(Row { clock, counts: Counts::new(counts) })
}

fn count(channel: Channel, text: &str) -> Result<i16, Reason> {
    let value: i64 = text.parse().map_err(|_| Reason::NotInteger(table::quote(text)))?;
    let (low, high) = channel.limits();
    i16::try_from(value).ok().filter(|count| (low..=high).contains(count)).ok_or(Reason::OutOfField {
        value,
        low,
        high,
    })
}

fn index(text: &str) -> Result<u64, Reason> {
    text.parse().map_err(|_| Reason::NotInteger(table::quote(text)))
}

/// Whether `now` may stand in the row after `before`. Equal times are late deliveries read in one go; equal indices are not.
fn follows(before: Clock, now: Clock) -> Result<(), Fault> {
    if let (Some(before), Some(now)) = (before.index, now.index)
        && now <= before
    {
        return Err((Some(Column::Index), Reason::IndexBackwards { before, now }));
    }
    if let (Some(before), Some(now)) = (before.time_s, now.time_s)
        && now < before
    {
        return Err((Some(Column::Time), Reason::TimeBackwards { before, now }));
    }
    Ok(())
}
