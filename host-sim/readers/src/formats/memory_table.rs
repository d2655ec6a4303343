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
