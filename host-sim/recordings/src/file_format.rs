//! Formats: ADIS16405 counts and bus logs, or any sensor.

use crate::batch_source::{BatchSource, field};
use crate::counts::{count_table_writer, frame_log, recorded_file, serial};
use adis16405_driver::{Channel, GyroRange};
use measurement::{ChannelProfile, SensorProfile, adis16405};
use readers::inspection::InspectedTable;
use readers::{
    ColumnSelection, FileBytes, FileHash, FileRows, HEAD_BYTES, InputError, InputFile, MemoryTable, ReadMonitor,
    Reason, RowOptions, SensorChannel, SensorChannels, is_output_register,
};
use std::io::{self, BufReader};
use std::ops::Deref;
use std::path::Path;
use std::sync::Arc;
use tempfile::NamedTempFile;

pub use readers::{FileFormat, TopicDescription, files_of_bag};

/// The recording as the user states it.
#[derive(Debug, Clone, PartialEq)]
pub struct ReadOptions {
    pub sensor: SensorProfile,
    /// Columns and units.
    pub selection: ColumnSelection,
    pub topic: Option<String>,
}

/// The part of a profile that the readers need.
fn channels_of(sensor: &SensorProfile) -> SensorChannels {
    let channel = |of: &ChannelProfile| {
        let has_counts = *of != ChannelProfile::generic(of.name, of.quantity);
        SensorChannel { name: of.name, unit: of.quantity.unit(), lsb: Some(of.lsb).filter(|_| has_counts) }
    };
    SensorChannels { name: sensor.name, channels: sensor.channels.iter().map(channel).collect() }
}

/// The format of a recording.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RecordedFormat {
    /// Register counts of an ADIS16405 in CSV, plain or gzip.
    CountTable,
    /// A log of the SPI bus: `time_s,mosi,miso`.
    FrameLog,
    /// An export of a logic analyzer's SPI decoder.
    SpiExport,
    File(FileFormat),
}

impl RecordedFormat {
    /// Name for messages.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::CountTable => "register counts of an ADIS16405",
            Self::FrameLog | Self::SpiExport => "a log of the SPI bus of an ADIS16405",
            Self::File(format) => format.name(),
        }
    }

    /// True for a table or replayable log.
    #[must_use]
    pub fn is_text(self) -> bool {
        matches!(self, Self::CountTable | Self::FrameLog | Self::SpiExport | Self::File(FileFormat::TextTable))
    }
}

/// A re-readable recording of known format.
#[derive(Debug)]
pub struct RecordedInput {
    file: InputFile,
    format: RecordedFormat,
    /// The raw stream behind a frame log.
    capture: Option<FileBytes>,
}

impl RecordedInput {
    /// Opens `name`, `-` for standard input, as [`InputFile::open`]; a raw stream becomes a frame log.
    ///
    /// # Errors
    /// The file cannot be read or copied, or it has none of the formats.
    pub fn open(name: &Path) -> Result<Self, InputError> {
        Self::open_monitored(name, &ReadMonitor::default())
    }

    /// As [`open`](Self::open); `monitor` counts bytes and may stop pipes, text and arrays.
    ///
    /// # Errors
    /// As [`open`](Self::open).
    pub fn open_monitored(name: &Path, monitor: &ReadMonitor) -> Result<Self, InputError> {
        Self::recognised(name, InputFile::files(name, monitor)?, monitor)
    }

    /// Opens bytes in memory that are called `name`.
    ///
    /// # Errors
    /// They have none of the formats, or are too many once they are decompressed.
    pub fn in_memory_monitored(
        name: &Path,
        bytes: impl Into<Arc<[u8]>>,
        monitor: &ReadMonitor,
    ) -> Result<Self, InputError> {
        Self::recognised(name, vec![FileBytes::in_memory(name, bytes)], monitor)
    }

    /// Arrays in memory that are called `name`.
    #[must_use]
    pub fn of_arrays(name: &Path, arrays: Arc<MemoryTable>, monitor: &ReadMonitor) -> Self {
        let file = InputFile::of_arrays(name, arrays, monitor);
        Self { file, format: RecordedFormat::File(FileFormat::Arrays), capture: None }
    }

    fn recognised(name: &Path, mut files: Vec<FileBytes>, monitor: &ReadMonitor) -> Result<Self, InputError> {
        let fail = |error| InputError::file(name, Reason::Io(error));
        let mut capture = None;
        if let [only] = files.as_mut_slice()
            && serial::is_capture(&only.head(HEAD_BYTES).map_err(fail)?)
        {
            let log = log_of_capture(name, only).map_err(fail)?;
            capture = Some(std::mem::replace(only, log));
        }
        let file = InputFile::recognised(name, files, monitor)?;
        let format = match file.format() {
            FileFormat::TextTable => match file.first_line()?.as_str() {
                frame_log::HEADER => RecordedFormat::FrameLog,
                header if recorded_file::is_export(header) => RecordedFormat::SpiExport,
                header if count_table_writer::is_header(header) => RecordedFormat::CountTable,
                _ => RecordedFormat::File(FileFormat::TextTable),
            },
            format => RecordedFormat::File(format),
        };
        Ok(Self { file, format, capture })
    }

    /// The recognised format.
    #[must_use]
    pub fn format(&self) -> RecordedFormat {
        self.format
    }

    /// Begins to make the hash of the bytes, as they were given.
    pub fn begin_hash(&self) -> io::Result<FileHash> {
        match &self.capture {
            Some(capture) => FileHash::begin(std::slice::from_ref(capture)),
            None => self.file.begin_hash(),
        }
    }

    /// Rows of any sensor, or register counts; an error for damage, a failed choice, or a log of the SPI bus.
    pub(crate) fn rows(&self, options: &ReadOptions, are_registers: bool) -> Result<FileRows<'_>, InputError> {
        self.check_columns()?;
        rows(&self.file, options, are_registers)
    }

    /// [`rows`](Self::rows) with the validator's verdicts, for rates in `range`.
    pub(crate) fn batches(
        &self,
        options: &ReadOptions,
        range: Option<GyroRange>,
    ) -> Result<BatchSource<'_>, InputError> {
        Ok(BatchSource::file(self.rows(options, range.is_some())?, &options.sensor, range))
    }

    fn check_columns(&self) -> Result<(), InputError> {
        match self.format {
            RecordedFormat::FrameLog | RecordedFormat::SpiExport => {
                let told = "this is an SPI frame log; read it with `replay`";
                Err(InputError::file(self.name(), Reason::other(told)))
            }
            RecordedFormat::CountTable | RecordedFormat::File(_) => Ok(()),
        }
    }

    /// Content without an analysis, of the named topic or all inertial sensors; `selection` is the user's.
    ///
    /// # Errors
    /// The file is damaged, has no rows of numbers, or is a log of the SPI bus, which has no columns.
    pub fn inspect(&self, topic: Option<&str>, selection: &ColumnSelection) -> Result<Vec<InspectedTable>, InputError> {
        self.check_columns()?;
        let is_of_registers = |names: &[&str]| match self.format {
            RecordedFormat::CountTable => true,
            format => format.is_text() && names.iter().any(|name| is_output_register(name)),
        };
        let sensor = |names: &[&str]| {
            let of_part = || channels_of(&adis16405::profile(adis16405::GYRO_LSB_300));
            if is_of_registers(names) { of_part() } else { SensorChannels::generic() }
        };
        let mut tables = self.file.inspect(topic, selection, &sensor)?;
        for table in &mut tables {
            let has_registers = table.columns.iter().any(|column| is_output_register(&column.name));
            for proposal in table.proposals.iter_mut().filter(|_| has_registers) {
                proposal.sensor = Some("adis16405");
                proposal.is_guessed = true;
            }
        }
        Ok(tables)
    }
}

impl Deref for RecordedInput {
    type Target = InputFile;

    fn deref(&self) -> &InputFile {
        &self.file
    }
}

/// Frame log of a raw stream, in a temporary file where the system has files.
fn log_of_capture(name: &Path, capture: &FileBytes) -> io::Result<FileBytes> {
    let capture = BufReader::new(capture.open()?);
    if cfg!(target_family = "wasm") {
        let mut log = Vec::new();
        serial::log_of_capture(capture, &mut log)?;
        return Ok(FileBytes::in_memory(name, log));
    }
    let mut log = NamedTempFile::new()?;
    serial::log_of_capture(capture, log.as_file_mut())?;
    Ok(FileBytes::in_temporary_file(name, log))
}

pub(crate) fn rows<'a>(
    file: &'a InputFile,
    options: &ReadOptions,
    are_registers: bool,
) -> Result<FileRows<'a>, InputError> {
    let register = |name: &str| {
        let channel = Channel::ALL.into_iter().find(|channel| are_registers && channel.name() == name);
        channel.map(field)
    };
    let ReadOptions { sensor, selection, topic } = options.clone();
    file.rows(&RowOptions { sensor: channels_of(&sensor), selection, topic }, &register)
}

pub(crate) fn options_of_counts(range: GyroRange) -> ReadOptions {
    let sensor = adis16405::profile(range.lsb());
    ReadOptions { sensor, selection: ColumnSelection::default(), topic: None }
}
