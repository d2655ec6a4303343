//! Tables of numbers in any units: CSV with commas, semicolons, tabs or blanks, with or without a heading, sentences as of NMEA 0183, and
//! lines that name each number.

use crate::columns::column_selection::{AvailableColumn, ChosenColumn, Role, SelectionError, as_they_are};
use crate::columns::unit::Unit;
use crate::formats::calendar::{self, CalendarClock, CalendarColumns};
use crate::formats::labelled_row;
use crate::formats::nmea::{self, Sentence};
use crate::formats::row_kinds::RowKinds;
use crate::input::budget::Budget;
use crate::input::delimited_text::{self, Lines};
use crate::input::input_error::{InputError, Reason};
use crate::input::read_monitor::ReadMonitor;
use crate::rows::any_sensor::ReadOptions;
use crate::rows::batch::{BatchBuilder, Number, RowFault};
use crate::rows::row_source::{EachRow, Ending, Refusal, RowSource};
use crate::rows::whole_table::{WholeTable, most_rows};
use std::collections::{BTreeMap, VecDeque};
use std::path::{Path, PathBuf};

/// Separators of columns, the first that occurs; blanks where none does.
const SEPARATORS: [char; 3] = [';', '\t', ','];

/// Fields that stand for a missing value, in small letters.
const MISSING: [&str; 22] = [
    "", "nan", "na", "n/a", "null", "none", "nil", "-", "--", "---", "*", "?", "#n/a", "#na", "#value!", "#num!",
    "#div/0!", "1.#qnan", "-1.#ind", "1.#inf", "ovf", "missing",
];

/// Part of the rows that may be damaged: a file with more is another one than it is taken for. So many are damaged before that is asked.
const MOST_DAMAGED: f64 = 0.1;
const FIRST_DAMAGED: u64 = 64;

/// Lines before the first row of numbers that may be comments or a heading.
const MAX_PREAMBLE: usize = 64;

/// Rows or sentences at the start of a file that tell their kinds.
const FIRST_LINES: usize = 64;

/// What the serial monitor of the Arduino IDE writes between the time of a line and the line.
const ARROW: &str = " -> ";

/// The rows of a table, which can be read again; a monitor counts the bytes and may stop the reading.
pub(crate) struct TextRows<'a> {
    file: &'a Path,
    options: ReadOptions,
    monitor: ReadMonitor,
    chosen: Vec<ChosenColumn>,
    rate_hz: Option<f64>,
    /// The table before its first reading.
    opened: Option<TextTable>,
}

impl<'a> TextRows<'a> {
    /// Opens a table and chooses its columns.
    pub(crate) fn open(file: &'a Path, options: &ReadOptions, monitor: &ReadMonitor) -> Result<Self, InputError> {
        let table = TextTable::open(file, options, monitor)?;
        let (chosen, rate_hz) = (table.chosen.clone(), table.rate_hz);
        let (options, monitor) = (options.clone(), monitor.clone());
        Ok(Self { file, options, monitor, chosen, rate_hz, opened: Some(table) })
    }
}

impl RowSource for TextRows<'_> {
    fn chosen(&self) -> &[ChosenColumn] {
        &self.chosen
    }

    fn rate_hz(&self) -> Option<f64> {
        self.rate_hz
    }

    fn budget(&self) -> Option<Budget> {
        None
    }

    fn read(&mut self, each: &mut EachRow) -> Result<Ending, InputError> {
        let mut table = match self.opened.take() {
            Some(table) => table,
            None => TextTable::open(self.file, &self.options, &self.monitor)?,
        };
        while let Some(line) = table.next_row()? {
            match each(&table.row) {
                Ok(()) => table.damaged.rows += 1,
                Err(Refusal::Fault(fault)) => {
                    let error = table.fault(line, fault);
                    table.damaged.add(error)?;
                }
                Err(Refusal::Enough) => break,
            }
        }
        table.damaged.check()?;
        Ok(Ending { damage: None, notes: table.notes() })
    }
}

/// Reads all columns of a table; fields that are no numbers are missing.
pub(crate) fn read_whole(file: &Path, topic: Option<&str>, monitor: &ReadMonitor) -> Result<WholeTable, InputError> {
    let mut table = TextTable::open_with(file, topic, monitor, &|available| Ok(as_they_are(available)))?;
    table.is_lenient = true;
    let mut builder = BatchBuilder::new(&table.chosen, &[], None);
    let most = most_rows(table.chosen.len());
    let mut whole = WholeTable { name: topic.unwrap_or_default().to_owned(), ..WholeTable::default() };
    loop {
        whole.is_cut = builder.rows() >= most;
        let row = table.next_row().and_then(|line| {
            let Some(line) = line.filter(|_| !whole.is_cut) else { return Ok(false) };
            table.damaged.rows += 1;
            builder.push(&table.row).map(|()| true).map_err(|fault| table.fault(line, fault))
        });
        let row = match row {
            Ok(false) => table.damaged.check().map(|()| false),
            row => row,
        };
        match row {
            Ok(true) => {}
            Ok(false) => break,
            Err(error) if builder.rows() == 0 => return Err(error),
            Err(error) => {
                whole.notes.push(format!("{error}; the {} rows before that are shown", builder.rows()));
                break;
            }
        }
    }
    whole.notes.extend(table.notes());
    whole.rate_hz = table.rate_hz;
    Ok(whole.with_rows(table.chosen, builder))
}

/// Chooses the columns to read of those that there are.
type Choose<'a> = dyn Fn(&[AvailableColumn]) -> Result<Vec<ChosenColumn>, SelectionError> + 'a;

/// How the fields of a row are told from each other.
enum Layout {
    /// By a separator; blanks where there is none.
    Columns {
        separator: Option<char>,
        calendar: Option<CalendarClock>,
        /// Where the name of the kind of row is, and that which is read, of rows of several kinds.
        kind: Option<(usize, String)>,
        /// Rows of the other kinds.
        others: u64,
    },
    /// Those of one kind of sentence.
    Sentences { name: String, damaged: u64, others: u64 },
    /// Each with its name; `others` are lines without these names.
    Labelled { names: Vec<String>, calendar: Option<CalendarClock>, others: u64 },
}

/// Rows that are left out because they cannot be read.
#[derive(Debug, Default)]
struct DamagedRows {
    rows: u64,
    damaged: u64,
    first: Option<InputError>,
    note: String,
}

impl DamagedRows {
    /// Leaves out a row.
    ///
    /// # Errors
    /// Too many rows are damaged.
    fn add(&mut self, error: InputError) -> Result<(), InputError> {
        self.damaged += 1;
        if self.first.is_none() {
            let line = error.line.map_or_else(String::new, |line| format!("line {line}: "));
            self.note = format!("{line}{}", error.reason);
            self.first = Some(error);
        }
        if self.damaged >= FIRST_DAMAGED { self.check() } else { Ok(()) }
    }

    fn check(&mut self) -> Result<(), InputError> {
        let are_many = self.damaged as f64 > MOST_DAMAGED * self.rows as f64;
        self.first.take_if(|_| are_many).map_or(Ok(()), Err)
    }

    fn note(&self) -> Option<String> {
        let Self { damaged, note, .. } = self;
        (*damaged > 0).then(|| format!("{damaged} damaged rows are left out, the first of them {note}"))
    }
}

/// An open table, read row by row.
pub(crate) struct TextTable {
    file: PathBuf,
    lines: Lines,
    available: Vec<AvailableColumn>,
    chosen: Vec<ChosenColumn>,
    layout: Layout,
    /// The rate that a line before the rows states, Hz.
    rate_hz: Option<f64>,
    /// What the user should know of the columns.
    columns_notes: Vec<String>,
    damaged: DamagedRows,
    /// Whether a field that is no number is a missing one.
    is_lenient: bool,
    fields: RowFields,
    /// The first rows, which were read to tell the columns.
    first: VecDeque<(u64, String)>,
    row: Vec<Number>,
}

impl TextTable {
    /// Opens a table and chooses its columns.
    pub(crate) fn open(file: &Path, options: &ReadOptions, monitor: &ReadMonitor) -> Result<Self, InputError> {
        let choose = |available: &[AvailableColumn]| options.choose(available);
        let table = Self::open_with(file, options.topic.as_deref(), monitor, &choose)?;
        let columns_notes = options.selection.notes(&table.available, &table.chosen, &options.sensor);
        Ok(Self { columns_notes, ..table })
    }

    fn open_with(file: &Path, topic: Option<&str>, monitor: &ReadMonitor, choose: &Choose) -> Result<Self, InputError> {
        let mut lines = Lines::open_monitored(file, monitor)?;
        let mut preamble: Vec<(u64, String)> = Vec::new();
        let first = loop {
            let Some((line, text)) = lines.next()? else {
                if let Some(names) = labelled_names(&preamble) {
                    return Self::open_labelled(file, choose, lines, names, preamble);
                }
                let reason = if preamble.is_empty() { Reason::Empty } else { Reason::NoData };
                return Err(InputError::file(file, reason));
            };
            if Sentence::parse(text).is_some() {
                let first = (line, text.to_owned());
                return Self::open_sentences(file, topic, choose, lines, first);
            }
            if is_row(text) {
                break (line, text.to_owned());
            }
            preamble.push((line, text.to_owned()));
            if preamble.len() > MAX_PREAMBLE {
                if let Some(names) = labelled_names(&preamble) {
                    return Self::open_labelled(file, choose, lines, names, preamble);
                }
                return Err(InputError::line(file, line, Reason::NoNumbers));
            }
        };
        let separator = separator_of(&first.1);
        let mut first = VecDeque::from([first]);
        while first.len() < FIRST_LINES {
            let Some((line, text)) = lines.next()? else { break };
            first.push_back((line, text.to_owned()));
        }
        let has_kinds = {
            let rows: Vec<Vec<&str>> = first.iter().map(|(_, text)| split(text, separator).collect()).collect();
            RowKinds::find(&rows).is_some()
        };
        if !has_kinds {
            leave_preamble(&mut first, &mut preamble);
        }
        let separator = first.front().map_or(separator, |(_, text)| separator_of(text));
        let rows: Vec<Vec<&str>> = first.iter().map(|(_, text)| split(text, separator).collect()).collect();
        let of_numbers = || {
            let heading = split(&preamble.last()?.1, separator).collect::<Vec<_>>();
            RowKinds::find_by_number(&rows, &heading)
        };
        let kinds = RowKinds::find(&rows).or_else(of_numbers);
        let kind = match (&kinds, topic) {
            (None, None) => None,
            (None, Some(topic)) => {
                let names = Box::new((topic.to_owned(), "no topics: it is a table".to_owned()));
                return Err(InputError::file(file, Reason::UnknownTopic(names)));
            }
            (Some(kinds), topic) => Some(kinds.choose(topic).map_err(|reason| InputError::file(file, reason))?),
        };
        let is_kind = |row: &&Vec<&str>| kind.as_ref().is_none_or(|(at, name)| row.get(*at) == Some(&name.as_str()));
        let row = rows.iter().find(is_kind).cloned().unwrap_or_default();
        let (width, calendar) = (width_of(&row, &preamble, separator), CalendarColumns::find(&row));
        // As `write.table` of R numbers the rows, without a name in the heading.
        let is_numbered = matches!(rows.as_slice(), [first, second, ..] if first[0] == "1" && second[0] == "2");
        // The heading may have one name for a date and a time of day.
        let is_unnumbered = |fields: usize| fields + 1 == width && is_numbered;
        let is_heading = |fields: usize| fields == width || is_short(fields, width, calendar) || is_unnumbered(fields);
        let fields = |text: &str| names(text, separator, width).len();
        let mut headings = preamble.iter().rev().filter(|(_, text)| is_heading(fields(text)));
        let mut heading = headings.next();
        // A row of units below the names.
        let units = heading.and_then(|(_, text)| units_of(split(text, separator)));
        if let Some(names) = headings.next().filter(|_| units.is_some()) {
            heading = Some(names);
        }
        if kind.is_some() && heading.is_none_or(|(_, text)| fields(text) != width) {
            // Rows of several kinds have no common heading.
            heading = None;
        }
        let mut available: Vec<AvailableColumn> = match heading {
            Some((line, text)) => {
                let above = preamble.iter().rev().find(|(above, _)| above + 1 == *line);
                let own = names(text, separator, width);
                let above = above.map(|(_, text)| names(text, separator, width));
                let joined = above.and_then(|above| joined_names(&above, &own));
                match &joined {
                    Some(joined) => named_columns(joined.iter().map(String::as_str), units.as_deref()),
                    None => named_columns(own.into_iter(), units.as_deref()),
                }
            }
            None => (0..width).map(|number| AvailableColumn { name: number.to_string(), unit: None }).collect(),
        };
        if let Some(calendar) = calendar {
            if is_short(available.len(), width, Some(calendar)) {
                let time_of_day = AvailableColumn { name: "time of day".to_owned(), unit: None };
                available.insert(calendar.position() + 1, time_of_day);
            }
            set_calendar(&mut available, calendar);
        } else if is_unnumbered(available.len()) {
            available.insert(0, AvailableColumn { name: "row".to_owned(), unit: None });
        }
        let chosen = choose(&available).map_err(|error| match heading {
            Some((line, _)) => InputError::line(file, *line, Reason::Selection(Box::new(error))),
            None => InputError::file(file, Reason::Selection(Box::new(error))),
        })?;
        check_origin(&rows, &chosen).map_err(|reason| InputError::file(file, reason))?;
        let row = Vec::with_capacity(chosen.len());
        // The tabs at the end of a line are blanks too.
        let fields = RowFields::new(width, separator == Some('\t'), &chosen);
        let layout = Layout::Columns { separator, calendar: calendar.map(CalendarClock::new), kind, others: 0 };
        Ok(Self {
            file: file.to_owned(),
            lines,
            available,
            chosen,
            layout,
            rate_hz: preamble.iter().find_map(|(_, text)| stated_rate(text)),
            columns_notes: Vec::new(),
            damaged: DamagedRows::default(),
            is_lenient: false,
            fields,
            first,
            row,
        })
    }

    /// Opens a file of sentences: of one kind, that which the options name, else the most frequent one with numbers among the first.
    fn open_sentences(
        file: &Path,
        topic: Option<&str>,
        choose: &Choose,
        mut lines: Lines,
        first: (u64, String),
    ) -> Result<Self, InputError> {
        let mut first = VecDeque::from([first]);
        while first.len() < FIRST_LINES {
            let Some((line, text)) = lines.next()? else { break };
            first.push_back((line, text.to_owned()));
        }
        // Name and number of fields of each kind, and how many there are.
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
                named.ok_or_else(|| InputError::file(file, unknown(topic)))?
            }
            None => {
                let most = kinds.iter().filter(|(name, ..)| is_numeric(name)).max_by_key(|(.., count)| *count);
                most.ok_or_else(|| InputError::file(file, Reason::NoNumbers))?
            }
        };
        let (name, width) = (kind.0.clone(), kind.1);
        let available = nmea::columns(&name, width);
        let chosen = choose(&available);
        let chosen = chosen.map_err(|error| InputError::file(file, Reason::Selection(Box::new(error))))?;
        let row = Vec::with_capacity(chosen.len());
        let fields = RowFields::new(width, false, &chosen);
        let layout = Layout::Sentences { name, damaged: 0, others: 0 };
        Ok(Self {
            file: file.to_owned(),
            lines,
            available,
            chosen,
            layout,
            rate_hz: None,
            columns_notes: Vec::new(),
            damaged: DamagedRows::default(),
            is_lenient: false,
            fields,
            first,
            row,
        })
    }

    /// Opens a file whose lines name each of their numbers; `first` are the lines that were read.
    fn open_labelled(
        file: &Path,
        choose: &Choose,
        lines: Lines,
        names: Vec<String>,
        first: Vec<(u64, String)>,
    ) -> Result<Self, InputError> {
        let rows = first.iter().filter_map(|(_, text)| labelled_row::parse(text));
        let row = rows.map(|row| values_of(&names, row)).next().unwrap_or_default();
        let calendar = CalendarColumns::find(&row.iter().map(String::as_str).collect::<Vec<_>>());
        let mut available = named_columns(names.iter().map(String::as_str), None);
        if let Some(calendar) = calendar {
            set_calendar(&mut available, calendar);
        }
        let chosen = choose(&available);
        let chosen = chosen.map_err(|error| InputError::file(file, Reason::Selection(Box::new(error))))?;
        let row = Vec::with_capacity(chosen.len());
        let fields = RowFields::new(names.len(), false, &chosen);
        Ok(Self {
            file: file.to_owned(),
            lines,
            available,
            chosen,
            layout: Layout::Labelled { names, calendar: calendar.map(CalendarClock::new), others: 0 },
            rate_hz: None,
            columns_notes: Vec::new(),
            damaged: DamagedRows::default(),
            is_lenient: false,
            fields,
            first: first.into(),
            row,
        })
    }

    /// What the user should know of the rows that were read, one sentence each.
    fn notes(&self) -> Vec<String> {
        let of_rate = self.rate_hz.map(|hz| format!("the file states a rate of {hz} Hz before its rows"));
        let zeros = self.lines.zero_bytes();
        let of_zeros = (zeros > 0).then(|| format!("{zeros} bytes that are zero are left out"));
        let mut notes: Vec<String> = self.columns_notes.iter().cloned().chain(of_rate).collect();
        notes.extend(self.damaged.note().into_iter().chain(of_zeros));
        let (name, damaged, others) = match &self.layout {
            Layout::Columns { others: 0, .. } | Layout::Labelled { others: 0, .. } => return notes,
            Layout::Labelled { others, .. } => {
                notes.push(format!("{others} lines without the names of the others are left out"));
                return notes;
            }
            Layout::Columns { others, .. } => {
                notes.push(format!("{others} rows of other kinds are left out; --topic reads another"));
                return notes;
            }
            Layout::Sentences { name, damaged, others } => (name, damaged, others),
        };
        let sentences = [
            (*damaged, format!("{damaged} sentences whose checksum is wrong; their values are missing")),
            (*others, format!("{others} lines that are no sentence {name} are left out; --topic reads another")),
        ];
        notes.extend(sentences.into_iter().filter(|(count, _)| *count > 0).map(|(_, text)| text));
        notes
    }

    /// An error of a row of a line.
    fn fault(&self, line: u64, RowFault { column, reason }: RowFault) -> InputError {
        match column {
            Some(at) => InputError::field(&self.file, line, &self.chosen[at].label, reason),
            None => InputError::line(&self.file, line, reason),
        }
    }

    /// Reads the next row into `row`; its line, or `None` at the end.
    fn next_row(&mut self) -> Result<Option<u64>, InputError> {
        let Self { file, lines, chosen, layout, is_lenient, fields: of_row, first, row, damaged, .. } = self;
        loop {
            let first = first.pop_front();
            let (line, text) = match &first {
                Some((line, text)) => (*line, text.as_str()),
                None => match lines.next()? {
                    Some(next) => next,
                    None => return Ok(None),
                },
            };
            let of_layout = match layout {
                Layout::Columns { separator, kind: Some((at, name)), others, .. }
                    if split(text, *separator).nth(*at) != Some(name) =>
                {
                    *others += 1;
                    Ok(false)
                }
                Layout::Columns { separator, calendar, others, .. } => {
                    let read = of_row.numbers(split(text, *separator), calendar.as_mut(), row);
                    let is_empty = |(column, number): (&ChosenColumn, &Number)| {
                        !matches!(column.role, Role::Channel(_)) || number.value().is_nan()
                    };
                    let is_other = read.is_ok()
                        && !*is_lenient
                        && chosen.iter().zip(row.iter()).all(is_empty)
                        && is_of_other_sensor(split(text, *separator), chosen);
                    *others += u64::from(is_other);
                    read.map(|()| !is_other)
                }
                Layout::Labelled { names, calendar, others } => {
                    let row_of = labelled_row::parse(text);
                    match row_of.filter(|row_of| row_of.iter().any(|(name, _)| names.contains(name))) {
                        Some(row_of) => {
                            let values = values_of(names, row_of);
                            of_row.numbers(values.iter().map(String::as_str), calendar.as_mut(), row).map(|()| true)
                        }
                        None => {
                            *others += 1;
                            Ok(false)
                        }
                    }
                }
                Layout::Sentences { name, damaged, others } => match Sentence::parse(text) {
                    Some(sentence) if !sentence.is_intact => {
                        *damaged += 1;
                        row.clear();
                        row.resize(chosen.len(), Number::Real(f64::NAN));
                        // A sample came, and its values are not known; nor is its time, if it has one.
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
                // The row has the missing ones as NaN.
                (Some(_), Reason::NotNumber(_) | Reason::NotTime(_)) if *is_lenient => Ok(true),
                fault => Err(fault),
            });
            match of_layout {
                Ok(true) => return Ok(Some(line)),
                Ok(false) => {}
                Err((Some(at), reason)) => damaged.add(InputError::field(file, line, &chosen[at].label, reason))?,
                Err((None, reason)) => damaged.add(InputError::line(file, line, reason))?,
            }
        }
    }
}

/// The names in most of the first lines of a file, where each names its numbers.
fn labelled_names(lines: &[(u64, String)]) -> Option<Vec<String>> {
    let mut kinds: Vec<(Vec<String>, usize)> = Vec::new();
    for row in lines.iter().filter_map(|(_, text)| labelled_row::parse(text)) {
        let numbers = row.iter().filter(|(_, value)| number(value).is_some()).count();
        let names: Vec<String> = row.into_iter().map(|(name, _)| name).collect();
        match kinds.iter_mut().find(|(known, _)| *known == names) {
            Some((_, count)) => *count += 1,
            None if 2 * numbers >= names.len() => kinds.push((names, 1)),
            None => {}
        }
    }
    let (names, count) = kinds.into_iter().max_by_key(|(_, count)| *count)?;
    (2 * count > lines.len()).then_some(names)
}

/// The values of a row in the order of `names`; empty where it has none.
fn values_of(names: &[String], row: Vec<(String, String)>) -> Vec<String> {
    let mut values = vec![String::new(); names.len()];
    for (at, (name, value)) in row.into_iter().enumerate() {
        // Most rows have the same order.
        let is_same = names.get(at) == Some(&name);
        if let Some(at) = Some(at).filter(|_| is_same).or_else(|| names.iter().position(|known| *known == name)) {
            values[at] = value;
        }
    }
    values
}

/// Marks the column of calendar times.
fn set_calendar(available: &mut [AvailableColumn], calendar: CalendarColumns) {
    let at = calendar.position();
    let name = if available[at].is_time() { available[at].name.clone() } else { "time".to_owned() };
    available[at] = AvailableColumn::known(&name, "ns");
}

/// Whether a heading has one name for the date and the time of day of rows of `width` fields.
fn is_short(fields: usize, width: usize, calendar: Option<CalendarColumns>) -> bool {
    fields + 1 == width && matches!(calendar, Some(CalendarColumns::Two(_)))
}

/// The fields of a row, and which of them are read.
#[derive(Debug)]
struct RowFields {
    width: usize,
    /// Whether empty fields at the end may be absent.
    may_be_short: bool,
    /// Position of each field that is read, in ascending order, and which of the chosen columns it is.
    read: Vec<(usize, usize)>,
}

impl RowFields {
    fn new(width: usize, may_be_short: bool, chosen: &[ChosenColumn]) -> Self {
        let mut read: Vec<(usize, usize)> =
            chosen.iter().enumerate().map(|(at, column)| (column.position, at)).collect();
        read.sort_unstable();
        Self { width, may_be_short, read }
    }

    /// The numbers of the chosen columns of a row.
    fn numbers<'a>(
        &self,
        mut fields: impl Iterator<Item = &'a str>,
        mut calendar: Option<&mut CalendarClock>,
        row: &mut Vec<Number>,
    ) -> Result<(), (Option<usize>, Reason)> {
        row.clear();
        row.resize(self.read.len(), Number::Real(f64::NAN));
        let mut read = self.read.as_slice();
        let mut found = 0;
        // Fields up to the last one that is not empty.
        let mut filled = 0;
        let mut fault: Option<(usize, Reason)> = None;
        let mut after_date = None;
        while let Some(field) = after_date.take().or_else(|| fields.next()) {
            let position = found;
            found += 1;
            if !field.is_empty() {
                filled = found;
            }
            let mut time_ns = None;
            if let Some(clock) = calendar.as_mut().filter(|clock| clock.columns.position() == position) {
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
                    None => (number(field), Reason::NotNumber),
                };
                match known {
                    Some(known) => row[*at] = known,
                    None if fault.as_ref().is_some_and(|(first, _)| first < at) => {}
                    None => fault = Some((*at, reason(delimited_text::quote(field)))),
                }
            }
        }
        let is_complete = found >= self.width || self.may_be_short && found + 1 >= self.width.min(2);
        match fault {
            _ if !is_complete || filled > self.width => Err((None, Reason::FieldCount { found, expected: self.width })),
            Some((at, reason)) => Err((Some(at), reason)),
            None => Ok(()),
        }
    }
}

/// Whether a row has a number, but none of the `chosen` channels: it is of another sensor.
fn is_of_other_sensor<'a>(fields: impl Iterator<Item = &'a str>, chosen: &[ChosenColumn]) -> bool {
    let (mut has_other, mut has_own) = (false, false);
    for (at, field) in fields.enumerate().filter(|(_, field)| !field.is_empty()) {
        match chosen.iter().find(|column| column.position == at) {
            Some(column) if matches!(column.role, Role::Channel(_)) => has_own = true,
            Some(_) => {}
            None => has_other |= number(field).is_some_and(|number| !number.value().is_nan()),
        }
    }
    has_other && !has_own
}

/// Refuses rows of two sensors in one table: some have one part of the `chosen` channels, the others the rest.
fn check_origin(rows: &[Vec<&str>], chosen: &[ChosenColumn]) -> Result<(), Reason> {
    let channels: Vec<&ChosenColumn> = chosen.iter().filter(|column| matches!(column.role, Role::Channel(_))).collect();
    let mut parts: Vec<Vec<bool>> = Vec::new();
    for row in rows {
        let has = |column: &&ChosenColumn| row.get(column.position).is_some_and(|field| !field.is_empty());
        let part: Vec<bool> = channels.iter().map(has).collect();
        if part.contains(&true) && !parts.contains(&part) {
            parts.push(part);
        }
    }
    let are_apart = |one: &[bool], other: &[bool]| one.iter().zip(other).all(|(one, other)| !(*one && *other));
    let [one, other] = parts.as_slice() else { return Ok(()) };
    if !are_apart(one, other) {
        return Ok(());
    }
    let name = |part: &[bool]| {
        let names = channels.iter().zip(part).filter(|(_, has)| **has).map(|(column, _)| column.label.as_str());
        names.collect::<Vec<_>>().join(", ")
    };
    Err(Reason::SeveralOrigins(Box::new((name(one), name(other)))))
}

/// Moves the lines before the rows of the most frequent width to the `preamble`.
fn leave_preamble(first: &mut VecDeque<(u64, String)>, preamble: &mut Vec<(u64, String)>) {
    let width = |text: &str| trimmed_width(&split(text, separator_of(text)).collect::<Vec<_>>());
    let mut counts: BTreeMap<usize, usize> = BTreeMap::new();
    for (_, text) in first.iter().filter(|(_, text)| is_row(text)) {
        *counts.entry(width(text)).or_insert(0) += 1;
    }
    // Of equally frequent widths the widest.
    let Some((&usual, &count)) = counts.iter().max_by_key(|(_, count)| **count) else { return };
    if 2 * count <= first.len() {
        return;
    }
    // Of rows between tabs the empty cells at the end are cut.
    let is_of_table = |text: &str| {
        let width = width(text);
        is_row(text) && (width == usual || width > usual && separator_of(text) == Some('\t'))
    };
    while first.front().is_some_and(|(_, text)| !is_of_table(text)) {
        preamble.extend(first.pop_front());
    }
}

/// Fields up to the last one that is not empty.
fn trimmed_width(fields: &[&str]) -> usize {
    fields.iter().rposition(|field| !field.is_empty()).map_or(0, |at| at + 1)
}

/// Fields of the rows of a table: those of `row`, but for empty ones at the end that no heading has a name for.
fn width_of(row: &[&str], preamble: &[(u64, String)], separator: Option<char>) -> usize {
    let least = trimmed_width(row);
    let headings = preamble.iter().map(|(_, text)| trimmed_width(&split(text, separator).collect::<Vec<_>>()));
    headings.filter(|names| (least..row.len()).contains(names)).max().unwrap_or(row.len())
}

/// The names of a heading in two lines, of which the upper one names groups of columns: `Gyroscope,,` over `X,Y,Z`. `None` for one in a line.
fn joined_names(above: &[&str], own: &[&str]) -> Option<Vec<String>> {
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

/// The sample rate that a line before the rows states, as in `// Update Rate: 100.0Hz`, Hz.
fn stated_rate(line: &str) -> Option<f64> {
    const NAMES: [&str; 4] = ["rate", "frequency", "freq", "fs"];
    let plain = line.to_lowercase();
    let (before, _) = plain.split_once("hz")?;
    let number = before.trim_end();
    let start = number.rfind(|letter: char| !letter.is_ascii_digit() && letter != '.').map_or(0, |at| at + 1);
    let is_named = number[..start].split(|letter: char| !letter.is_alphanumeric()).any(|word| NAMES.contains(&word));
    number[start..].parse().ok().filter(|hz: &f64| is_named && *hz > 0.0)
}

/// The sign between the fields of a row, without the time that a serial monitor writes before it.
fn separator_of(text: &str) -> Option<char> {
    let fields = text.split_once(ARROW).map_or(text, |(_, rest)| rest);
    SEPARATORS.into_iter().find(|separator| fields.contains(*separator))
}

fn split(text: &str, separator: Option<char>) -> Fields<'_> {
    Fields { rest: Some(text), separator: separator.map(|separator| separator as u8), has_arrow: text.contains(ARROW) }
}

/// The fields of a row, of which some may stand between quotation marks, in which a separator is none (RFC 4180).
struct Fields<'a> {
    rest: Option<&'a str>,
    /// An ASCII character; blanks where there is none.
    separator: Option<u8>,
    /// Whether there may be a time of a serial monitor before the row.
    has_arrow: bool,
}

impl<'a> Fields<'a> {
    /// The text before the next separator, and what follows it.
    fn cut(text: &'a str, separator: u8) -> (&'a str, Option<&'a str>) {
        let at = text.bytes().position(|byte| byte == separator);
        at.map_or((text, None), |at| (&text[..at], Some(&text[at + 1..])))
    }

    /// The next field, if it stands between quotation marks, and what follows them.
    fn quoted(text: &'a str) -> Option<(&'a str, &'a str)> {
        if text.bytes().next().is_none_or(|first| first.is_ascii_graphic() && first != b'"') {
            return None;
        }
        let inner = text.trim_start().strip_prefix('"')?;
        // Two marks are one in the text.
        let mut marks = inner.match_indices('"').map(|(at, _)| at).peekable();
        while let Some(at) = marks.next() {
            if marks.next_if_eq(&(at + 1)).is_none() {
                return Some((&inner[..at], &inner[at + 1..]));
            }
        }
        None
    }
}

impl<'a> Iterator for Fields<'a> {
    type Item = &'a str;

    fn next(&mut self) -> Option<&'a str> {
        let rest = self.rest.take()?;
        if self.has_arrow {
            if let Some((time, row)) = rest.split_once(ARROW) {
                self.rest = Some(row);
                return Some(time.trim());
            }
            self.has_arrow = false;
        }
        let Some(separator) = self.separator else {
            let start = rest.trim_ascii_start();
            let end = start.bytes().position(|byte| byte.is_ascii_whitespace()).unwrap_or(start.len());
            self.rest = Some(&start[end..]);
            return Some(delimited_text::field(&start[..end])).filter(|_| end > 0);
        };
        if let Some((field, after)) = Self::quoted(rest) {
            self.rest = Self::cut(after, separator).1;
            return Some(field.trim());
        }
        let (field, after) = Self::cut(rest, separator);
        self.rest = after;
        Some(delimited_text::field(field))
    }
}

/// The names in a heading above rows of `width` fields. Between blanks, a unit in brackets belongs to the name before it, and quotation
/// marks hold a name together.
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

/// The units of a row below the names, where it is one.
fn units_of<'a>(fields: impl Iterator<Item = &'a str>) -> Option<Vec<Option<Unit>>> {
    let fields: Vec<&str> = fields.collect();
    let unit = |field: &&str| Unit::parse(field.trim_matches(['[', ']', '(', ')']));
    let units: Vec<Option<Unit>> = fields.iter().map(unit).collect();
    let known = units.iter().flatten().count();
    (2 * known > fields.len()).then_some(units)
}

/// The columns of a heading. Of several with the same name each is known by its number, from 0.
fn named_columns<'a>(names: impl Iterator<Item = &'a str>, units: Option<&[Option<Unit>]>) -> Vec<AvailableColumn> {
    let mut columns: Vec<AvailableColumn> = names.map(AvailableColumn::from_heading).collect();
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

/// A number, with a decimal comma too; NaN for a missing one; `None` for other texts.
fn number(field: &str) -> Option<Number> {
    if let Some(number) = short_number(field.as_bytes()) {
        return Some(number);
    }
    if !field.contains('.')
        && let Ok(integer) = field.parse()
    {
        return Some(Number::Integer(integer));
    }
    let real = field.parse().ok().or_else(|| field.replace(',', ".").parse().ok());
    let missing = || MISSING.contains(&field.to_lowercase().as_str()).then_some(f64::NAN);
    real.or_else(missing).map(Number::Real)
}

/// Digits of a number with decimals whose quotient by their power of ten is the nearest float: both are exact.
const EXACT_DIGITS: usize = 15;

/// Most numbers: at most 18 digits without decimals, or 15 of which some are decimals; `None` for other texts.
fn short_number(field: &[u8]) -> Option<Number> {
    const POWERS: [f64; EXACT_DIGITS + 1] =
        [1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15];
    let (is_negative, text) = field.strip_prefix(b"-").map_or((false, field), |text| (true, text));
    if text.len() > 18 {
        return None;
    }
    let (mut value, mut point) = (0_i64, None);
    for (at, byte) in text.iter().enumerate() {
        match byte.wrapping_sub(b'0') {
            digit if digit < 10 => value = 10 * value + i64::from(digit),
            _ if *byte == b'.' && point.is_none() => point = Some(at),
            _ => return None,
        }
    }
    let Some(point) = point else {
        return (!text.is_empty()).then_some(Number::Integer(if is_negative { -value } else { value }));
    };
    let digits = text.len() - 1;
    if digits == 0 || digits > EXACT_DIGITS {
        return None;
    }
    let size = value as f64 / POWERS[digits - point];
    Some(Number::Real(if is_negative { -size } else { size }))
}

/// Whether a line is a row and no heading or comment: at least half of its fields are numbers or calendar times, or all are missing. The
/// others may be texts, such as the name of a frame.
fn is_row(text: &str) -> bool {
    let separator = separator_of(text);
    let (mut numbers, mut missing, mut fields, mut named) = (0, 0, 0, 0);
    for field in split(text, separator) {
        fields += 1;
        match number(field) {
            Some(known) if known.value().is_nan() => {
                missing += 1;
                named += usize::from(!field.is_empty());
            }
            Some(_) => numbers += 1,
            None => {
                let is_time = calendar::time_of_day(field).is_some() || calendar::date_time(field).is_some();
                numbers += usize::from(is_time || calendar::date(field).is_some());
            }
        }
    }
    numbers > 0 && 2 * numbers >= fields || named > 0 && missing == fields
}

#[cfg(test)]
mod tests {
    use super::{MISSING, Number, number, short_number, split};
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    #[test]
    fn a_short_number_is_the_nearest_float_of_its_text() {
        let mut random = ChaCha8Rng::seed_from_u64(1);
        let mut texts: Vec<String> = ["-0.0", "5.", ".5", "-.5", "0.1", "999999999999999.", ".000000000000001"]
            .into_iter()
            .map(str::to_owned)
            .collect();
        for _ in 0..20_000 {
            let mut text = random.random_range(0..1_000_000_000_000_000_u64).to_string();
            text.truncate(random.random_range(1..=15));
            text.insert(random.random_range(0..=text.len()), '.');
            texts.extend([format!("-{text}"), text]);
        }
        for text in texts {
            let expected = text.parse::<f64>().expect(&text);
            let found = short_number(text.as_bytes()).map(|number| number.value().to_bits());
            assert_eq!(found, Some(expected.to_bits()), "{text}");
        }
        assert_eq!(short_number(b"-123456789012345678"), Some(Number::Integer(-123_456_789_012_345_678)));
        for text in ["", "-", ".", "-.", "1.2.3", "1-2", "--1", "+1", "1e3", "1,5", " 1"] {
            assert_eq!(short_number(text.as_bytes()), None, "{text}");
        }
        for text in ["+1", "1e0", "1,0", "1.0000000000000000"] {
            assert_eq!(number(text).map(Number::value), Some(1.0), "{text}");
        }
        assert!(MISSING.iter().all(|text| number(text).is_some_and(|number| number.value().is_nan())));
    }

    #[test]
    fn fields_end_at_their_separator_unless_it_is_between_quotation_marks() {
        for (text, separator, expected) in [
            ("", Some(','), &[""][..]),
            ("1,,2,", Some(','), &["1", "", "2", ""]),
            (" 1 ;\u{a0}2\u{a0};\"3\"", Some(';'), &["1", "2", "3"]),
            ("\"a,b\" , \"c\"\"d\",\"", Some(','), &["a,b", "c\"\"d", "\""]),
            ("12:00:01.5 -> 1,2", Some(','), &["12:00:01.5", "1", "2"]),
            ("12:00:01.5 -> 1  2 ", None, &["12:00:01.5", "1", "2"]),
            ("\t1 \"2\"", None, &["1", "2"]),
            ("1°,2°", Some(','), &["1°", "2°"]),
        ] {
            assert_eq!(split(text, separator).collect::<Vec<_>>(), expected, "{text}");
        }
    }
}
