//! The header of a NumPy array (format 1.0 to 3.0), a literal of Python.

use crate::formats::message_layout::Scalar;
use crate::input::{Reason, too_deep};
use serde_json::Value;
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
        let header: Value = serde_json::from_str(&json(&text)?).map_err(|_| damaged("its header is no literal"))?;
        let (Some(is_fortran_order), Some(shape)) = (header["fortran_order"].as_bool(), header["shape"].as_array())
        else {
            return Err(damaged("its header lacks descr, fortran_order or shape"));
        };
        let shape: Option<Vec<u64>> = shape.iter().map(Value::as_u64).collect();
        let shape = shape.ok_or_else(|| damaged("its shape is none"))?;
        Ok(Self { element: element(&header["descr"])?, is_fortran_order, shape })
    }
}

fn damaged(what: &str) -> Reason {
    Reason::damaged(FORMAT, what)
}

fn fill(input: &mut impl Read, bytes: &mut [u8]) -> Result<(), Reason> {
    input.read_exact(bytes).map_err(|error| Reason::ended(FORMAT, error))
}

fn element(descr: &Value) -> Result<ElementType, Reason> {
    match descr {
        Value::String(text) => encoding(text).map(ElementType::Plain),
        Value::Array(fields) => {
            let fields = fields.iter().map(|field| {
                let (name, inner, shape) = match field.as_array().map(Vec::as_slice) {
                    Some([name, inner]) => (name, inner, &[][..]),
                    Some([name, inner, Value::Array(shape)]) => (name, inner, shape.as_slice()),
                    _ => return Err(damaged("a field is none")),
                };
                // A title may come first.
                let name = name.as_array().and_then(|names| names.last()).unwrap_or(name);
                let name = name.as_str().ok_or_else(|| damaged("a field has no name"))?;
                let mut of_field = element(inner)?;
                for length in shape.iter().rev() {
                    let length = length.as_u64().ok_or_else(|| damaged("the shape of a field is none"))?;
                    of_field = ElementType::Array(length, Box::new(of_field));
                }
                Ok((name.to_owned(), of_field))
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

/// The literal as JSON: other brackets and quotation marks, no comma before a bracket, `true` for `True`, 3 for Python 2's `3L`.
fn json(literal: &str) -> Result<String, Reason> {
    let mut json = String::with_capacity(literal.len());
    let (mut quote, mut depth) = (None, 0);
    for letter in literal.chars() {
        match (quote, letter) {
            (Some(mark), letter) if letter == mark => {
                quote = None;
                json.push('"');
            }
            (Some(_), letter) => {
                json.extend(Some('\\').filter(|_| ['"', '\\'].contains(&letter)));
                json.push(letter);
            }
            (None, '\'' | '"') => {
                quote = Some(letter);
                json.push('"');
            }
            (None, '(' | '[' | '{') => {
                depth += 1;
                if depth > MOST_BRACKETS {
                    return Err(too_deep(MOST_BRACKETS));
                }
                json.push(if letter == '(' { '[' } else { letter });
            }
            (None, ')' | ']' | '}') => {
                depth = depth.saturating_sub(1);
                json.truncate(json.trim_end_matches([',', ' ']).len());
                json.push(if letter == ')' { ']' } else { letter });
            }
            (None, 'L') => {}
            (None, letter) => json.push(letter.to_ascii_lowercase()),
        }
    }
    Ok(json)
}

#[cfg(test)]
mod tests {
    use super::{ElementType, Header};
    use crate::input::Reason;

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
        // Names with the signs of a literal, and Python 2.
        let text = "{\"descr\": [('a) \\ \"b\", Labc', '<i2')], 'fortran_order': False, 'shape': (3L,), }";
        let of_python_2 = header(text).expect("a record");
        let ElementType::Record(fields) = of_python_2.element else { panic!("a record") };
        assert_eq!((fields[0].0.as_str(), of_python_2.shape.as_slice()), ("a) \\ \"b\", Labc", &[3][..]));
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
