//! Tables of numbers in any units: CSV with commas, semicolons, tabs or blanks, with or without a heading.

use crate::columns::column_selection::{AvailableColumn, ChosenColumn};
use crate::input::delimited_text::{self, Lines};
use crate::input::input_error::{InputError, Reason};
use crate::input::read_monitor::ReadMonitor;
use crate::tables::any_sensor::ReadOptions;
use crate::tables::sensor_table::{Number, SensorTable, TableBuilder};
use std::path::{Path, PathBuf};

/// Separators of columns, the first that occurs; blanks where none does.
const SEPARATORS: [char; 3] = [';', '\t', ','];

/// Fields that stand for a missing value, in small letters.
const MISSING: [&str; 6] = ["", "nan", "na", "n/a", "null", "none"];

/// Lines before the first row of numbers that may be comments or a heading.
const MAX_PREAMBLE: usize = 64;

/// Reads a table; `monitor` counts the bytes and may stop the reading.
pub(crate) fn read(file: &Path, options: &ReadOptions, monitor: &ReadMonitor) -> Result<SensorTable, InputError> {
    let mut table = TextTable::open(file, options, monitor)?;
    let mut builder = TableBuilder::new(table.chosen().to_vec());
    while table.add_row(&mut builder)? {}
    builder.finish().map_err(|reason| InputError::file(file, reason))
}

/// An open table, read row by row.
pub(crate) struct TextTable {
    file: PathBuf,
    lines: Lines,
    chosen: Vec<ChosenColumn>,
    separator: Option<char>,
    /// Fields of a row.
    width: usize,
    /// The first row, which was read to tell the columns.
    first: Option<(u64, String)>,
    row: Vec<Number>,
}

impl TextTable {
    /// Opens a table and chooses its columns.
    pub(crate) fn open(file: &Path, options: &ReadOptions, monitor: &ReadMonitor) -> Result<Self, InputError> {
        let mut lines = Lines::open_monitored(file, monitor)?;
        let mut preamble: Vec<(u64, String)> = Vec::new();
        let first = loop {
            let Some((line, text)) = lines.next()? else {
                let reason = if preamble.is_empty() { Reason::Empty } else { Reason::NoData };
                return Err(InputError::file(file, reason));
            };
            if is_row(text) {
                break (line, text.to_owned());
            }
            preamble.push((line, text.to_owned()));
            if preamble.len() > MAX_PREAMBLE {
                return Err(InputError::line(file, line, Reason::NoNumbers));
            }
        };
        let separator = SEPARATORS.into_iter().find(|separator| first.1.contains(*separator));
        let fields = |text: &str| split(text, separator).count();
        let width = fields(&first.1);
        let heading = preamble.iter().rev().find(|(_, text)| fields(text) == width);
        if heading.is_none()
            && let Some((line, text)) = preamble.iter().rev().find(|(_, text)| !text.starts_with(['#', '%', '/']))
        {
            return Err(InputError::line(file, *line, Reason::FieldCount { found: width, expected: fields(text) }));
        }
        let available: Vec<AvailableColumn> = match heading {
            Some((_, text)) => split(text, separator).map(AvailableColumn::from_heading).collect(),
            None => (0..width).map(|number| AvailableColumn { name: number.to_string(), unit: None }).collect(),
        };
        let chosen = options.choose(&available).map_err(|error| match heading {
            Some((line, _)) => InputError::line(file, *line, Reason::Selection(Box::new(error))),
            None => InputError::file(file, Reason::Selection(Box::new(error))),
        })?;
        let row = Vec::with_capacity(chosen.len());
        Ok(Self { file: file.to_owned(), lines, chosen, separator, width, first: Some(first), row })
    }

    /// The columns that are read.
    pub(crate) fn chosen(&self) -> &[ChosenColumn] {
        &self.chosen
    }

    /// Adds the next row to `builder`; false at the end.
    pub(crate) fn add_row(&mut self, builder: &mut TableBuilder) -> Result<bool, InputError> {
        let Self { file, lines, chosen, separator, width, first, row } = self;
        let first = first.take();
        let (line, text) = match &first {
            Some((line, text)) => (*line, text.as_str()),
            None => match lines.next()? {
                Some(next) => next,
                None => return Ok(false),
            },
        };
        let added = numbers(text, chosen, *separator, *width, row).and_then(|()| {
            let of_column = |(at, reason)| (Some(at), reason);
            builder.push(row).map_err(of_column)
        });
        added.map(|()| true).map_err(|(at, reason)| match at {
            Some(at) => InputError::field(file, line, &chosen[at].label, reason),
            None => InputError::line(file, line, reason),
        })
    }

    /// Whether the reading was stopped before the end of the table.
    pub(crate) fn is_stopped(&self) -> bool {
        self.lines.is_stopped()
    }
}

/// The numbers of the `chosen` columns of a row of `width` fields.
fn numbers(
    text: &str,
    chosen: &[ChosenColumn],
    separator: Option<char>,
    width: usize,
    row: &mut Vec<Number>,
) -> Result<(), (Option<usize>, Reason)> {
    row.clear();
    row.resize(chosen.len(), Number::Real(f64::NAN));
    let mut found = 0;
    let mut fault: Option<(usize, Reason)> = None;
    for (position, field) in split(text, separator).enumerate() {
        found += 1;
        for (at, _) in chosen.iter().enumerate().filter(|(_, column)| column.position == position) {
            match number(field) {
                Some(known) => row[at] = known,
                None if fault.as_ref().is_some_and(|(first, _)| *first < at) => {}
                None => fault = Some((at, Reason::NotNumber(delimited_text::quote(field)))),
            }
        }
    }
    match fault {
        _ if found != width => Err((None, Reason::FieldCount { found, expected: width })),
        Some((at, reason)) => Err((Some(at), reason)),
        None => Ok(()),
    }
}

fn split(text: &str, separator: Option<char>) -> Box<dyn Iterator<Item = &str> + '_> {
    match separator {
        Some(separator) => Box::new(text.split(separator).map(delimited_text::field)),
        None => Box::new(text.split_ascii_whitespace().map(delimited_text::field)),
    }
}

/// A number, with a decimal comma too; NaN for a missing one; `None` for other texts.
fn number(field: &str) -> Option<Number> {
    if let Ok(integer) = field.parse() {
        return Some(Number::Integer(integer));
    }
    let real = field.parse().ok().or_else(|| field.replace(',', ".").parse().ok());
    let missing = || MISSING.contains(&field.to_lowercase().as_str()).then_some(f64::NAN);
    real.or_else(missing).map(Number::Real)
}

/// Whether a line is a row and no heading or comment: at least half of its fields are numbers. The others may be texts, such as
/// the name of a frame.
fn is_row(text: &str) -> bool {
    let separator = SEPARATORS.into_iter().find(|separator| text.contains(*separator));
    let (mut numbers, mut fields) = (0, 0);
    for field in split(text, separator) {
        fields += 1;
        numbers += usize::from(number(field).is_some_and(|known| !known.value().is_nan()));
    }
    numbers > 0 && 2 * numbers >= fields
}
