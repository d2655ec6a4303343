//! Batches of rows, column by column.

use crate::columns::{ACCELEROMETER, ChosenColumn, GYROSCOPE, MAGNETOMETER, Role, SECOND, SensorChannel, Unit};
use crate::input::{Budget, Meter, Reason};
use std::ops::Range;
use time_base::{Order, ROWS_OF_FIRST, ROWS_OF_SET_CLOCK, StampOrder};

/// Largest share of rows whose time goes back.
const MAX_BACKWARDS: f64 = 0.1;

/// For times without a unit.
const PLAUSIBLE_HZ: std::ops::RangeInclusive<f64> = 0.2..=40_000.0;

/// Larger ones are subtracted: too few digits for ns since 1970.
const LARGEST_OWN_TIME: f64 = (1u64 << 40) as f64;

/// A number as a file holds it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Number {
    /// For ns since 1970.
    Integer(i64),
    Real(f64),
}

impl Number {
    pub(crate) fn value(self) -> f64 {
        match self {
            Self::Integer(integer) => integer as f64,
            Self::Real(real) => real,
        }
    }

    fn since(self, origin: Self) -> f64 {
        match (self, origin) {
            (Self::Integer(now), Self::Integer(origin)) => (i128::from(now) - i128::from(origin)) as f64,
            _ => self.value() - origin.value(),
        }
    }
}

/// A channel `C`, and its numbers.
#[derive(Debug, Clone, PartialEq)]
pub struct ValueColumn<C = SensorChannel> {
    /// Its LSB is not that of the numbers.
    pub channel: C,
    /// For 1, in the channel's unit.
    pub factor: f64,
    pub label: String,
    pub register: Option<RegisterField>,
}

/// A register of a sensor, of which a table has the words.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RegisterField {
    /// Among the sensor's.
    pub place: usize,
    pub limits: (i16, i16),
}

/// Rows, with a verdict `V` each by the sensor's reader.
#[derive(Debug, Clone, PartialEq)]
pub struct Batch<V = ()> {
    pub rows: usize,
    /// s once the unit is known, large ones from the first; may be empty.
    pub times: Vec<f64>,
    /// May be empty.
    pub indices: Vec<u64>,
    /// In the file's unit; NaN if missing.
    pub values: Vec<Vec<f64>>,
    /// May be empty.
    pub verdicts: Vec<V>,
    /// Positions behind rows with earlier times.
    pub backwards: Vec<usize>,
}

impl<V> Default for Batch<V> {
    fn default() -> Self {
        let (times, indices, values) = (Vec::new(), Vec::new(), Vec::new());
        Self { rows: 0, times, indices, values, verdicts: Vec::new(), backwards: Vec::new() }
    }
}

impl Batch {
    #[must_use]
    pub fn with_verdicts<V>(self, verdicts: Vec<V>) -> Batch<V> {
        let Self { rows, times, indices, values, backwards, verdicts: _ } = self;
        Batch { rows, times, indices, values, verdicts, backwards }
    }
}

impl<V> Batch<V> {
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

    /// With what was left out before them.
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
    /// True for each row that equals the one before.
    pub fn equals<V>(&mut self, batch: &Batch<V>) -> Vec<bool> {
        let Some(last) = batch.rows.checked_sub(1) else { return Vec::new() };
        let first =
            self.0.as_ref().is_some_and(|before| before.iter().zip(&batch.values).all(|(one, of)| *one == of[0]));
        let is_equal = |row: usize| batch.values.iter().all(|column| column[row] == column[row - 1]);
        self.0 = Some(batch.values.iter().map(|column| column[last]).collect());
        std::iter::once(first).chain((1..batch.rows).map(is_equal)).collect()
    }
}

/// Column (position) and reason.
#[derive(Debug)]
pub(crate) struct RowFault {
    pub(crate) column: Option<usize>,
    pub(crate) reason: Reason,
}

#[derive(Debug)]
struct BackRow {
    time: f64,
    number: u64,
    index: Option<u64>,
    values: Vec<f64>,
}

/// Rows kept back for a later verdict.
pub(crate) const HELD_ROWS: usize = ROWS_OF_FIRST + 1;

const COUNTERS: [u64; 3] = [1 << 8, 1 << 16, 1 << 32];
const MOST_MISSING: u64 = 8;

#[derive(Debug, Clone, Copy)]
enum Use {
    Time,
    Index,
    Value(Option<(i16, i16)>),
}

#[derive(Debug)]
pub(crate) struct BatchBuilder {
    uses: Vec<Use>,
    batch: Batch,
    first_time: Option<Number>,
    order: StampOrder,
    back: Vec<BackRow>,
    last_index: Option<u64>,
    index_offset: u64,
    rows: u64,
    meter: Option<Meter>,
    backwards: u64,
    first_backwards: Option<(u64, f64)>,
    is_first_open: bool,
    row: Vec<f64>,
    /// Positions of values of three axes.
    axes: Vec<[usize; 3]>,
    /// Rows in which nines stand for the values of three axes, and the first.
    nines: u64,
    first_nines: f64,
}

impl BatchBuilder {
    /// Checks registers against their fields.
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
            axes: [GYROSCOPE, ACCELEROMETER, MAGNETOMETER].iter().filter_map(|names| axes(columns, names)).collect(),
            nines: 0,
            first_nines: f64::NAN,
        }
    }

    pub(crate) fn rows(&self) -> u64 {
        self.rows
    }

    pub(crate) fn waiting(&self) -> usize {
        self.batch.rows
    }

    pub(crate) fn first_time(&self) -> f64 {
        self.first_time.map_or(0.0, Number::value)
    }

    /// One number per column; earlier times are left out.
    pub(crate) fn push(&mut self, row: &[Number]) -> Result<(), RowFault> {
        self.rows += 1;
        let fault = |column: usize, reason: Reason| Err(RowFault { column: Some(column), reason });
        if let Some(meter) = &mut self.meter {
            meter.add_values(row.len() as u64).map_err(|reason| RowFault { column: None, reason })?;
        }
        // All or nothing.
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
                            return fault(position, Reason::other(format!("sample {now} does not follow {before}")));
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
        for [x, y, z] in &self.axes {
            if values[*x] == values[*y] && values[*y] == values[*z] && is_of_nines(values[*x]) {
                if self.nines == 0 {
                    self.first_nines = values[*x];
                }
                self.nines += 1;
                [x, y, z].into_iter().for_each(|axis| values[*axis] = f64::NAN);
            }
        }
        self.place(time, index, &values);
        self.row = values;
        Ok(())
    }

    /// By its time; `time` is the first stamp and its own.
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
            Order::AfterWrong(time, wrong) => {
                self.leave_out_back();
                self.remove(self.batch.rows.saturating_sub(wrong)..self.batch.rows);
                (0..wrong).for_each(|_| self.order.forget_last());
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

    fn remove(&mut self, rows: Range<usize>) {
        let is_kept: Vec<bool> = (0..self.batch.rows).map(|at| !rows.contains(&at)).collect();
        self.batch.retain(&is_kept);
        self.batch.backwards.extend(rows.clone().map(|_| rows.start));
        self.batch.backwards.sort_unstable();
    }

    fn leave_out_back(&mut self) {
        for row in std::mem::take(&mut self.back) {
            self.backwards += 1;
            let by = self.batch.times.last().map_or(0.0, |last| last - row.time);
            self.first_backwards.get_or_insert((row.number, by));
            self.batch.backwards.push(self.batch.rows);
        }
    }

    fn check_first(&mut self) {
        let is_time = self.is_first_open && self.batch.times.len() == ROWS_OF_FIRST;
        if is_time {
            self.is_first_open = false;
            if self.order.is_first_wrong(&self.batch.times) {
                self.remove(0..1);
            }
        }
    }

    /// A clock set back that goes on.
    fn check_clock(&mut self) {
        let is_first_wrong = self.order.has_first_alone() && self.back.len() == ROWS_OF_FIRST;
        if !is_first_wrong && self.back.len() < ROWS_OF_SET_CLOCK {
            return;
        }
        let rows = std::mem::take(&mut self.back);
        let offset = self.order.offset();
        if is_first_wrong {
            self.order.begin_anew();
            self.remove(0..1);
        } else {
            self.order.set_clock(rows[0].time, rows[0].number);
        }
        for row in rows {
            let time = self.order.shift(row.time, if is_first_wrong { 0.0 } else { offset });
            self.add(Some(time), row.index, &row.values);
        }
    }

    pub(crate) fn take(&mut self) -> Batch {
        let held = if self.batch.times.is_empty() { 0 } else { HELD_ROWS };
        self.batch.split_off_front(self.batch.rows.saturating_sub(held))
    }

    pub(crate) fn take_last(&mut self) -> Batch {
        self.leave_out_back();
        let next = empty(self.batch.values.len());
        std::mem::replace(&mut self.batch, next)
    }

    pub(crate) fn notes(&self) -> Vec<String> {
        let Self { nines, first_nines, .. } = self;
        let of_nines =
            || format!("{nines} times {first_nines} stands in all axes of a sensor, for values that are missing");
        self.order.notes().into_iter().chain((*nines > 0).then(of_nines)).collect()
    }

    /// On rows with earlier times, `None` without any; an error if they are many, or without a row.
    pub(crate) fn backwards(&self) -> Result<Option<String>, Reason> {
        if self.rows == self.backwards {
            return Err(Reason::NoData);
        }
        let Some((row, by)) = self.first_backwards else { return Ok(None) };
        if self.backwards as f64 > MAX_BACKWARDS * self.rows as f64 {
            let rows = self.backwards;
            return Err(Reason::other(format!(
                "the time goes back before row {row} by {by} of its units, and {rows} rows are earlier than one before them"
            )));
        }
        Ok(Some(format!("{} rows whose time goes back are left out, the first of them row {row}", self.backwards)))
    }
}

/// Positions of these channels, unless they are register words.
fn axes(columns: &[ValueColumn], names: &[&str; 3]) -> Option<[usize; 3]> {
    let position = |name: &str| columns.iter().position(|of| of.channel.name == name && of.register.is_none());
    Some([position(names[0])?, position(names[1])?, position(names[2])?])
}

/// Such as -9999 or 999.9, which stands for no value where it is that of all axes.
fn is_of_nines(value: f64) -> bool {
    let digits: String = value.abs().to_string().chars().filter(|letter| *letter != '.').collect();
    digits.len() > 2 && digits.bytes().all(|digit| digit == b'9')
}

/// NaN if missing.
fn check_count(number: Number, (low, high): (i16, i16)) -> Result<(), Reason> {
    let value = match number {
        Number::Integer(value) => value,
        Number::Real(value) if value.is_nan() => return Ok(()),
        // Saturates.
        Number::Real(value) if value.fract() == 0.0 => value as i64,
        Number::Real(value) => return Err(Reason::NotInteger(value.to_string())),
    };
    let is_in_field = (i64::from(low)..=i64::from(high)).contains(&value);
    if is_in_field { Ok(()) } else { Err(Reason::other(format!("{value} is outside {low}..={high}"))) }
}

fn empty(columns: usize) -> Batch {
    Batch { values: vec![Vec::new(); columns], ..Batch::default() }
}

/// Unit of times from `origin` on: a date of 2001 to 2096, else seconds at a plausible rate; `None` otherwise.
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
