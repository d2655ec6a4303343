//! Which format a file has, by its content; and the reading of any of them.

use crate::columns::column_selection::{ColumnSelection, is_output_register};
use crate::counts::count_table_writer;
use crate::counts::frame_log;
use crate::counts::{serial, spi_export};
use crate::formats::ardupilot_log::{self, ArduPilotSource};
#[cfg(feature = "hdf5")]
use crate::formats::hdf5::Hdf5Reader;
use crate::formats::matlab::MatReader;
use crate::formats::mcap_bag::McapSource;
use crate::formats::numpy::{NpyReader, NpzReader};
use crate::formats::ros_bag::RosBagSource;
#[cfg(feature = "sqlite")]
use crate::formats::sqlite_bag::SqliteSource;
use crate::formats::text_table::TextRows;
pub use crate::formats::topics::TopicDescription;
use crate::formats::topics::{self, Source, TopicRows};
use crate::formats::ulog::UlogSource;
use crate::formats::{foreign_format, text_table};
use crate::input::budget::{Budget, Metered};
use crate::input::delimited_text::{Lines, is_utf16};
use crate::input::file_hash::FileHash;
use crate::input::gzip_members::{GZIP_MAGIC, GzipMembers};
use crate::input::input_error::{InputError, Reason};
use crate::input::read_monitor::{Counted, ReadMonitor};
use crate::input::zstd_frames::{ZSTD_MAGIC, ZstdFrames};
use crate::inspection::InspectedTable;
use crate::rows::any_sensor::ReadOptions;
use crate::rows::row_source::{BatchSource, FileRows, RowSource};
use crate::rows::whole_table::WholeTable;
use crate::time_base::time_base_error::StreamError;
use adis16405_driver::GyroRange;
use measurement::{SensorProfile, adis16405};
use std::fs::File;
use std::io::{self, BufReader, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::thread;
use std::time::Duration;
use tempfile::NamedTempFile;

/// Bytes that tell a format: several messages of the raw stream.
const HEAD_BYTES: u64 = 1 << 14;

/// The format of a recording.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FileFormat {
    /// Register counts of an ADIS16405 in CSV, plain or gzip.
    CountTable,
    /// A log of the SPI bus: `time_s,mosi,miso`.
    FrameLog,
    /// An export of a logic analyzer's SPI decoder.
    SpiExport,
    /// A table of numbers in any units.
    TextTable,
    /// One array of NumPy.
    Npy,
    /// An archive of arrays of NumPy.
    Npz,
    /// MATLAB, level 5.
    Mat,
    /// A bag of ROS 1.
    RosBag,
    /// MCAP, of ROS 2 or Foxglove.
    Mcap,
    /// A bag of ROS 2 in SQLite.
    Sqlite,
    /// A log of PX4.
    Ulog,
    /// A DataFlash log of ArduPilot.
    ArduPilot,
    /// HDF5, which is also MATLAB 7.3.
    Hdf5,
}

impl FileFormat {
    /// What it is called in a sentence.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::CountTable => "register counts of an ADIS16405",
            Self::FrameLog | Self::SpiExport => "a log of the SPI bus of an ADIS16405",
            Self::TextTable => "text",
            Self::Npy => "an array of NumPy",
            Self::Npz => "arrays of NumPy",
            Self::Mat => "MATLAB",
            Self::RosBag => "a bag of ROS 1",
            Self::Mcap => "MCAP",
            Self::Sqlite => "a bag of ROS 2 in SQLite",
            Self::Ulog => "a log of PX4",
            Self::ArduPilot => "a DataFlash log of ArduPilot",
            Self::Hdf5 => "HDF5",
        }
    }

    /// Whether the file is text: a table or a log that may be replayed.
    pub fn is_text(self) -> bool {
        matches!(self, Self::CountTable | Self::FrameLog | Self::SpiExport | Self::TextTable)
    }
}

/// First bytes of the binary formats.
const MAGICS: [(&[u8], FileFormat); 8] = [
    (b"\x93NUMPY", FileFormat::Npy),
    (b"PK\x03\x04", FileFormat::Npz),
    (b"MATLAB 5.0 MAT-file", FileFormat::Mat),
    (b"#ROSBAG V2.0", FileFormat::RosBag),
    (b"\x89MCAP0\r\n", FileFormat::Mcap),
    (b"SQLite format 3\0", FileFormat::Sqlite),
    (b"ULog\x01\x12\x35", FileFormat::Ulog),
    (&ardupilot_log::MAGIC, FileFormat::ArduPilot),
];

/// An input that can be read more than once: a file, or a copy of what came through a pipe or was compressed.
#[derive(Debug)]
pub struct InputFile {
    /// As the user named it.
    name: PathBuf,
    copy: Option<NamedTempFile>,
    format: FileFormat,
    monitor: ReadMonitor,
    budget: Budget,
}

impl InputFile {
    /// Opens `name`, `-` for standard input, and recognises its format. A pipe is copied to a temporary file, and so is a
    /// compressed file of a binary format. Bytes that a device sent while its raw stream was on become a frame log.
    ///
    /// # Errors
    /// The file cannot be read or copied, or it has none of the formats.
    pub fn open(name: &Path) -> Result<Self, InputError> {
        Self::open_monitored(name, &ReadMonitor::default())
    }

    /// As [`open`](Self::open); `monitor` counts the bytes that are read of the recording, and may stop the reading of a pipe, of
    /// text and of an array.
    ///
    /// # Errors
    /// As [`open`](Self::open).
    pub fn open_monitored(name: &Path, monitor: &ReadMonitor) -> Result<Self, InputError> {
        let fail = |error| InputError::file(name, Reason::Io(error));
        let mut copy = None;
        if name == Path::new("-") {
            copy = Some(copied_pipe(io::stdin(), monitor).map_err(fail)?);
        } else {
            let metadata = name.metadata().map_err(fail)?;
            if metadata.is_dir() {
                return Err(InputError::file(name, Reason::Directory));
            }
            if !metadata.is_file() {
                copy = Some(copied_pipe(File::open(name).map_err(fail)?, monitor).map_err(fail)?);
            }
        }
        let budget = Budget::of_file(copy.as_ref().map_or(name, NamedTempFile::path)).map_err(fail)?;
        // Of compressed text, what is in it.
        let mut text = None;
        let mut head = head(copy.as_ref().map_or(name, NamedTempFile::path)).map_err(fail)?;
        if head.starts_with(&GZIP_MAGIC) {
            let compressed = File::open(copy.as_ref().map_or(name, NamedTempFile::path)).map_err(fail)?;
            let mut inner = GzipMembers::new(BufReader::new(compressed));
            let mut start = Vec::new();
            // Damage is reported with its line where the whole is read.
            let _ = inner.by_ref().take(HEAD_BYTES).read_to_end(&mut start);
            if binary_format(&start).is_some() {
                let whole = Metered::new(start.as_slice().chain(inner), budget.meter());
                copy = Some(copied(whole).map_err(|error| InputError::file(name, Reason::from_io(error)))?);
                head = start;
            } else {
                text = Some(start);
            }
        }
        if head.starts_with(&ZSTD_MAGIC) {
            let compressed = File::open(copy.as_ref().map_or(name, NamedTempFile::path)).map_err(fail)?;
            let whole = ZstdFrames::new(BufReader::new(compressed));
            let expanded = copied(Metered::new(whole, budget.meter()));
            let expanded = expanded.map_err(|error| InputError::file(name, Reason::from_io(error)))?;
            head = self::head(expanded.path()).map_err(fail)?;
            copy = Some(expanded);
        }
        let format = match binary_format(&head) {
            Some(format) => format,
            None if serial::is_capture(&head) => {
                let log = NamedTempFile::new().map_err(fail)?;
                let capture = File::open(copy.as_ref().map_or(name, NamedTempFile::path)).map_err(fail)?;
                serial::log_of_capture(BufReader::new(capture), log.path()).map_err(fail)?;
                copy = Some(log);
                FileFormat::FrameLog
            }
            None if foreign_format::is_report(&head) => {
                return Err(InputError::file(name, foreign_format::REPORT));
            }
            None if foreign_format::is_json_document(&head) => {
                return Err(InputError::file(name, foreign_format::JSON_DOCUMENT));
            }
            None if foreign_format::is_binary(text.as_ref().unwrap_or(&head))
                && !(text.is_none() && is_utf16(&head)) =>
            {
                return Err(InputError::file(name, foreign_format::refusal(text.as_ref().unwrap_or(&head))));
            }
            None => {
                text_format(copy.as_ref().map_or(name, NamedTempFile::path)).map_err(|error| renamed(error, name))?
            }
        };
        Ok(Self { name: name.to_owned(), copy, format, monitor: monitor.clone(), budget })
    }

    /// What was recognised.
    pub fn format(&self) -> FileFormat {
        self.format
    }

    /// Begins to make the hash of the bytes.
    ///
    /// # Errors
    /// The file cannot be opened.
    pub fn begin_hash(&self) -> io::Result<FileHash> {
        FileHash::begin(self.path())
    }

    /// As the user named it.
    pub fn name(&self) -> &Path {
        &self.name
    }

    /// Who watches the reading.
    pub fn monitor(&self) -> &ReadMonitor {
        &self.monitor
    }

    /// Where the bytes are.
    pub fn path(&self) -> &Path {
        self.copy.as_ref().map_or(&self.name, NamedTempFile::path)
    }

    /// An error of [`path`](Self::path) under the name by which the user knows the file.
    pub fn rename(&self, error: InputError) -> InputError {
        renamed(error, &self.name)
    }

    /// The same of an error that may be of its time base.
    pub(crate) fn rename_any(&self, error: StreamError) -> StreamError {
        match error {
            StreamError::Input(error) => self.rename(error).into(),
            StreamError::TimeBase(_) => error,
        }
    }

    /// The rows of any sensor, or of register counts of an ADIS16405 whose rates were taken in `range`.
    ///
    /// # Errors
    /// The file is damaged, its topic or columns cannot be chosen, or it is a log of the SPI bus.
    pub(crate) fn batches(
        &self,
        options: &ReadOptions,
        range: Option<GyroRange>,
    ) -> Result<BatchSource<'_>, InputError> {
        let path = self.path();
        let rows: Box<dyn RowSource + '_> = match self.format {
            FileFormat::CountTable | FileFormat::TextTable => Box::new(TextRows::open(path, options, &self.monitor)?),
            FileFormat::FrameLog | FileFormat::SpiExport => return Err(InputError::file(path, Reason::FrameLog)),
            _ => {
                let budget = self.budget.again();
                Box::new(TopicRows::open(path, self.source(budget)?, options, budget)?)
            }
        };
        Ok(BatchSource::File(Box::new(FileRows::new(path, rows, &self.monitor, range))))
    }

    /// What is in the file without an analysis, of the topic that is named or of all that have an inertial sensor; `selection` is what the
    /// user says of the columns.
    ///
    /// # Errors
    /// The file is damaged, has no rows of numbers, or is a log of the SPI bus, which has no columns.
    pub fn inspect(&self, topic: Option<&str>, selection: &ColumnSelection) -> Result<Vec<InspectedTable>, InputError> {
        let path = self.path();
        let whole = match self.format {
            FileFormat::CountTable | FileFormat::TextTable => {
                let read = |topic: Option<&str>| text_table::read_whole(path, topic, &self.monitor);
                match read(topic) {
                    // Rows of several kinds.
                    Err(InputError { reason: Reason::SeveralTopics(names), .. }) => {
                        names.split(", ").map(|name| read(Some(name))).collect()
                    }
                    table => table.map(|table| vec![table]),
                }
            }
            FileFormat::FrameLog | FileFormat::SpiExport => Err(InputError::file(path, Reason::FrameLog)),
            _ => {
                let budget = self.budget.again();
                self.source(budget).and_then(|mut source| topics::read_whole(path, source.as_mut(), topic, budget))
            }
        };
        let tables = whole.map_err(|error| self.rename(error))?;
        let inspect = |table: WholeTable| {
            let has_registers = table.columns.iter().any(|of| is_output_register(&of.column.name));
            let sensor = match self.format {
                FileFormat::CountTable => adis16405::profile(adis16405::GYRO_LSB_300),
                FileFormat::TextTable if has_registers => adis16405::profile(adis16405::GYRO_LSB_300),
                _ => SensorProfile::generic(),
            };
            InspectedTable::new(table, &sensor, selection)
        };
        Ok(tables.into_iter().map(inspect).collect())
    }

    /// Names of the sensors of one kind that the file has, each to be read with [`ReadOptions::topic`]; none of a file with one sensor,
    /// without a known one, or of text.
    ///
    /// # Errors
    /// The file is damaged.
    pub fn sensors(&self) -> Result<Vec<String>, InputError> {
        if self.format.is_text() {
            return Ok(Vec::new());
        }
        let source = self.source(self.budget.again()).map_err(|error| self.rename(error))?;
        Ok(topics::names_of_several(source.as_ref()))
    }

    /// What is in the file: topics of messages, groups of arrays or the only array, with their columns; nothing of text.
    ///
    /// # Errors
    /// The file is damaged.
    pub fn contents(&self) -> Result<Vec<TopicDescription>, InputError> {
        if self.format.is_text() {
            return Ok(Vec::new());
        }
        let source = self.source(self.budget.again()).map_err(|error| self.rename(error))?;
        Ok(source.topics().iter().map(TopicDescription::from).collect())
    }

    /// The topics of a binary format.
    fn source(&self, budget: Budget) -> Result<Box<dyn Source + '_>, InputError> {
        let path = self.path();
        Ok(match self.format {
            FileFormat::CountTable | FileFormat::TextTable | FileFormat::FrameLog | FileFormat::SpiExport => {
                return Err(InputError::file(path, Reason::NoTopic { format: "text" }));
            }
            FileFormat::Npy => Box::new(NpyReader::open(path, budget, &self.monitor)?),
            FileFormat::Npz => Box::new(NpzReader::open(path, budget)?),
            FileFormat::Mat => Box::new(MatReader::open(path, budget)?),
            FileFormat::RosBag => Box::new(RosBagSource::open(path, budget)?),
            FileFormat::Mcap => Box::new(McapSource::open(path, budget)?),
            #[cfg(feature = "sqlite")]
            FileFormat::Sqlite => Box::new(SqliteSource::open(path, budget)?),
            FileFormat::Ulog => Box::new(UlogSource::open(path, budget)?),
            FileFormat::ArduPilot => Box::new(ArduPilotSource::open(path, budget)?),
            #[cfg(feature = "hdf5")]
            FileFormat::Hdf5 => Box::new(Hdf5Reader::open(path, budget)?),
            #[cfg(not(all(feature = "hdf5", feature = "sqlite")))]
            format => return Err(InputError::file(path, Reason::NotBuilt(format.name()))),
        })
    }
}

fn renamed(error: InputError, name: &Path) -> InputError {
    InputError { file: name.to_owned(), ..error }
}

/// A temporary file with all that `input` has.
fn copied(mut input: impl Read) -> io::Result<NamedTempFile> {
    let mut copy = NamedTempFile::new()?;
    io::copy(&mut input, &mut copy)?;
    copy.flush()?;
    copy.seek(SeekFrom::Start(0))?;
    Ok(copy)
}

/// How often a pipe that sends nothing is left for a request to stop.
const STOP_INTERVAL: Duration = Duration::from_millis(50);
/// Parts of a pipe that wait to be written.
const PARTS: usize = 4;
/// Bytes of a part.
const PART_BYTES: usize = 1 << 16;

/// A temporary file with all that comes through a pipe, until it ends or `monitor` stops the reading.
///
/// A thread reads the pipe, because a read waits until something comes. After a stop it waits for the end of the process.
fn copied_pipe(input: impl Read + Send + 'static, monitor: &ReadMonitor) -> io::Result<NamedTempFile> {
    monitor.begin();
    let (sender, parts) = mpsc::sync_channel::<io::Result<Vec<u8>>>(PARTS);
    let mut input = Counted::new(input, monitor);
    thread::spawn(move || {
        loop {
            let mut part = vec![0; PART_BYTES];
            let read = match input.read(&mut part) {
                Ok(0) => break,
                Ok(count) => {
                    part.truncate(count);
                    Ok(part)
                }
                Err(error) if error.kind() == io::ErrorKind::Interrupted => continue,
                Err(error) => Err(error),
            };
            let is_failed = read.is_err();
            if sender.send(read).is_err() || is_failed {
                break;
            }
        }
    });
    let mut copy = NamedTempFile::new()?;
    loop {
        if monitor.take_stop() {
            monitor.cut();
            break;
        }
        match parts.recv_timeout(STOP_INTERVAL) {
            Ok(part) => copy.write_all(&part?)?,
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => break,
        }
    }
    copy.flush()?;
    monitor.end();
    Ok(copy)
}

fn head(file: &Path) -> io::Result<Vec<u8>> {
    let mut head = Vec::new();
    File::open(file)?.take(HEAD_BYTES).read_to_end(&mut head)?;
    Ok(head)
}

/// Whether the first bytes are those of HDF5, whose signature may come behind 512 bytes, or 1024, and so on.
fn is_hdf5(head: &[u8]) -> bool {
    let mut starts =
        std::iter::once(0).chain((9..).map(|power| 1usize << power).take_while(|start| *start < head.len()));
    starts.any(|start| head[start..].starts_with(b"\x89HDF\r\n\x1A\n"))
}

fn binary_format(head: &[u8]) -> Option<FileFormat> {
    if is_hdf5(head) {
        return Some(FileFormat::Hdf5);
    }
    MAGICS.iter().find(|(magic, _)| head.starts_with(magic)).map(|(_, format)| *format)
}

fn text_format(file: &Path) -> Result<FileFormat, InputError> {
    let mut lines = Lines::open(file)?;
    Ok(match lines.header()? {
        None => return Err(InputError::file(file, Reason::Empty)),
        Some(frame_log::HEADER) => FileFormat::FrameLog,
        Some(header) if spi_export::is_header(header) => FileFormat::SpiExport,
        Some(header) if count_table_writer::is_header(header) => FileFormat::CountTable,
        Some(_) => FileFormat::TextTable,
    })
}
