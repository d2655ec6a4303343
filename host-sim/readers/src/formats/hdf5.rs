//! Datasets of HDF5 (MATLAB 7.3, `h5py`): matrices and tables of records, by path, in windows of rows.

use crate::columns::Unit;
use crate::formats::array_topics::{ArrayReader, ArraySource, Encoded, NamedArray, WantedColumns, stated_rate};
use crate::formats::message_layout::Scalar;
use crate::formats::topics::{EachRow, Stop};
use crate::input::{Budget, FileBytes, InputError, Meter, Reason};
use crate::rows::Number;
use hdf5_pure::{AttrValue, Dataset, Datatype, DatatypeByteOrder, File, Group};
use std::collections::HashMap;
use std::io::Read;

const FORMAT: &str = "HDF5";

const MAX_COLUMNS: usize = 1024;
const MAX_OBJECTS: usize = 1 << 14;
const ROWS_AT_ONCE: u64 = 4096;

const UNITS: [&str; 2] = ["unit", "units"];
/// Factor and offset (NetCDF Climate and Forecast Conventions, 8.1).
const SCALES: [&str; 2] = ["scale_factor", "scale"];
const OFFSET: &str = "add_offset";
/// Class of an array in MATLAB.
const MATLAB_CLASS: &str = "MATLAB_class";
const NO_NUMBERS: [&str; 4] = ["char", "cell", "string", "function_handle"];

struct Layout {
    path: String,
    rows: usize,
    /// All at the element's start if columns are rows of the file.
    columns: Vec<Encoded>,
    stride: usize,
    /// Columns are rows of the file.
    is_by_column: bool,
    scale: Option<[f64; 2]>,
}

pub(crate) struct Hdf5Reader {
    file: File,
    layouts: Vec<Layout>,
    meter: Meter,
}

/// Statements of enclosing groups.
#[derive(Clone, Default)]
struct Stated {
    rate: Option<(f64, String)>,
    unit: Option<Unit>,
}

impl Hdf5Reader {
    pub(crate) fn open(bytes: &FileBytes, budget: Budget) -> Result<ArraySource<'_, Self>, InputError> {
        let fail = |reason| bytes.error(reason);
        let file = match bytes.file() {
            Some(file) => File::open_streaming(file),
            None => {
                let mut whole = Vec::new();
                let read = bytes.open().and_then(|mut input| input.read_to_end(&mut whole));
                read.map_err(|error| fail(Reason::Io(error)))?;
                File::from_bytes(whole)
            }
        };
        let file = file.map_err(|error| fail(damaged(error)))?;
        let mut found = Found { layouts: Vec::new(), arrays: Vec::new(), objects: 0 };
        found.add_group(&file.root(), "", &Stated::default(), 0).map_err(fail)?;
        let Found { layouts, arrays, .. } = found;
        Ok(ArraySource::new(bytes.name(), Self { file, layouts, meter: budget.meter() }, arrays, budget))
    }
}

fn damaged(error: impl ToString) -> Reason {
    Reason::damaged(FORMAT, error.to_string())
}

struct Found {
    layouts: Vec<Layout>,
    arrays: Vec<NamedArray>,
    objects: usize,
}

impl Found {
    fn add_group(&mut self, group: &Group, path: &str, around: &Stated, level: usize) -> Result<(), Reason> {
        Budget::check_depth(level)?;
        let stated = around.with(&group.attrs().unwrap_or_default(), path);
        for name in group.datasets().map_err(damaged)? {
            self.count()?;
            // An unreadable dataset leaves the others.
            let Ok(dataset) = group.dataset(&name) else { continue };
            self.add(&dataset, path, &name, &stated);
        }
        for name in group.groups().map_err(damaged)? {
            self.count()?;
            // MATLAB's group for references.
            if name.starts_with('#') {
                continue;
            }
            let inner = group.group(&name).map_err(damaged)?;
            self.add_group(&inner, &format!("{path}{name}/"), &stated, level + 1)?;
        }
        Ok(())
    }

    fn count(&mut self) -> Result<(), Reason> {
        self.objects += 1;
        let most = MAX_OBJECTS;
        if self.objects > most { Err(Reason::other(format!("more than {most} datasets"))) } else { Ok(()) }
    }

    fn add(&mut self, dataset: &Dataset, group: &str, name: &str, around: &Stated) {
        let attributes = dataset.attrs().unwrap_or_default();
        let class = attributes.get(MATLAB_CLASS).and_then(text);
        if class.is_some_and(|class| NO_NUMBERS.contains(&class.as_str())) {
            return;
        }
        let (Ok(kind), Ok(shape)) = (dataset.datatype(), dataset.shape()) else { return };
        let path = format!("{group}{name}");
        let Some((mut layout, names)) = layout(&path, &kind, &shape) else { return };
        let of = |known: &[&str]| {
            attributes
                .iter()
                .find(|(name, _)| known.contains(&name.to_lowercase().as_str()))
                .and_then(|(_, of)| number(of))
        };
        let (factor, offset) = (of(&SCALES), of(&[OFFSET]));
        layout.scale = factor.or(offset).map(|_| [factor.unwrap_or(1.0), offset.unwrap_or(0.0)]);
        let Stated { rate, unit } = around.with(&attributes, &path);
        let (group, name, rows) = (group.to_owned(), name.to_owned(), layout.rows);
        self.arrays.push(NamedArray { group, name, rows, columns: names, unit, rate });
        self.layouts.push(layout);
    }
}

impl Stated {
    fn with(&self, attributes: &HashMap<String, AttrValue>, path: &str) -> Self {
        let mut stated = self.clone();
        for (name, value) in attributes {
            let plain = name.to_lowercase();
            if let Some(hz) = number(value).and_then(|number| stated_rate(name, number)) {
                let of = if path.is_empty() { "the file" } else { path.trim_end_matches('/') };
                stated.rate = Some((hz, format!("attribute {name} of {of}")));
            }
            if UNITS.contains(&plain.as_str()) {
                stated.unit = text(value).and_then(|text| Unit::parse(&text)).or(stated.unit);
            }
        }
        stated
    }
}

fn number(value: &AttrValue) -> Option<f64> {
    let whole = || value.as_i64().map(|number| number as f64).or_else(|| value.as_u64().map(|number| number as f64));
    value.as_f64().or_else(whole).or_else(|| text(value)?.trim().parse().ok())
}

fn text(value: &AttrValue) -> Option<String> {
    let texts = value.as_strings()?;
    let first = texts.first().filter(|first| texts.iter().all(|text| text == *first))?;
    Some(first.trim_end_matches('\0').to_owned())
}

/// `None` unless vector, matrix or table of numbers.
fn layout(path: &str, kind: &Datatype, shape: &[u64]) -> Option<(Layout, Vec<String>)> {
    let sides: Vec<usize> = shape.iter().map(|side| usize::try_from(*side).ok()).collect::<Option<_>>()?;
    let (first, second) = match *sides.as_slice() {
        [rows] => (rows, 1),
        [rows, columns] => (rows, columns),
        _ => return None,
    };
    let size = kind.type_size() as usize;
    let path = path.to_owned();
    if let Datatype::Compound { .. } = kind {
        let mut found = Vec::new();
        add_numbers("", kind, 0, 0, &mut found);
        if second != 1 || found.len() > MAX_COLUMNS {
            return None;
        }
        found.retain(|(encoded, _)| encoded.offset + encoded.scalar.bytes() <= size);
        let (columns, names): (Vec<Encoded>, Vec<String>) = found.into_iter().unzip();
        let layout = Layout { path, rows: first, columns, stride: size, is_by_column: false, scale: None };
        return Some((layout, names)).filter(|(layout, _)| !layout.columns.is_empty() && layout.rows > 0);
    }
    let element = encoded(kind, 0)?;
    let (rows, columns) = (first.max(second), first.min(second));
    if columns == 0 || columns > MAX_COLUMNS || size != element.scalar.bytes() {
        return None;
    }
    let is_by_column = second > first;
    let place = |column: usize| if is_by_column { 0 } else { column * size };
    let layout = Layout {
        path,
        rows,
        columns: (0..columns).map(|column| Encoded { offset: place(column), ..element }).collect(),
        stride: second * size,
        is_by_column,
        scale: None,
    };
    Some((layout, (0..columns).map(|column| column.to_string()).collect()))
}

/// Numbers of a record at `offset`, nested: `gyro.x`, `gyro.0`.
fn add_numbers(path: &str, kind: &Datatype, offset: usize, level: usize, found: &mut Vec<(Encoded, String)>) {
    if found.len() > MAX_COLUMNS || Budget::check_depth(level).is_err() {
        return;
    }
    let inner = |name: &str| if path.is_empty() { name.to_owned() } else { format!("{path}.{name}") };
    match kind {
        Datatype::Compound { members, .. } => {
            for member in members {
                let Ok(own) = usize::try_from(member.byte_offset) else { continue };
                add_numbers(&inner(&member.name), &member.datatype, offset.saturating_add(own), level + 1, found);
            }
        }
        Datatype::Array { base_type, dimensions } => {
            let count = dimensions.iter().fold(1usize, |count, side| count.saturating_mul(*side as usize));
            let size = base_type.type_size() as usize;
            for number in 0..count.min(MAX_COLUMNS) {
                let own = offset.saturating_add(number.saturating_mul(size));
                add_numbers(&inner(&number.to_string()), base_type, own, level + 1, found);
            }
        }
        _ => found.extend(encoded(kind, offset).map(|encoded| (encoded, path.to_owned()))),
    }
}

fn encoded(kind: &Datatype, offset: usize) -> Option<Encoded> {
    let bytes = u8::try_from(kind.type_size()).ok()?;
    let (scalar, order) = match kind {
        Datatype::FixedPoint { byte_order, layout, .. } if matches!(bytes, 1 | 2 | 4 | 8) => {
            (if layout.signed { Scalar::Signed(bytes) } else { Scalar::Unsigned(bytes) }, *byte_order)
        }
        Datatype::FloatingPoint { byte_order, .. } if matches!(bytes, 2 | 4 | 8) => (Scalar::Float(bytes), *byte_order),
        Datatype::Enumeration { base_type, .. } => return encoded(base_type, offset),
        _ => return None,
    };
    let is_big_endian = match order {
        DatatypeByteOrder::LittleEndian => false,
        DatatypeByteOrder::BigEndian => true,
        _ => return None,
    };
    Some(Encoded { offset, scalar, is_big_endian })
}

impl ArrayReader for Hdf5Reader {
    const FORMAT: &'static str = FORMAT;

    fn rows(&mut self, wanted: &WantedColumns, each: &mut EachRow) -> Result<(), Stop> {
        wanted.held(each, |array, columns| self.read(array, columns))
    }
}

impl Hdf5Reader {
    fn read(&mut self, array: usize, columns: &[usize]) -> Result<Vec<Vec<Number>>, Reason> {
        let Layout { path, rows, columns: encoded, stride, is_by_column, scale } = &self.layouts[array];
        let number = |column: usize, bytes: &[u8]| {
            let number = encoded[column].number(bytes);
            scale.map_or(number, |[factor, offset]| Number::Real(factor * number.value() + offset))
        };
        let (rows, stride) = (*rows as u64, *stride as u64);
        let dataset = self.file.dataset(path).map_err(damaged)?;
        let mut values: Vec<Vec<Number>> = vec![Vec::new(); columns.len()];
        if *is_by_column {
            for (values, &column) in values.iter_mut().zip(columns) {
                self.meter.add_bytes(stride)?;
                let bytes = dataset.read_raw_rows(column as u64, 1).map_err(damaged)?;
                let elements = bytes.chunks_exact(encoded[column].scalar.bytes());
                values.extend(elements.map(|element| number(column, element)));
            }
            return Ok(values);
        }
        let chunk = dataset.chunk_shape().ok().flatten().and_then(|shape| shape.first().copied()).unwrap_or(1);
        let window = ROWS_AT_ONCE.next_multiple_of(chunk.clamp(1, ROWS_AT_ONCE)).max(chunk.min(1 << 20));
        let mut start = 0;
        while start < rows {
            let count = window.min(rows - start);
            self.meter.add_bytes(count * stride)?;
            let bytes = dataset.read_raw_rows(start, count).map_err(damaged)?;
            for row in bytes.chunks_exact(stride as usize) {
                for (values, &column) in values.iter_mut().zip(columns) {
                    values.push(number(column, row));
                }
            }
            start += count;
        }
        Ok(values)
    }
}
