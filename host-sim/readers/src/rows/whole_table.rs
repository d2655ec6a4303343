//! All columns of a source of rows as they are, to be looked at.

use crate::columns::column_selection::{AvailableColumn, ChosenColumn};
use crate::columns::unit::Unit;
use crate::input::input_error::InputError;
use crate::rows::batch::BatchBuilder;
use crate::rows::row_source::{Ending, Refusal, RowSource};

/// Numbers that are held at most, 128 MiB.
const MOST_VALUES: u64 = 1 << 24;

/// Most rows of a recording that is read from a file: they take 2 GiB. A longer one is given in parts.
pub const MAX_SAMPLES: u64 = 1 << 25;

/// Rows of so many columns that are looked at: a recording of a day of a usual sensor.
fn most_rows(columns: usize) -> u64 {
    MOST_VALUES / (columns.max(1) as u64)
}

/// A column and its numbers.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct WholeColumn {
    pub(crate) column: AvailableColumn,
    /// One a row, in the unit of the file; NaN where there is none.
    pub(crate) values: Vec<f64>,
}

/// A sensor that the format or the names of the columns tell.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct WholeSensor {
    /// For `--topic`; empty where the file has one sensor.
    pub(crate) name: String,
    /// Channel, `time` or `sample`; position of the column; and the unit that the format says.
    pub(crate) columns: Vec<(&'static str, usize, Option<Unit>)>,
}

/// The rows of a source.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct WholeTable {
    /// For `--topic`; empty where there is one source.
    pub(crate) name: String,
    /// Its type in the file; empty where there is none.
    pub(crate) kind: String,
    /// The columns, in their order.
    pub(crate) columns: Vec<WholeColumn>,
    /// Sensors that the format knows.
    pub(crate) sensors: Vec<WholeSensor>,
    /// True if its columns are arrays, which may lie in several groups.
    pub(crate) is_of_arrays: bool,
    /// The rate that the file states beside its rows, Hz.
    pub(crate) rate_hz: Option<f64>,
    /// True if there are more rows than are held.
    pub(crate) is_cut: bool,
    /// Notes for the user, one sentence each.
    pub(crate) notes: Vec<String>,
}

impl WholeTable {
    /// With the rows of `source`, whose columns were chosen as they are.
    ///
    /// # Errors
    /// It has no row that can be read.
    pub(crate) fn read(mut self, source: &mut dyn RowSource) -> Result<Self, InputError> {
        let chosen = source.chosen().to_vec();
        let most = most_rows(chosen.len());
        let mut builder = BatchBuilder::new(&chosen, &[], source.budget());
        let mut is_cut = false;
        let read = source.read(&mut |row| {
            is_cut = builder.rows() >= most;
            if is_cut { Err(Refusal::Enough) } else { builder.push(row).map_err(Refusal::Fault) }
        });
        let damage = match read {
            Ok(Ending { damage, notes }) => {
                self.notes.extend(notes);
                damage
            }
            Err(error) if builder.rows() == 0 || error.reason.is_limit() => return Err(error),
            Err(error) => Some(error.to_string()),
        };
        self.notes.extend(damage.map(|damage| format!("{damage}; the {} rows before that are shown", builder.rows())));
        let column = |(chosen, values): (ChosenColumn, Vec<f64>)| WholeColumn {
            column: AvailableColumn { name: chosen.label, unit: chosen.unit },
            values,
        };
        let columns = chosen.into_iter().zip(builder.take_last().values).map(column).collect();
        Ok(Self { columns, is_cut, rate_hz: source.rate_hz(), ..self })
    }

    /// Number of rows.
    pub(crate) fn rows(&self) -> usize {
        self.columns.first().map_or(0, |column| column.values.len())
    }
}
