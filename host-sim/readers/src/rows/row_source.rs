//! Rows of any format as batches.

use crate::columns::{ChosenColumn, ReadingNote, Role};
use crate::input::{Budget, InputError, ReadMonitor, Reason, StreamError};
use crate::rows::{Batch, BatchBuilder, HELD_ROWS, Number, RegisterField, RowFault, ValueColumn, usual_unit};
use std::path::Path;
use time_base::TimeBaseError;
use time_base::TimeRange;

/// Rows of a batch.
pub const BATCH: usize = 1 << 14;
/// For unstated units.
const ROWS_OF_UNIT: usize = 1 << 16;

pub(crate) type EachRow<'a> = dyn FnMut(&[Number]) -> Result<(), Refusal> + 'a;

#[derive(Debug)]
pub(crate) enum Refusal {
    Fault(RowFault),
    Enough,
}

#[derive(Debug, Default)]
pub(crate) struct Ending {
    pub(crate) damage: Option<Reason>,
    pub(crate) notes: Vec<ReadingNote>,
}

impl Ending {
    /// A sentence on the damage behind `rows`, which are `used`; an error without any, and for a limit.
    pub(crate) fn told(&mut self, file: &Path, rows: u64, used: &str) -> Result<Option<String>, InputError> {
        match self.damage.take() {
            Some(reason) if rows == 0 || reason.is_limit() => Err(InputError::file(file, reason)),
            damage => Ok(damage.map(|reason| format!("{reason}; the {rows} rows before that are {used}"))),
        }
    }
}

pub(crate) trait RowSource: Send {
    fn chosen(&self) -> &[ChosenColumn];

    /// Stated, Hz.
    fn rate_hz(&self) -> Option<f64>;

    /// If rows can exceed bytes.
    fn budget(&self) -> Option<Budget> {
        None
    }

    /// All rows until a refusal, once.
    ///
    /// # Errors
    /// The file is damaged, or a row is at fault.
    fn read(&mut self, each: &mut EachRow) -> Result<Ending, InputError>;
}

/// The rows of a recording that are wanted.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WantedRows {
    pub part: Option<TimeRange>,
    /// User's rate, Hz, without times.
    pub stated_hz: Option<f64>,
    pub most_rows: u64,
    pub batch_rows: usize,
}

impl WantedRows {
    pub fn all(stated_hz: Option<f64>) -> Self {
        Self { part: None, stated_hz, most_rows: u64::MAX, batch_rows: BATCH }
    }
}

/// Result, without batches.
#[derive(Debug, Default, Clone, PartialEq)]
pub struct RowsRead {
    pub rows: u64,
    pub outside: u64,
    pub padding: u64,
    pub is_stopped: bool,
    pub damage: Option<String>,
    pub notes: Vec<ReadingNote>,
}

impl RowsRead {
    /// To the end of file or part.
    #[must_use]
    pub fn is_complete(&self) -> bool {
        self.damage.is_none() && !self.is_stopped
    }
}

pub struct PartFilter {
    part: Option<TimeRange>,
    period_s: Option<f64>,
    first_index: Option<u64>,
    first_s: Option<f64>,
    rows: u64,
    kept: u64,
    last_s: f64,
}

impl PartFilter {
    /// The file states this rate, Hz.
    #[must_use]
    pub fn new(wanted: WantedRows, file_hz: Option<f64>) -> Self {
        let period_s = wanted.stated_hz.or(file_hz).map(f64::recip);
        Self { part: wanted.part, period_s, first_index: None, first_s: None, rows: 0, kept: 0, last_s: 0.0 }
    }

    /// False if no later row is inside.
    ///
    /// # Errors
    /// Neither times nor a rate place the rows.
    pub fn apply<V>(&mut self, batch: &mut Batch<V>) -> Result<bool, TimeBaseError> {
        let Some(TimeRange { from_s, to_s }) = self.part else { return Ok(true) };
        let period_s = || match self.period_s {
            Some(period_s) if period_s.is_finite() && period_s > 0.0 => Ok(period_s),
            Some(period_s) => Err(TimeBaseError::InvalidRate(period_s.recip())),
            None => Err(TimeBaseError::NoRate),
        };
        let elapsed_s: Vec<f64> = if let Some(&first) = batch.times.first() {
            let first_s = *self.first_s.get_or_insert(first);
            batch.times.iter().map(|time| time - first_s).collect()
        } else if let Some(&first) = batch.indices.first() {
            let first = *self.first_index.get_or_insert(first);
            let period_s = period_s()?;
            batch.indices.iter().map(|index| (index - first) as f64 * period_s).collect()
        } else if batch.rows == 0 {
            Vec::new()
        } else {
            let period_s = period_s()?;
            (0..batch.rows as u64).map(|row| (self.rows + row) as f64 * period_s).collect()
        };
        self.rows += batch.rows as u64;
        self.last_s = elapsed_s.last().copied().unwrap_or(self.last_s);
        let is_inside: Vec<bool> = elapsed_s.iter().map(|time| (from_s..to_s).contains(time)).collect();
        batch.retain(&is_inside);
        self.kept += batch.rows as u64;
        Ok(self.last_s < to_s)
    }

    /// # Errors
    /// The part has no rows.
    pub fn finish(&self) -> Result<(), TimeBaseError> {
        match self.part {
            Some(TimeRange { from_s, to_s }) if self.kept == 0 => {
                Err(TimeBaseError::EmptyTimeRange { from_s, to_s, recording_s: self.last_s })
            }
            _ => Ok(()),
        }
    }
}

pub struct FileRows<'a> {
    file: &'a Path,
    source: Box<dyn RowSource + 'a>,
    columns: Vec<ValueColumn>,
    monitor: ReadMonitor,
}

struct Delivery<'a> {
    builder: BatchBuilder,
    /// Until the unit is known.
    waiting: Vec<Batch>,
    waiting_rows: usize,
    time_unit_s: Option<f64>,
    filter: PartFilter,
    give: &'a mut dyn FnMut(Batch) -> bool,
    error: Option<StreamError>,
    notes: Vec<String>,
    time_label: String,
    is_over: bool,
}

impl<'a> FileRows<'a> {
    /// Channels may be register words.
    pub(crate) fn new(
        file: &'a Path,
        source: Box<dyn RowSource + 'a>,
        monitor: &ReadMonitor,
        register: &dyn Fn(&str) -> Option<RegisterField>,
    ) -> Self {
        let column = |column: &ChosenColumn| match column.role {
            Role::Channel(channel) => Some(ValueColumn {
                channel,
                factor: column.factor,
                label: column.label.clone(),
                register: register(channel.name),
            }),
            Role::Time | Role::Index => None,
        };
        let columns = source.chosen().iter().filter_map(column).collect();
        Self { file, source, columns, monitor: monitor.clone() }
    }

    #[must_use]
    pub fn columns(&self) -> &[ValueColumn] {
        &self.columns
    }

    #[must_use]
    pub fn monitor(&self) -> &ReadMonitor {
        &self.monitor
    }

    /// Hz, without time stamps.
    #[must_use]
    pub fn rate_hz(&self) -> Option<f64> {
        let has_times = self.source.chosen().iter().any(|column| column.role == Role::Time);
        self.source.rate_hz().filter(|_| !has_times)
    }

    /// Until `give` returns false.
    ///
    /// # Errors
    /// The file is damaged, or the part has no row.
    pub fn read(&mut self, wanted: WantedRows, give: &mut dyn FnMut(Batch) -> bool) -> Result<RowsRead, StreamError> {
        let file = self.file;
        let chosen = self.source.chosen();
        let time = chosen.iter().find(|column| column.role == Role::Time);
        let file_hz = self.source.rate_hz().filter(|_| time.is_none());
        let mut delivery = Delivery {
            builder: BatchBuilder::new(chosen, &self.columns, self.source.budget()),
            waiting: Vec::new(),
            waiting_rows: 0,
            time_unit_s: time.map_or(Some(1.0), |time| time.unit.map(|unit| unit.factor)),
            filter: PartFilter::new(wanted, file_hz),
            give,
            error: None,
            notes: Vec::new(),
            time_label: time.map(|time| time.label.clone()).unwrap_or_default(),
            is_over: false,
        };
        let mut is_stopped = false;
        let monitor = &self.monitor;
        monitor.begin();
        let ending = self.source.read(&mut |row| {
            is_stopped |= monitor.take_stop();
            if is_stopped || delivery.is_over || delivery.builder.rows() >= wanted.most_rows {
                return Err(Refusal::Enough);
            }
            delivery.builder.push(row).map_err(Refusal::Fault)?;
            if delivery.builder.waiting() >= wanted.batch_rows.saturating_add(HELD_ROWS) {
                delivery.deliver(file);
            }
            Ok(())
        });
        monitor.end();
        // The consumer's refusal comes first.
        if let Some(error) = delivery.error.take() {
            return Err(error);
        }
        let mut ending = ending?;
        let damage = ending.told(file, delivery.builder.rows(), "used")?;
        is_stopped |= monitor.is_cut();
        delivery.finish(file)?;
        let backwards = delivery.builder.backwards().map_err(|reason| InputError::file(file, reason))?;
        let rows = delivery.builder.rows();
        let notes_of_rows =
            backwards.into_iter().chain(delivery.builder.notes()).chain(delivery.notes).map(ReadingNote::from);
        let notes = notes_of_rows.chain(ending.notes).collect();
        let outside = delivery.filter.rows.saturating_sub(delivery.filter.kept);
        Ok(RowsRead { rows, outside, padding: 0, is_stopped, damage, notes })
    }
}

impl Delivery<'_> {
    /// Once the unit is known.
    fn deliver(&mut self, file: &Path) {
        let batch = self.builder.take();
        self.waiting_rows += batch.rows;
        self.waiting.push(batch);
        if self.time_unit_s.is_none() && self.waiting_rows < ROWS_OF_UNIT {
            return;
        }
        if let Err(error) = self.give_waiting(file) {
            self.error = Some(error);
            self.is_over = true;
        }
    }

    fn finish(&mut self, file: &Path) -> Result<(), StreamError> {
        let batch = self.builder.take_last();
        self.waiting.push(batch);
        if self.builder.rows() > 0 {
            self.give_waiting(file)?;
            self.filter.finish()?;
        }
        Ok(())
    }

    fn give_waiting(&mut self, file: &Path) -> Result<(), StreamError> {
        let time_unit_s = match self.time_unit_s {
            Some(time_unit_s) => time_unit_s,
            None => {
                let times: Vec<f64> =
                    self.waiting.iter().flat_map(|batch| &batch.times).copied().take(ROWS_OF_UNIT).collect();
                let unit = usual_unit(&times, self.builder.first_time());
                let unit = unit.ok_or_else(|| InputError::file(file, Reason::NoTimeUnit(self.time_label.clone())))?;
                self.notes.push(format!("the column {} is taken to be in {}", self.time_label, unit.name));
                self.time_unit_s = Some(unit.factor);
                unit.factor
            }
        };
        for mut batch in std::mem::take(&mut self.waiting) {
            if self.is_over {
                break;
            }
            batch.times.iter_mut().for_each(|time| *time *= time_unit_s);
            let may_go_on = self.filter.apply(&mut batch)?;
            let is_wanted = (self.give)(batch);
            self.is_over = !is_wanted || !may_go_on;
        }
        Ok(())
    }
}
