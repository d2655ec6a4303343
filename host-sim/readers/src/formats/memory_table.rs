//! Arrays in memory, as of NumPy or Arrow.

use crate::columns::Unit;
use crate::formats::array_topics::{ArrayReader, ArraySource, NamedArray, WantedColumns};
use crate::formats::topics::{EachRow, Stop};
use crate::input::{Budget, InputError, Reason};
use crate::rows::Number;
use std::fmt::Debug;
use std::path::Path;
use std::sync::Arc;

const ROWS_AT_ONCE: usize = 4096;

/// The numbers of one column.
pub trait MemoryColumn: Debug + Send + Sync {
    fn rows(&self) -> usize;

    /// From `first` on; NaN if missing.
    fn read(&self, first: usize, numbers: &mut [Number]);
}

/// An array: a vector, or a matrix as its columns.
#[derive(Debug, Clone)]
pub struct MemoryArray {
    /// Empty if it is the only one.
    pub name: String,
    /// Such as `ns`.
    pub unit: Option<String>,
    /// At least one, of equal length.
    pub columns: Vec<Arc<dyn MemoryColumn>>,
}

/// Arrays that are one recording.
#[derive(Debug, Clone, Default)]
pub struct MemoryTable {
    pub arrays: Vec<MemoryArray>,
}

impl MemoryTable {
    pub(crate) fn bytes(&self) -> u64 {
        let numbers = self.arrays.iter().flat_map(|array| &array.columns).map(|column| column.rows() as u64 * 8);
        numbers.sum()
    }

    pub(crate) fn source<'a>(
        &'a self,
        name: &'a Path,
        budget: Budget,
    ) -> Result<ArraySource<'a, &'a Self>, InputError> {
        if self.arrays.iter().all(|array| array.columns.is_empty()) {
            return Err(InputError::file(name, Reason::NoData));
        }
        let named = |array: &MemoryArray| NamedArray {
            unit: array.unit.as_deref().and_then(Unit::parse),
            ..NamedArray::matrix("", &array.name, array.columns.first().map_or(0, |of| of.rows()), array.columns.len())
        };
        Ok(ArraySource::new(name, self, self.arrays.iter().map(named).collect(), budget))
    }
}

impl ArrayReader for &MemoryTable {
    const FORMAT: &'static str = "arrays";

    fn rows(&mut self, wanted: &WantedColumns, each: &mut EachRow) -> Result<(), Stop> {
        let columns: Vec<&Arc<dyn MemoryColumn>> =
            wanted.places.iter().map(|&(array, column)| &self.arrays[array].columns[column]).collect();
        let rows = columns.iter().map(|column| column.rows()).min().unwrap_or(0);
        let mut buffers = vec![vec![Number::Integer(0); ROWS_AT_ONCE]; columns.len()];
        let mut row = Vec::with_capacity(columns.len());
        for first in (0..rows).step_by(ROWS_AT_ONCE) {
            let count = ROWS_AT_ONCE.min(rows - first);
            buffers.iter_mut().zip(&columns).for_each(|(buffer, column)| column.read(first, &mut buffer[..count]));
            for at in 0..count {
                row.clear();
                row.extend(buffers.iter().map(|buffer| buffer[at]));
                each(&row)?;
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::{MemoryArray, MemoryColumn, MemoryTable, ROWS_AT_ONCE};
    use crate::columns::{RowOptions, SensorChannels};
    use crate::formats::file_format::InputFile;
    use crate::input::ReadMonitor;
    use crate::rows::{Number, WantedRows};
    use std::path::Path;
    use std::sync::Arc;

    impl MemoryColumn for Vec<f64> {
        fn rows(&self) -> usize {
            self.len()
        }

        fn read(&self, first: usize, numbers: &mut [Number]) {
            numbers.iter_mut().zip(&self[first..]).for_each(|(number, value)| *number = Number::Real(*value));
        }
    }

    #[test]
    fn arrays_of_one_length_are_a_table_of_several_blocks() {
        let rows = ROWS_AT_ONCE + 5;
        let column = |offset: f64| -> Arc<dyn MemoryColumn> {
            Arc::new((0..rows).map(|row| row as f64 + offset).collect::<Vec<f64>>())
        };
        let gyro = MemoryArray {
            name: "gyro".to_owned(),
            unit: Some("rad/s".to_owned()),
            columns: [0.1, 0.2, 0.3].map(column).into(),
        };
        let time = MemoryArray { name: "time".to_owned(), unit: Some("s".to_owned()), columns: vec![column(0.0)] };
        let table = MemoryTable { arrays: vec![time, gyro] };
        let file = InputFile::of_arrays(Path::new("arrays"), Arc::new(table), &ReadMonitor::default());
        let options = RowOptions::of_sensor(SensorChannels::generic());
        let mut reader = file.rows(&options, &|_| None).expect("columns by name");
        let names: Vec<&str> = reader.columns().iter().map(|column| column.channel.name).collect();
        assert_eq!(names, ["gyro_x", "gyro_y", "gyro_z"]);
        let (mut times, mut last) = (Vec::new(), Vec::new());
        let read = reader.read(WantedRows::all(None), &mut |batch| {
            times.extend(batch.times);
            last.extend(&batch.values[2]);
            true
        });
        assert_eq!(read.expect("numbers").rows, rows as u64);
        assert_eq!((times.len(), last[rows - 1]), (rows, (rows - 1) as f64 + 0.3));
    }
}
