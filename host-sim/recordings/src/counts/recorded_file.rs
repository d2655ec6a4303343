//! SPI transactions of this program or a logic analyzer.

use crate::counts::frame_log::{FrameLogReader, HEADER};
use crate::counts::spi_export::{self, CapturedFrame, SpiExportReader};
use readers::delimited_text::Lines;
use readers::{FileBytes, InputError};

/// Transactions of the SPI bus, by this program or by a logic analyzer.
pub enum FrameReader {
    Log(FrameLogReader),
    Export(Box<SpiExportReader>),
}

impl FrameReader {
    /// Opens `file`, plain or gzip; `None` for a table.
    ///
    /// # Errors
    /// The file cannot be read, or its header is that of none of the formats.
    pub fn open(file: &FileBytes) -> Result<Option<Self>, InputError> {
        let mut lines = Lines::open(file)?;
        Ok(match lines.header()? {
            Some(HEADER) => Some(Self::Log(FrameLogReader::new(file.name(), lines)?)),
            Some(header) if spi_export::is_header(header) => {
                Some(Self::Export(Box::new(SpiExportReader::new(file.name(), lines)?)))
            }
            _ => None,
        })
    }

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
