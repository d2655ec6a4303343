//! Arrays of NumPy: `.npy` and `.npz`.

use crate::columns::Unit;
use crate::formats::array_topics::{ArrayReader, ArraySource, Encoded, NamedArray, WantedColumns};
use crate::formats::numpy_header::{ElementType, Encoding, Header};
use crate::formats::topics::{EachRow, Stop};
use crate::input::{Budget, Counted, FileBytes, InputError, Meter, Metered, OpenBytes, ReadMonitor, Reason};
use crate::rows::Number;
use std::io::{BufReader, Read, Seek, SeekFrom};
use zip::ZipArchive;

const FORMAT: &str = "NumPy array";
const MAX_COLUMNS: u64 = 1024;
const OBJECTS: &str = "holds Python objects, which are not read; of a dict of arrays, in Python: \
                       numpy.savez(\"FILE.npz\", **numpy.load(\"FILE\", allow_pickle=True).item())";

const ROWS_AT_ONCE: usize = 4096;

pub(crate) struct NpyReader {
    input: BufReader<Counted<OpenBytes>>,
    layout: ArrayLayout,
    /// Offset, bytes.
    start: u64,
}

impl NpyReader {
    pub(crate) fn open<'a>(
        file: &'a FileBytes,
        budget: Budget,
        monitor: &ReadMonitor,
    ) -> Result<ArraySource<'a, Self>, InputError> {
        let fail = |reason| file.error(reason);
        let io = |error| fail(Reason::Io(error));
        let mut input = BufReader::new(Counted::new(file.open().map_err(io)?, monitor));
        let layout = ArrayLayout::read(&mut input, "").map_err(fail)?;
        let start = input.stream_position().map_err(io)?;
        let arrays = vec![layout.array()];
        Ok(ArraySource::new(file.name(), Self { input, layout, start }, arrays, budget))
    }

    /// Up to `rows` rows from `first` on, of `columns` or whole; as many as there are.
    fn fill(&mut self, first: usize, rows: usize, columns: &[usize], buffers: &mut [Vec<u8>]) -> Result<usize, Reason> {
        let Self { layout, input, start } = self;
        let mut whole = rows;
        for (buffer, column) in buffers.iter_mut().zip(columns) {
            let before = if layout.by_column { column * layout.rows + first } else { first };
            input.seek(SeekFrom::Start(*start + (before * layout.stride) as u64)).map_err(Reason::Io)?;
            buffer.clear();
            input.by_ref().take((rows * layout.stride) as u64).read_to_end(buffer).map_err(Reason::from_io)?;
            whole = whole.min(buffer.len() / layout.stride);
        }
        Ok(whole)
    }
}

impl ArrayReader for NpyReader {
    const FORMAT: &'static str = FORMAT;

    fn rows(&mut self, wanted: &WantedColumns, each: &mut EachRow) -> Result<(), Stop> {
        let columns: Vec<usize> = wanted.places.iter().map(|(_, column)| *column).collect();
        let mut buffers = vec![Vec::new(); if self.layout.by_column { columns.len() } else { 1 }];
        // The buffer of each column.
        let last = buffers.len() - 1;
        let encoded: Vec<(usize, Encoded)> =
            columns.iter().enumerate().map(|(at, &column)| (at.min(last), self.layout.columns[column].1)).collect();
        let mut row = Vec::with_capacity(columns.len());
        let mut first = 0;
        while first < self.layout.rows {
            let expected = ROWS_AT_ONCE.min(self.layout.rows - first);
            let rows = self.fill(first, expected, &columns, &mut buffers)?;
            for at in 0..rows {
                let start = at * self.layout.stride;
                row.clear();
                row.extend(encoded.iter().map(|(buffer, encoded)| encoded.number(&buffers[*buffer][start..])));
                each(&row)?;
            }
            if rows < expected {
                return Err(Reason::Truncated { format: FORMAT }.into());
            }
            first += rows;
        }
        Ok(())
    }
}

pub(crate) struct NpzReader {
    archive: ZipArchive<BufReader<OpenBytes>>,
    layouts: Vec<(usize, ArrayLayout)>,
    meter: Meter,
}

impl NpzReader {
    pub(crate) fn open(file: &FileBytes, budget: Budget) -> Result<ArraySource<'_, Self>, InputError> {
        let fail = |reason| file.error(reason);
        let input = BufReader::new(file.open().map_err(|error| fail(Reason::Io(error)))?);
        let mut archive = ZipArchive::new(input).map_err(|error| fail(damaged(error)))?;
        let mut layouts: Vec<(usize, ArrayLayout)> = Vec::new();
        for number in 0..archive.len() {
            if let Some(layout) = entry_layout(&mut archive, number).map_err(fail)? {
                layouts.push((number, layout));
            }
        }
        if layouts.is_empty() {
            // Spreadsheets are archives too.
            let what = if archive.index_for_name("[Content_Types].xml").is_some() {
                "a spreadsheet"
            } else {
                "a ZIP archive without an array"
            };
            let how = "give the table in it, as CSV";
            return Err(fail(Reason::Foreign { what, how }));
        }
        let mut arrays: Vec<NamedArray> = layouts.iter().map(|(_, layout)| layout.array()).collect();
        // A single array needs no name.
        if let [array] = arrays.as_mut_slice() {
            array.name.clear();
        }
        Ok(ArraySource::new(file.name(), Self { archive, layouts, meter: budget.meter() }, arrays, budget))
    }
}

impl ArrayReader for NpzReader {
    const FORMAT: &'static str = "NumPy .npz";

    fn rows(&mut self, wanted: &WantedColumns, each: &mut EachRow) -> Result<(), Stop> {
        wanted.held(each, |array, columns| {
            let (number, layout) = &self.layouts[array];
            let mut entry = self.archive.by_index(*number).map_err(damaged)?;
            ArrayLayout::read(&mut entry, &layout.name)?;
            layout.read_columns(&mut BufReader::new(Metered::new(entry, &mut self.meter)), columns)
        })
    }
}

/// `None` for text and objects.
fn entry_layout<R: Read + Seek>(archive: &mut ZipArchive<R>, number: usize) -> Result<Option<ArrayLayout>, Reason> {
    let mut entry = archive.by_index(number).map_err(damaged)?;
    let path = entry.name().map_err(damaged)?.into_owned();
    let Some(name) = path.strip_suffix(".npy") else { return Ok(None) };
    match ArrayLayout::read(&mut entry, name) {
        Ok(layout) => Ok(Some(layout)),
        Err(Reason::Other(_)) => Ok(None),
        Err(other) => Err(other),
    }
}

fn damaged(error: zip::result::ZipError) -> Reason {
    Reason::damaged("NumPy .npz", error.to_string())
}

#[derive(Debug, Clone, PartialEq)]
struct ArrayLayout {
    name: String,
    rows: usize,
    columns: Vec<(String, Encoded)>,
    /// Per row, or per element if contiguous.
    stride: usize,
    by_column: bool,
    unit: Option<Unit>,
}

impl ArrayLayout {
    fn read(input: &mut impl Read, name: &str) -> Result<Self, Reason> {
        let unusable = |what: String| Reason::other(format!("array {name:?} {what}"));
        let Header { element, is_fortran_order, shape } = Header::read(input)?;
        let (outer, inner, first_is_time) = match *shape.as_slice() {
            [] => (1, 1, true),
            [rows] => (rows, 1, true),
            [rows, columns] => (rows.max(columns), rows.min(columns), rows >= columns),
            _ => return Err(unusable(format!("has {} dimensions; a recording has 1 or 2", shape.len()))),
        };
        if inner > MAX_COLUMNS {
            return Err(unusable(format!("has {inner} columns, more than {MAX_COLUMNS}")));
        }
        let mut unit = None;
        let mut columns = Vec::new();
        let mut stride = 0usize;
        let mut add = |name: String, encoding: &Encoding| -> Result<(), Reason> {
            if encoding.kind == 'O' {
                return Err(unusable(OBJECTS.to_owned()));
            }
            let scalar = encoding.scalar();
            let scalar = scalar.ok_or_else(|| unusable(format!("holds no numbers but {}", encoding.text)))?;
            unit = unit.or_else(|| encoding.time_unit().and_then(Unit::parse));
            columns.push((name, Encoded { offset: stride, scalar, is_big_endian: encoding.is_big_endian }));
            stride += encoding.bytes;
            Ok(())
        };
        let is_plain = match element {
            ElementType::Record(named) => {
                if inner > 1 {
                    return Err(unusable("is a matrix of records".to_owned()));
                }
                let mut plain = Vec::new();
                for (name, field) in &named {
                    flatten(name, field, &mut plain).map_err(unusable)?;
                }
                plain.into_iter().try_for_each(|(name, encoding)| add(name, encoding))?;
                false
            }
            ElementType::Plain(encoding) => {
                (0..inner).try_for_each(|number| add(number.to_string(), &encoding))?;
                true
            }
            ElementType::Array(..) => return Err(unusable("has rows within rows".to_owned())),
        };
        let by_column = is_plain && inner > 1 && is_fortran_order == first_is_time;
        if by_column {
            stride /= columns.len();
            columns.iter_mut().for_each(|(_, encoded)| encoded.offset = 0);
        }
        Ok(Self { name: name.to_owned(), rows: outer as usize, columns, stride, by_column, unit })
    }

    fn array(&self) -> NamedArray {
        let columns = self.columns.iter().map(|(name, _)| name.clone()).collect();
        NamedArray { name: self.name.clone(), rows: self.rows, columns, unit: self.unit, ..NamedArray::default() }
    }

    fn read_columns(&self, input: &mut impl Read, columns: &[usize]) -> Result<Vec<Vec<Number>>, Reason> {
        let mut values: Vec<Vec<Number>> = vec![Vec::new(); columns.len()];
        let mut bytes = vec![0; self.stride];
        // Elements of one column after the other, or rows of all.
        let parts = if self.by_column { self.columns.len() } else { 1 };
        for part in 0..parts {
            for _ in 0..self.rows {
                input.read_exact(&mut bytes).map_err(|error| Reason::ended(FORMAT, error))?;
                for (values, &column) in values.iter_mut().zip(columns) {
                    if !self.by_column || column == part {
                        values.push(self.columns[column].1.number(&bytes));
                    }
                }
            }
        }
        Ok(values)
    }
}

/// `gyro.0` of an array, `imu.gx` of a record.
fn flatten<'a>(name: &str, element: &'a ElementType, plain: &mut Vec<(String, &'a Encoding)>) -> Result<(), String> {
    match element {
        ElementType::Plain(encoding) => plain.push((name.to_owned(), encoding)),
        ElementType::Array(count, inner) => {
            for number in 0..*count {
                let before = plain.len();
                flatten(&format!("{name}.{number}"), inner, plain)?;
                if plain.len() == before {
                    // Arrays without a number.
                    break;
                }
            }
        }
        ElementType::Record(fields) => {
            for (of_field, field) in fields {
                flatten(&format!("{name}.{of_field}"), field, plain)?;
            }
        }
    }
    let most = MAX_COLUMNS;
    if plain.len() as u64 > most { Err(format!("has more than {most} columns")) } else { Ok(()) }
}
