//! A file of either format, opened once: it may be a pipe.

use crate::count_table::CountTable;
use crate::delimited_text::Lines;
use crate::frame_log::{FrameLogReader, HEADER};
use crate::input_error::InputError;
use std::path::Path;

/// An open recording, told apart by its header.
pub enum RecordedFile {
    /// A table of register counts.
    Table(CountTable),
    /// A log of the SPI bus.
    FrameLog(FrameLogReader),
}

impl RecordedFile {
    /// Opens `file`, plain or gzip.
    ///
    /// # Errors
    /// The file cannot be read, or its header is that of neither format.
    pub fn open(file: &Path) -> Result<Self, InputError> {
        let mut lines = Lines::open(file)?;
        if lines.header()? == Some(HEADER) {
            FrameLogReader::new(file, lines).map(Self::FrameLog)
        } else {
            CountTable::new(file, lines).map(Self::Table)
        }
    }
}
