//! Tables of numbers in any units: CSV with commas, semicolons, tabs or blanks, with or without a heading.

use crate::any_sensor::ReadOptions;
use crate::column_selection::AvailableColumn;
use crate::delimited_text::{self, Lines};
use crate::input_error::{InputError, Reason};
use crate::sensor_table::{Number, SensorTable, TableBuilder};
use std::path::Path;

/// Separators of columns, the first that occurs; blanks where none does.
const SEPARATORS: [char; 3] = [';', '\t', ','];

/// Fields that stand for a missing value, in small letters.
const MISSING: [&str; 6] = ["", "nan", "na", "n/a", "null", "none"];

/// Lines before the first row of numbers that may be comments or a heading.
const MAX_PREAMBLE: usize = 64;

/// Reads a table.
pub(crate) fn read(file: &Path, options: &ReadOptions) -> Result<SensorTable, InputError> {
    let mut lines = Lines::open(file)?;
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
    let mut builder = TableBuilder::new(chosen);
    let mut row = Vec::with_capacity(builder.chosen().len());
    let mut next = Some(first);
    while let Some((line, text)) = next.take() {
        add(&mut builder, &mut row, &text, separator, width).map_err(|(at, reason)| match at {
            Some(at) => InputError::field(file, line, &builder.chosen()[at].label, reason),
            None => InputError::line(file, line, reason),
        })?;
        next = lines.next()?.map(|(line, text)| (line, text.to_owned()));
    }
    builder.finish().map_err(|reason| InputError::file(file, reason))
}

fn add(
    builder: &mut TableBuilder,
    row: &mut Vec<Number>,
    text: &str,
    separator: Option<char>,
    width: usize,
) -> Result<(), (Option<usize>, Reason)> {
    let fields: Vec<&str> = split(text, separator).collect();
    if fields.len() != width {
        return Err((None, Reason::FieldCount { found: fields.len(), expected: width }));
    }
    row.clear();
    for (at, column) in builder.chosen().iter().enumerate() {
        let field = fields[column.position];
        row.push(number(field).ok_or_else(|| (Some(at), Reason::NotNumber(delimited_text::quote(field))))?);
    }
    builder.push(row).map_err(|(at, reason)| (Some(at), reason))
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
