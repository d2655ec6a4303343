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
use crate::formats::split_bag::SplitBag;
pub use crate::formats::split_bag::files_of_bag;
#[cfg(feature = "sqlite")]
use crate::formats::sqlite_bag::SqliteSource;
use crate::formats::text_table::TextRows;
pub use crate::formats::topics::TopicDescription;
use crate::formats::topics::{self, Source, TopicRows};
use crate::formats::ulog::UlogSource;
use crate::formats::{foreign_format, text_table};
use crate::input::budget::{Budget, Metered};
use crate::input::delimited_text::{Lines, is_utf16};
use crate::input::file_bytes::FileBytes;
use crate::input::file_hash::FileHash;
use crate::input::gzip_members::{GZIP_MAGIC, GzipMembers};
use crate::input::input_error::{InputError, Reason};
use crate::input::read_monitor::{Counted, ReadMonitor};
use crate::input::zstd_frames::{ZSTD_MAGIC, ZstdFrames};
use crate::inspection::InspectedTable;
use crate::rows::any_sensor::ReadOptions;
use crate::rows::row_source::{BatchSource, FileRows, RowSource};
use crate::rows::whole_table::WholeTable;
use adis16405_driver::GyroRange;
use measurement::{SensorProfile, adis16405};
use std::fs::File;
use std::io::{self, BufReader, Read, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;
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

/// An input that can be read more than once: a file, a copy of what came through a pipe or was compressed, bytes in memory, or the files of
/// a bag that was split.
#[derive(Debug)]
pub struct InputFile {
    /// As the user named it.
    name: PathBuf,
    /// At least one; of a bag of ROS 2 in a folder all of its files, in their order.
    parts: Vec<InputPart>,
    format: FileFormat,
    monitor: ReadMonitor,
    budget: Budget,
}

/// A file of an input.
#[derive(Debug)]
struct InputPart {
    /// As it was given.
    origin: FileBytes,
    /// As it is read.
    bytes: FileBytes,
    budget: Budget,
}

impl InputFile {
    /// Opens `name`, `-` for standard input, and recognises its format. A pipe is copied to a temporary file, and so is a
    /// compressed file of a binary format. Bytes that a device sent while its raw stream was on become a frame log. Of a folder the
    /// bag of ROS 2 in it is opened.
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
        let pipe =
            |copied: io::Result<NamedTempFile>| Ok(vec![FileBytes::in_temporary_file(name, copied.map_err(fail)?)]);
        let files = if name == Path::new("-") {
            pipe(copied_pipe(io::stdin(), monitor))?
        } else {
            let metadata = name.metadata().map_err(fail)?;
            if metadata.is_dir() {
                let files = files_of_bag(name).map_err(fail)?;
                if files.is_empty() {
                    return Err(InputError::file(name, Reason::Directory));
                }
                files.iter().map(FileBytes::from).collect()
            } else if metadata.is_file() {
                vec![FileBytes::from(name)]
            } else {
                pipe(copied_pipe(File::open(name).map_err(fail)?, monitor))?
            }
        };
        Self::recognised(name, files, monitor)
    }

    /// Opens bytes in memory that are called `name`.
    ///
    /// # Errors
    /// They have none of the formats, or are too many once they are decompressed.
    pub fn in_memory(name: &Path, bytes: impl Into<Arc<[u8]>>) -> Result<Self, InputError> {
        Self::recognised(name, vec![FileBytes::in_memory(name, bytes)], &ReadMonitor::default())
    }

    fn recognised(name: &Path, files: Vec<FileBytes>, monitor: &ReadMonitor) -> Result<Self, InputError> {
        let (mut parts, mut format) = (Vec::new(), None);
        for file in files {
            let (part, of_part) = InputPart::recognised(file)?;
            if *format.get_or_insert(of_part) != of_part {
                return Err(InputError::file(name, Reason::Directory));
            }
            parts.push(part);
        }
        let format = format.ok_or_else(|| InputError::file(name, Reason::Directory))?;
        let budget = Budget::joined(parts.iter().map(|part| part.budget));
        Ok(Self { name: name.to_owned(), parts, format, monitor: monitor.clone(), budget })
    }

    /// What was recognised.
    pub fn format(&self) -> FileFormat {
        self.format
    }

    /// Begins to make the hash of the bytes, as they were given.
    ///
    /// # Errors
    /// The file cannot be opened.
    pub fn begin_hash(&self) -> io::Result<FileHash> {
        FileHash::begin(&self.parts.iter().map(|part| part.origin.clone()).collect::<Vec<_>>())
    }

    /// As the user named it.
    pub fn name(&self) -> &Path {
        &self.name
    }

    /// Who watches the reading.
    pub fn monitor(&self) -> &ReadMonitor {
        &self.monitor
    }

    /// The bytes as they are read; of a bag that was split, those of its first file.
    pub fn bytes(&self) -> &FileBytes {
        &self.parts[0].bytes
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
        let (name, bytes) = (self.name(), self.bytes());
        let rows: Box<dyn RowSource + '_> = match self.format {
            FileFormat::CountTable | FileFormat::TextTable => Box::new(TextRows::open(bytes, options, &self.monitor)?),
            FileFormat::FrameLog | FileFormat::SpiExport => return Err(InputError::file(name, Reason::FrameLog)),
            _ => Box::new(TopicRows::open(name, self.source()?, options, self.budget)?),
        };
        Ok(BatchSource::File(Box::new(FileRows::new(name, rows, &self.monitor, range))))
    }

    /// What is in the file without an analysis, of the topic that is named or of all that have an inertial sensor; `selection` is what the
    /// user says of the columns.
    ///
    /// # Errors
    /// The file is damaged, has no rows of numbers, or is a log of the SPI bus, which has no columns.
    pub fn inspect(&self, topic: Option<&str>, selection: &ColumnSelection) -> Result<Vec<InspectedTable>, InputError> {
        let name = self.name();
        let whole = match self.format {
            FileFormat::CountTable | FileFormat::TextTable => {
                let read = |topic: Option<&str>| text_table::read_whole(self.bytes(), topic, &self.monitor);
                match read(topic) {
                    // Rows of several kinds.
                    Err(InputError { reason: Reason::SeveralTopics(names), .. }) => {
                        names.split(", ").map(|name| read(Some(name))).collect()
                    }
                    table => table.map(|table| vec![table]),
                }
            }
            FileFormat::FrameLog | FileFormat::SpiExport => Err(InputError::file(name, Reason::FrameLog)),
            _ => {
                let source = self.source();
                source.and_then(|mut source| topics::read_whole(name, source.as_mut(), topic, self.budget))
            }
        };
        let inspect = |table: WholeTable| {
            let has_registers = table.columns.iter().any(|of| is_output_register(&of.column.name));
            let sensor = match self.format {
                FileFormat::CountTable => adis16405::profile(adis16405::GYRO_LSB_300),
                FileFormat::TextTable if has_registers => adis16405::profile(adis16405::GYRO_LSB_300),
                _ => SensorProfile::generic(),
            };
            InspectedTable::new(table, &sensor, selection)
        };
        Ok(whole?.into_iter().map(inspect).collect())
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
        let source = self.source()?;
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
        let source = self.source()?;
        Ok(source.topics().iter().map(TopicDescription::from).collect())
    }

    /// The topics of a binary format.
    fn source(&self) -> Result<Box<dyn Source + '_>, InputError> {
        let mut sources = self.parts.iter().map(|part| self.source_of(part)).collect::<Result<Vec<_>, _>>()?;
        match sources.pop() {
            Some(only) if sources.is_empty() => Ok(only),
            last => Ok(Box::new(SplitBag::new(sources.into_iter().chain(last).collect()))),
        }
    }

    fn source_of<'a>(&self, part: &'a InputPart) -> Result<Box<dyn Source + 'a>, InputError> {
        let (bytes, budget) = (&part.bytes, part.budget.again());
        Ok(match self.format {
            FileFormat::CountTable | FileFormat::TextTable | FileFormat::FrameLog | FileFormat::SpiExport => {
                return Err(bytes.error(Reason::NoTopic { format: "text" }));
            }
            FileFormat::Npy => Box::new(NpyReader::open(bytes, budget, &self.monitor)?),
            FileFormat::Npz => Box::new(NpzReader::open(bytes, budget)?),
            FileFormat::Mat => Box::new(MatReader::open(bytes, budget)?),
            FileFormat::RosBag => Box::new(RosBagSource::open(bytes, budget)?),
            FileFormat::Mcap => Box::new(McapSource::open(bytes, budget)?),
            #[cfg(feature = "sqlite")]
            FileFormat::Sqlite => Box::new(SqliteSource::open(bytes, budget)?),
            FileFormat::Ulog => Box::new(UlogSource::open(bytes, budget)?),
            FileFormat::ArduPilot => Box::new(ArduPilotSource::open(bytes, budget)?),
            #[cfg(feature = "hdf5")]
            FileFormat::Hdf5 => Box::new(Hdf5Reader::open(bytes, budget)?),
            #[cfg(not(all(feature = "hdf5", feature = "sqlite")))]
            format => return Err(bytes.error(Reason::NotBuilt(format.name()))),
        })
    }
}

impl InputPart {
    /// A file of a recording, decompressed where its format needs that, and its format.
    fn recognised(origin: FileBytes) -> Result<(Self, FileFormat), InputError> {
        let fail = |error| origin.error(Reason::Io(error));
        let refuse = |reason| Err(origin.error(reason));
        let budget = Budget::of_file(&origin).map_err(fail)?;
        let expanded = |whole: &mut dyn Read| {
            FileBytes::copied(origin.name(), Metered::new(whole, budget.meter()))
                .map_err(|error| origin.error(Reason::from_io(error)))
        };
        let mut bytes = origin.clone();
        // Of compressed text, what is in it.
        let mut text = None;
        let mut head = head(&bytes).map_err(fail)?;
        if head.starts_with(&GZIP_MAGIC) {
            let mut inner = GzipMembers::new(BufReader::new(bytes.open().map_err(fail)?));
            let mut start = Vec::new();
            // Damage is reported with its line where the whole is read.
            let _ = inner.by_ref().take(HEAD_BYTES).read_to_end(&mut start);
            if binary_format(&start).is_some() {
                bytes = expanded(&mut start.as_slice().chain(inner))?;
                head = start;
            } else {
                text = Some(start);
            }
        }
        if head.starts_with(&ZSTD_MAGIC) {
            bytes = expanded(&mut ZstdFrames::new(BufReader::new(bytes.open().map_err(fail)?)))?;
            head = self::head(&bytes).map_err(fail)?;
        }
        let format = match binary_format(&head) {
            Some(format) => format,
            None if serial::is_capture(&head) => {
                let log = NamedTempFile::new().map_err(fail)?;
                serial::log_of_capture(BufReader::new(bytes.open().map_err(fail)?), log.path()).map_err(fail)?;
                bytes = FileBytes::in_temporary_file(origin.name(), log);
                FileFormat::FrameLog
            }
            None if foreign_format::is_report(&head) => return refuse(foreign_format::REPORT),
            None if foreign_format::is_json_document(&head) => return refuse(foreign_format::JSON_DOCUMENT),
            None if foreign_format::is_binary(text.as_ref().unwrap_or(&head))
                && !(text.is_none() && is_utf16(&head)) =>
            {
                return refuse(foreign_format::refusal(text.as_ref().unwrap_or(&head)));
            }
            None => text_format(&bytes)?,
        };
        Ok((Self { origin, bytes, budget }, format))
    }
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

fn head(file: &FileBytes) -> io::Result<Vec<u8>> {
    let mut head = Vec::new();
    file.open()?.take(HEAD_BYTES).read_to_end(&mut head)?;
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

fn text_format(file: &FileBytes) -> Result<FileFormat, InputError> {
    let mut lines = Lines::open(file)?;
    Ok(match lines.header()? {
        None => return Err(file.error(Reason::Empty)),
        Some(frame_log::HEADER) => FileFormat::FrameLog,
        Some(header) if spi_export::is_header(header) => FileFormat::SpiExport,
        Some(header) if count_table_writer::is_header(header) => FileFormat::CountTable,
        Some(_) => FileFormat::TextTable,
    })
}
