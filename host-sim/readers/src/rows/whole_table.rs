//! Whole columns of a source.

use crate::columns::{AvailableColumn, ChosenColumn, ReadingNote, Unit};
use crate::input::InputError;
use crate::rows::{BatchBuilder, Refusal, RowSource};
use std::path::Path;

/// 128 MiB.
const MOST_VALUES: u64 = 1 << 24;

/// 2 GiB in memory; longer ones go in parts.
pub const MAX_SAMPLES: u64 = 1 << 25;

fn most_rows(columns: usize) -> u64 {
    MOST_VALUES / (columns.max(1) as u64)
}

#[derive(Debug, Clone, PartialEq)]
pub(crate) struct WholeColumn {
    pub(crate) column: AvailableColumn,
    /// File's unit; NaN if missing.
    pub(crate) values: Vec<f64>,
}

#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct TopicSensor {
    /// Empty for the only one.
    pub(crate) name: String,
    /// Channel, `time` or `sample`; position; unit if the column lacks it.
    pub(crate) columns: Vec<(&'static str, usize, Option<Unit>)>,
    /// Reason of unstated units.
    pub(crate) note: Option<String>,
}

impl TopicSensor {
    pub(crate) fn has(&self, channel: &str) -> bool {
        self.columns.iter().any(|(name, ..)| *name == channel)
    }

    pub(crate) fn add_axes(&mut self, channels: [&'static str; 3], positions: [usize; 3], unit: &str) {
        let unit = Unit::parse(unit);
        self.columns.extend(channels.into_iter().zip(positions).map(|(channel, at)| (channel, at, unit)));
    }
}

#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct WholeTable {
    /// May be empty.
    pub(crate) name: String,
    /// May be empty.
    pub(crate) kind: String,
    pub(crate) columns: Vec<WholeColumn>,
    pub(crate) sensors: Vec<TopicSensor>,
    /// Arrays of perhaps several groups.
    pub(crate) is_of_arrays: bool,
    /// Stated, Hz.
    pub(crate) rate_hz: Option<f64>,
    pub(crate) is_cut: bool,
    /// The source ended early; a note says why.
    pub(crate) is_damaged: bool,
    pub(crate) notes: Vec<ReadingNote>,
}

impl WholeTable {
    /// Columns as they are; an error if no row can be read.
    pub(crate) fn read(mut self, file: &Path, source: &mut dyn RowSource) -> Result<Self, InputError> {
        let chosen = source.chosen().to_vec();
        let most = most_rows(chosen.len());
        let mut builder = BatchBuilder::new(&chosen, &[], source.budget());
        let mut is_cut = false;
        let read = source.read(&mut |row| {
            is_cut = builder.rows() >= most;
            if is_cut { Err(Refusal::Enough) } else { builder.push(row).map_err(Refusal::Fault) }
        });
        let damage = match read {
            Ok(mut ending) => {
                self.notes.append(&mut ending.notes);
                ending.told(file, builder.rows(), "shown")?
            }
            Err(error) if builder.rows() == 0 || error.reason.is_limit() => return Err(error),
            Err(error) => Some(format!("{error}; the {} rows before that are shown", builder.rows())),
        };
        self.is_damaged = damage.is_some();
        self.notes.extend(damage.map(ReadingNote::from));
        let column = |(chosen, values): (ChosenColumn, Vec<f64>)| WholeColumn {
            column: AvailableColumn { name: chosen.label, unit: chosen.unit },
            values,
        };
        let columns = chosen.into_iter().zip(builder.take_last().values).map(column).collect();
        Ok(Self { columns, is_cut, rate_hz: source.rate_hz(), ..self })
    }

    pub(crate) fn rows(&self) -> usize {
        self.columns.first().map_or(0, |column| column.values.len())
    }
}
