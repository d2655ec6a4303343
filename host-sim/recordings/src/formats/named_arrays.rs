//! Arrays of numbers with names, as NumPy and MATLAB keep them: which of them are columns of one table.

use crate::columns::column_selection::{AvailableColumn, ChosenColumn};
use crate::columns::unit::Unit;
use crate::input::input_error::{InputError, Reason};
use crate::tables::any_sensor::ReadOptions;
use crate::tables::sensor_table::{Number, SensorTable, TableBuilder};
use std::path::Path;

/// An array of a file: a vector, or a matrix whose longer side is the time.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct NamedArray {
    /// Its name; empty where the file has one array without a name.
    pub(crate) name: String,
    /// Length of the longer side.
    pub(crate) rows: usize,
    /// Names of the columns, or their numbers, from 0.
    pub(crate) columns: Vec<String>,
    /// Unit of the numbers, where the file says it.
    pub(crate) unit: Option<Unit>,
}

impl NamedArray {
    /// A matrix of `rows` by `columns` whose columns have numbers.
    pub(crate) fn matrix(name: &str, rows: usize, columns: usize) -> Self {
        let columns = (0..columns).map(|number| number.to_string()).collect();
        Self { name: name.to_owned(), rows, columns, unit: None }
    }

    /// A column of the table: `gyro.0` of the matrix `gyro`, the name alone of a vector, the number alone where the array
    /// has no name.
    fn available(&self, column: usize) -> AvailableColumn {
        let name = match (self.name.as_str(), self.columns.len()) {
            ("", _) => self.columns[column].clone(),
            (name, 1) => name.to_owned(),
            (name, _) => format!("{name}.{}", self.columns[column]),
        };
        let heading = AvailableColumn::from_heading(&name);
        AvailableColumn {
            unit: self.unit.or(heading.unit),
            name: if heading.unit.is_some() { heading.name } else { name },
        }
    }
}

/// The columns to read of the only array of a file.
pub(crate) fn choose(array: &NamedArray, options: &ReadOptions) -> Result<Vec<ChosenColumn>, Reason> {
    let is_named = options.topic.as_ref().is_none_or(|topic| *topic == array.name);
    let columns = (0..array.columns.len()).filter(|_| is_named);
    let available: Vec<AvailableColumn> = columns.map(|column| array.available(column)).collect();
    options.choose(&available).map_err(|error| Reason::Selection(Box::new(error)))
}

/// Reads the chosen columns of `arrays`; `read` gives those of an array, by their numbers.
pub(crate) fn read(
    file: &Path,
    arrays: &[NamedArray],
    options: &ReadOptions,
    mut read: impl FnMut(usize, &[usize]) -> Result<Vec<Vec<Number>>, Reason>,
) -> Result<SensorTable, InputError> {
    let fail = |reason| InputError::file(file, reason);
    let places: Vec<(usize, usize)> = (arrays.iter().enumerate())
        .filter(|(_, array)| options.topic.as_ref().is_none_or(|topic| *topic == array.name))
        .flat_map(|(number, array)| (0..array.columns.len()).map(move |column| (number, column)))
        .collect();
    let available: Vec<AvailableColumn> =
        places.iter().map(|&(array, column)| arrays[array].available(column)).collect();
    let chosen = options.choose(&available).map_err(|error| fail(Reason::Selection(Box::new(error))))?;
    let mut values: Vec<Vec<Number>> = vec![Vec::new(); chosen.len()];
    let first = chosen.first().map_or(0, |column| places[column.position].0);
    for (number, array) in arrays.iter().enumerate() {
        let own: Vec<usize> = (0..chosen.len()).filter(|&at| places[chosen[at].position].0 == number).collect();
        if own.is_empty() {
            continue;
        }
        if array.rows != arrays[first].rows {
            let [one, other] =
                [&arrays[first], array].map(|array| format!("array {:?} has {} rows", array.name, array.rows));
            return Err(fail(Reason::Array(format!("{one}, {other}"))));
        }
        let columns: Vec<usize> = own.iter().map(|&at| places[chosen[at].position].1).collect();
        for (at, column) in own.into_iter().zip(read(number, &columns).map_err(fail)?) {
            values[at] = column;
        }
    }
    let mut builder = TableBuilder::new(chosen);
    let rows = values.iter().map(Vec::len).min().unwrap_or(0);
    let mut row = Vec::with_capacity(values.len());
    for at in 0..rows {
        row.clear();
        row.extend(values.iter().map(|column| column[at]));
        builder.push(&row).map_err(|(column, reason)| {
            let label = builder.chosen().get(column).map_or("", |column| column.label.as_str());
            InputError::row(file, at as u64 + 1, label, reason)
        })?;
    }
    builder.finish().map_err(fail)
}
