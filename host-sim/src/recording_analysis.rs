//! The analysis of one recording as a function: it takes a file, bytes or arrays and returns a report. Nothing is
//! printed or written.

use crate::analyze::report;
use crate::cli::{InputArguments, RecordingArguments, RecordingInMemory};
use crate::inspect::{Question, read_or_ask};
use crate::output::brief;
use crate::tip::tip;
use recordings::{InputError, MemoryTable, Printable, ReadMonitor, Reason};
use std::io::ErrorKind;
use std::path::PathBuf;
use std::sync::Arc;

pub use crate::output::Analysed;

/// The source of a recording.
#[derive(Debug, Clone)]
pub enum RecordingSource {
    /// A file of any format.
    File(PathBuf),
    /// The bytes of a file in memory, with its name.
    Bytes(String, Arc<[u8]>),
    /// Arrays, with their name.
    Arrays(String, Arc<MemoryTable>),
}

/// Options for reading and analysing a recording, as those of `analyze`.
#[derive(Debug, Clone, Default)]
pub struct AnalysisOptions {
    /// Sample rate, Hz; overrides the time stamps.
    pub rate_hz: Option<f64>,
    /// Assignments such as `gyro_x=wx`.
    pub columns: Vec<String>,
    /// Units, one per quantity, such as `deg/s`.
    pub units: Vec<String>,
    /// Topic, message or array of a file that has several.
    pub topic: Option<String>,
    /// Name of a sensor, or its profile file.
    pub sensor: Option<String>,
    /// True if only curves and models are wanted.
    pub is_quick: bool,
}

/// The reason for which a recording has no report.
#[derive(Debug, Clone, thiserror::Error)]
#[error("{text}")]
pub struct AnalysisError {
    /// Text of the command: the error, a tip, and the columns of a file that lacks information.
    pub text: String,
    /// The kind of the system's error, if it is one.
    pub system: Option<ErrorKind>,
}

/// Analyses a recording; `monitor` may stop its reading.
///
/// # Errors
/// The recording cannot be read, or lacks information.
pub fn analyze(
    source: RecordingSource,
    options: AnalysisOptions,
    monitor: &ReadMonitor,
) -> Result<Analysed, AnalysisError> {
    let (file, memory) = match source {
        RecordingSource::File(file) => (file, None),
        RecordingSource::Bytes(name, bytes) => (name.into(), Some(RecordingInMemory::Bytes(bytes))),
        RecordingSource::Arrays(name, arrays) => (name.into(), Some(RecordingInMemory::Arrays(arrays))),
    };
    let AnalysisOptions { rate_hz, columns, units, topic, sensor, is_quick } = options;
    let input = InputArguments { columns, units, topic, sensor, memory, ..InputArguments::new(&file) };
    let arguments = RecordingArguments { rate: rate_hz, ..RecordingArguments::new(input) };
    read_or_ask(&arguments, |arguments| report(arguments, is_quick, monitor, &mut |_, _| {})).map_err(|error| {
        let mut text = Printable(&brief(&format!("{error:#}"))).to_string();
        if let Some(tip) = tip(&error) {
            text += &format!("\n  tip: {}", Printable(&tip));
        }
        if let Some(question) = error.downcast_ref::<Question>() {
            text += &format!("\n{}", question.text);
        }
        let system = error.chain().find_map(|cause| match &cause.downcast_ref::<InputError>()?.reason {
            Reason::Io(error) => Some(error.kind()),
            _ => None,
        });
        AnalysisError { text, system }
    })
}
