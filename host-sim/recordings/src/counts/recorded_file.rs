//! A table of register counts, or what was on the SPI bus, opened once: it may be a pipe.

use crate::counts::frame_log::{FrameLogReader, HEADER};
use crate::counts::spi_export::{self, CapturedFrame, SpiExportReader};
use readers::delimited_text::Lines;
use readers::{FileBytes, InputError};

/// An open recording, told apart by its header.
pub enum RecordedFile {
    /// A table.
    Table,
    /// Transactions of the SPI bus.
    Frames(FrameReader),
}

/// Transactions of the SPI bus, by this program or by a logic analyzer.
pub enum FrameReader {
    /// A log of this program.
    Log(FrameLogReader),
    /// An export of a logic analyzer.
    Export(Box<SpiExportReader>),
}

impl RecordedFile {
    /// Opens `file`, plain or gzip.
    ///
    /// # Errors
    /// The file cannot be read, or its header is that of none of the formats.
    pub fn open(file: &FileBytes) -> Result<Self, InputError> {
        let mut lines = Lines::open(file)?;
        let header = lines.header()?;
        if header == Some(HEADER) {
            FrameLogReader::new(file.name(), lines).map(|log| Self::Frames(FrameReader::Log(log)))
        } else if header.is_some_and(spi_export::is_header) {
            SpiExportReader::new(file.name(), lines).map(|export| Self::Frames(FrameReader::Export(Box::new(export))))
        } else {
            Ok(Self::Table)
        }
    }
}

impl FrameReader {
    /// The next transaction; `None` at the end.
    ///
    /// # Errors
    /// A line is not what the format has.
    #[expect(clippy::should_implement_trait, reason = "fallible: an iterator would yield errors for ever")]
    pub fn next(&mut self) -> Result<Option<CapturedFrame>, InputError> {
        match self {
            Self::Log(log) => Ok(log.next()?.map(|frame| CapturedFrame { frame, end_s: None })),
            Self::Export(export) => export.next(),
        }
    }

    /// Line of the transaction that was read last, from 1.
    pub fn line(&self) -> u64 {
        match self {
            Self::Log(log) => log.line(),
            Self::Export(export) => export.line(),
        }
    }
}
