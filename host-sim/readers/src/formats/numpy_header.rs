//! The header of a NumPy array (format 1.0 to 3.0), a literal of Python.

use crate::formats::message_layout::Scalar;
use crate::input::budget::too_deep;
use crate::input::input_error::Reason;
use std::io::Read;

const FORMAT: &str = "NumPy array";
const MOST_BRACKETS: usize = 8;
const MOST_BYTES: u64 = 1 << 20;

#[derive(Debug, Clone, PartialEq)]
pub(crate) enum ElementType {
    Plain(Encoding),
    Array(u64, Box<ElementType>),
    Record(Vec<(String, ElementType)>),
}

/// Such as `<f8` or `<M8[ns]`.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Encoding {
    pub(crate) text: String,
    pub(crate) is_big_endian: bool,
    /// `f`, `i`, `u`, `b`, `M`, `m`, `O` and others.
    pub(crate) kind: char,
    pub(crate) bytes: usize,
}

#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Header {
    pub(crate) element: ElementType,
    /// The first index changes fastest.
    pub(crate) is_fortran_order: bool,
    pub(crate) shape: Vec<u64>,
}

impl Header {
    pub(crate) fn read(input: &mut impl Read) -> Result<Self, Reason> {
        let mut start = [0; 8];
        fill(input, &mut start)?;
        if !start.starts_with(b"\x93NUMPY") {
            return Err(damaged("it does not begin as an array"));
        }
        // Two bytes in version 1.
        let mut length = [0; 8];
        fill(input, &mut length[..if start[6] == 1 { 2 } else { 4 }])?;
        let length = u64::from_le_bytes(length);
        if length > MOST_BYTES {
            return Err(Reason::other(format!("the header of the array has {length} bytes")));
        }
        let mut text = vec![0; length as usize];
        fill(input, &mut text)?;
        // Latin-1 before version 3.
        let text =
            String::from_utf8(text).unwrap_or_else(|error| error.into_bytes().into_iter().map(char::from).collect());
        let literal = Parser { rest: text.trim_start(), depth: 0 }.literal()?;
        let Literal::Dict(entries) = literal else { return Err(damaged("its header is no dictionary")) };
        let entry = |name: &str| entries.iter().find(|(key, _)| key == name).map(|(_, value)| value);
        let (Some(descr), Some(Literal::Bool(is_fortran_order)), Some(Literal::List(shape))) =
            (entry("descr"), entry("fortran_order"), entry("shape"))
        else {
            return Err(damaged("its header lacks descr, fortran_order or shape"));
        };
        let length = |of: &Literal| match of {
            Literal::Number(number) => Ok(*number),
            _ => Err(damaged("its shape is none")),
        };
        let shape = shape.iter().map(length).collect::<Result<_, _>>()?;
        Ok(Self { element: element(descr)?, is_fortran_order: *is_fortran_order, shape })
    }
}

fn damaged(what: &str) -> Reason {
    Reason::damaged(FORMAT, what)
}

fn fill(input: &mut impl Read, bytes: &mut [u8]) -> Result<(), Reason> {
    input.read_exact(bytes).map_err(|error| Reason::ended(FORMAT, error))
}

fn element(descr: &Literal) -> Result<ElementType, Reason> {
    match descr {
        Literal::Text(text) => encoding(text).map(ElementType::Plain),
        Literal::List(fields) => {
            let fields = fields.iter().map(|field| {
                let Literal::List(field) = field else { return Err(damaged("a field has no name")) };
                let (name, inner, shape) = match field.as_slice() {
                    [name, inner] => (name, inner, &[][..]),
                    [name, inner, Literal::List(shape)] => (name, inner, shape.as_slice()),
                    _ => return Err(damaged("a field is none")),
                };
                // A title may come first.
                let name = match name {
                    Literal::Text(name) => name,
                    Literal::List(names) => match names.as_slice() {
                        [.., Literal::Text(name)] => name,
                        _ => return Err(damaged("a field has no name")),
                    },
                    _ => return Err(damaged("a field has no name")),
                };
                let mut of_field = element(inner)?;
                for length in shape.iter().rev() {
                    let Literal::Number(length) = length else { return Err(damaged("the shape of a field is none")) };
                    of_field = ElementType::Array(*length, Box::new(of_field));
                }
                Ok((name.clone(), of_field))
            });
            fields.collect::<Result<_, _>>().map(ElementType::Record)
        }
        _ => Err(damaged("its type is none")),
    }
}

fn encoding(text: &str) -> Result<Encoding, Reason> {
    let fault = || damaged(&format!("its type {text:?} is not known"));
    let mut letters = text.chars();
    let order = letters.next().ok_or_else(fault)?;
    let kind = letters.next().ok_or_else(fault)?;
    let size = letters.as_str().split('[').next().unwrap_or_default();
    let bytes = if size.is_empty() { 0 } else { size.parse().map_err(|_| fault())? };
    if !matches!(order, '<' | '>' | '|' | '=') || !kind.is_ascii_alphabetic() {
        return Err(fault());
    }
    Ok(Encoding { text: text.to_owned(), is_big_endian: order == '>', kind, bytes })
}

impl Encoding {
    /// As in `<M8[ns]`.
    pub(crate) fn time_unit(&self) -> Option<&str> {
        self.text.split_once('[').and_then(|(_, unit)| unit.strip_suffix(']'))
    }

    /// A number or time of a readable size.
    pub(crate) fn scalar(&self) -> Option<Scalar> {
        let bytes = self.bytes as u8;
        match (self.kind, self.bytes) {
            ('i', 1 | 2 | 4 | 8) | ('M' | 'm', 8) => Some(Scalar::Signed(bytes)),
            ('u' | 'b', 1 | 2 | 4 | 8) => Some(Scalar::Unsigned(bytes)),
            ('f', 2 | 4 | 8) => Some(Scalar::Float(bytes)),
            _ => None,
        }
    }
}

#[derive(Debug, Clone, PartialEq)]
enum Literal {
    Text(String),
    Number(u64),
    Bool(bool),
    List(Vec<Literal>),
    Dict(Vec<(String, Literal)>),
}

struct Parser<'a> {
    rest: &'a str,
    depth: usize,
}

impl Parser<'_> {
    fn literal(&mut self) -> Result<Literal, Reason> {
        self.rest = self.rest.trim_start();
        match self.rest.chars().next() {
            Some('{') => self.entries(),
            Some('(') => self.items(')'),
            Some('[') => self.items(']'),
            Some(quote @ ('\'' | '"')) => {
                let (text, rest) = self.rest[1..].split_once(quote).ok_or_else(|| damaged("a text does not end"))?;
                self.rest = rest;
                Ok(Literal::Text(text.to_owned()))
            }
            Some(digit) if digit.is_ascii_digit() => {
                let end = self.rest.find(|letter: char| !letter.is_ascii_digit()).unwrap_or(self.rest.len());
                let (number, rest) = self.rest.split_at(end);
                // Python 2 wrote 3L.
                self.rest = rest.strip_prefix('L').unwrap_or(rest);
                number.parse().map(Literal::Number).map_err(|_| damaged("a number is too large"))
            }
            _ => {
                let words = [("True", true), ("False", false)];
                let word = words.into_iter().find_map(|(word, value)| Some((self.rest.strip_prefix(word)?, value)));
                let (rest, value) = word.ok_or_else(|| damaged("its header is no literal"))?;
                self.rest = rest;
                Ok(Literal::Bool(value))
            }
        }
    }

    fn enter(&mut self) -> Result<(), Reason> {
        self.depth += 1;
        self.rest = &self.rest[1..];
        if self.depth > MOST_BRACKETS { Err(too_deep(MOST_BRACKETS)) } else { Ok(()) }
    }

    fn leave(&mut self, end: char) -> bool {
        self.rest = self.rest.trim_start();
        let Some(rest) = self.rest.strip_prefix(end) else { return false };
        self.rest = rest;
        self.depth -= 1;
        true
    }

    /// The last comma is optional.
    fn take(&mut self, sign: char) -> bool {
        self.rest = self.rest.trim_start();
        let rest = self.rest.strip_prefix(sign);
        self.rest = rest.unwrap_or(self.rest);
        rest.is_some()
    }

    fn items(&mut self, end: char) -> Result<Literal, Reason> {
        self.enter()?;
        let mut items = Vec::new();
        while !self.leave(end) {
            items.push(self.literal()?);
            if !self.take(',') && !self.rest.starts_with(end) {
                return Err(damaged("a bracket does not end"));
            }
        }
        Ok(Literal::List(items))
    }

    fn entries(&mut self) -> Result<Literal, Reason> {
        self.enter()?;
        let mut entries = Vec::new();
        while !self.leave('}') {
            let Literal::Text(key) = self.literal()? else { return Err(damaged("a key is no text")) };
            if !self.take(':') {
                return Err(damaged("a key has no value"));
            }
            entries.push((key, self.literal()?));
            if !self.take(',') && !self.rest.starts_with('}') {
                return Err(damaged("a bracket does not end"));
            }
        }
        Ok(Literal::Dict(entries))
    }
}

#[cfg(test)]
mod tests {
    use super::{ElementType, Header};
    use crate::input::input_error::Reason;

    fn header(text: &str) -> Result<Header, Reason> {
        let length = u16::try_from(text.len()).expect("short").to_le_bytes();
        Header::read(&mut [&b"\x93NUMPY\x01\x00"[..], &length, text.as_bytes()].concat().as_slice())
    }

    #[test]
    fn headers_of_numpy_are_understood() {
        let matrix =
            header("{'descr': '<f8', 'fortran_order': False, 'shape': (30, 4), }          \n").expect("a matrix");
        assert_eq!((matrix.shape.as_slice(), matrix.is_fortran_order), (&[30, 4][..], false));
        let ElementType::Plain(encoding) = matrix.element else { panic!("a plain type") };
        assert_eq!((encoding.kind, encoding.bytes, encoding.is_big_endian), ('f', 8, false));
        let times = header("{'descr': '>M8[ns]', 'fortran_order': True, 'shape': (7,), }").expect("a vector");
        let ElementType::Plain(encoding) = times.element else { panic!("a plain type") };
        assert_eq!((encoding.time_unit(), encoding.is_big_endian), (Some("ns"), true));
        let text = "{'descr': [('t', '<u8'), ('gyro', '<f4', (3,)), ('imu', [('ax', '<f4'), ('ay', '<f4')])], \
                    'fortran_order': False, 'shape': (5,), }";
        let ElementType::Record(fields) = header(text).expect("a record").element else { panic!("a record") };
        let names: Vec<&str> = fields.iter().map(|(name, _)| name.as_str()).collect();
        assert_eq!(names, ["t", "gyro", "imu"]);
        assert!(matches!(&fields[1].1, ElementType::Array(3, inner) if matches!(**inner, ElementType::Plain(_))));
        assert!(header("{'descr': '|O', 'fortran_order': False, 'shape': (), }").expect("an object").shape.is_empty());
    }

    #[test]
    fn damaged_headers_are_refused_and_deep_ones_at_once() {
        for text in
            ["", "{", "{'descr': }", "{'descr': '<f8', 'fortran_order': False, 'shape': (1", "[1, 2]", "{'descr': 'x'}"]
        {
            assert!(header(text).is_err(), "{text}");
        }
        let deep = "[".repeat(60_000);
        assert!(matches!(header(&deep), Err(Reason::Limit(_))));
    }
}
