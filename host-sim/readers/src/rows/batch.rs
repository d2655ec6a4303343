//! Consecutive rows of a recording, column by column: what every format becomes.

use crate::columns::column_selection::{ChosenColumn, Role};
use crate::columns::unit::{SECOND, Unit};
use crate::input::budget::{Budget, Meter};
use crate::input::input_error::Reason;
use measurement::ChannelProfile;
use time_base::{Order, ROWS_OF_FIRST, ROWS_OF_SET_CLOCK, StampOrder};

/// Largest share of rows whose time stamps may go back; they are left out. More are another recording.
const MAX_BACKWARDS: f64 = 0.1;

/// Sample rates, Hz, that a time column without a unit may have.
const PLAUSIBLE_HZ: std::ops::RangeInclusive<f64> = 0.2..=40_000.0;

/// Larger first time stamps, in the unit of the file, are taken off all of them: a float has too few digits for ns since 1970.
const LARGEST_OWN_TIME: f64 = (1u64 << 40) as f64;

/// A number as a file holds it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Number {
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

/// A channel and how its numbers are read.
#[derive(Debug, Clone, PartialEq)]
pub struct ValueColumn {
    /// The channel; its LSB is not that of the numbers.
    pub profile: ChannelProfile,
    /// Size of 1 in the unit of the profile.
    pub factor: f64,
    /// As the file names it.
    pub label: String,
    /// The register whose words these are.
    pub register: Option<RegisterField>,
}

/// A register of a sensor, of which a table has the words.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RegisterField {
    /// Its place among those of the sensor.
    pub place: usize,
    /// The least and the largest number that it can hold.
    pub limits: (i16, i16),
}

/// Consecutive rows, of which each may have a verdict `V` by who knows the sensor.
#[derive(Debug, Clone, PartialEq)]
pub struct Batch<V = ()> {
    /// Number of rows.
    pub rows: usize,
    /// Time stamps, s once the unit is known; large ones count from the first. Empty where there are none.
    pub times: Vec<f64>,
    /// Running numbers; empty where there are none.
    pub indices: Vec<u64>,
    /// The numbers of each channel in the unit of the file, NaN where there is none.
    pub values: Vec<Vec<f64>>,
    /// One a row; empty where there are none.
    pub verdicts: Vec<V>,
    /// Positions before which a row was left out because its time goes back.
    pub backwards: Vec<usize>,
}

impl<V> Default for Batch<V> {
    fn default() -> Self {
        let (times, indices, values) = (Vec::new(), Vec::new(), Vec::new());
        Self { rows: 0, times, indices, values, verdicts: Vec::new(), backwards: Vec::new() }
    }
}

impl Batch {
    /// The same rows with their verdicts.
    #[must_use]
    pub fn with_verdicts<V>(self, verdicts: Vec<V>) -> Batch<V> {
        let Self { rows, times, indices, values, backwards, verdicts: _ } = self;
        Batch { rows, times, indices, values, verdicts, backwards }
    }
}

impl<V> Batch<V> {
    /// The first rows, which are removed.
    fn split_off_front(&mut self, rows: usize) -> Self {
        fn front<T>(values: &mut Vec<T>, rows: usize) -> Vec<T> {
            // As many are likely to follow.
            let mut rest = Vec::with_capacity(values.capacity());
            rest.extend(values.drain(rows.min(values.len())..));
            std::mem::replace(values, rest)
        }
        let is_front = |at: &&usize| **at < rows;
        let backwards = self.backwards.iter().filter(is_front).copied().collect();
        self.backwards = self.backwards.iter().filter(|at| !is_front(at)).map(|at| at - rows).collect();
        self.rows -= rows;
        Self {
            rows,
            times: front(&mut self.times, rows),
            indices: front(&mut self.indices, rows),
            values: self.values.iter_mut().map(|column| front(column, rows)).collect(),
            verdicts: front(&mut self.verdicts, rows),
            backwards,
        }
    }

    /// Leaves out the rows whose flag is not set, and what was left out before them.
    pub fn retain(&mut self, is_kept: &[bool]) {
        fn retain<T>(values: &mut Vec<T>, is_kept: &[bool]) {
            let mut is_kept = is_kept.iter();
            values.retain(|_| is_kept.next().copied().unwrap_or(true));
        }
        if is_kept.iter().all(|is_kept| *is_kept) {
            return;
        }
        let before = |at: usize| is_kept[..at].iter().filter(|is_kept| **is_kept).count();
        let is_inside = |at: &usize| is_kept.get(*at).or(is_kept.last()).copied().unwrap_or(true);
        self.backwards = self.backwards.iter().filter(|at| is_inside(at)).map(|at| before(*at)).collect();
        retain(&mut self.times, is_kept);
        retain(&mut self.indices, is_kept);
        retain(&mut self.verdicts, is_kept);
        self.values.iter_mut().for_each(|column| retain(column, is_kept));
        self.rows = before(is_kept.len());
    }
}

/// The last row of the batches that were compared.
#[derive(Debug, Default)]
pub struct RowBefore(Option<Vec<f64>>);

impl RowBefore {
    /// Whether each row of the next batch has the numbers of the row before it; the first row of all has none before it.
    pub fn equals<V>(&mut self, batch: &Batch<V>) -> Vec<bool> {
        let Some(last) = batch.rows.checked_sub(1) else { return Vec::new() };
        let first =
            self.0.as_ref().is_some_and(|before| before.iter().zip(&batch.values).all(|(one, of)| *one == of[0]));
        let is_equal = |row: usize| batch.values.iter().all(|column| column[row] == column[row - 1]);
        self.0 = Some(batch.values.iter().map(|column| column[last]).collect());
        std::iter::once(first).chain((1..batch.rows).map(is_equal)).collect()
    }
}

/// Why a row cannot be used: the column at fault, by its position among the chosen ones, and the reason.
#[derive(Debug)]
pub(crate) struct RowFault {
    pub(crate) column: Option<usize>,
    pub(crate) reason: Reason,
}

/// A row whose time goes back.
#[derive(Debug)]
struct BackRow {
    time: f64,
    number: u64,
    index: Option<u64>,
    values: Vec<f64>,
}

/// Rows that a later one may show to be wrong.
pub(crate) const HELD_ROWS: usize = ROWS_OF_FIRST + 1;

/// Numbers at which counters of samples begin anew.
const COUNTERS: [u64; 3] = [1 << 8, 1 << 16, 1 << 32];
/// Part of a counter that may be missing where it begins anew.
const MOST_MISSING: u64 = 8;

/// Purpose of the number of a column.
#[derive(Debug, Clone, Copy)]
enum Use {
    Time,
    Index,
    /// A value; of a register with the least and the largest number of its field.
    Value(Option<(i16, i16)>),
}

/// Makes batches of the rows of a file.
#[derive(Debug)]
pub(crate) struct BatchBuilder {
    /// Use of each chosen column.
    uses: Vec<Use>,
    batch: Batch,
    /// The first time stamp.
    first_time: Option<Number>,
    order: StampOrder,
    /// Rows whose time goes back, each with its time and number, until more of them come or another row.
    back: Vec<BackRow>,
    last_index: Option<u64>,
    index_offset: u64,
    rows: u64,
    /// Budget of the file.
    meter: Option<Meter>,
    backwards: u64,
    /// The first row whose time went back: number of the row, and by how much.
    first_backwards: Option<(u64, f64)>,
    /// True if the first row is not judged yet.
    is_first_open: bool,
    /// The numbers of the row that is added.
    row: Vec<f64>,
}

impl BatchBuilder {
    /// Batch of rows with these columns; those with a register are checked against their field.
    pub(crate) fn new(chosen: &[ChosenColumn], columns: &[ValueColumn], budget: Option<Budget>) -> Self {
        let mut registers = columns.iter().map(|column| column.register.map(|register| register.limits));
        let uses = chosen.iter().map(|column| match column.role {
            Role::Channel(_) => Use::Value(registers.next().flatten()),
            Role::Time => Use::Time,
            Role::Index => Use::Index,
        });
        Self {
            uses: uses.collect(),
            batch: empty(chosen.iter().filter(|column| matches!(column.role, Role::Channel(_))).count()),
            first_time: None,
            order: StampOrder::default(),
            back: Vec::new(),
            last_index: None,
            index_offset: 0,
            rows: 0,
            meter: budget.map(Budget::meter),
            backwards: 0,
            first_backwards: None,
            is_first_open: true,
            row: Vec::new(),
        }
    }

    /// Rows that were added, those that were left out included.
    pub(crate) fn rows(&self) -> u64 {
        self.rows
    }

    /// Rows that wait to be taken.
    pub(crate) fn waiting(&self) -> usize {
        self.batch.rows
    }

    /// The first time stamp, in the unit of the file.
    pub(crate) fn first_time(&self) -> f64 {
        self.first_time.map_or(0.0, Number::value)
    }

    /// Adds a row: one number for each chosen column. A row whose time goes back is left out.
    pub(crate) fn push(&mut self, row: &[Number]) -> Result<(), RowFault> {
        self.rows += 1;
        let fault = |column: usize, reason: Reason| Err(RowFault { column: Some(column), reason });
        if let Some(meter) = &mut self.meter {
            meter.add_values(row.len() as u64).map_err(|reason| RowFault { column: None, reason })?;
        }
        // A row at fault leaves nothing behind.
        let (mut time, mut index) = (None, None);
        let mut values = std::mem::take(&mut self.row);
        values.clear();
        for (position, (of, &number)) in self.uses.iter().zip(row).enumerate() {
            match *of {
                Use::Time => {
                    if !number.value().is_finite() {
                        return fault(position, Reason::NotFinite(number.value().to_string()));
                    }
                    let first = self.first_time.unwrap_or(number);
                    let is_large = first.value().abs() > LARGEST_OWN_TIME;
                    time = Some((first, number.since(if is_large { first } else { Number::Integer(0) })));
                }
                Use::Index => match number {
                    Number::Integer(now) if now >= 0 => {
                        let now = now.unsigned_abs() + self.index_offset;
                        let Some(before) = self.last_index.filter(|before| now <= *before) else {
                            index = Some(now);
                            continue;
                        };
                        let (own, before_own) = (now - self.index_offset, before - self.index_offset);
                        let is_passed =
                            |size: &&u64| before_own < **size && (**size - before_own) + own <= **size / MOST_MISSING;
                        let Some(size) = COUNTERS.iter().find(is_passed) else {
                            return fault(position, Reason::IndexBackwards { before, now });
                        };
                        self.index_offset += size;
                        index = Some(now + size);
                    }
                    Number::Integer(index) => return fault(position, Reason::NotInteger(index.to_string())),
                    Number::Real(index) => return fault(position, Reason::NotInteger(index.to_string())),
                },
                Use::Value(limits) => {
                    if let Some(limits) = limits {
                        check_count(number, limits).map_err(|reason| RowFault { column: Some(position), reason })?;
                    }
                    values.push(number.value());
                }
            }
        }
        self.place(time, index, &values);
        self.row = values;
        Ok(())
    }

    /// Adds a row where its time says it belongs; `time` is the first time stamp and that of the row.
    fn place(&mut self, time: Option<(Number, f64)>, index: Option<u64>, values: &[f64]) {
        let Some((first, stamp)) = time else {
            self.add(None, index, values);
            return;
        };
        self.first_time = Some(first);
        match self.order.judge(stamp) {
            Order::Next(time) => {
                self.leave_out_back();
                self.add(Some(time), index, values);
                self.check_first();
            }
            Order::AfterWrong(time) => {
                self.leave_out_back();
                self.remove(self.batch.rows.saturating_sub(1));
                self.order.forget_last();
                self.add(Some(time), index, values);
            }
            Order::AfterSet(time, by) => {
                self.leave_out_back();
                if let Some(last) = self.batch.times.last_mut() {
                    *last -= by;
                }
                self.add(Some(time), index, values);
                self.check_first();
            }
            Order::Back(time) => {
                if self.back.last().is_some_and(|before| time < before.time) {
                    self.leave_out_back();
                }
                self.back.push(BackRow { time, number: self.rows, index, values: values.to_vec() });
                self.check_clock();
            }
        }
    }

    /// Adds a row to the batch.
    fn add(&mut self, time: Option<f64>, index: Option<u64>, values: &[f64]) {
        if let Some(time) = time {
            self.order.accept(time);
            self.batch.times.push(time);
        }
        if let Some(index) = index {
            self.last_index = Some(index);
            self.batch.indices.push(index);
        }
        for (column, value) in self.batch.values.iter_mut().zip(values) {
            column.push(*value);
        }
        self.batch.rows += 1;
    }

    /// Removes a row of the batch, and counts it.
    fn remove(&mut self, row: usize) {
        let is_kept: Vec<bool> = (0..self.batch.rows).map(|at| at != row).collect();
        self.batch.retain(&is_kept);
        self.batch.backwards.push(row);
        self.batch.backwards.sort_unstable();
    }

    /// Leaves out the rows whose time goes back: the others have gone on without them.
    fn leave_out_back(&mut self) {
        for row in std::mem::take(&mut self.back) {
            self.backwards += 1;
            let by = self.batch.times.last().map_or(0.0, |last| last - row.time);
            self.first_backwards.get_or_insert((row.number, by));
            self.batch.backwards.push(self.batch.rows);
        }
    }

    /// Leaves out the first row where the next ones are far from it.
    fn check_first(&mut self) {
        let is_time = self.is_first_open && self.batch.times.len() == ROWS_OF_FIRST;
        if is_time {
            self.is_first_open = false;
            if self.order.is_first_wrong(&self.batch.times) {
                self.remove(0);
            }
        }
    }

    /// Goes on with a clock that was set back, when enough rows go on by it.
    fn check_clock(&mut self) {
        let is_first_wrong = self.order.has_first_alone() && self.back.len() == ROWS_OF_FIRST;
        if !is_first_wrong && self.back.len() < ROWS_OF_SET_CLOCK {
            return;
        }
        let rows = std::mem::take(&mut self.back);
        let offset = self.order.offset();
        if is_first_wrong {
            self.order.begin_anew();
            self.remove(0);
        } else {
            self.order.set_clock(rows[0].time, rows[0].number);
        }
        for row in rows {
            let time = self.order.shift(row.time, if is_first_wrong { 0.0 } else { offset });
            self.add(Some(time), row.index, &row.values);
        }
    }

    /// The rows that were added since they were taken last, but for those that a later one may show to be wrong.
    pub(crate) fn take(&mut self) -> Batch {
        let held = if self.batch.times.is_empty() { 0 } else { HELD_ROWS };
        self.batch.split_off_front(self.batch.rows.saturating_sub(held))
    }

    /// The last rows.
    pub(crate) fn take_last(&mut self) -> Batch {
        self.leave_out_back();
        let next = empty(self.batch.values.len());
        std::mem::replace(&mut self.batch, next)
    }

    /// Sentences on stamps that go back and are understood.
    pub(crate) fn notes(&self) -> Vec<String> {
        self.order.notes()
    }

    /// A sentence on the rows whose time goes back; `None` without one.
    ///
    /// # Errors
    /// There is no row, or the times of many rows go back.
    pub(crate) fn backwards(&self) -> Result<Option<String>, Reason> {
        if self.rows == self.backwards {
            return Err(Reason::NoData);
        }
        let Some((row, by)) = self.first_backwards else { return Ok(None) };
        if self.backwards as f64 > MAX_BACKWARDS * self.rows as f64 {
            return Err(Reason::ClockSetBack { row, by, rows: self.backwards });
        }
        Ok(Some(format!("{} rows whose time goes back are left out, the first of them row {row}", self.backwards)))
    }
}

/// Checks a register count against its field; a missing one is NaN.
fn check_count(number: Number, (low, high): (i16, i16)) -> Result<(), Reason> {
    let value = match number {
        Number::Integer(value) => value,
        Number::Real(value) if value.is_nan() => return Ok(()),
        // A float beyond the range of i64 saturates.
        Number::Real(value) if value.fract() == 0.0 => value as i64,
        Number::Real(value) => return Err(Reason::NotInteger(value.to_string())),
    };
    let is_in_field = (i64::from(low)..=i64::from(high)).contains(&value);
    if is_in_field { Ok(()) } else { Err(Reason::OutOfField { value, low, high }) }
}

fn empty(columns: usize) -> Batch {
    Batch { values: vec![Vec::new(); columns], ..Batch::default() }
}

/// The unit of times that do not say it, of which the first is `origin`: of a clock that counts from 1970 (2001 to 2096) the one that gives
/// this date, else seconds if they give a plausible sample rate. `None` where neither is so.
pub(crate) fn usual_unit(times: &[f64], origin: f64) -> Option<Unit> {
    let units = || ["s", "ms", "us", "ns"].into_iter().filter_map(Unit::parse);
    let by_date = units().find(|unit| (1e9..4e9).contains(&(origin * unit.factor)));
    let rows = times.len().saturating_sub(1).max(1) as f64;
    let span = times.first().zip(times.last()).map_or(0.0, |(first, last)| last - first);
    let interval = span / rows;
    let seconds = units().next().filter(|_| PLAUSIBLE_HZ.contains(&interval.recip()));
    debug_assert!(seconds.is_none_or(|unit| unit.base == SECOND));
    by_date.or(seconds)
}
