//! The head of a text table: start of the rows, preamble, columns.

use crate::columns::{AvailableColumn, Unit, is_output_register};
use crate::formats::calendar::{self, CalendarColumns};
use crate::formats::fields::{list_lengths, number, separator_of, split, with_unit};
use crate::formats::row_kinds::RowKind;
use crate::input::delimited_text;
use std::collections::{BTreeMap, VecDeque};

pub(crate) const HEAD_LINES: usize = 256;

/// Damaged lines within a table.
const MOST_BETWEEN: usize = 2;

pub(crate) type Line = (u64, String);

#[derive(Debug, Default)]
pub(crate) struct TableHead {
    preamble: Vec<Line>,
    pub(crate) rows: VecDeque<Line>,
    pub(crate) separator: Option<char>,
}

#[derive(Debug)]
pub(crate) struct TableColumns {
    pub(crate) available: Vec<AvailableColumn>,
    pub(crate) width: usize,
    pub(crate) calendar: Option<CalendarColumns>,
    pub(crate) heading_line: Option<u64>,
}

impl TableHead {
    pub(crate) fn at_first_row(lines: Vec<Line>) -> Option<Self> {
        let first = lines.iter().position(|(_, text)| is_row(text))?;
        let separator = separator_of(&lines[first].1);
        let mut preamble = lines;
        let rows = preamble.split_off(first).into();
        Some(Self { preamble, rows, separator })
    }

    /// Moves lines before the longest run of one width to the preamble; single damaged lines do not end it.
    pub(crate) fn leave_preamble(&mut self) {
        let shapes: Vec<Option<(Option<char>, usize)>> = self.rows.iter().map(|(_, text)| shape(text)).collect();
        let mut longest = 0..0;
        let mut start = 0;
        for at in 1..=shapes.len() {
            if at == shapes.len() || shapes[at].is_none() || shapes[at] != shapes[start] {
                if shapes[start].is_some() && at - start > longest.len() {
                    longest = start..at;
                }
                start = at;
            }
        }
        let mut first = longest.start;
        let own = kinds_of_fields(&self.rows[first].1);
        let is_alike = |at: usize| {
            let other = kinds_of_fields(&self.rows[at].1);
            shapes[at] == shapes[longest.start] && other.iter().zip(&own).all(|(one, own)| one.is_like(*own))
        };
        // Numbers above a heading are no rows; a heading that comes again is one of damaged lines.
        let is_heading = |at: usize| {
            let fields = kinds_of_fields(&self.rows[at].1);
            let is_first = || self.preamble.iter().all(|(_, text)| *text != self.rows[at].1);
            fields.len() == own.len() && fields.iter().all(|kind| *kind == FieldKind::Text) && is_first()
        };
        let before = |first: usize| (0..first).rev().take_while(|at| !is_heading(*at)).take(MOST_BETWEEN + 1);
        while let Some(row) = before(first).find(|at| is_alike(*at)) {
            first = row;
        }
        let rows = self.rows.split_off(first);
        self.preamble.extend(std::mem::replace(&mut self.rows, rows));
        self.separator = self.rows.front().and_then(|(_, text)| separator_of(text));
        while let Some(row) = self.preamble.pop_if(|(_, text)| has_words_for_values(&kinds_of_fields(text), &own)) {
            self.rows.push_front(row);
        }
    }

    pub(crate) fn fields(&self) -> Vec<Vec<&str>> {
        self.rows.iter().map(|(_, text)| split(text, self.separator).collect()).collect()
    }

    pub(crate) fn last_names(&self) -> Vec<&str> {
        self.preamble.last().map(|(_, text)| split(text, self.separator).collect()).unwrap_or_default()
    }

    pub(crate) fn rate_hz(&self) -> Option<f64> {
        let keyed = || self.value_of(&["rate", "sample_rate", "samplerate", "sampling_rate", "frequency", "fs", "odr"]);
        self.preamble.iter().find_map(|(_, text)| stated_rate(text)).or_else(keyed).filter(|hz| *hz > 0.0)
    }

    fn value_of(&self, keys: &[&str]) -> Option<f64> {
        self.preamble.iter().find_map(|(_, text)| {
            let fields: Vec<&str> =
                text.split([',', ';', '\t', '=', ':']).map(str::trim).filter(|field| !field.is_empty()).collect();
            let [key, value] = fields.as_slice() else { return None };
            let plain = key.trim_start_matches(['#', '%', ' ']).to_lowercase();
            number(value).filter(|_| keys.contains(&plain.as_str())).map(|number| number.value())
        })
    }

    /// For one `kind`, or all.
    pub(crate) fn columns(&self, kind: Option<&RowKind>) -> TableColumns {
        let fields = self.fields();
        let own: Vec<Vec<&str>> = fields.iter().filter(|row| kind.is_none_or(|kind| kind.has(row))).cloned().collect();
        let row = own.first().cloned().unwrap_or_default();
        let lengths = self.rows.iter().zip(&fields).find(|(_, fields)| kind.is_none_or(|kind| kind.has(fields)));
        let lengths = lengths.map(|((_, text), _)| list_lengths(text, self.separator)).unwrap_or_default();
        let lists = Lists(lengths);
        let width = self.width_of(&row, &lists);
        let mut calendar = CalendarColumns::find(&row);
        // R's `write.table` numbers rows without a name, pandas from 0.
        let first_of = |at: usize| own.get(at).and_then(|row| row.first()).copied();
        let is_numbered =
            [["1", "2"], ["0", "1"]].iter().any(|[one, two]| first_of(0) == Some(*one) && first_of(1) == Some(*two));
        let is_short = |names: usize| names + 1 == width && matches!(calendar, Some(CalendarColumns::Two(_)));
        let is_unnumbered = |names: usize| names + 1 == width && is_numbered;
        let names_of = |text: &str| lists.names(&names(text, self.separator, lists.cells(width)));
        let units_of = |text: &str| units_of(&lists.names(&split(text, self.separator).collect::<Vec<_>>()));
        let of_kind = kind.and_then(|kind| self.heading_of(kind, width));
        let is_heading = |names: usize| names == width || is_short(names) || is_unnumbered(names);
        let is_last = |line: u64| self.preamble.last().is_some_and(|(last, _)| *last == line);
        let plain = || {
            // The last line before a table is its heading.
            let is_own = |(line, text): &&Line| {
                let names = names_of(text);
                is_heading(names.len()) || is_last(*line) && is_part_of_heading(&names, width)
            };
            let mut lines = self.preamble.iter().rev().filter(|(_, text)| units_of(text).is_none());
            lines.find(is_own).map(|(line, text)| (*line, names_of(text)))
        };
        let heading = match (kind, of_kind) {
            (_, Some(heading)) => Some(heading),
            // A common heading if it fits.
            (Some(RowKind::Labelled { .. }), None) => {
                plain().filter(|(line, names)| names.len() == width && !is_comment(&self.preamble, *line))
            }
            _ => plain(),
        };
        let units =
            self.preamble.iter().rev().find_map(|(_, text)| units_of(text).filter(|units| units.len() + 1 >= width));
        let heading_line = heading.as_ref().map(|(line, _)| *line);
        let mut available: Vec<AvailableColumn> = match heading {
            Some((line, own)) => {
                let above = self.preamble.iter().rev().find(|(above, _)| above + 1 == line);
                let above = above.map(|(_, text)| names_of(text));
                let own = above.and_then(|above| joined_names(&above, &own)).unwrap_or(own);
                named_columns(&own, units.as_deref())
            }
            None => Vec::new(),
        };
        available.truncate(width);
        if let Some(columns) = calendar.as_ref().filter(|_| is_short(available.len())) {
            let time_of_day = AvailableColumn { name: "time of day".to_owned(), unit: None };
            available.insert(columns.position() + 1, time_of_day);
        } else if is_unnumbered(available.len()) && calendar.is_none() {
            available.insert(0, AvailableColumn { name: "row".to_owned(), unit: None });
        }
        let unnamed = available.len()..width;
        available.extend(unnamed.map(|number| AvailableColumn { name: number.to_string(), unit: None }));
        for (at, column) in available.iter_mut().enumerate() {
            let fields = || own.iter().filter_map(|row| row.get(at));
            let is_fraction = |field: &&str| number(field).is_some_and(|number| number.value().fract().abs() > 0.0);
            // Registers may be scaled.
            if is_output_register(&column.name) && fields().any(is_fraction) {
                column.unit = None;
            }
            column.unit = column.unit.or_else(|| fields().find_map(|field| with_unit(field)).map(|(_, unit)| unit));
        }
        calendar = calendar.or_else(|| CalendarColumns::parts(&available, &own));
        if let Some(columns) = &calendar {
            set_calendar(&mut available, columns);
        }
        self.set_scales(&mut available);
        TableColumns { available, width, calendar, heading_line }
    }

    /// Without final empty fields that have no name.
    fn width_of(&self, row: &[&str], lists: &Lists) -> usize {
        let least = trimmed_width(row);
        let width = |text: &str| trimmed_width(&lists.names(&split(text, self.separator).collect::<Vec<_>>()));
        let headings = self.preamble.iter().map(|(_, text)| width(text));
        headings.filter(|names| (least..row.len()).contains(names)).max().unwrap_or(row.len())
    }

    /// From a comment: `'ACCE;time(s);x(m/s^2)'`.
    fn heading_of(&self, kind: &RowKind, width: usize) -> Option<(u64, Vec<String>)> {
        let RowKind::Labelled { at: 0, name } = kind else { return None };
        let separator = self.separator?;
        self.preamble.iter().find_map(|(line, text)| {
            let mut starts = text.match_indices(name.as_str()).map(|(at, _)| at);
            let start = starts.find(|at| text[at + name.len()..].starts_with(separator))?;
            let own = text[start..].trim_end_matches(['\'', '"', ' ']);
            let names: Vec<String> = split(own, Some(separator)).map(str::to_owned).collect();
            (names.len() == width).then_some((*line, names))
        })
    }

    /// Scales as `gscale,0.001`.
    fn set_scales(&self, available: &mut [AvailableColumn]) {
        const SCALES: [(&str, &str, &str); 4] = [
            ("tscale", "time", "s"),
            ("gscale", "gyro", "rad/s"),
            ("ascale", "accl", "g"),
            ("mscale", "magn", "gauss"),
        ];
        for (key, group, unit) in SCALES {
            let Some((scale, unit)) = self.value_of(&[key]).zip(Unit::parse(unit)) else { continue };
            let is_own = |column: &AvailableColumn| {
                column.prefix_and_channel().is_some_and(|(_, channel)| channel.starts_with(group))
            };
            for column in available.iter_mut().filter(|column| column.unit.is_none() && is_own(column)) {
                column.unit = Some(Unit { factor: scale * unit.factor, ..unit });
            }
        }
    }
}

struct Lists(Vec<usize>);

impl Lists {
    /// `gyro.0`, `gyro.1` of a list, unless its cell has as many names.
    fn names(&self, cells: &[&str]) -> Vec<String> {
        let mut names = Vec::with_capacity(cells.len());
        for (at, cell) in cells.iter().enumerate() {
            match self.0.get(at) {
                Some(length) if *length > 1 && cell.split(',').count() == *length => {
                    names.extend(cell.split(',').map(|name| name.trim().to_owned()));
                }
                Some(length) if *length > 1 => {
                    let (name, unit) = name_of_list(cell);
                    let unit = unit.map_or_else(String::new, |unit| format!(" [{}]", unit.name));
                    names.extend((0..*length).map(|number| format!("{name}.{number}{unit}")));
                }
                _ => names.push((*cell).to_owned()),
            }
        }
        names
    }

    fn cells(&self, width: usize) -> usize {
        width - self.0.iter().map(|length| length - 1).sum::<usize>().min(width)
    }
}

/// `gyro [deg/s]` or `gyro_dps`.
fn name_of_list(heading: &str) -> (String, Option<Unit>) {
    let ends = heading.match_indices('_').map(|(at, _)| at);
    let by_ending = ends
        .filter_map(|at| Some((&heading[..at], Unit::parse(&heading[at + 1..])?)))
        .find(|(name, _)| AvailableColumn { name: format!("{name}.0"), unit: None }.prefix_and_channel().is_some());
    match by_ending {
        Some((name, unit)) => (name.to_owned(), Some(unit)),
        None => {
            let AvailableColumn { name, unit } = AvailableColumn::from_heading(heading);
            (name, unit)
        }
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum FieldKind {
    Number,
    Time,
    Missing,
    Empty,
    Text,
}

impl FieldKind {
    fn new(field: &str) -> Self {
        let clock = || calendar::time_of_day(field).or_else(|| calendar::date_time(field));
        let is_time = || clock().or_else(|| calendar::date(field)).is_some();
        match number(field) {
            Some(known) if known.value().is_nan() && field.is_empty() => Self::Empty,
            Some(known) if known.value().is_nan() => Self::Missing,
            None if with_unit(field).is_none() && !is_time() => Self::Text,
            None if with_unit(field).is_none() => Self::Time,
            _ => Self::Number,
        }
    }

    fn is_missing(self) -> bool {
        matches!(self, Self::Missing | Self::Empty)
    }

    fn is_like(self, other: Self) -> bool {
        self == other || self.is_missing() || other.is_missing()
    }
}

fn kinds_of_fields(text: &str) -> Vec<FieldKind> {
    split(text, separator_of(text)).map(FieldKind::new).collect()
}

/// True for words where `rows` have numbers, behind a first number: a row, and no heading.
fn has_words_for_values(fields: &[FieldKind], rows: &[FieldKind]) -> bool {
    let is_value = |(field, row): (&FieldKind, &FieldKind)| field.is_like(*row) || *row == FieldKind::Number;
    let first = rows.iter().position(|row| *row == FieldKind::Number);
    let begins = first.is_some_and(|first| fields.get(first) == Some(&FieldKind::Number));
    begins && fields.len() == rows.len() && fields.iter().zip(rows).all(is_value)
}

/// Separator and fields; final tabs are cut as blanks.
fn shape(text: &str) -> Option<(Option<char>, usize)> {
    let separator = separator_of(text);
    let width = if separator == Some('\t') { 0 } else { split(text, separator).count() };
    is_row(text).then_some((separator, width))
}

fn trimmed_width<T: AsRef<str>>(fields: &[T]) -> usize {
    fields.iter().rposition(|field| !field.as_ref().is_empty()).map_or(0, |at| at + 1)
}

fn is_comment(preamble: &[Line], line: u64) -> bool {
    preamble.iter().any(|(own, text)| *own == line && text.starts_with(['#', '%']) && text.contains(['\'', ':']))
}

/// Names of the first of `width` columns, or more; channels among them.
fn is_part_of_heading(names: &[String], width: usize) -> bool {
    let is_known = |name: &String| {
        let column = AvailableColumn::from_heading(name);
        column.unit.is_some() || column.prefix_and_channel().is_some()
    };
    let are_names = names.iter().all(|name| number(name).is_none_or(|number| number.value().is_nan()));
    names.len() > 1 && 2 * names.len() >= width && names.len() < 2 * width && are_names && names.iter().any(is_known)
}

/// Two lines: `Gyroscope,,` over `X,Y,Z`; `None` for one.
fn joined_names(above: &[String], own: &[String]) -> Option<Vec<String>> {
    let is_of_groups = above.len() == own.len()
        && above.iter().any(|name| name.is_empty())
        && above.iter().any(|name| !name.is_empty())
        && above.iter().all(|name| number(name).is_none_or(|number| number.value().is_nan()));
    if !is_of_groups {
        return None;
    }
    let mut group = "";
    let joined = above.iter().zip(own).map(|(above, own)| {
        group = if above.is_empty() { group } else { above };
        format!("{group} {own}").trim().to_owned()
    });
    Some(joined.collect())
}

/// `// Update Rate: 100.0Hz`.
fn stated_rate(line: &str) -> Option<f64> {
    const NAMES: [&str; 4] = ["rate", "frequency", "freq", "fs"];
    let plain = line.to_lowercase();
    let (before, _) = plain.split_once("hz")?;
    let number = before.trim_end();
    let start = number.rfind(|letter: char| !letter.is_ascii_digit() && letter != '.').map_or(0, |at| at + 1);
    let mut words = number[..start].split(|letter: char| !letter.is_alphanumeric());
    let is_named = words.any(|word| NAMES.contains(&word) || word.ends_with("rate"));
    number[start..].parse().ok().filter(|hz: &f64| is_named && *hz > 0.0)
}

pub(crate) fn set_calendar(available: &mut [AvailableColumn], calendar: &CalendarColumns) {
    let at = calendar.position();
    let is_part = matches!(calendar, CalendarColumns::Parts(_));
    let name = if available[at].is_time() && !is_part { available[at].name.clone() } else { "time".to_owned() };
    if let CalendarColumns::Parts(parts) = calendar {
        // Other parts are no times.
        for (part, _) in &parts[1..] {
            available[*part] =
                AvailableColumn { name: format!("{} (part of the time)", available[*part].name), unit: None };
        }
    }
    available[at] = AvailableColumn::known(&name, "ns");
}

/// Names above `width` fields; units in brackets and quotation marks keep blanks.
fn names(text: &str, separator: Option<char>, width: usize) -> Vec<&str> {
    let mut plain: Vec<&str> = split(text, separator).collect();
    while plain.len() > width && plain.last() == Some(&"") {
        plain.pop();
    }
    if separator.is_some() || plain.len() == width {
        return plain;
    }
    if width == 1 {
        return vec![delimited_text::field(text)];
    }
    let mut names: Vec<std::ops::Range<usize>> = Vec::new();
    let mut closing = None;
    for (at, letter) in text.char_indices() {
        let end = at + letter.len_utf8();
        let is_first = text[..at].ends_with(|before: char| before.is_ascii_whitespace()) || at == 0;
        let belongs = closing.is_some() || matches!(letter, '[' | '(') && !names.is_empty();
        match names.last_mut() {
            _ if letter.is_ascii_whitespace() && closing.is_none() => continue,
            Some(name) if belongs || !is_first => name.end = end,
            _ => names.push(at..end),
        }
        closing = match (closing, letter) {
            (Some(closing), letter) if closing != letter => Some(closing),
            (Some(_), _) => None,
            (None, '[') => Some(']'),
            (None, '(') => Some(')'),
            (None, '"') => Some('"'),
            (None, _) => None,
        };
    }
    let names = names.into_iter().map(|name| delimited_text::field(&text[name]));
    names.filter(|name| !matches!(*name, "#" | "%")).collect()
}

fn units_of(fields: &[String]) -> Option<Vec<Option<Unit>>> {
    let unit = |field: &String| Unit::parse(field.trim_matches(['[', ']', '(', ')']));
    let units: Vec<Option<Unit>> = fields.iter().map(unit).collect();
    let known = units.iter().flatten().count();
    (2 * known > trimmed_width(fields)).then_some(units)
}

/// Equal names are numbered from 0.
pub(crate) fn named_columns(names: &[String], units: Option<&[Option<Unit>]>) -> Vec<AvailableColumn> {
    let mut columns: Vec<AvailableColumn> = names.iter().map(|name| AvailableColumn::from_heading(name)).collect();
    for (column, unit) in columns.iter_mut().zip(units.unwrap_or_default()) {
        column.unit = column.unit.or(*unit);
    }
    let mut counts: BTreeMap<String, usize> = BTreeMap::new();
    for column in &columns {
        *counts.entry(column.name.clone()).or_insert(0) += 1;
    }
    for (number, column) in columns.iter_mut().enumerate().filter(|(_, column)| counts[&column.name] > 1) {
        column.name = number.to_string();
    }
    columns
}

/// At least half numbers or calendar times, or all missing; other texts may be frames.
pub(crate) fn is_row(text: &str) -> bool {
    if text.starts_with('{') && text.contains(':') {
        return false; // An object of names and numbers.
    }
    let kinds = kinds_of_fields(text);
    let numbers = kinds.iter().filter(|kind| matches!(kind, FieldKind::Number | FieldKind::Time)).count();
    let is_all_missing = kinds.contains(&FieldKind::Missing) && kinds.iter().all(|kind| kind.is_missing());
    numbers > 0 && 2 * numbers >= kinds.len() || is_all_missing
}
