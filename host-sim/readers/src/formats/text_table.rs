//! Tables of numbers in text: CSV, sentences, named numbers.

use crate::columns::{
    AvailableColumn, COUNT, ChosenColumn, ReadingNote, Role, RowOptions, SelectionError, Unit, as_they_are,
};
use crate::formats::calendar::{CalendarClock, CalendarColumns};
use crate::formats::fields::{leading_number, number, split, with_unit};
use crate::formats::nmea::{self, Sentence};
use crate::formats::records::{Records, Taken, values_of};
use crate::formats::row_kinds::{RowKind, RowKinds};
use crate::formats::table_head::{self, HEAD_LINES, Line, TableColumns, TableHead, is_row};
use crate::input::{FileBytes, InputError, Lines, ReadMonitor, Reason, delimited_text};
use crate::rows::{EachRow, Ending, Number, Refusal, RowFault, RowSource, WholeTable};
use std::collections::VecDeque;
use std::path::PathBuf;

/// Largest share of damaged rows, and number before it counts; largest share of rows with words for values.
const MOST_DAMAGED: f64 = 0.1;
const MOST_WORDS: f64 = 0.5;
const FIRST_DAMAGED: u64 = 64;

pub(crate) fn read_whole(
    file: &FileBytes,
    topic: Option<&str>,
    monitor: &ReadMonitor,
) -> Result<WholeTable, InputError> {
    let table = TextTable::open_with(file, topic, monitor, &|available| Ok(as_they_are(available)))?;
    let whole = WholeTable { name: topic.unwrap_or_default().to_owned(), ..WholeTable::default() };
    whole.read(file.name(), &mut TextTable { is_lenient: true, ..table })
}

type Choose<'a> = dyn Fn(&[AvailableColumn]) -> Result<Vec<ChosenColumn>, SelectionError> + 'a;

enum Layout {
    /// Fields between separators; between blanks without one.
    Columns {
        separator: Option<char>,
        calendar: Option<CalendarClock>,
        /// The kind that is read, if there are several.
        kind: Option<RowKind>,
        /// Rows of the other kinds.
        others: u64,
    },
    /// Sentences of one kind.
    Sentences { name: String, damaged: u64, others: u64 },
    /// Records that name each number; `others` lack these names.
    Labelled { records: Records, names: Vec<String>, calendar: Option<CalendarClock>, others: u64 },
}

/// Rows of a kind that is counted, with the first.
#[derive(Debug, Default)]
struct CountedRows {
    rows: u64,
    first: Option<InputError>,
    note: String,
}

impl CountedRows {
    fn add(&mut self, error: InputError) {
        self.rows += 1;
        if self.first.is_none() {
            let line = error.line.map_or_else(String::new, |line| format!("line {line}: "));
            self.note = format!("{line}{}", error.reason);
            self.first = Some(error);
        }
    }

    /// The first, if they are more than `most`.
    fn check(&mut self, most: f64) -> Result<(), InputError> {
        let are_many = self.rows as f64 > most;
        self.first.take_if(|_| are_many).map_or(Ok(()), Err)
    }

    fn note(&self, what: &str) -> Option<String> {
        let Self { rows, note, .. } = self;
        (*rows > 0).then(|| format!("{rows} {what}, the first of them {note}"))
    }
}

#[derive(Debug, Default)]
struct DamagedRows {
    rows: u64,
    damaged: CountedRows,
    /// Rows with words for values.
    words: CountedRows,
}

impl DamagedRows {
    /// Leaves out a row; an error if these are too many.
    fn add(&mut self, error: InputError) -> Result<(), InputError> {
        self.damaged.add(error);
        if self.damaged.rows >= FIRST_DAMAGED { self.check() } else { Ok(()) }
    }

    fn check(&mut self) -> Result<(), InputError> {
        self.damaged.check(MOST_DAMAGED * self.rows as f64)
    }

    fn notes(&self) -> impl Iterator<Item = String> {
        let damaged = self.damaged.note("damaged rows are left out");
        damaged.into_iter().chain(self.words.note("rows have words for values, which are missing"))
    }
}

pub(crate) struct TextTable {
    file: PathBuf,
    lines: Lines,
    available: Vec<AvailableColumn>,
    chosen: Vec<ChosenColumn>,
    layout: Layout,
    /// Stated before the rows, Hz.
    rate_hz: Option<f64>,
    columns_notes: Vec<ReadingNote>,
    damaged: DamagedRows,
    is_lenient: bool,
    /// Rows begin with a letter.
    are_words: bool,
    fields: RowFields,
    first: VecDeque<(u64, String)>,
    row: Vec<Number>,
}

impl TextTable {
    pub(crate) fn open(file: &FileBytes, options: &RowOptions, monitor: &ReadMonitor) -> Result<Self, InputError> {
        let choose = |available: &[AvailableColumn]| options.choose(available);
        let table = Self::open_with(file, options.topic.as_deref(), monitor, &choose)?;
        let columns_notes = options.selection.notes(&table.available, &table.chosen, &options.sensor);
        Ok(Self { columns_notes, ..table })
    }

    fn open_with(
        file: &FileBytes,
        topic: Option<&str>,
        monitor: &ReadMonitor,
        choose: &Choose,
    ) -> Result<Self, InputError> {
        let mut lines = Lines::open_monitored(file, monitor)?;
        let mut first: Vec<Line> = Vec::new();
        while first.len() < HEAD_LINES {
            let Some((line, text)) = lines.next_line()? else { break };
            first.push((line, text.to_owned()));
        }
        lines.begin_rows();
        let mut opened = Opened { file, choose, lines };
        let is_whole = first.len() < HEAD_LINES;
        let sentence = first.iter().position(|(_, text)| Sentence::parse(text).is_some());
        let row = first.iter().position(|(_, text)| is_row(text));
        if sentence.is_none()
            && let Some((records, names, start)) = Records::of_several_lines(&first)
        {
            return opened.labelled(records, names, first.split_off(start));
        }
        match (sentence, row) {
            (Some(sentence), row) if row.is_none_or(|row| sentence <= row) => {
                opened.sentences(topic, first.split_off(sentence).into())
            }
            (_, Some(_)) => {
                let head = TableHead::at_first_row(first).unwrap_or_default();
                opened.columns(topic, head)
            }
            _ => {
                if let Some((records, names)) = Records::of_lines(&first) {
                    return opened.labelled(records, names, first);
                }
                let last = first.last().map(|(line, _)| *line);
                Err(match (last, opened.lines.take_damage()) {
                    (_, Some(damage)) => file.error(damage),
                    (None, None) => file.error(Reason::Empty),
                    (Some(_), None) if is_whole => file.error(Reason::NoData),
                    (Some(line), None) => InputError::line(file.name(), line, Reason::NoNumbers),
                })
            }
        }
    }
}

struct Opened<'a> {
    file: &'a FileBytes,
    choose: &'a Choose<'a>,
    lines: Lines,
}

impl Opened<'_> {
    fn columns(self, topic: Option<&str>, mut head: TableHead) -> Result<TextTable, InputError> {
        let fail = |reason| self.file.error(reason);
        let kinds = RowKinds::find(&head.fields(), &head.last_names());
        if kinds.is_none() {
            head.leave_preamble();
        }
        let rows = head.fields();
        let by_blanks = || RowKinds::find_by_blanks(&rows, &head.columns(None).available);
        let kinds = kinds.or_else(|| RowKinds::find_by_number(&rows, &head.last_names())).or_else(by_blanks);
        let kind = match (&kinds, topic) {
            (None, None) => None,
            (None, Some(topic)) => {
                let names = Box::new((topic.to_owned(), "no topics: it is a table".to_owned()));
                return Err(fail(Reason::UnknownTopic(names)));
            }
            (Some(kinds), topic) => {
                // Perhaps of one kind alone.
                let by_columns = || {
                    let chosen = (self.choose)(&head.columns(None).available).ok()?;
                    let channels = chosen.iter().filter(|column| matches!(column.role, Role::Channel(_)));
                    kinds.filled_at(&channels.map(|column| column.position).collect::<Vec<_>>()).cloned()
                };
                Some(match topic.map_or_else(by_columns, |_| None) {
                    Some(kind) => kind,
                    None => kinds.choose(topic).map_err(fail)?,
                })
            }
        };
        let TableColumns { available, width, calendar, heading_line } = head.columns(kind.as_ref());
        let others: &[usize] = if let Some(RowKind::Filled { others, .. }) = &kind { others } else { &[] };
        let positions: Vec<usize> = (0..available.len()).filter(|at| !others.contains(at)).collect();
        let available: Vec<AvailableColumn> = positions.iter().map(|at| available[*at].clone()).collect();
        let mut chosen = (self.choose)(&available).map_err(|error| {
            let reason = Reason::Selection(Box::new(error));
            InputError { line: heading_line, ..self.file.error(reason) }
        })?;
        chosen.iter_mut().for_each(|column| column.position = positions[column.position]);
        drop(rows);
        // Final tabs are blanks.
        let fields = RowFields::new(width, head.separator == Some('\t'), &chosen);
        let rate_hz = head.rate_hz();
        let calendar = calendar.map(CalendarClock::new);
        let layout = Layout::Columns { separator: head.separator, calendar, kind, others: 0 };
        Ok(TextTable { rate_hz, ..self.table(available, chosen, layout, fields, head.rows) })
    }

    fn table(
        self,
        available: Vec<AvailableColumn>,
        chosen: Vec<ChosenColumn>,
        layout: Layout,
        fields: RowFields,
        first: VecDeque<Line>,
    ) -> TextTable {
        TextTable {
            file: self.file.name().to_owned(),
            lines: self.lines,
            available,
            row: Vec::with_capacity(chosen.len()),
            chosen,
            layout,
            rate_hz: None,
            columns_notes: Vec::new(),
            damaged: DamagedRows::default(),
            is_lenient: false,
            are_words: first.front().is_some_and(|(_, text)| text.starts_with(|sign: char| sign.is_ascii_alphabetic())),
            fields,
            first,
        }
    }

    fn chosen(&self, available: &[AvailableColumn]) -> Result<Vec<ChosenColumn>, InputError> {
        (self.choose)(available).map_err(|error| self.file.error(Reason::Selection(Box::new(error))))
    }

    /// The named kind, else the most frequent with numbers.
    fn sentences(self, topic: Option<&str>, first: VecDeque<Line>) -> Result<TextTable, InputError> {
        let file = self.file;
        // Name, fields, count.
        let mut kinds: Vec<(String, usize, usize)> = Vec::new();
        for sentence in first.iter().filter_map(|(_, text)| Sentence::parse(text)).filter(|of| of.is_intact) {
            match kinds.iter_mut().find(|(name, ..)| name == sentence.name) {
                Some((.., count)) => *count += 1,
                None => kinds.push((sentence.name.to_owned(), sentence.fields.len(), 1)),
            }
        }
        let names = || kinds.iter().map(|(name, ..)| name.as_str()).collect::<Vec<_>>().join(", ");
        let unknown = |topic: &str| Reason::UnknownTopic(Box::new((topic.to_owned(), names())));
        let is_numeric = |name: &str| {
            let of_kind = first.iter().filter_map(|(_, text)| Sentence::parse(text)).find(|of| of.name == name);
            of_kind.is_some_and(|of| {
                let numbers =
                    of.fields.iter().filter(|field| number(field).is_some_and(|it| !it.value().is_nan())).count();
                2 * numbers >= of.fields.len()
            })
        };
        let kind = match topic {
            Some(topic) => {
                let named = kinds.iter().find(|(name, ..)| name == topic);
                named.ok_or_else(|| file.error(unknown(topic)))?
            }
            None => {
                let is_of_sensor = |(name, width, _): &(String, usize, usize)| {
                    nmea::columns(name, *width).iter().any(|column| column.prefix_and_channel().is_some())
                };
                let numeric = kinds.iter().filter(|(name, ..)| is_numeric(name));
                let most = numeric.max_by_key(|kind| (is_of_sensor(kind), kind.2));
                most.ok_or_else(|| file.error(Reason::NoNumbers))?
            }
        };
        let (name, width) = (kind.0.clone(), kind.1);
        let available = nmea::columns(&name, width);
        let chosen = self.chosen(&available)?;
        let fields = RowFields::new(width, false, &chosen);
        Ok(self.table(available, chosen, Layout::Sentences { name, damaged: 0, others: 0 }, fields, first))
    }

    /// `first` are lines already read.
    fn labelled(self, mut records: Records, names: Vec<String>, first: Vec<Line>) -> Result<TextTable, InputError> {
        let record = first.iter().find_map(|(_, text)| match records.push(text) {
            Taken::Record(record) => Some(record),
            Taken::Part | Taken::Other => None,
        });
        records.finish();
        let row = values_of(&names, record.unwrap_or_default());
        let row: Vec<&str> = row.iter().map(String::as_str).collect();
        let mut available = table_head::named_columns(&names, None);
        let calendar =
            CalendarColumns::find(&row).or_else(|| CalendarColumns::parts(&available, std::slice::from_ref(&row)));
        if let Some(calendar) = &calendar {
            table_head::set_calendar(&mut available, calendar);
        }
        let chosen = self.chosen(&available)?;
        let fields = RowFields::new(names.len(), false, &chosen);
        let layout = Layout::Labelled { records, names, calendar: calendar.map(CalendarClock::new), others: 0 };
        Ok(self.table(available, chosen, layout, fields, first.into()))
    }
}

impl RowSource for TextTable {
    fn chosen(&self) -> &[ChosenColumn] {
        &self.chosen
    }

    fn rate_hz(&self) -> Option<f64> {
        self.rate_hz
    }

    fn read(&mut self, each: &mut EachRow) -> Result<Ending, InputError> {
        while let Some(line) = self.next_row()? {
            match each(&self.row) {
                Ok(()) => self.damaged.rows += 1,
                Err(Refusal::Fault(fault)) => {
                    let error = self.fault(line, fault);
                    self.damaged.add(error)?;
                }
                Err(Refusal::Enough) => break,
            }
        }
        self.damaged.check()?;
        self.damaged.words.check(MOST_WORDS * self.damaged.rows as f64)?;
        Ok(Ending { damage: self.lines.take_damage(), notes: self.notes() })
    }
}

impl TextTable {
    fn notes(&self) -> Vec<ReadingNote> {
        let of_rate = self.rate_hz.map(|hz| format!("the file states a rate of {hz} Hz before its rows"));
        let zeros = self.lines.zero_bytes();
        let mut counted = vec![(zeros, format!("{zeros} bytes that are zero are left out"))];
        let (others, what) = match &self.layout {
            Layout::Labelled { others, .. } => {
                (others, "lines without the names of the others are left out".to_owned())
            }
            Layout::Columns { others, .. } => {
                (others, "rows of other kinds are left out; --topic reads another".to_owned())
            }
            Layout::Sentences { name, damaged, others } => {
                let of_damaged = format!("{damaged} sentences whose checksum is wrong; their values are missing");
                counted.push((*damaged, of_damaged));
                (others, format!("lines that are no sentence {name} are left out; --topic reads another"))
            }
        };
        counted.push((*others, format!("{others} {what}")));
        let counted = counted.into_iter().filter(|(count, _)| *count > 0).map(|(_, text)| text);
        let of_rows = of_rate.into_iter().chain(self.damaged.notes()).chain(counted).map(ReadingNote::from);
        self.columns_notes.iter().cloned().chain(of_rows).collect()
    }

    fn fault(&self, line: u64, RowFault { column, reason }: RowFault) -> InputError {
        match column {
            Some(at) => InputError::field(&self.file, line, &self.chosen[at].label, reason),
            None => InputError::line(&self.file, line, reason),
        }
    }

    /// Into `row`; `None` at the end.
    fn next_row(&mut self) -> Result<Option<u64>, InputError> {
        let Self { file, lines, chosen, layout, is_lenient, are_words, fields: of_row, first, row, damaged, .. } = self;
        let plain = match layout {
            Layout::Columns { separator, calendar: None, kind: None, .. } if first.is_empty() => *separator,
            _ => None,
        };
        loop {
            if let Some(separator) = plain
                && let Some(bytes) = of_row.plain_numbers(lines.buffer(), separator, row)
            {
                return Ok(Some(lines.consume_line(bytes)));
            }
            let first = first.pop_front();
            let (line, text) = match &first {
                Some((line, text)) => (*line, text.as_str()),
                None => match lines.next_line()? {
                    Some(next) => next,
                    None => {
                        let Layout::Labelled { records, names, calendar, .. } = layout else { return Ok(None) };
                        let Some(record) = records.finish().filter(|last| last.len() == names.len()) else {
                            return Ok(None);
                        };
                        let values = values_of(names, record);
                        let read = of_row.numbers(values.iter().map(String::as_str), calendar.as_mut(), row);
                        return Ok(read.is_ok().then_some(lines.line()));
                    }
                },
            };
            let mut is_short = false;
            let of_layout = match layout {
                Layout::Columns { separator, kind: Some(RowKind::Labelled { at, name }), others, .. }
                    if split(text, *separator).nth(*at) != Some(name) =>
                {
                    *others += 1;
                    Ok(false)
                }
                Layout::Columns { separator, calendar, kind, others } => {
                    let read = of_row.numbers(split(text, *separator), calendar.as_mut(), row);
                    let of_kind = if let Some(RowKind::Filled { own, .. }) = &*kind { Some(own) } else { None };
                    let is_own = |column: &ChosenColumn| match of_kind {
                        Some(own) => own.contains(&column.position),
                        None => matches!(column.role, Role::Channel(_)),
                    };
                    let is_empty =
                        |(column, number): (&ChosenColumn, &Number)| !is_own(column) || number.value().is_nan();
                    let is_other = read.is_ok()
                        && (!*is_lenient || of_kind.is_some())
                        && chosen.iter().zip(row.iter()).all(is_empty)
                        && is_of_other_sensor(split(text, *separator), chosen, is_own);
                    *others += u64::from(is_other);
                    read.map(|()| !is_other)
                }
                Layout::Labelled { records, names, calendar, others } => match records.push(text) {
                    Taken::Record(record) if record.iter().any(|(name, _)| names.contains(name)) => {
                        is_short = record.len() < names.len();
                        let values = values_of(names, record);
                        of_row.numbers(values.iter().map(String::as_str), calendar.as_mut(), row).map(|()| true)
                    }
                    Taken::Part => continue,
                    Taken::Record(_) | Taken::Other => {
                        *others += 1;
                        Ok(false)
                    }
                },
                Layout::Sentences { name, damaged, others } => match Sentence::parse(text) {
                    Some(sentence) if !sentence.is_intact => {
                        *damaged += 1;
                        is_short = true;
                        row.clear();
                        row.resize(chosen.len(), Number::Real(f64::NAN));
                        // A sample without values; its time must be known.
                        Ok(chosen.iter().all(|column| matches!(column.role, Role::Channel(_))))
                    }
                    Some(Sentence { name: own, fields, .. }) if own == *name => {
                        of_row.numbers(fields.into_iter(), None, row).map(|()| true)
                    }
                    _ => {
                        *others += 1;
                        Ok(false)
                    }
                },
            };
            let of_layout = of_layout.or_else(|fault| match fault {
                // Missing ones are NaN.
                (Some(_), Reason::NotNumber(_) | Reason::NotTime(_)) if *is_lenient => Ok(true),
                fault => Err(fault),
            });
            if let Some(last) = lines.unended(line) {
                let starts_as_row = match layout {
                    Layout::Columns { .. } => last.first.is_ascii_alphabetic() == *are_words,
                    Layout::Sentences { .. } | Layout::Labelled { .. } => true,
                };
                let is_row = of_layout.as_ref().is_ok_and(|is_own| *is_own || matches!(layout, Layout::Columns { .. }));
                let is_part = starts_as_row && !b"#%/*;".contains(&last.first) && (!is_row || is_short);
                if is_part || last.is_in_quotes {
                    lines.ends_within(line);
                    return Ok(None);
                }
            }
            match of_layout {
                Ok(true) => {
                    if let Some((at, word)) = of_row.word.take().filter(|_| !*is_lenient) {
                        let label = &chosen[at].label;
                        damaged.words.add(InputError::field(file, line, label, Reason::NotNumber(word)));
                    }
                    return Ok(Some(line));
                }
                Ok(false) => {}
                Err((Some(at), reason)) => damaged.add(InputError::field(file, line, &chosen[at].label, reason))?,
                Err((None, reason)) => damaged.add(InputError::line(file, line, reason))?,
            }
        }
    }
}

#[derive(Debug)]
struct RowFields {
    width: usize,
    /// Final empty fields may be absent.
    may_be_short: bool,
    /// Fields in ascending order, and their columns.
    read: Vec<(usize, usize)>,
    /// Column of each field; empty if a field has two.
    plain: Vec<Option<usize>>,
    /// True for columns of values, which may be missing; registers always have counts.
    are_values: Vec<bool>,
    /// A word for a value in the last row, with its column.
    word: Option<(usize, String)>,
    units: Vec<Option<Unit>>,
}

impl RowFields {
    fn new(width: usize, may_be_short: bool, chosen: &[ChosenColumn]) -> Self {
        let mut read: Vec<(usize, usize)> =
            chosen.iter().enumerate().map(|(at, column)| (column.position, at)).collect();
        read.sort_unstable();
        let column_at = |position| read.iter().find(|(of, _)| *of == position).map(|(_, at)| *at);
        let plain: Vec<Option<usize>> = (0..width).map(column_at).collect();
        let plain = if plain.iter().flatten().count() == read.len() { plain } else { Vec::new() };
        let is_value = |column: &ChosenColumn| {
            matches!(column.role, Role::Channel(_)) && column.unit.is_none_or(|unit| unit.base != COUNT)
        };
        let are_values = chosen.iter().map(is_value).collect();
        let units = chosen.iter().map(|column| column.unit).collect();
        Self { width, may_be_short, read, plain, are_values, word: None, units }
    }

    /// Fast path of [`numbers`](Self::numbers) for plain lines, and the bytes of the line; `None` for any other.
    fn plain_numbers(&self, text: &[u8], separator: char, row: &mut Vec<Number>) -> Option<usize> {
        row.resize(self.read.len(), Number::Real(f64::NAN));
        let (mut rest, last) = (text, self.plain.len().checked_sub(1)?);
        for (position, column) in self.plain.iter().enumerate() {
            rest = match column {
                Some(column) => {
                    let (number, after) = leading_number(rest)?;
                    row[*column] = number;
                    after
                }
                None => {
                    let is_plain = |byte: &u8| byte.is_ascii_alphanumeric() || matches!(byte, b'.' | b'-' | b'_');
                    &rest[rest.iter().take_while(|byte| is_plain(byte)).count()..]
                }
            };
            if position < last {
                rest = rest.strip_prefix(&[separator as u8])?;
            }
        }
        let rest = rest.strip_prefix(b"\r").unwrap_or(rest).strip_prefix(b"\n")?;
        Some(text.len() - rest.len())
    }

    fn numbers<'a>(
        &mut self,
        mut fields: impl Iterator<Item = &'a str>,
        mut calendar: Option<&mut CalendarClock>,
        row: &mut Vec<Number>,
    ) -> Result<(), (Option<usize>, Reason)> {
        row.clear();
        row.resize(self.read.len(), Number::Real(f64::NAN));
        self.word = None;
        let mut read = self.read.as_slice();
        let mut found = 0;
        let mut filled = 0;
        let mut fault: Option<(usize, Reason)> = None;
        let mut after_date = None;
        let mut parts_ns = Some(0_i64);
        while let Some(field) = after_date.take().or_else(|| fields.next()) {
            let position = found;
            found += 1;
            if !field.is_empty() {
                filled = found;
            }
            let mut time_ns = None;
            if let Some(part) = calendar.as_ref().and_then(|clock| clock.part_ns(position, field)) {
                parts_ns = parts_ns.zip(part).and_then(|(sum, part)| sum.checked_add(part));
            }
            if let Some(clock) = calendar.as_deref_mut().filter(|clock| clock.is_at(position)) {
                if matches!(clock.columns, CalendarColumns::Two(_)) {
                    after_date = fields.next();
                }
                time_ns = Some(clock.time_ns(field, after_date.unwrap_or_default()));
            }
            while let [(next, at), rest @ ..] = read
                && *next == position
            {
                read = rest;
                let (known, reason): (_, fn(String) -> Reason) = match time_ns {
                    Some(time_ns) => (time_ns.map(Number::Integer), Reason::NotTime),
                    None => (number(field).or_else(|| in_unit(field, self.units[*at])), Reason::NotNumber),
                };
                match known {
                    Some(known) => row[*at] = known,
                    // Garbled numbers have digits.
                    None if self.are_values[*at] && !field.bytes().any(|byte| byte.is_ascii_digit()) => {
                        self.word.get_or_insert_with(|| (*at, delimited_text::quote(field)));
                    }
                    None if fault.as_ref().is_some_and(|(first, _)| first < at) => {}
                    None => fault = Some((*at, reason(delimited_text::quote(field)))),
                }
            }
        }
        if let Some(start) = calendar.as_ref().and_then(|clock| clock.start_of_parts())
            && let Some((_, at)) = self.read.iter().find(|(position, _)| *position == start)
        {
            let time_ns = parts_ns.and_then(|sum| calendar.as_mut()?.sum_ns(sum));
            row[*at] = time_ns.map_or(Number::Real(f64::NAN), Number::Integer);
        }
        let is_complete = found >= self.width || self.may_be_short && found + 1 >= self.width.min(2);
        match fault {
            _ if !is_complete || filled > self.width => Err((None, Reason::FieldCount { found, expected: self.width })),
            Some((at, reason)) => Err((Some(at), reason)),
            None => match &self.word {
                // Words alone are no row.
                Some((at, word)) if row.iter().all(|number| number.value().is_nan()) => {
                    Err((Some(*at), Reason::NotNumber(word.clone())))
                }
                _ => Ok(()),
            },
        }
    }
}

/// A number with its unit, in the column's.
fn in_unit(field: &str, of_column: Option<Unit>) -> Option<Number> {
    let ((number, unit), own) = with_unit(field).zip(of_column)?;
    let scaled = || Number::Real(number.value() * unit.factor / own.factor);
    (unit.base == own.base).then(|| if unit.factor == own.factor { number } else { scaled() })
}

/// A number, but none of the `chosen` columns.
fn is_of_other_sensor<'a>(
    fields: impl Iterator<Item = &'a str>,
    chosen: &[ChosenColumn],
    is_own: impl Fn(&ChosenColumn) -> bool,
) -> bool {
    let (mut has_other, mut has_own) = (false, false);
    for (at, field) in fields.enumerate().filter(|(_, field)| !field.is_empty()) {
        match chosen.iter().find(|column| column.position == at) {
            Some(column) if is_own(column) => has_own = true,
            Some(_) => {}
            None => has_other |= number(field).is_some_and(|number| !number.value().is_nan()),
        }
    }
    has_other && !has_own
}
