//! Tables of register counts in CSV: one row a sample, one column a channel.

use crate::counts::frame_log;
use crate::counts::recording::{MAX_SAMPLES, NOT_RECORDED, Recorder, Recording, TimeStamp};
use crate::input::delimited_text::{self, Lines};
use crate::input::input_error::{InputError, Reason};
use crate::input::read_monitor::ReadMonitor;
use adis16405_driver::{Burst, Channel, Counts, GyroRange};
use std::path::{Path, PathBuf};

/// Separators of tables from programs of other countries, which are named in the error.
const OTHER_SEPARATORS: [char; 3] = [';', '\t', ' '];

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
/// The header names the columns: `<channel>_counts` for any of the twelve channels in any order, and the optional time stamps
/// `sample` (an index that grows by one a sample) and `time_s`.
///
/// # Errors
/// The file cannot be read, the header has an unknown column or no channel, or a row does not have one field in range for
/// each column.
pub fn read(file: &Path, range: GyroRange) -> Result<Recording, InputError> {
    read_monitored(file, range, &ReadMonitor::default())
}

/// As [`read`]; `monitor` counts the bytes and may stop the reading.
///
/// # Errors
/// As [`read`].
pub fn read_monitored(file: &Path, range: GyroRange, monitor: &ReadMonitor) -> Result<Recording, InputError> {
    let mut table = CountTable::new(file, Lines::open_monitored(file, monitor)?)?;
    let mut recorder = Recorder::new(table.channels(), range);
    while let Some(row) = table.next()? {
        recorder.push(row.time_stamp, &Burst::from_counts(&row.counts));
    }
    Ok(recorder.finish())
}

/// One row of a table.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CountRow {
    /// When the sample was taken.
    pub time_stamp: TimeStamp,
    /// In the range of their register fields; channels that the table lacks are as in [`NOT_RECORDED`].
    pub counts: Counts,
}

/// An open table, read row by row.
pub struct CountTable {
    file: PathBuf,
    lines: Lines,
    columns: Vec<Column>,
    line: u64,
    rows: u64,
    /// Rows that the reader holds at most.
    most_rows: u64,
    last: Option<TimeStamp>,
}

impl CountTable {
    /// Opens a table and reads its header.
    ///
    /// # Errors
    /// As [`read`].
    pub fn open(file: &Path) -> Result<Self, InputError> {
        Self::new(file, Lines::open(file)?)
    }

    /// As [`open`](Self::open), of a file that was opened before.
    pub(crate) fn new(file: &Path, mut lines: Lines) -> Result<Self, InputError> {
        let Some((line, header)) = lines.next()? else {
            return Err(InputError::file(file, Reason::Empty));
        };
        let columns = columns(file, line, header)?;
        Ok(Self { file: file.to_owned(), lines, columns, line, rows: 0, most_rows: MAX_SAMPLES, last: None })
    }

    /// The same table for a reader that does not hold its rows.
    pub(crate) fn of_any_length(self) -> Self {
        Self { most_rows: u64::MAX, ..self }
    }

    /// The channels that the table has, in the order of the burst.
    pub fn channels(&self) -> Vec<Channel> {
        let mut channels: Vec<Channel> = self.columns.iter().filter_map(|c| c.channel()).collect();
        channels.sort();
        channels
    }

    /// Rows that were read.
    pub(crate) fn rows(&self) -> u64 {
        self.rows
    }

    /// Whether the reading was stopped before the end of the table.
    pub(crate) fn is_stopped(&self) -> bool {
        self.lines.is_stopped()
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
    pub fn next(&mut self) -> Result<Option<CountRow>, InputError> {
        let Some((line, text)) = self.lines.next()? else {
            return match self.last {
                Some(_) => Ok(None),
                None => Err(InputError::file(&self.file, Reason::NoData)),
            };
        };
        let row = plain_row(&self.columns, text.as_bytes()).map_or_else(|| row(&self.columns, text), Ok);
        let checked = row.and_then(|row| order(self.last.unwrap_or_default(), row.time_stamp).map(|()| row));
        self.rows += 1;
        if self.rows > self.most_rows {
            return Err(InputError::line(&self.file, line, Reason::TooManySamples));
        }
        match checked {
            Ok(row) => {
                self.line = line;
                self.last = Some(row.time_stamp);
                Ok(Some(row))
            }
            Err((Some(column), reason)) => Err(InputError::field(&self.file, line, &column.name(), reason)),
            Err((None, reason)) => Err(InputError::line(&self.file, line, reason)),
        }
    }
}

/// The column, where one is at fault, and the reason.
type ColumnFault = (Option<Column>, Reason);

impl Column {
    fn from_name(name: &str) -> Option<Self> {
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

/// Whether a first line names a channel of register counts.
pub(crate) fn is_header(header: &str) -> bool {
    let is_channel =
        |name: &str| Column::from_name(delimited_text::field(name)).is_some_and(|it| it.channel().is_some());
    header.split([',', ';', '\t', ' ']).any(is_channel)
}

fn columns(file: &Path, line: u64, header: &str) -> Result<Vec<Column>, InputError> {
    if header == frame_log::HEADER {
        return Err(InputError::line(file, line, Reason::FrameLog));
    }
    let names: Vec<&str> = header.split(',').map(delimited_text::field).collect();
    let is_known = |name: &str| Column::from_name(name.trim()).is_some();
    if !names.iter().any(|name| Column::from_name(name).is_some_and(|c| c.channel().is_some())) {
        let names_columns = |separator: &char| header.contains(*separator) && header.split(*separator).any(is_known);
        let separator = OTHER_SEPARATORS.into_iter().find(names_columns);
        let reason = separator.map_or(Reason::NoChannel, Reason::Separator);
        return Err(InputError::line(file, line, reason));
    }
    if names.last() == Some(&"") {
        return Err(InputError::line(file, line, Reason::TrailingComma));
    }
    let mut columns = Vec::with_capacity(names.len());
    for name in names {
        let fail = |reason| InputError::field(file, line, &delimited_text::quote(name), reason);
        let column = Column::from_name(name).ok_or_else(|| fail(Reason::UnknownColumn))?;
        if columns.contains(&column) {
            return Err(fail(Reason::DuplicateColumn));
        }
        columns.push(column);
    }
    Ok(columns)
}

/// A row of whole numbers in range and of times, without blanks or quotation marks, which nearly all rows are: [`row`] takes four
/// times as long. `None` for any other.
fn plain_row(columns: &[Column], text: &[u8]) -> Option<CountRow> {
    let mut time_stamp = TimeStamp::default();
    let mut counts = NOT_RECORDED;
    let mut rest = text;
    for (position, &column) in columns.iter().enumerate() {
        if position > 0 {
            rest = rest.strip_prefix(b",")?;
        }
        match column {
            Column::Counts(channel) => {
                let (value, behind) = whole_number(rest)?;
                let (low, high) = channel.limits();
                counts[channel as usize] = i16::try_from(value).ok().filter(|count| (low..=high).contains(count))?;
                rest = behind;
            }
            Column::Index => {
                let (value, behind) = whole_number(rest).filter(|_| !rest.starts_with(b"-"))?;
                time_stamp.index = Some(value.unsigned_abs());
                rest = behind;
            }
            Column::Time => {
                let end = rest.iter().position(|byte| *byte == b',').unwrap_or(rest.len());
                let (field, behind) = rest.split_at(end);
                let time: f64 = std::str::from_utf8(field).ok()?.parse().ok()?;
                time_stamp.time_s = Some(time).filter(|time| time.is_finite());
                time_stamp.time_s?;
                rest = behind;
            }
        }
    }
    rest.is_empty().then(|| CountRow { time_stamp, counts: Counts::new(counts) })
}

/// The whole number of at most 18 digits at the start of `text`, and what is behind it.
fn whole_number(text: &[u8]) -> Option<(i64, &[u8])> {
    let (is_negative, digits) = match text.strip_prefix(b"-") {
        Some(digits) => (true, digits),
        None => (false, text),
    };
    let mut value = 0_i64;
    let mut count = 0;
    for &byte in digits.iter().take_while(|byte| byte.is_ascii_digit()) {
        count += 1;
        if count > 18 {
            return None;
        }
        value = 10 * value + i64::from(byte - b'0');
    }
    (count > 0).then(|| (if is_negative { -value } else { value }, &digits[count..]))
}

fn row(columns: &[Column], text: &str) -> Result<CountRow, ColumnFault> {
    let mut time_stamp = TimeStamp::default();
    let mut counts = NOT_RECORDED;
    let mut fields = text.split(',').map(delimited_text::field);
    for (position, &column) in columns.iter().enumerate() {
        let Some(field) = fields.next() else {
            return Err((None, Reason::FieldCount { found: position, expected: columns.len() }));
        };
        let fail = |reason| (Some(column), reason);
        match column {
            Column::Index => time_stamp.index = Some(index(field).map_err(fail)?),
            Column::Time => time_stamp.time_s = Some(delimited_text::time(field).map_err(fail)?),
            Column::Counts(channel) => counts[channel as usize] = count(channel, field).map_err(fail)?,
        }
    }
    let surplus = fields.count();
    if surplus > 0 {
        let found = columns.len() + surplus;
        return Err((None, Reason::FieldCount { found, expected: columns.len() }));
    }
    Ok(CountRow { time_stamp, counts: Counts::new(counts) })
}

fn count(channel: Channel, text: &str) -> Result<i16, Reason> {
    let value: i64 = text.parse().map_err(|_| Reason::NotInteger(delimited_text::quote(text)))?;
    let (low, high) = channel.limits();
    i16::try_from(value).ok().filter(|count| (low..=high).contains(count)).ok_or(Reason::OutOfField {
        value,
        low,
        high,
    })
}

fn index(text: &str) -> Result<u64, Reason> {
    text.parse().map_err(|_| Reason::NotInteger(delimited_text::quote(text)))
}

/// Checks that the index grows from row to row and that the time does not decrease: samples that the host has read together
/// may have equal times.
fn order(before: TimeStamp, now: TimeStamp) -> Result<(), ColumnFault> {
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

#[cfg(test)]
mod tests {
    use super::{Column, plain_row, row};
    use adis16405_driver::Channel;

    /// Of every row that the quick reader takes, the other one reads the same; what it does not take is left to the other.
    #[test]
    fn both_readers_of_a_row_agree() {
        let columns = [Column::Index, Column::Time, Column::Counts(Channel::GyroX), Column::Counts(Channel::Temp)];
        let fields = [
            "0",
            "-0",
            "7",
            "-7",
            "+7",
            "007",
            "8191",
            "8192",
            "-8192",
            "-8193",
            "2047",
            "2048",
            "99999999999999999999",
            "1.5",
            "1e3",
            "-1e-3",
            "",
            " 7",
            "7 ",
            "\"7\"",
            "x",
            "-",
            "inf",
            "nan",
        ];
        let mut taken = 0;
        for index in fields {
            for time in fields {
                for gyro in fields {
                    for (temperature, end) in [("12", ""), ("-2048", ""), ("2048", ""), ("12", ","), ("12", ",3")] {
                        let text = format!("{index},{time},{gyro},{temperature}{end}");
                        let Some(plain) = plain_row(&columns, text.as_bytes()) else { continue };
                        taken += 1;
                        assert_eq!(row(&columns, &text).ok(), Some(plain), "{text}");
                    }
                }
            }
        }
        // 7 whole numbers without a sign and with less than 19 digits, 16 finite times, 9 counts in range, 2 temperatures.
        assert_eq!(taken, 7 * 16 * 9 * 2);
    }
}
