//! Samples of named numbers: a line each, lines that repeat their names, or a row for each value.

use crate::columns::{AvailableColumn, Unit};
use crate::formats::calendar;
use crate::formats::fields::{number, separator_of, split};
use crate::formats::labelled_row::{self, Record, pairs};
use crate::formats::table_head::{Line, is_row};

const LEAST_RECORDS: usize = 2;
const LEAST_CHANNELS: usize = 2;

pub(crate) enum Records {
    Line,
    /// Several lines are a record; a name that comes again begins the next. A line that ends in a colon names the group of those
    /// below, as in YAML.
    Block {
        group: String,
        pending: Record,
    },
    /// Consecutive rows of one time, which is the first pair.
    Rows {
        layout: RowLayout,
        pending: Record,
    },
}

/// Positions in a row such as `0.01,gyro_x,0.2`.
#[derive(Clone)]
pub(crate) struct RowLayout {
    separator: Option<char>,
    time_name: String,
    time: usize,
    label: usize,
    value: usize,
    unit: Option<usize>,
}

/// The effect of a line.
pub(crate) enum Taken {
    Record(Record),
    /// A line of a record that is not complete.
    Part,
    Other,
}

impl Records {
    /// Records of a line each, by the first lines, with their names.
    pub(crate) fn of_lines(lines: &[Line]) -> Option<(Self, Vec<String>)> {
        let records = lines.iter().filter_map(|(_, text)| labelled_row::parse(text)).collect();
        let (names, count) = usual_names(records)?;
        (2 * count > lines.len()).then_some((Self::Line, names))
    }

    /// Records of several lines, and the position of the first.
    pub(crate) fn of_several_lines(lines: &[Line]) -> Option<(Self, Vec<String>, usize)> {
        let of_rows = || Some((RowLayout::find(lines)?, lines.iter().position(|(_, text)| is_row(text))?));
        let (layout, first) = of_rows().map_or((None, 0), |(layout, first)| (Some(layout), first));
        let new = || match &layout {
            Some(layout) => Self::Rows { layout: layout.clone(), pending: Record::new() },
            None => Self::Block { group: String::new(), pending: Record::new() },
        };
        let (mut all, mut records, mut others) = (new(), Vec::new(), 0);
        for (_, text) in &lines[first..] {
            match all.push(text) {
                Taken::Record(record) => records.push(record),
                Taken::Part => {}
                Taken::Other => others += 1,
            }
        }
        let (names, count) = usual_names(records)?;
        let is_most = 2 * others < lines.len() - first && count >= LEAST_RECORDS && names.len() > LEAST_CHANNELS;
        is_most.then(|| (new(), names, first))
    }

    pub(crate) fn push(&mut self, line: &str) -> Taken {
        let (found, pending) = match self {
            Self::Line => return labelled_row::parse(line).map_or(Taken::Other, Taken::Record),
            Self::Block { group, pending } => match of_block(line, group) {
                Some(found) => (found, pending),
                None => return Taken::Other,
            },
            Self::Rows { layout, pending } => match layout.pairs(line) {
                // The next time, or the value comes again.
                Some([time, value]) => match pending.first() {
                    Some(first) if *first == time => (vec![value], pending),
                    _ => return complete(pending, vec![time, value]),
                },
                None => return Taken::Other,
            },
        };
        let is_again = |(name, _): &(String, String)| pending.iter().any(|(known, _)| known == name);
        if found.first().is_some_and(is_again) {
            return complete(pending, found);
        }
        pending.extend(found);
        Taken::Part
    }

    /// The last one.
    pub(crate) fn finish(&mut self) -> Option<Record> {
        match self {
            Self::Line => None,
            Self::Block { pending, .. } | Self::Rows { pending, .. } => {
                Some(std::mem::take(pending)).filter(|pending| !pending.is_empty())
            }
        }
    }
}

fn complete(pending: &mut Record, next: Record) -> Taken {
    let before = std::mem::replace(pending, next);
    if before.is_empty() { Taken::Part } else { Taken::Record(before) }
}

/// Pairs of a line with nothing else; `None` for another line.
fn of_block(line: &str, group: &mut String) -> Option<Record> {
    if line.starts_with("---") {
        group.clear();
        return Some(Record::new());
    }
    if let Some(name) = line.strip_suffix(':').filter(|name| !name.contains([' ', ':', ','])) {
        name.clone_into(group);
        return Some(Record::new());
    }
    let found = pairs(line).filter(|found| !found.is_empty())?;
    let inner =
        |(name, value): (String, String)| (if group.is_empty() { name } else { format!("{group}.{name}") }, value);
    Some(found.into_iter().map(inner).collect())
}

impl RowLayout {
    /// `None` unless the rows name channels, with a time and one number.
    fn find(lines: &[Line]) -> Option<Self> {
        let first = lines.iter().position(|(_, text)| is_row(text))?;
        let separator = separator_of(&lines[first].1);
        let rows: Vec<Vec<&str>> = lines[first..].iter().map(|(_, text)| split(text, separator).collect()).collect();
        let width = rows[0].len();
        let rows: Vec<&Vec<&str>> = rows.iter().filter(|row| row.len() == width).collect();
        let is_all = |at: usize, is_one: &dyn Fn(&str) -> bool| rows.iter().all(|row| is_one(row[at]));
        let is_number = |field: &str| number(field).is_some_and(|number| !number.value().is_nan());
        let is_time = |field: &str| is_number(field) || calendar::date_time(field).is_some();
        let channels = |at: usize| {
            let mut channels: Vec<&str> = rows.iter().filter_map(|row| channel(row[at])).collect();
            channels.sort_unstable();
            channels.dedup();
            channels.len()
        };
        let label = (0..width).find(|at| !is_all(*at, &is_time) && channels(*at) >= LEAST_CHANNELS)?;
        let numbers: Vec<usize> = (0..width).filter(|at| *at != label && is_all(*at, &is_time)).collect();
        let &[time, value] = numbers.as_slice() else { return None };
        let unit = (0..width).find(|at| *at != label && is_all(*at, &|field| Unit::parse(field).is_some()));
        let heading = first.checked_sub(1).and_then(|above| split(&lines[above].1, separator).nth(time));
        let time_name = heading.filter(|name| !name.is_empty()).unwrap_or("time").to_owned();
        Some(Self { separator, time_name, time, label, value, unit })
    }

    /// The time, and the value.
    fn pairs(&self, line: &str) -> Option<[(String, String); 2]> {
        let fields: Vec<&str> = split(line, self.separator).collect();
        let (time, label, value) = (*fields.get(self.time)?, *fields.get(self.label)?, *fields.get(self.value)?);
        let unit = self.unit.and_then(|at| fields.get(at)).map(|unit| format!(" [{unit}]")).unwrap_or_default();
        let is_value = !label.is_empty() && number(value).is_some();
        is_value.then(|| [(self.time_name.clone(), time.to_owned()), (format!("{label}{unit}"), value.to_owned())])
    }
}

fn channel(text: &str) -> Option<&'static str> {
    let column = AvailableColumn::from_heading(text);
    column.prefix_and_channel().map(|(_, channel)| channel).filter(|channel| !["time", "sample"].contains(channel))
}

/// The names of most records, at least half of them of numbers, and the number of these.
fn usual_names(records: Vec<Record>) -> Option<(Vec<String>, usize)> {
    let mut kinds: Vec<(Vec<String>, usize)> = Vec::new();
    for record in records {
        let numbers = record.iter().filter(|(_, value)| number(value).is_some()).count();
        let names: Vec<String> = record.into_iter().map(|(name, _)| name).collect();
        match kinds.iter_mut().find(|(known, _)| *known == names) {
            Some((_, count)) => *count += 1,
            None if 2 * numbers >= names.len() => kinds.push((names, 1)),
            None => {}
        }
    }
    kinds.into_iter().max_by_key(|(_, count)| *count)
}

/// In the order of `names`; empty if missing.
pub(crate) fn values_of(names: &[String], record: Record) -> Vec<String> {
    let mut values = vec![String::new(); names.len()];
    for (at, (name, value)) in record.into_iter().enumerate() {
        // Mostly in one order.
        let is_same = names.get(at) == Some(&name);
        if let Some(at) = Some(at).filter(|_| is_same).or_else(|| names.iter().position(|known| *known == name)) {
            values[at] = value;
        }
    }
    values
}
