//! Errors of an input file: place and reason.

use crate::columns::column_selection::SelectionError;
use std::fmt;
use std::io;
use std::path::{Path, PathBuf};

/// A file that cannot be used; `Display` is one line.
#[derive(Debug)]
pub struct InputError {
    /// As the user named it.
    pub file: PathBuf,
    /// Counted from 1, the header included; absent when the file as a whole is at fault.
    pub line: Option<u64>,
    /// Row of an array or message of a log, counted from 1, in files without lines.
    pub row: Option<u64>,
    /// Name of the column, where one column is at fault.
    pub column: Option<String>,
    /// Why it is refused.
    pub reason: Reason,
}

/// Why a file, a line or a field is refused.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Reason {
    #[error("{0}")]
    Io(io::Error),
    #[error("is a directory, not a file, and not that of one bag of ROS 2 in .mcap or .db3 files")]
    Directory,
    #[error("the file is empty")]
    Empty,
    #[error("no data after the header")]
    NoData,
    #[error("truncated gzip: the compressed data end early")]
    TruncatedGzip,
    #[error("damaged gzip: {0}")]
    DamagedGzip(io::Error),
    #[error("bytes after the end of the gzip data that are no gzip data")]
    TrailingBytes,
    #[error("more than 33554432 samples: give the recording in parts")]
    TooManySamples,
    #[error(
        "its data are more than {bytes} bytes, far more than a recording of this size has; decompress it or save it uncompressed"
    )]
    Expands {
        /// Bytes that are read at most.
        bytes: u64,
    },
    #[error("more than {values} numbers, far more than a recording of this size has; save it uncompressed")]
    TooManyValues {
        /// Numbers that are read at most.
        values: u64,
    },
    #[error("nested more than {most} levels deep")]
    TooDeep {
        /// Levels that are read.
        most: usize,
    },
    #[error("not read within {seconds} s, far longer than a recording of this size takes")]
    TooSlow {
        /// Time for a file of this size, s.
        seconds: u64,
    },
    #[error("{0}, which this program was built without; build it with the features hdf5 and sqlite")]
    NotBuilt(&'static str),
    #[error("{what}, which is not read; {how}")]
    Foreign {
        /// Description of the format.
        what: &'static str,
        how: &'static str,
    },
    #[error(
        "of no known format: it begins with {begins}; known are tables in text, NumPy, MATLAB, HDF5, bags of ROS, MCAP, ULog and \
         DataFlash logs; write its numbers as text or, in Python, with numpy.save(\"FILE.npy\", array)"
    )]
    UnknownBinary {
        /// The first bytes.
        begins: String,
    },
    #[error("not text in UTF-8 or Latin-1")]
    NotText,
    #[error("the line is longer than 65536 bytes")]
    LongLine,
    #[error("no known column; expected names such as gyro_x_counts")]
    NoChannel,
    #[error("this is an SPI frame log; read it with `replay`")]
    FrameLog,
    #[error("{found} fields, the header has {expected}")]
    FieldCount {
        /// Fields of this line.
        found: usize,
        expected: usize,
    },
    #[error("{0:?} is not a whole number")]
    NotInteger(String),
    #[error("{0:?} is not a number")]
    NotNumber(String),
    #[error("{0:?} is not a finite time")]
    NotFinite(String),
    #[error("{0:?} is no date or time as in the rows above")]
    NotTime(String),
    /// A count that the register's field cannot hold.
    #[error("{value} is outside {low}..={high}")]
    OutOfField {
        /// As read.
        value: i64,
        /// Smallest count of the field.
        low: i16,
        /// Largest count of the field.
        high: i16,
    },
    #[error("time {now} s is before {before} s of the row above")]
    TimeBackwards {
        /// Time of the row above, s.
        before: f64,
        /// Time of this row, s.
        now: f64,
    },
    #[error("sample {now} does not follow {before}")]
    IndexBackwards {
        /// Index of the row above.
        before: u64,
        now: u64,
    },
    #[error("{0:?} is not a row of hexadecimal bytes")]
    NotHex(String),
    #[error("{0} bytes are no whole number of 16-bit words")]
    OddBytes(usize),
    #[error("{mosi} bytes out but {miso} bytes in")]
    UnequalLengths {
        /// Bytes from the host.
        mosi: usize,
        miso: usize,
    },
    #[error("not an SPI frame log: the first line must be `time_s,mosi,miso`")]
    NotFrameLog,
    #[error("no burst transaction (26 bytes that start with 3E00)")]
    NoBurst,
    #[error("the gyro range changes from {before} to {now} deg/s between bursts; give each range its own log")]
    MixedRange {
        /// Range of the bursts above, deg/s.
        before: u16,
        /// Range of this burst, deg/s.
        now: u16,
    },
    #[error("no row of numbers: neither a table nor another known format")]
    NoNumbers,
    #[error("{0}")]
    Selection(Box<SelectionError>),
    #[error("column {0}: no unit of the time; give one, as in --units us")]
    NoTimeUnit(String),
    #[error(
        "the time goes back before row {row} by {by} of its units, and {rows} rows are earlier than one before them"
    )]
    ClockSetBack {
        /// The first such row, from 1.
        row: u64,
        /// In the unit of the column.
        by: f64,
        /// Such rows.
        rows: u64,
    },
    #[error("there is nothing to read in this {format}")]
    NoTopic {
        /// Name of the format.
        format: &'static str,
    },
    #[error(
        "no inertial sensor is known in this {format}; say which columns with --topic and --columns: it has {topics}"
    )]
    NoSensor {
        /// Name of the format.
        format: &'static str,
        topics: String,
    },
    #[error(
        "the messages of {} cannot be decoded: the file has no definition of {}; where that package is installed, `ros2 bag convert` to MCAP \
         writes it along",
        .0.0, .0.1
    )]
    NoDefinition(Box<(String, String)>),
    #[error(
        "the messages of {} are encoded in {}; those of ROS 1 and ROS 2 (ros1, cdr) are decoded; in Python, mcap.reader gives the messages, of \
         which a table is made by csv.writer",
        .0.0, .0.1
    )]
    Encoding(Box<(String, String)>),
    #[error("--topic {}: not in the file; it has {}", .0.0, .0.1)]
    UnknownTopic(Box<(String, String)>),
    #[error("several topics: choose one with --topic: {0}")]
    SeveralTopics(String),
    #[error("{0}; columns of one table have as many rows")]
    UnequalRows(String),
    #[error("{0}")]
    Array(String),
    #[error("damaged {format} file: {error}")]
    Format {
        /// Name of the format.
        format: &'static str,
        error: Box<str>,
    },
    #[error("truncated {format}: the data end early")]
    Truncated {
        /// Name of the format.
        format: &'static str,
    },
    #[error("replay over the bus: {0}")]
    Bus(String),
}

impl Reason {
    /// A limit of this program: the file may be intact.
    pub(crate) fn is_limit(&self) -> bool {
        matches!(
            self,
            Self::TooManySamples
                | Self::Expands { .. }
                | Self::TooManyValues { .. }
                | Self::TooDeep { .. }
                | Self::TooSlow { .. }
        )
    }

    /// A [`Metered`](crate::input::budget::Metered) refusal, or the error itself.
    pub(crate) fn from_io(error: io::Error) -> Self {
        match error.downcast::<Self>() {
            Ok(reason) => reason,
            Err(error) => Self::Io(error),
        }
    }
}

impl InputError {
    /// A fault of the file as a whole.
    pub fn file(file: &Path, reason: Reason) -> Self {
        Self { file: file.to_owned(), line: None, row: None, column: None, reason }
    }

    /// A fault of one line.
    pub fn line(file: &Path, line: u64, reason: Reason) -> Self {
        Self { file: file.to_owned(), line: Some(line), row: None, column: None, reason }
    }

    /// A fault of one field.
    pub fn field(file: &Path, line: u64, column: &str, reason: Reason) -> Self {
        Self { file: file.to_owned(), line: Some(line), row: None, column: Some(column.to_owned()), reason }
    }
}

impl InputError {
    /// A fault of one row of an array or one message of a log.
    pub fn row(file: &Path, row: u64, column: &str, reason: Reason) -> Self {
        Self { file: file.to_owned(), line: None, row: Some(row), column: Some(column.to_owned()), reason }
    }
}

impl fmt::Display for InputError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", Printable(&self.file.display().to_string()))?;
        if let Some(line) = self.line {
            write!(f, ": line {line}")?;
        }
        if let Some(row) = self.row {
            write!(f, ": row {row}")?;
        }
        if let Some(column) = &self.column {
            write!(f, ": column {}", Printable(column))?;
        }
        // Some describe a fault in several lines.
        let reason = self.reason.to_string();
        let lines: Vec<&str> = reason.lines().map(str::trim).filter(|line| !line.is_empty()).collect();
        write!(f, ": {}", lines.join(" "))
    }
}

impl std::error::Error for InputError {}

/// Escapes characters that a terminal obeys or that hide others.
#[derive(Debug, Clone, Copy)]
pub struct Printable<'a>(pub &'a str);

/// Invisible characters (Unicode Cf), and line ends.
fn is_format(c: char) -> bool {
    matches!(c,
        '\u{ad}' | '\u{600}'..='\u{605}' | '\u{61c}' | '\u{6dd}' | '\u{70f}' | '\u{180e}' | '\u{200b}'..='\u{200f}'
        | '\u{2028}'..='\u{202e}' | '\u{2060}'..='\u{206f}' | '\u{feff}' | '\u{fff9}'..='\u{fffb}' | '\u{e0000}'..='\u{e007f}')
}

impl fmt::Display for Printable<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for c in self.0.chars() {
            if c.is_control() || is_format(c) {
                write!(f, "{}", c.escape_default())?;
            } else {
                write!(f, "{c}")?;
            }
        }
        Ok(())
    }
}
