//! MATLAB `.mat` files of level 5, with structures and cells (MAT-File Format, chapter 1). `matfile` has no structures.

use crate::formats::array_topics::{ArrayReader, ArraySource, NamedArray, WantedColumns};
use crate::formats::message_layout::Scalar;
use crate::formats::topics::{EachRow, Stop};
use crate::input::{Budget, FileBytes, InputError, Meter, Metered, Reason};
use crate::rows::Number;
use flate2::read::ZlibDecoder;
use std::io::{self, BufReader, Read};

const FORMAT: &str = "MATLAB";

const MAX_COLUMNS: usize = 1024;
/// Children of a cell array or structure.
const MAX_CHILDREN: usize = 1024;
/// Longest sample in a structure's field.
const MAX_IN_SAMPLE: usize = 16;
/// Limits per file, without and with structures of samples.
const MAX_ARRAYS: usize = 1 << 12;
const MAX_PARTS: usize = 1 << 20;
const MAX_NAME: u64 = 256;
const BUFFER_BYTES: usize = 1 << 13;

const HEADER_BYTES: usize = 128;
const TAG_BYTES: usize = 8;
const MATRIX: u32 = 14;
const COMPRESSED: u32 = 15;
const CELL: u32 = 1;
const STRUCTURE: u32 = 2;
/// Object: its numbers lie in undocumented bytes.
const OBJECT: u32 = 17;
const NUMERIC: std::ops::RangeInclusive<u32> = 6..=15;

/// A matrix, or a field of structures with a sample each.
#[derive(Debug, Clone)]
struct ListedArray {
    group: String,
    name: String,
    sides: [usize; 2],
    parts: Parts,
}

/// Numbers of the matrices in the file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Parts {
    first: usize,
    stride: usize,
    /// `None` for a matrix.
    structures: Option<usize>,
}

impl Parts {
    fn contain(self, number: usize) -> bool {
        let from = number.checked_sub(self.first);
        from.is_some_and(|from| from % self.stride == 0 && from / self.stride < self.count())
    }

    fn count(self) -> usize {
        self.structures.unwrap_or(1)
    }
}

impl ListedArray {
    /// Samples and numbers per sample.
    fn shape(&self) -> [usize; 2] {
        let [rows, columns] = self.sides;
        match self.parts.structures {
            Some(count) => [count, rows * columns],
            None => [rows.max(columns), rows.min(columns)],
        }
    }
}

/// For objects other than tables.
const OTHER_COMMANDS: &str = "copy its numbers into matrices and save these";

fn table_commands(name: &str, class: &str) -> String {
    let table = if class == "timetable" { format!("timetable2table({name})") } else { name.to_owned() };
    format!("writetable({table}, \"{name}.csv\")")
}

/// Read from the start for each array.
pub(crate) struct MatReader {
    file: FileBytes,
    arrays: Vec<ListedArray>,
    budget: Budget,
}

impl MatReader {
    pub(crate) fn open(file: &FileBytes, budget: Budget) -> Result<ArraySource<'_, Self>, InputError> {
        let fail = |reason| file.error(reason);
        let mut listing = Walk::new(budget);
        listing.file(file).map_err(fail)?;
        if let ([], Some((name, class))) = (listing.arrays.as_slice(), listing.objects.first()) {
            let how = if ["table", "timetable"].contains(&class.as_str()) {
                table_commands(name, class)
            } else {
                OTHER_COMMANDS.to_owned()
            };
            return Err(fail(Reason::other(format!(
                "it holds a MATLAB object ({name}, a {class}), which is not read; in MATLAB: {how}"
            ))));
        }
        let array = |array: &ListedArray| {
            let [rows, columns] = array.shape();
            NamedArray::matrix(&array.group, &array.name, rows, columns)
        };
        let arrays = listing.arrays.iter().map(array).collect();
        let reader = Self { file: file.clone(), arrays: listing.arrays, budget };
        Ok(ArraySource::new(file.name(), reader, arrays, budget))
    }
}

impl ArrayReader for MatReader {
    const FORMAT: &'static str = FORMAT;

    fn rows(&mut self, wanted: &WantedColumns, each: &mut EachRow) -> Result<(), Stop> {
        wanted.held(each, |array, columns| {
            let mut walk = Walk::new(self.budget);
            walk.values = vec![Vec::new(); columns.len()];
            walk.wanted = Some((self.arrays[array].parts, columns));
            walk.file(&self.file)?;
            if walk.is_done() { Ok(walk.values) } else { Err(Reason::Truncated { format: FORMAT }) }
        })
    }
}

/// A pass over the data elements, to list or to read.
struct Walk<'a> {
    wanted: Option<(Parts, &'a [usize])>,
    arrays: Vec<ListedArray>,
    objects: Vec<(String, String)>,
    /// Matrices so far, and those read.
    walked: usize,
    taken: usize,
    values: Vec<Vec<Number>>,
    is_big_endian: bool,
    meter: Meter,
}

impl Walk<'_> {
    fn new(budget: Budget) -> Self {
        let meter = budget.meter();
        Self {
            wanted: None,
            arrays: Vec::new(),
            objects: Vec::new(),
            walked: 0,
            taken: 0,
            values: Vec::new(),
            is_big_endian: false,
            meter,
        }
    }

    fn is_done(&self) -> bool {
        self.wanted.is_some_and(|(parts, _)| self.taken == parts.count())
    }

    fn takes_next(&self) -> bool {
        self.wanted.is_some_and(|(parts, _)| parts.contain(self.walked))
    }

    fn file(&mut self, file: &FileBytes) -> Result<(), Reason> {
        let mut input = BufReader::new(file.open().map_err(Reason::Io)?);
        let mut header = [0; HEADER_BYTES];
        input.read_exact(&mut header).map_err(ended)?;
        self.is_big_endian = header.ends_with(b"MI");
        let mut bytes = [0; TAG_BYTES];
        while !self.is_done() && input.read_exact(&mut bytes).is_ok() {
            let tag = Tag::read(&mut bytes.as_slice(), self.is_big_endian)?;
            let mut element = input.by_ref().take(u64::from(tag.length));
            let mut padding = 0;
            if tag.kind == COMPRESSED {
                let budget = self.meter.budget();
                let meter = std::mem::replace(&mut self.meter, budget.meter());
                let mut expanded = Metered::new(ZlibDecoder::new(&mut element), meter);
                let walked = self.element(&mut expanded);
                self.meter = expanded.into_meter();
                walked?;
            } else if tag.held.is_none() {
                self.element(&mut bytes.as_slice().chain(&mut element))?;
                // Uncompressed elements are aligned to 8 bytes.
                padding = tag.rest() - u64::from(tag.length);
            } else {
                element.set_limit(0);
            }
            io::copy(&mut element, &mut io::sink()).map_err(ended)?;
            if element.limit() > 0 && !self.is_done() {
                return Err(Reason::Truncated { format: FORMAT });
            }
            io::copy(&mut input.by_ref().take(padding), &mut io::sink()).map_err(ended)?;
            if self.arrays.len() > MAX_ARRAYS {
                return Err(Reason::other(format!("more than {MAX_ARRAYS} arrays")));
            }
        }
        Ok(())
    }

    fn add(&mut self, group: String, name: String, sides: [usize; 2]) -> Result<(), Reason> {
        let parts = Parts { first: self.walked, stride: 1, structures: None };
        self.arrays.push(ListedArray { group, name, sides, parts });
        self.walked += 1;
        let most = MAX_PARTS;
        if self.walked > most { Err(Reason::other(format!("more than {most} arrays"))) } else { Ok(()) }
    }

    /// Joins the arrays of `count` structures with a sample each; drops those of too many structures.
    fn join(&mut self, start: usize, count: usize, group: &str) {
        let all = &self.arrays[start..];
        let fields = all.len() / count;
        let place = |at: usize| all[at].group.strip_prefix(&inner_group(group, at / fields));
        let is_alike = |at: usize| {
            let (one, first) = (&all[at], &all[at % fields]);
            let is_sample = one.parts.structures.is_none() && one.sides[0] * one.sides[1] <= MAX_IN_SAMPLE;
            is_sample && (&one.name, one.sides, place(at)) == (&first.name, first.sides, place(at % fields))
        };
        if fields > 0 && fields * count == all.len() && (0..all.len()).all(is_alike) {
            let joined = |at: usize| ListedArray {
                group: format!("{group}.{}", place(at).unwrap_or_default()),
                parts: Parts { stride: fields, structures: Some(count), ..all[at].parts },
                ..all[at].clone()
            };
            let joined: Vec<ListedArray> = (0..fields).map(joined).collect();
            self.arrays.truncate(start);
            self.arrays.extend(joined);
        } else if count > MAX_CHILDREN {
            self.arrays.truncate(start);
        }
    }

    /// Top level: an array, or skipped.
    fn element(&mut self, input: &mut dyn Read) -> Result<(), Reason> {
        let mut input = Counted { input, at: 0 };
        let tag = Tag::read(&mut input, self.is_big_endian)?;
        if tag.kind == MATRIX { self.matrix(&mut input, tag, "", None, 0) } else { Ok(()) }
    }

    /// After its tag; `name` is that of a field.
    fn matrix(
        &mut self,
        input: &mut Counted,
        tag: Tag,
        group: &str,
        name: Option<String>,
        level: usize,
    ) -> Result<(), Reason> {
        Budget::check_depth(level)?;
        let end = input.at + u64::from(tag.length);
        if tag.length == 0 {
            return Ok(());
        }
        let flags = self.small(input, 8)?;
        let class = flags.first().copied().map_or(0, |word| word & 0xFF);
        if class == OBJECT {
            let own = self.text(input)?;
            self.text(input)?;
            let class = self.text(input)?;
            self.objects.push((name.unwrap_or(own), class));
            return input.skip(end.saturating_sub(input.at));
        }
        let dimensions = self.small(input, 64)?;
        let own = self.text(input)?;
        let name = name.unwrap_or(own);
        let sides: Vec<usize> = dimensions.iter().map(|&side| side as usize).collect();
        let elements = sides.iter().try_fold(1usize, |product, side| product.checked_mul(*side)).unwrap_or(usize::MAX);
        match (class, sides.as_slice()) {
            (class, &[rows, columns])
                if NUMERIC.contains(&class)
                    && rows.min(columns) <= MAX_COLUMNS
                    && elements > 0
                    && !(name.is_empty() && level == 0) =>
            {
                if self.takes_next() {
                    self.numbers(input, [rows, columns])?;
                }
                self.add(group.to_owned(), name, [rows, columns])?;
            }
            (STRUCTURE, _) if elements <= MAX_PARTS => {
                let fields = self.fields(input)?;
                let (start, group) = (self.arrays.len(), format!("{group}{name}"));
                for element in 0..elements {
                    let inner = if elements == 1 { format!("{group}.") } else { inner_group(&group, element) };
                    for field in &fields {
                        self.child(input, &inner, field.clone(), level)?;
                    }
                }
                if elements > 1 {
                    self.join(start, elements, &group);
                }
            }
            (CELL, _) if elements <= MAX_CHILDREN => {
                for element in 0..elements {
                    self.child(input, &format!("{group}{name}."), element.to_string(), level)?;
                }
            }
            _ => {}
        }
        if self.is_done() {
            return Ok(());
        }
        input.skip(end.saturating_sub(input.at))
    }

    fn child(&mut self, input: &mut Counted, group: &str, name: String, level: usize) -> Result<(), Reason> {
        if self.is_done() {
            return Ok(());
        }
        let tag = Tag::read(input, self.is_big_endian)?;
        if tag.kind == MATRIX { self.matrix(input, tag, group, Some(name), level + 1) } else { input.skip(tag.rest()) }
    }

    fn fields(&mut self, input: &mut Counted) -> Result<Vec<String>, Reason> {
        let length = self.small(input, 4)?.first().map_or(0, |length| *length as usize);
        let tag = Tag::read(input, self.is_big_endian)?;
        if length == 0 || u64::from(tag.length) > (MAX_CHILDREN * length) as u64 || length as u64 > MAX_NAME {
            return Err(Reason::damaged(FORMAT, "names of fields are too long"));
        }
        let names = self.content(input, tag)?;
        let name = |bytes: &[u8]| {
            let end = bytes.iter().position(|byte| *byte == 0).unwrap_or(bytes.len());
            String::from_utf8_lossy(&bytes[..end]).into_owned()
        };
        Ok(names.chunks(length).map(name).collect())
    }

    /// 32-bit words, at most `most` bytes.
    fn small(&mut self, input: &mut Counted, most: u64) -> Result<Vec<u32>, Reason> {
        let tag = Tag::read(input, self.is_big_endian)?;
        if u64::from(tag.length) > most {
            return Err(Reason::damaged(FORMAT, "an array has too many dimensions"));
        }
        let bytes = self.content(input, tag)?;
        Ok(bytes.chunks_exact(4).map(|word| number(word, self.is_big_endian) as u32).collect())
    }

    fn text(&mut self, input: &mut Counted) -> Result<String, Reason> {
        let tag = Tag::read(input, self.is_big_endian)?;
        if u64::from(tag.length) > MAX_NAME {
            return Err(Reason::damaged(FORMAT, "the name of an array is too long"));
        }
        Ok(String::from_utf8_lossy(&self.content(input, tag)?).into_owned())
    }

    fn content(&self, input: &mut Counted, tag: Tag) -> Result<Vec<u8>, Reason> {
        let mut bytes = tag.held.map_or_else(Vec::new, |held| held[..tag.length as usize].to_vec());
        if tag.held.is_none() {
            bytes.resize(tag.length as usize, 0);
            input.read_exact(&mut bytes).map_err(ended)?;
            input.skip(tag.rest() - u64::from(tag.length))?;
        }
        Ok(bytes)
    }

    fn numbers(&mut self, input: &mut Counted, [rows, columns]: [usize; 2]) -> Result<(), Reason> {
        let tag = Tag::read(input, self.is_big_endian)?;
        let scalar = match tag.kind {
            1 => Scalar::Signed(1),
            2 => Scalar::Unsigned(1),
            3 => Scalar::Signed(2),
            4 => Scalar::Unsigned(2),
            5 => Scalar::Signed(4),
            6 => Scalar::Unsigned(4),
            7 => Scalar::Float(4),
            9 => Scalar::Float(8),
            12 => Scalar::Signed(8),
            13 => Scalar::Unsigned(8),
            _ => return Err(Reason::damaged(FORMAT, "an array has numbers of an unknown type")),
        };
        match tag.held {
            Some(held) => {
                self.columns(&mut &held[..tag.length as usize], [rows, columns], scalar, u64::from(tag.length))
            }
            None => self.columns(input, [rows, columns], scalar, u64::from(tag.length)),
        }
    }

    fn columns(
        &mut self,
        input: &mut dyn Read,
        [rows, columns]: [usize; 2],
        scalar: Scalar,
        bytes: u64,
    ) -> Result<(), Reason> {
        let Some((parts, wanted)) = self.wanted else { return Ok(()) };
        let size = scalar.bytes();
        let is_big_endian = self.is_big_endian;
        let mut at = 0;
        let mut take = |bytes: &[u8]| {
            for word in bytes.chunks_exact(size) {
                // The first index varies fastest.
                let column = match parts.structures {
                    Some(_) => at,
                    None if rows >= columns => at / rows,
                    None => at % rows,
                };
                at += 1;
                for (values, _) in self.values.iter_mut().zip(wanted).filter(|(_, wanted)| **wanted == column) {
                    values.push(scalar.read(word, is_big_endian));
                }
            }
        };
        let mut left = bytes.min((rows as u64).saturating_mul(columns as u64).saturating_mul(size as u64));
        let mut buffer = [0; BUFFER_BYTES];
        while left > 0 {
            let count = left.min(BUFFER_BYTES as u64) as usize;
            input.read_exact(&mut buffer[..count]).map_err(ended)?;
            take(&buffer[..count]);
            left -= count as u64;
        }
        self.taken += 1;
        Ok(())
    }
}

fn inner_group(group: &str, element: usize) -> String {
    format!("{group}.{element}.")
}

fn number(bytes: &[u8], is_big_endian: bool) -> u64 {
    let join = |word: u64, byte: &u8| word << 8 | u64::from(*byte);
    if is_big_endian { bytes.iter().fold(0, join) } else { bytes.iter().rev().fold(0, join) }
}

fn ended(error: io::Error) -> Reason {
    match error.kind() {
        io::ErrorKind::InvalidInput | io::ErrorKind::InvalidData => Reason::damaged(FORMAT, error.to_string()),
        _ => Reason::ended(FORMAT, error),
    }
}

/// Type and length; up to 4 bytes lie in the tag.
#[derive(Clone, Copy)]
struct Tag {
    kind: u32,
    length: u32,
    held: Option<[u8; 4]>,
}

impl Tag {
    fn read(input: &mut impl Read, is_big_endian: bool) -> Result<Self, Reason> {
        let mut bytes = [0; TAG_BYTES];
        input.read_exact(&mut bytes).map_err(ended)?;
        let word = |at: usize| number(&bytes[at..at + 4], is_big_endian) as u32;
        let (kind, length) = (word(0), word(4));
        match kind >> 16 {
            0 => Ok(Self { kind, length, held: None }),
            small @ 1..=4 => {
                let [.., a, b, c, d] = bytes;
                Ok(Self { kind: kind & 0xFFFF, length: small, held: Some([a, b, c, d]) })
            }
            _ => Err(Reason::damaged(FORMAT, "an element is longer than its tag")),
        }
    }

    /// With padding to 8.
    fn rest(self) -> u64 {
        if self.held.is_some() { 0 } else { u64::from(self.length).next_multiple_of(TAG_BYTES as u64) }
    }
}

struct Counted<'a> {
    input: &'a mut dyn Read,
    at: u64,
}

impl Counted<'_> {
    fn skip(&mut self, bytes: u64) -> Result<(), Reason> {
        io::copy(&mut self.by_ref().take(bytes), &mut io::sink()).map(|_| ()).map_err(ended)
    }
}

impl Read for Counted<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let count = self.input.read(buffer)?;
        self.at += count as u64;
        Ok(count)
    }
}
