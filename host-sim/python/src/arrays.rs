//! NumPy arrays and Arrow tables as input for the reader of recordings, without a copy.

use arrow_array::cast::AsArray;
use arrow_array::ffi_stream::{ArrowArrayStreamReader, FFI_ArrowArrayStream};
use arrow_array::types::{
    DurationMicrosecondType, DurationMillisecondType, DurationNanosecondType, DurationSecondType, Float16Type,
    Float32Type, Float64Type, Int8Type, Int16Type, Int32Type, Int64Type, TimestampMicrosecondType,
    TimestampMillisecondType, TimestampNanosecondType, TimestampSecondType, UInt8Type, UInt16Type, UInt32Type,
    UInt64Type,
};
use arrow_array::{Array, ArrayRef, ArrowPrimitiveType, RecordBatch};
use arrow_schema::{ArrowError, DataType, Field, TimeUnit};
use numpy::{PyReadonlyArray1, PyUntypedArray, PyUntypedArrayMethods};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyCapsule;
use recordings::{MemoryArray, MemoryColumn, MemoryTable, Number};
use std::fmt;
use std::sync::Arc;

/// The numbers of a one-dimensional NumPy array.
struct Strided<T> {
    /// The owner, which keeps the memory alive.
    _owner: Py<PyAny>,
    first: *const T,
    /// Distance from one number to the next, in elements.
    stride: isize,
    rows: usize,
}

// SAFETY: the memory is only read, and its owner keeps it alive; it may be released on any thread.
unsafe impl<T: Sync> Send for Strided<T> {}
// SAFETY: as above.
unsafe impl<T: Sync> Sync for Strided<T> {}

impl<T> fmt::Debug for Strided<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Strided").field("stride", &self.stride).field("rows", &self.rows).finish_non_exhaustive()
    }
}

impl<T: numpy::Element + Copy> Strided<T> {
    fn new(array: &PyReadonlyArray1<'_, T>) -> Self {
        let view = array.as_array();
        let owner = array.as_any().clone().unbind();
        Self { _owner: owner, first: view.as_ptr(), stride: view.strides()[0], rows: view.len() }
    }

    /// The numbers from row `first` on.
    fn numbers(&self, first: usize) -> impl Iterator<Item = T> + '_ {
        (first..self.rows).map(|row| {
            // SAFETY: the array has this row, and it is a multiple of the stride away from the first one.
            unsafe { *self.first.offset(row as isize * self.stride) }
        })
    }
}

/// Declares the dtypes that can be read, each with a conversion to a number.
macro_rules! dtypes {
    ($($name:ident $type:ty, |$value:ident| $number:expr;)*) => {
        /// The numbers of a column.
        #[derive(Debug)]
        enum ColumnNumbers {
            $($name(Strided<$type>),)*
        }

        impl ColumnNumbers {
            fn new(array: &Bound<PyAny>) -> PyResult<Self> {
                $(if let Ok(array) = array.extract::<PyReadonlyArray1<$type>>() {
                    return Ok(Self::$name(Strided::new(&array)));
                })*
                let array = array.cast::<PyUntypedArray>()?;
                Err(PyTypeError::new_err(format!("an array of {} with {} dimensions", array.dtype(), array.ndim())))
            }

            fn rows(&self) -> usize {
                match self {
                    $(Self::$name(numbers) => numbers.rows,)*
                }
            }

            fn read(&self, first: usize, numbers: &mut [Number]) {
                match self {
                    $(Self::$name(own) => {
                        numbers.iter_mut().zip(own.numbers(first)).for_each(|(number, $value)| *number = $number);
                    })*
                }
            }
        }
    };
}
dtypes! {
    Bool bool, |value| Number::Integer(i64::from(value));
    Int8 i8, |value| Number::Integer(i64::from(value));
    Int16 i16, |value| Number::Integer(i64::from(value));
    Int32 i32, |value| Number::Integer(i64::from(value));
    Int64 i64, |value| Number::Integer(value);
    UInt8 u8, |value| Number::Integer(i64::from(value));
    UInt16 u16, |value| Number::Integer(i64::from(value));
    UInt32 u32, |value| Number::Integer(i64::from(value));
    UInt64 u64, |value| unsigned(value);
    Float32 f32, |value| Number::Real(f64::from(value));
    Float64 f64, |value| Number::Real(value);
}

fn unsigned(value: u64) -> Number {
    i64::try_from(value).map_or(Number::Real(value as f64), Number::Integer)
}

/// A NumPy column, with its mask.
#[derive(Debug)]
struct NumpyColumn {
    numbers: ColumnNumbers,
    mask: Option<Strided<bool>>,
}

impl MemoryColumn for NumpyColumn {
    fn rows(&self) -> usize {
        self.numbers.rows()
    }

    fn read(&self, first: usize, numbers: &mut [Number]) {
        self.numbers.read(first, numbers);
        let masked = self.mask.iter().flat_map(|mask| mask.numbers(first));
        for (number, _) in numbers.iter_mut().zip(masked).filter(|(_, is_masked)| *is_masked) {
            *number = Number::Real(f64::NAN);
        }
    }
}

/// An Arrow column, in one piece per batch of its table.
#[derive(Debug)]
struct ArrowColumn {
    /// The pieces, each with its first row.
    pieces: Vec<(usize, ArrayRef)>,
    rows: usize,
}

impl ArrowColumn {
    fn new(pieces: Vec<ArrayRef>) -> Self {
        let mut rows = 0;
        let place = |piece: ArrayRef| {
            let start = rows;
            rows += piece.len();
            (start, piece)
        };
        Self { pieces: pieces.into_iter().map(place).collect(), rows }
    }
}

impl MemoryColumn for ArrowColumn {
    fn rows(&self) -> usize {
        self.rows
    }

    fn read(&self, mut first: usize, mut numbers: &mut [Number]) {
        let mut at = self.pieces.partition_point(|(start, _)| *start <= first).saturating_sub(1);
        while let Some((start, piece)) = self.pieces.get(at).filter(|_| !numbers.is_empty()) {
            let skipped = first - start;
            let count = (piece.len() - skipped).min(numbers.len());
            let (here, rest) = std::mem::take(&mut numbers).split_at_mut(count);
            read_piece(piece, skipped, here);
            (first, numbers, at) = (first + count, rest, at + 1);
        }
    }
}

/// Puts the numbers of an Arrow array from `first` on into `numbers`.
fn read_piece(piece: &ArrayRef, first: usize, numbers: &mut [Number]) {
    fn integers<T: ArrowPrimitiveType<Native: Into<i64>>>(piece: &ArrayRef, first: usize, numbers: &mut [Number]) {
        let values = piece.as_primitive::<T>().values()[first..].iter();
        numbers.iter_mut().zip(values).for_each(|(number, value)| *number = Number::Integer((*value).into()));
    }
    fn reals<T: ArrowPrimitiveType<Native: Into<f64>>>(piece: &ArrayRef, first: usize, numbers: &mut [Number]) {
        let values = piece.as_primitive::<T>().values()[first..].iter();
        numbers.iter_mut().zip(values).for_each(|(number, value)| *number = Number::Real((*value).into()));
    }
    match piece.data_type() {
        DataType::Int8 => integers::<Int8Type>(piece, first, numbers),
        DataType::Int16 => integers::<Int16Type>(piece, first, numbers),
        DataType::Int32 => integers::<Int32Type>(piece, first, numbers),
        DataType::Int64 => integers::<Int64Type>(piece, first, numbers),
        DataType::UInt8 => integers::<UInt8Type>(piece, first, numbers),
        DataType::UInt16 => integers::<UInt16Type>(piece, first, numbers),
        DataType::UInt32 => integers::<UInt32Type>(piece, first, numbers),
        DataType::UInt64 => {
            let values = piece.as_primitive::<UInt64Type>().values()[first..].iter();
            numbers.iter_mut().zip(values).for_each(|(number, value)| *number = unsigned(*value));
        }
        DataType::Float16 => reals::<Float16Type>(piece, first, numbers),
        DataType::Float32 => reals::<Float32Type>(piece, first, numbers),
        DataType::Float64 => reals::<Float64Type>(piece, first, numbers),
        DataType::Timestamp(TimeUnit::Second, _) => integers::<TimestampSecondType>(piece, first, numbers),
        DataType::Timestamp(TimeUnit::Millisecond, _) => integers::<TimestampMillisecondType>(piece, first, numbers),
        DataType::Timestamp(TimeUnit::Microsecond, _) => integers::<TimestampMicrosecondType>(piece, first, numbers),
        DataType::Timestamp(TimeUnit::Nanosecond, _) => integers::<TimestampNanosecondType>(piece, first, numbers),
        DataType::Duration(TimeUnit::Second) => integers::<DurationSecondType>(piece, first, numbers),
        DataType::Duration(TimeUnit::Millisecond) => integers::<DurationMillisecondType>(piece, first, numbers),
        DataType::Duration(TimeUnit::Microsecond) => integers::<DurationMicrosecondType>(piece, first, numbers),
        DataType::Duration(TimeUnit::Nanosecond) => integers::<DurationNanosecondType>(piece, first, numbers),
        // No column of another type is created.
        _ => numbers.fill(Number::Real(f64::NAN)),
    }
    if let Some(nulls) = piece.nulls() {
        for (at, number) in numbers.iter_mut().enumerate().filter(|(at, _)| nulls.is_null(first + at)) {
            let _ = at;
            *number = Number::Real(f64::NAN);
        }
    }
}

/// The unit of a column's numbers if its type names one; `None` if the column has no numbers.
fn unit(field: &Field) -> Option<Option<&'static str>> {
    match field.data_type() {
        DataType::Timestamp(unit, _) | DataType::Duration(unit) => Some(Some(match unit {
            TimeUnit::Second => "s",
            TimeUnit::Millisecond => "ms",
            TimeUnit::Microsecond => "us",
            TimeUnit::Nanosecond => "ns",
        })),
        numbers
            if numbers.is_numeric()
                && !matches!(
                    numbers,
                    DataType::Decimal32(..)
                        | DataType::Decimal64(..)
                        | DataType::Decimal128(..)
                        | DataType::Decimal256(..)
                ) =>
        {
            Some(None)
        }
        _ => None,
    }
}

/// One array: its name, its columns with their masks, and the unit that its type names.
type NumpyArray<'py> = (String, Vec<(Bound<'py, PyAny>, Option<PyReadonlyArray1<'py, bool>>)>, Option<String>);

/// The arrays of one recording.
#[pyclass(frozen, module = "imunoise._native")]
pub(crate) struct Arrays {
    pub(crate) table: Arc<MemoryTable>,
    /// Notes for the user, one sentence each.
    pub(crate) notes: Vec<String>,
}

#[pymethods]
impl Arrays {
    /// The recording in NumPy arrays.
    #[staticmethod]
    fn of_numpy(arrays: Vec<NumpyArray>) -> PyResult<Self> {
        let array = |(name, columns, unit): NumpyArray| {
            let column = |(array, mask): (Bound<PyAny>, Option<PyReadonlyArray1<bool>>)| {
                let column =
                    NumpyColumn { numbers: ColumnNumbers::new(&array)?, mask: mask.as_ref().map(Strided::new) };
                Ok(Arc::new(column) as Arc<dyn MemoryColumn>)
            };
            Ok(MemoryArray { name, unit, columns: columns.into_iter().map(column).collect::<PyResult<_>>()? })
        };
        let arrays = arrays.into_iter().map(array).collect::<PyResult<_>>()?;
        Ok(Self { table: Arc::new(MemoryTable { arrays }), notes: Vec::new() })
    }

    /// The recording in the table of `__arrow_c_stream__`.
    #[staticmethod]
    fn of_stream(py: Python, stream: &Bound<PyCapsule>) -> PyResult<Self> {
        let pointer = stream.pointer_checked(Some(c"arrow_array_stream"))?.cast::<FFI_ArrowArrayStream>();
        let fail = |error: ArrowError| PyValueError::new_err(format!("the table cannot be read: {error}"));
        // SAFETY: a capsule of this name holds a stream of the C data interface, which is taken out of it.
        let reader = unsafe { ArrowArrayStreamReader::from_raw(pointer.as_ptr()) }.map_err(fail)?;
        py.detach(|| {
            let schema = arrow_array::RecordBatchReader::schema(&reader);
            let batches: Vec<RecordBatch> = reader.collect::<Result<_, _>>().map_err(fail)?;
            let (mut arrays, mut left_out) = (Vec::new(), Vec::new());
            for (at, field) in schema.fields().iter().enumerate() {
                let Some(unit) = unit(field) else {
                    left_out.push(field.name().as_str());
                    continue;
                };
                let pieces = batches.iter().map(|batch| Arc::clone(batch.column(at))).collect();
                let column: Arc<dyn MemoryColumn> = Arc::new(ArrowColumn::new(pieces));
                arrays.push(MemoryArray {
                    name: field.name().clone(),
                    unit: unit.map(str::to_owned),
                    columns: vec![column],
                });
            }
            let note = format!("left out, because they hold no numbers: {}", left_out.join(", "));
            let notes = if left_out.is_empty() { Vec::new() } else { vec![note] };
            Ok(Self { table: Arc::new(MemoryTable { arrays }), notes })
        })
    }
}
