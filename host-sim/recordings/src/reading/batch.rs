//! Consecutive rows of a recording, column by column: what every format becomes.

use crate::columns::column_selection::{ChosenColumn, Role};
use crate::columns::unit::{SECOND, Unit};
use crate::input::budget::{Budget, Meter};
use crate::input::input_error::Reason;
use adis16405_driver::{Channel, ChannelMask, Faults};
use measurement::ChannelProfile;

/// Largest share of rows whose time stamps may go back; they are left out. More are another recording.
const MAX_BACKWARDS: f64 = 0.1;

/// Sample rates, Hz, that a time column without a unit may have.
const PLAUSIBLE_HZ: std::ops::RangeInclusive<f64> = 0.2..=40_000.0;

/// Larger first time stamps, in the unit of the file, are taken off all of them: a float has too few digits for ns since 1970.
const LARGEST_OWN_TIME: f64 = (1u64 << 40) as f64;

/// A number as a file holds it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Number {
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
pub(crate) struct ValueColumn {
    /// The channel; its LSB is not that of the numbers.
    pub(crate) profile: ChannelProfile,
    /// Size of 1 in the unit of the profile.
    pub(crate) factor: f64,
    /// As the file names it.
    pub(crate) label: String,
    /// The channel of an ADIS16405 whose register counts these are.
    pub(crate) register: Option<Channel>,
}

/// What the burst validator says of a row of register counts.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Verdict {
    /// Why no channel of the row is used; `None` if one is.
    pub(crate) loss: Option<&'static str>,
    /// Faults that the row and the rows before it show.
    pub(crate) faults: Faults,
    /// Channels whose words are not to be used.
    pub(crate) refused: ChannelMask,
}

/// Consecutive rows.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Batch {
    /// Number of rows.
    pub(crate) rows: usize,
    /// Time stamps, s once the unit is known; large ones count from the first. Empty where there are none.
    pub(crate) times: Vec<f64>,
    /// Running numbers; empty where there are none.
    pub(crate) indices: Vec<u64>,
    /// The numbers of each channel in the unit of the file, NaN where there is none.
    pub(crate) values: Vec<Vec<f64>>,
    /// Of register counts one a row; empty for other numbers.
    pub(crate) verdicts: Vec<Verdict>,
    /// Positions before which a row was left out because its time goes back.
    pub(crate) backwards: Vec<usize>,
}

impl Batch {
    /// Leaves out the rows whose flag is not set, and what was left out before them.
    pub(crate) fn retain(&mut self, is_kept: &[bool]) {
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

/// Why a row cannot be used: the column at fault, by its position among the chosen ones, and the reason.
#[derive(Debug)]
pub(crate) struct RowFault {
    pub(crate) column: Option<usize>,
    pub(crate) reason: Reason,
}

/// Makes batches of the rows of a file.
#[derive(Debug)]
pub(crate) struct BatchBuilder {
    chosen: Vec<ChosenColumn>,
    /// Of each chosen column, the least and the largest number of its register field.
    limits: Vec<Option<(i16, i16)>>,
    batch: Batch,
    /// The first time stamp.
    first_time: Option<Number>,
    last_time: Option<f64>,
    last_index: Option<u64>,
    rows: u64,
    /// What the file may cost.
    meter: Option<Meter>,
    backwards: u64,
    /// The first row whose time went back: number of the row, and by how much.
    first_backwards: Option<(u64, f64)>,
}

impl BatchBuilder {
    /// Of rows with these columns; those with a register are checked against their field.
    pub(crate) fn new(chosen: &[ChosenColumn], columns: &[ValueColumn], budget: Option<Budget>) -> Self {
        let mut registers = columns.iter().map(|column| column.register.map(Channel::limits));
        let limits = chosen.iter().map(|column| match column.role {
            Role::Channel(_) => registers.next().flatten(),
            Role::Time | Role::Index => None,
        });
        Self {
            limits: limits.collect(),
            batch: empty(chosen.iter().filter(|column| matches!(column.role, Role::Channel(_))).count()),
            chosen: chosen.to_vec(),
            first_time: None,
            last_time: None,
            last_index: None,
            rows: 0,
            meter: budget.map(Budget::meter),
            backwards: 0,
            first_backwards: None,
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
        for (position, (column, &number)) in self.chosen.iter().zip(row).enumerate() {
            match column.role {
                Role::Time => {
                    if !number.value().is_finite() {
                        return fault(position, Reason::NotFinite(number.value().to_string()));
                    }
                    let first = self.first_time.unwrap_or(number);
                    let is_large = first.value().abs() > LARGEST_OWN_TIME;
                    time = Some((first, number.since(if is_large { first } else { Number::Integer(0) })));
                }
                Role::Index => match number {
                    Number::Integer(now) if now >= 0 => {
                        let now = now.unsigned_abs();
                        if let Some(before) = self.last_index.filter(|before| now <= *before) {
                            return fault(position, Reason::IndexBackwards { before, now });
                        }
                        index = Some(now);
                    }
                    Number::Integer(index) => return fault(position, Reason::NotInteger(index.to_string())),
                    Number::Real(index) => return fault(position, Reason::NotInteger(index.to_string())),
                },
                Role::Channel(_) => {
                    if let Some(limits) = self.limits[position] {
                        check_count(number, limits).map_err(|reason| RowFault { column: Some(position), reason })?;
                    }
                }
            }
        }
        if let Some((first, time)) = time {
            self.first_time = Some(first);
            if let Some(last) = self.last_time.filter(|last| time < *last) {
                self.backwards += 1;
                self.first_backwards.get_or_insert((self.rows, last - time));
                self.batch.backwards.push(self.batch.rows);
                return Ok(());
            }
            self.last_time = Some(time);
            self.batch.times.push(time);
        }
        if let Some(index) = index {
            self.last_index = Some(index);
            self.batch.indices.push(index);
        }
        let channels = self.chosen.iter().zip(row).filter(|(column, _)| matches!(column.role, Role::Channel(_)));
        for ((_, number), values) in channels.zip(&mut self.batch.values) {
            values.push(number.value());
        }
        self.batch.rows += 1;
        Ok(())
    }

    /// The rows that were added since they were taken last.
    pub(crate) fn take(&mut self) -> Batch {
        let next = empty(self.batch.values.len());
        std::mem::replace(&mut self.batch, next)
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
