//! Errors of an input file: place and reason.

use crate::columns::{Printable, SelectionError};
use std::borrow::Cow;
use std::fmt;
use std::io;
use std::path::{Path, PathBuf};
use time_base::TimeBaseError;

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
    pub reason: Reason,
}

/// Why a file, a line or a field is refused.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Reason {
    #[error("{0}")]
    Io(io::Error),
    #[error("the file is empty")]
    Empty,
    #[error("no data after the header")]
    NoData,
    #[error("more than 33554432 samples: give the recording in parts")]
    TooManySamples,
    /// A limit of this program: the file may be intact.
    #[error("{0}")]
    Limit(String),
    #[error("{what}, which is not read; {how}")]
    Foreign {
        /// Description of the format.
        what: &'static str,
        how: &'static str,
    },
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
    #[error("no row of numbers: neither a table nor another known format")]
    NoNumbers,
    #[error("{0}")]
    Selection(Box<SelectionError>),
    #[error("column {0}: no unit of the time; give one, as in --units us")]
    NoTimeUnit(String),
    #[error("{0}; columns of one table have as many rows")]
    UnequalRows(String),
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
    #[error("--topic {}: not in the file; it has {}", .0.0, .0.1)]
    UnknownTopic(Box<(String, String)>),
    #[error("several topics: choose one with --topic: {0}")]
    SeveralTopics(String),
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
    #[error("{0}")]
    Other(Cow<'static, str>),
}

impl Reason {
    pub fn other(told: impl Into<Cow<'static, str>>) -> Self {
        Self::Other(told.into())
    }

    pub(crate) fn damaged(format: &'static str, error: impl Into<Box<str>>) -> Self {
        Self::Format { format, error: error.into() }
    }

    pub(crate) fn is_limit(&self) -> bool {
        matches!(self, Self::TooManySamples | Self::Limit(_))
    }

    /// A [`Metered`](crate::input::Metered) refusal, or the error itself.
    pub(crate) fn from_io(error: io::Error) -> Self {
        match error.downcast::<Self>() {
            Ok(reason) => reason,
            Err(error) => Self::Io(error),
        }
    }

    /// An early end of a file in `format`, or as [`from_io`](Self::from_io).
    pub(crate) fn ended(format: &'static str, error: io::Error) -> Self {
        match error.kind() {
            io::ErrorKind::UnexpectedEof => Self::Truncated { format },
            _ => Self::from_io(error),
        }
    }
}

impl InputError {
    /// A fault of the file as a whole.
    pub fn file(file: &Path, reason: Reason) -> Self {
        Self { file: file.to_owned(), line: None, row: None, column: None, reason }
    }

    pub fn line(file: &Path, line: u64, reason: Reason) -> Self {
        Self { file: file.to_owned(), line: Some(line), row: None, column: None, reason }
    }

    pub fn field(file: &Path, line: u64, column: &str, reason: Reason) -> Self {
        Self { file: file.to_owned(), line: Some(line), row: None, column: Some(column.to_owned()), reason }
    }

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

/// Why a recording cannot be read in blocks.
#[derive(Debug, thiserror::Error)]
pub enum StreamError {
    /// The file is damaged, or its columns cannot be chosen.
    #[error(transparent)]
    Input(#[from] InputError),
    #[error(transparent)]
    TimeBase(#[from] TimeBaseError),
}
