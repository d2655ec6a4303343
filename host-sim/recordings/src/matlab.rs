//! Arrays of MATLAB: `.mat` files of level 5, which `save` writes without `-v7.3`.

use crate::any_sensor::ReadOptions;
use crate::input_error::{InputError, Reason};
use crate::named_arrays::{self, NamedArray};
use crate::recording::MAX_SAMPLES;
use crate::sensor_table::{Number, SensorTable};
use matfile::{Array, MatFile, NumericData};
use std::fs::File;
use std::io::BufReader;
use std::path::Path;

/// Columns of a matrix beyond which it is no recording.
const MAX_COLUMNS: usize = 1024;

/// Reads a `.mat` file. It is held in memory as a whole.
pub(crate) fn read(file: &Path, options: &ReadOptions) -> Result<SensorTable, InputError> {
    let fail = |reason| InputError::file(file, reason);
    let input = BufReader::new(File::open(file).map_err(|error| fail(Reason::Io(error)))?);
    let parsed = MatFile::parse(input)
        .map_err(|error| fail(Reason::Format { format: "MATLAB level 5", error: error.to_string().into() }))?;
    let shape = |array: &Array| match *array.size().as_slice() {
        [rows, columns] if rows.min(columns) <= MAX_COLUMNS => {
            Some((rows.max(columns), rows.min(columns), rows >= columns))
        }
        _ => None,
    };
    let usable: Vec<(&Array, (usize, usize, bool))> =
        parsed.arrays().iter().filter_map(|array| Some((array, shape(array)?))).collect();
    if usable.iter().any(|(_, (rows, ..))| *rows as u64 > MAX_SAMPLES) {
        return Err(fail(Reason::TooManySamples));
    }
    let arrays: Vec<NamedArray> =
        usable.iter().map(|(array, (rows, columns, _))| NamedArray::matrix(array.name(), *rows, *columns)).collect();
    named_arrays::read(file, &arrays, options, |number, columns| {
        let (array, (rows, width, first_is_time)) = &usable[number];
        // The first index varies fastest.
        let at = |row: usize, column: usize| if *first_is_time { column * rows + row } else { row * width + column };
        let column = |&column: &usize| (0..*rows).map(|row| number_at(array.data(), at(row, column))).collect();
        Ok(columns.iter().map(column).collect())
    })
}

/// The number at `at`; NaN beyond the end of damaged data.
fn number_at(data: &NumericData, at: usize) -> Number {
    fn integer<T: Copy + Into<i64>>(real: &[T], at: usize) -> Option<Number> {
        real.get(at).map(|&value| Number::Integer(value.into()))
    }
    let number = match data {
        NumericData::Int8 { real, .. } => integer(real, at),
        NumericData::UInt8 { real, .. } => integer(real, at),
        NumericData::Int16 { real, .. } => integer(real, at),
        NumericData::UInt16 { real, .. } => integer(real, at),
        NumericData::Int32 { real, .. } => integer(real, at),
        NumericData::UInt32 { real, .. } => integer(real, at),
        NumericData::Int64 { real, .. } => integer(real, at),
        NumericData::UInt64 { real, .. } => {
            real.get(at).map(|&value| i64::try_from(value).map_or(Number::Real(value as f64), Number::Integer))
        }
        NumericData::Single { real, .. } => real.get(at).map(|&value| Number::Real(f64::from(value))),
        NumericData::Double { real, .. } => real.get(at).map(|&value| Number::Real(value)),
    };
    number.unwrap_or(Number::Real(f64::NAN))
}
