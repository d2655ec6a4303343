//! Arrays of MATLAB: `.mat` files of level 5, which `save` writes without `-v7.3`.

use crate::counts::recording::MAX_SAMPLES;
use crate::formats::named_arrays::{self, NamedArray};
use crate::input::input_error::{InputError, Reason};
use crate::tables::any_sensor::ReadOptions;
use crate::tables::sensor_table::{Number, SensorTable};
use flate2::read::ZlibDecoder;
use matfile::{Array, MatFile, NumericData};
use std::io::Read;
use std::path::Path;

const FORMAT: &str = "MATLAB level 5";

/// Columns of a matrix beyond which it is no recording.
const MAX_COLUMNS: usize = 1024;

/// Bytes of all arrays together, uncompressed.
const MAX_BYTES: u64 = 1 << 30;

/// Bytes before the first data element, and of the tag of an element: type and length (MAT-File Format, "Level 5").
const HEADER_BYTES: usize = 128;
const TAG_BYTES: usize = 8;
/// Types of data elements.
const ARRAY_DIMENSIONS: u32 = 5;
const ARRAY_FLAGS: u32 = 6;
const MATRIX: u32 = 14;
const COMPRESSED: u32 = 15;
/// Classes of arrays of numbers, double to uint64.
const NUMERIC_CLASSES: std::ops::RangeInclusive<u32> = 6..=15;

/// Reads a `.mat` file. It is held in memory as a whole.
pub(crate) fn read(file: &Path, options: &ReadOptions) -> Result<SensorTable, InputError> {
    let fail = |reason| InputError::file(file, reason);
    let bytes = std::fs::read(file).map_err(|error| fail(Reason::Io(error)))?;
    let numeric = numeric_arrays(&bytes).map_err(fail)?;
    let parsed = MatFile::parse(numeric.as_slice())
        .map_err(|error| fail(Reason::Format { format: FORMAT, error: error.to_string().into() }))?;
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

/// `file` with its arrays of numbers alone, uncompressed. The crate `matfile` prints to the terminal where it meets other elements or
/// damaged compressed ones, and has no limit for their length.
fn numeric_arrays(file: &[u8]) -> Result<Vec<u8>, Reason> {
    let damaged = |error: std::io::Error| Reason::Format { format: FORMAT, error: error.to_string().into() };
    let truncated = || Reason::Truncated { format: FORMAT };
    let (header, mut rest) = file.split_at_checked(HEADER_BYTES).ok_or_else(truncated)?;
    let is_big_endian = header.ends_with(b"MI");
    let mut kept = header.to_vec();
    while let (Some(kind), Some(length)) = (word(rest, 0, is_big_endian), word(rest, 4, is_big_endian)) {
        let end = TAG_BYTES + length as usize;
        let element = rest.get(..end).ok_or_else(truncated)?;
        let room = MAX_BYTES.saturating_sub(kept.len() as u64);
        if kind == COMPRESSED {
            let mut expanded = Vec::new();
            ZlibDecoder::new(&element[TAG_BYTES..]).take(room + 1).read_to_end(&mut expanded).map_err(damaged)?;
            if expanded.len() as u64 > room {
                return Err(Reason::TooManySamples);
            }
            if is_numeric(&expanded, is_big_endian) {
                kept.append(&mut expanded);
            }
        } else if is_numeric(element, is_big_endian) {
            kept.extend(element);
        }
        // Uncompressed elements begin at multiples of 8 bytes.
        kept.resize(kept.len().next_multiple_of(TAG_BYTES), 0);
        let next = if kind == COMPRESSED { end } else { end.next_multiple_of(TAG_BYTES) };
        rest = rest.get(next..).unwrap_or(&[]);
    }
    Ok(kept)
}

/// Whether a data element is an array of numbers whose length fits the type that counts it.
fn is_numeric(element: &[u8], is_big_endian: bool) -> bool {
    let word = |at: usize| word(element, at, is_big_endian);
    // The tag of the matrix, its flags with their tag, and the tag of its dimensions.
    let (flags, dimensions) = (TAG_BYTES, 3 * TAG_BYTES);
    let is_of = |at: usize, kind: u32| word(at) == Some(kind);
    let class = word(flags + TAG_BYTES).map(|flags| flags & 0xFF);
    let count = word(dimensions + 4).map_or(0, |bytes| bytes as usize / 4);
    let elements = (0..count).try_fold(1_i32, |product, dimension| {
        let length = word(dimensions + TAG_BYTES + 4 * dimension)?;
        product.checked_mul(i32::try_from(length).ok()?)
    });
    is_of(0, MATRIX)
        && is_of(flags, ARRAY_FLAGS)
        && class.is_some_and(|class| NUMERIC_CLASSES.contains(&class))
        && is_of(dimensions, ARRAY_DIMENSIONS)
        && elements.is_some()
}

/// The word at `at`; `None` beyond the end.
fn word(bytes: &[u8], at: usize, is_big_endian: bool) -> Option<u32> {
    let word = *bytes.get(at..)?.first_chunk()?;
    Some(if is_big_endian { u32::from_be_bytes(word) } else { u32::from_le_bytes(word) })
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
