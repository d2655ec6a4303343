//! Messages with defined fields, as in ROS and PX4: a column per number, such as `imu.angular_velocity.x` or `gyro[2]`.
//! The first 16 floats of a sequence are columns; longer arrays than 64 are skipped.

use crate::input::{Budget, Reason};
use crate::rows::Number;
use std::collections::HashMap;

/// Longest array with columns.
const MOST_ELEMENTS: usize = 64;
/// Columns of a sequence of floats.
const MOST_OF_SEQUENCE: usize = 16;
/// Definitions that use each other can ask for any number.
const MOST_STEPS: usize = 1 << 14;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Scalar {
    /// Bytes.
    Signed(u8),
    /// Bytes.
    Unsigned(u8),
    /// 2, 4 or 8 bytes.
    Float(u8),
}

impl Scalar {
    pub(crate) fn bytes(self) -> usize {
        let (Self::Signed(bytes) | Self::Unsigned(bytes) | Self::Float(bytes)) = self;
        usize::from(bytes)
    }

    /// At the start of `bytes`; NaN if they are too few.
    pub(crate) fn read(self, bytes: &[u8], is_big_endian: bool) -> Number {
        let size = self.bytes();
        let Some(own) = bytes.get(..size) else { return Number::Real(f64::NAN) };
        let mut word = [0; 8];
        match <[u8; 8]>::try_from(own) {
            Ok(whole) => word = whole,
            Err(_) => word[..size].copy_from_slice(own),
        }
        if is_big_endian {
            word[..size].reverse();
        }
        self.number(u64::from_le_bytes(word))
    }

    /// Uses [`bytes`](Self::bytes) of `word`.
    pub(crate) fn number(self, word: u64) -> Number {
        let unused = 64 - 8 * self.bytes() as u32;
        match self {
            Self::Signed(_) => Number::Integer((word << unused).cast_signed() >> unused),
            Self::Unsigned(_) => i64::try_from(word).map_or(Number::Real(word as f64), Number::Integer),
            Self::Float(2) => Number::Real(half(word as u16)),
            Self::Float(4) => Number::Real(f64::from(f32::from_bits(word as u32))),
            Self::Float(_) => Number::Real(f64::from_bits(word)),
        }
    }
}

/// IEEE 754 binary16.
fn half(bits: u16) -> f64 {
    let (exponent, fraction) = (i32::from(bits >> 10 & 0x1F), f64::from(bits & 0x3FF));
    let magnitude = match exponent {
        0 => fraction * 2f64.powi(-24),
        31 if fraction == 0.0 => f64::INFINITY,
        31 => f64::NAN,
        _ => (1024.0 + fraction) * 2f64.powi(exponent - 25),
    };
    if bits >> 15 == 1 { -magnitude } else { magnitude }
}

#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum FieldType {
    Scalar(Scalar),
    /// Seconds and ns of 32 bits; a column in ns.
    Time,
    /// 32-bit length and bytes.
    Text,
    Nested(String),
    /// Not decoded: ends the reading of a message.
    Unknown(String),
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Repeat {
    Once,
    Times(usize),
    /// 32-bit length first.
    Any,
}

#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Field {
    pub(crate) name: String,
    pub(crate) kind: FieldType,
    pub(crate) repeat: Repeat,
}

pub(crate) type Definitions = HashMap<String, Vec<Field>>;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Encoding {
    /// Little endian, unpadded: ROS 1 and PX4.
    Packed,
    /// CDR with a header of 4 bytes: ROS 2. Aligned to its size behind the header.
    Cdr,
}

#[derive(Debug, Clone)]
enum Step {
    Number(Scalar, Option<usize>),
    Time(Option<usize>),
    Text,
    /// 32-bit length; first column, number of columns.
    Sequence(Scalar, usize, usize),
    Repeat(Repeat, Vec<Step>),
    Unknown,
}

#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct MessageColumn {
    /// Path with `.`.
    pub(crate) name: String,
    /// ns.
    pub(crate) is_time: bool,
    pub(crate) is_float: bool,
}

#[derive(Debug, Clone)]
pub(crate) struct MessageLayout {
    columns: Vec<MessageColumn>,
    steps: Vec<Step>,
}

impl MessageLayout {
    /// Layout of the definition `root`; an error if one is missing, contains itself or is nested too deeply.
    pub(crate) fn new(root: &str, definitions: &Definitions) -> Result<Self, Reason> {
        let mut builder = Builder { definitions, columns: Vec::new(), steps: 0 };
        let steps = builder.steps_of(root, "", true, 0)?;
        Ok(Self { columns: builder.columns, steps })
    }

    /// Decodes wanted columns only, up to the last one.
    pub(crate) fn only(&self, is_wanted: impl Fn(usize) -> bool) -> Self {
        let mut steps: Vec<Step> = Vec::new();
        let mut end = 0;
        for step in &self.steps {
            let has_wanted = match step {
                Step::Number(_, column) | Step::Time(column) => column.is_some_and(&is_wanted),
                Step::Sequence(_, first, columns) => (*first..first + columns).any(&is_wanted),
                Step::Text | Step::Repeat(..) | Step::Unknown => false,
            };
            match (step, steps.last_mut()) {
                // Numbers of one size are skipped as one.
                (Step::Number(scalar, _), Some(Step::Repeat(Repeat::Times(count), each)))
                    if !has_wanted && matches!(each[..], [Step::Number(of, _)] if of.bytes() == scalar.bytes()) =>
                {
                    *count += 1;
                }
                (Step::Number(scalar, _), _) if !has_wanted => {
                    steps.push(Step::Repeat(Repeat::Times(1), vec![Step::Number(*scalar, None)]));
                }
                (step, _) => steps.push(step.clone()),
            }
            if has_wanted {
                end = steps.len();
            }
        }
        steps.truncate(end);
        Self { columns: self.columns.clone(), steps }
    }

    /// In the order of the message.
    pub(crate) fn columns(&self) -> &[MessageColumn] {
        &self.columns
    }

    /// One number per column; `None` if too short or of another encoding, with NaN for the rest of `row`.
    pub(crate) fn decode(&self, bytes: &[u8], encoding: Encoding, row: &mut Vec<Number>) -> Option<()> {
        row.clear();
        row.resize(self.columns.len(), Number::Real(f64::NAN));
        let mut cursor = Cursor::new(bytes, encoding)?;
        run(&self.steps, &mut cursor, row)
    }
}

struct Builder<'a> {
    definitions: &'a Definitions,
    columns: Vec<MessageColumn>,
    steps: usize,
}

impl Builder<'_> {
    /// Fields after `prefix`; columns if `named`.
    fn steps_of(&mut self, name: &str, prefix: &str, named: bool, level: usize) -> Result<Vec<Step>, Reason> {
        Budget::check_depth(level)?;
        let definitions = self.definitions;
        let Some(fields) = definitions.get(name) else {
            return Err(Reason::other(format!("no definition of {name:?} in the file")));
        };
        let mut steps = Vec::new();
        for field in fields {
            let path = if prefix.is_empty() { field.name.clone() } else { format!("{prefix}.{}", field.name) };
            match field.repeat {
                Repeat::Once => self.add(&mut steps, &field.kind, &path, named, level)?,
                Repeat::Times(count) if named && count <= MOST_ELEMENTS && field.kind != FieldType::Text => {
                    for element in 0..count {
                        self.add(&mut steps, &field.kind, &format!("{path}[{element}]"), true, level)?;
                    }
                }
                Repeat::Any if named && matches!(field.kind, FieldType::Scalar(Scalar::Float(_))) => {
                    let FieldType::Scalar(scalar) = field.kind else { continue };
                    self.count()?;
                    steps.push(Step::Sequence(scalar, self.columns.len(), MOST_OF_SEQUENCE));
                    let column = |element: usize| MessageColumn {
                        name: format!("{path}[{element}]"),
                        is_time: false,
                        is_float: true,
                    };
                    self.columns.extend((0..MOST_OF_SEQUENCE).map(column));
                }
                repeat => {
                    let mut each = Vec::new();
                    self.add(&mut each, &field.kind, &path, false, level)?;
                    self.count()?;
                    steps.push(Step::Repeat(repeat, each));
                }
            }
        }
        Ok(steps)
    }

    fn add(
        &mut self,
        steps: &mut Vec<Step>,
        kind: &FieldType,
        path: &str,
        named: bool,
        level: usize,
    ) -> Result<(), Reason> {
        self.count()?;
        let mut column = |is_time: bool, is_float: bool| {
            named.then(|| {
                self.columns.push(MessageColumn { name: path.to_owned(), is_time, is_float });
                self.columns.len() - 1
            })
        };
        match kind {
            FieldType::Scalar(scalar) => {
                steps.push(Step::Number(*scalar, column(false, matches!(scalar, Scalar::Float(_)))));
            }
            FieldType::Time => steps.push(Step::Time(column(true, false))),
            FieldType::Text => steps.push(Step::Text),
            FieldType::Nested(name) => steps.extend(self.steps_of(name, path, named, level + 1)?),
            FieldType::Unknown(_) => steps.push(Step::Unknown),
        }
        Ok(())
    }

    fn count(&mut self) -> Result<(), Reason> {
        self.steps += 1;
        let most = MOST_STEPS;
        let too_many = || Reason::other(format!("a message is defined to have more than {most} fields"));
        if self.steps > most { Err(too_many()) } else { Ok(()) }
    }
}

fn run(steps: &[Step], cursor: &mut Cursor, row: &mut [Number]) -> Option<()> {
    for step in steps {
        match step {
            Step::Number(scalar, column) => {
                let word = cursor.word(scalar.bytes())?;
                if let Some(column) = column {
                    row[*column] = scalar.number(word);
                }
            }
            Step::Time(column) => {
                let (seconds, nanoseconds) = (cursor.word(4)?, cursor.word(4)?);
                // Signed in ROS 2, unsigned in ROS 1.
                let seconds = seconds as u32;
                let seconds = if cursor.is_packed { i64::from(seconds) } else { i64::from(seconds.cast_signed()) };
                if let Some(column) = column {
                    row[*column] = Number::Integer(seconds * 1_000_000_000 + nanoseconds.cast_signed());
                }
            }
            Step::Text => {
                let length = cursor.word(4)?;
                cursor.skip(usize::try_from(length).ok()?)?;
            }
            Step::Sequence(scalar, first, columns) => {
                let count = usize::try_from(cursor.word(4)?).ok()?;
                for at in 0..count.min(*columns) {
                    row[first + at] = scalar.number(cursor.word(scalar.bytes())?);
                }
                if let Some(more) = count.checked_sub(*columns) {
                    cursor.skip(scalar.bytes().checked_mul(more)?)?;
                }
            }
            Step::Repeat(repeat, each) => {
                let count = match repeat {
                    Repeat::Once => 1,
                    Repeat::Times(count) => *count,
                    Repeat::Any => usize::try_from(cursor.word(4)?).ok()?,
                };
                if let [Step::Number(scalar, _)] = each.as_slice() {
                    if count > 0 {
                        cursor.align(scalar.bytes());
                        cursor.skip(scalar.bytes().checked_mul(count)?)?;
                    }
                    continue;
                }
                for _ in 0..count {
                    let before = cursor.at;
                    run(each, cursor, row)?;
                    if cursor.at == before {
                        // Takes no bytes.
                        break;
                    }
                }
            }
            Step::Unknown => return None,
        }
    }
    Some(())
}

struct Cursor<'a> {
    bytes: &'a [u8],
    at: usize,
    /// Origin of alignment, and its largest step.
    origin: usize,
    most: usize,
    is_big: bool,
    is_packed: bool,
}

impl<'a> Cursor<'a> {
    fn new(bytes: &'a [u8], encoding: Encoding) -> Option<Self> {
        const ENCAPSULATION: usize = 4;
        let (most, is_big) = match encoding {
            Encoding::Packed => return Some(Self { bytes, at: 0, origin: 0, most: 1, is_big: false, is_packed: true }),
            // Plain CDR 1 and 2 (DDS-XTypes 1.3, table 60) differ in 8 bytes.
            Encoding::Cdr => match bytes.get(..2)? {
                [0, 0] => (8, true),
                [0, 1] => (8, false),
                [0, 6] => (4, true),
                [0, 7] => (4, false),
                _ => return None,
            },
        };
        bytes.get(..ENCAPSULATION)?;
        Some(Self { bytes, at: ENCAPSULATION, origin: ENCAPSULATION, most, is_big, is_packed: false })
    }

    fn align(&mut self, size: usize) {
        self.at = self.origin + (self.at - self.origin).next_multiple_of(size.min(self.most));
    }

    fn skip(&mut self, bytes: usize) -> Option<()> {
        self.at = self.at.checked_add(bytes).filter(|at| *at <= self.bytes.len())?;
        Some(())
    }

    fn word(&mut self, size: usize) -> Option<u64> {
        self.align(size);
        let own = self.bytes.get(self.at..self.at.checked_add(size)?)?;
        self.at += size;
        let word = match *own {
            [byte] => u64::from(byte),
            [a, b] => u64::from(u16::from_le_bytes([a, b])),
            [a, b, c, d] => u64::from(u32::from_le_bytes([a, b, c, d])),
            _ => u64::from_le_bytes(own.try_into().ok()?),
        };
        Some(if self.is_big { word.swap_bytes() >> (64 - 8 * size) } else { word })
    }
}

#[cfg(test)]
mod tests {
    use super::Encoding;
    use crate::formats::ros_definition::{RosVersion, layout};
    use crate::rows::Number;

    /// 2065 in ROS 1; before 1970 in ROS 2.
    #[test]
    fn seconds_beyond_31_bits_are_those_of_the_version() {
        let stamp = [3_000_000_000u32.to_le_bytes(), 500u32.to_le_bytes()].concat();
        for (version, kind, encoding, head, expected) in [
            (RosVersion::Ros1, "time", Encoding::Packed, &[][..], 3_000_000_000_000_000_500),
            (RosVersion::Ros2, "builtin_interfaces/Time", Encoding::Cdr, &[0, 1, 0, 0], -1_294_967_295_999_999_500),
        ] {
            let layout = layout("test/Stamp", &format!("{kind} stamp\n"), version).expect("a definition");
            let mut row = Vec::new();
            layout.decode(&[head, &stamp].concat(), encoding, &mut row).expect("a message");
            assert_eq!(row, [Number::Integer(expected)], "{kind}");
        }
    }
}
