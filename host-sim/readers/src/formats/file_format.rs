//! Recognition of a format by content, and reading.

use crate::columns::{ColumnSelection, RowOptions, SensorChannels};
use crate::formats::ardupilot_log::{self, ArduPilotSource};
#[cfg(feature = "hdf5")]
use crate::formats::hdf5::Hdf5Reader;
use crate::formats::matlab::MatReader;
use crate::formats::mcap_bag::McapSource;
use crate::formats::memory_table::MemoryTable;
use crate::formats::numpy::{NpyReader, NpzReader};
use crate::formats::ros_bag::RosBagSource;
use crate::formats::split_bag::SplitBag;
pub use crate::formats::split_bag::files_of_bag;
#[cfg(feature = "sqlite")]
use crate::formats::sqlite_bag::SqliteSource;
use crate::formats::text_table::TextTable;
pub use crate::formats::topics::TopicDescription;
use crate::formats::topics::{self, FileLimits, Source, TopicRows};
use crate::formats::ulog::UlogSource;
use crate::formats::{foreign_format, text_table};
use crate::input::{
    Budget, Counted, FileBytes, FileHash, GZIP_MAGIC, GzipMembers, InputError, Lines, Metered, ReadAhead, ReadMonitor,
    Reason, ZSTD_MAGIC, ZstdFrames, is_utf16,
};
use crate::inspection::InspectedTable;
use crate::rows::{FileRows, RegisterField, RowSource, WholeTable};
use std::fs::File;
use std::io::{self, BufReader, Read, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;
use tempfile::NamedTempFile;

/// Several messages of the raw stream.
pub const HEAD_BYTES: u64 = 1 << 14;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FileFormat {
    TextTable,
    Npy,
    Npz,
    Mat,
    RosBag,
    /// MCAP, of ROS 2 or Foxglove.
    Mcap,
    Sqlite,
    Ulog,
    ArduPilot,
    /// HDF5, which is also MATLAB 7.3.
    Hdf5,
    Arrays,
}

impl FileFormat {
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
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
            Self::Arrays => "arrays in memory",
        }
    }
}

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

/// An input that can be read again: a file, a copy (pipe, compressed), memory, or a bag's files.
#[derive(Debug)]
pub struct InputFile {
    name: PathBuf,
    /// Empty for arrays; the files of a ROS 2 bag in order.
    parts: Vec<InputPart>,
    arrays: Option<Arc<MemoryTable>>,
    format: FileFormat,
    monitor: ReadMonitor,
    budget: Budget,
}

#[derive(Debug)]
struct InputPart {
    origin: FileBytes,
    bytes: FileBytes,
    budget: Budget,
}

impl InputFile {
    /// Opens `name`, `-` for standard input, and recognises its format. Pipes and compressed binary files are copied; a
    /// folder is a ROS 2 bag. `monitor` counts bytes and may stop pipes, text and arrays.
    ///
    /// # Errors
    /// The file cannot be read or copied, or it has none of the formats.
    pub fn open(name: &Path, monitor: &ReadMonitor) -> Result<Self, InputError> {
        Self::recognised(name, Self::files(name, monitor)?, monitor)
    }

    /// One file, or those of a bag.
    ///
    /// # Errors
    /// There is none, or a pipe cannot be copied.
    pub fn files(name: &Path, monitor: &ReadMonitor) -> Result<Vec<FileBytes>, InputError> {
        let fail = |error| InputError::file(name, Reason::Io(error));
        let pipe =
            |copied: io::Result<NamedTempFile>| Ok(vec![FileBytes::in_temporary_file(name, copied.map_err(fail)?)]);
        if name == Path::new("-") {
            return pipe(copied_pipe(io::stdin(), monitor));
        }
        let metadata = name.metadata().map_err(fail)?;
        if metadata.is_dir() {
            let files = files_of_bag(name).map_err(fail)?;
            let bytes: Vec<FileBytes> = files.iter().map(FileBytes::from).collect();
            if bytes.is_empty() { Err(InputError::file(name, no_bag())) } else { Ok(bytes) }
        } else if metadata.is_file() {
            Ok(vec![FileBytes::from(name)])
        } else {
            pipe(copied_pipe(File::open(name).map_err(fail)?, monitor))
        }
    }

    /// Opens bytes in memory that are called `name`.
    ///
    /// # Errors
    /// Unknown format, or too large when decompressed.
    pub fn in_memory(name: &Path, bytes: impl Into<Arc<[u8]>>) -> Result<Self, InputError> {
        Self::recognised(name, vec![FileBytes::in_memory(name, bytes)], &ReadMonitor::default())
    }

    #[must_use]
    pub fn of_arrays(name: &Path, arrays: Arc<MemoryTable>, monitor: &ReadMonitor) -> Self {
        let empty = FileBytes::in_memory(name, []);
        let budget = Budget::new(arrays.bytes());
        Self {
            name: name.to_owned(),
            parts: vec![InputPart { origin: empty.clone(), bytes: empty, budget }],
            arrays: Some(arrays),
            format: FileFormat::Arrays,
            monitor: monitor.clone(),
            budget,
        }
    }

    /// Recognises the files of one recording.
    ///
    /// # Errors
    /// As [`open`](Self::open).
    pub fn recognised(name: &Path, files: Vec<FileBytes>, monitor: &ReadMonitor) -> Result<Self, InputError> {
        let (mut parts, mut format) = (Vec::new(), None);
        for file in files {
            let (part, of_part) = InputPart::recognised(file)?;
            if *format.get_or_insert(of_part) != of_part {
                return Err(InputError::file(name, no_bag()));
            }
            parts.push(part);
        }
        let format = format.ok_or_else(|| InputError::file(name, no_bag()))?;
        let budget = Budget::joined(parts.iter().map(|part| part.budget));
        Ok(Self { name: name.to_owned(), parts, arrays: None, format, monitor: monitor.clone(), budget })
    }

    pub fn format(&self) -> FileFormat {
        self.format
    }

    /// Begins the hash of the given bytes.
    ///
    /// # Errors
    /// The file cannot be opened; or there is none, but arrays.
    pub fn begin_hash(&self) -> io::Result<FileHash> {
        if self.arrays.is_some() {
            return Err(io::ErrorKind::Unsupported.into());
        }
        FileHash::begin(&self.parts.iter().map(|part| part.origin.clone()).collect::<Vec<_>>())
    }

    /// Estimated rows, by the bytes of the first `rows`; `None` if not counted.
    pub fn expected_rows(&self, rows: u64) -> Option<u64> {
        let [part] = self.parts.as_slice() else { return None };
        let (length, read) = (part.bytes.length().ok()??, self.monitor.bytes());
        (read > 0).then(|| (rows as f64 * length as f64 / read as f64) as u64)
    }

    /// As the user named it.
    pub fn name(&self) -> &Path {
        &self.name
    }

    pub fn monitor(&self) -> &ReadMonitor {
        &self.monitor
    }

    /// The first file of a split bag.
    pub fn bytes(&self) -> &FileBytes {
        &self.parts[0].bytes
    }

    /// The first line of text that is not blank.
    ///
    /// # Errors
    /// It is no text, or there is none.
    pub fn first_line(&self) -> Result<String, InputError> {
        let mut lines = Lines::open(self.bytes())?;
        let header = lines.header()?.map(str::to_owned);
        header.ok_or_else(|| self.bytes().error(lines.take_damage().unwrap_or(Reason::Empty)))
    }

    /// Rows of a table or topic; `register` gives the register of a channel of words, by name.
    ///
    /// # Errors
    /// The file is damaged, or its topic or columns cannot be chosen.
    pub fn rows(
        &self,
        options: &RowOptions,
        register: &dyn Fn(&str) -> Option<RegisterField>,
    ) -> Result<FileRows<'_>, InputError> {
        let (name, bytes) = (self.name(), self.bytes());
        let rows: Box<dyn RowSource + '_> = match self.format {
            FileFormat::TextTable => Box::new(TextTable::open(bytes, options, &self.monitor)?),
            _ => Box::new(TopicRows::open(name, self.source()?, options, self.limits())?),
        };
        Ok(FileRows::new(name, rows, &self.monitor, register))
    }

    /// Content without an analysis, of the named topic or all inertial sensors; `selection` is the user's, `sensor` gives LSBs.
    ///
    /// # Errors
    /// The file is damaged, or has no rows of numbers.
    pub fn inspect(
        &self,
        topic: Option<&str>,
        selection: &ColumnSelection,
        sensor: &dyn Fn(&[&str]) -> SensorChannels,
    ) -> Result<Vec<InspectedTable>, InputError> {
        let name = self.name();
        let whole = match self.format {
            FileFormat::TextTable => {
                let read = |topic: Option<&str>| text_table::read_whole(self.bytes(), topic, &self.monitor);
                match read(topic) {
                    Err(InputError { reason: Reason::SeveralTopics(names), .. }) => {
                        names.split(", ").map(|name| read(Some(name))).collect()
                    }
                    table => table.map(|table| vec![table]),
                }
            }
            _ => self.source().and_then(|source| topics::read_whole(name, source, topic, self.limits())),
        };
        let inspect = |table: WholeTable| {
            let names: Vec<&str> = table.columns.iter().map(|of| of.column.name.as_str()).collect();
            let sensor = sensor(&names);
            InspectedTable::new(table, &sensor, selection)
        };
        Ok(whole?.into_iter().map(inspect).collect())
    }

    /// Sensors of one kind for [`RowOptions::topic`]; empty for one sensor, unknown ones, or text.
    ///
    /// # Errors
    /// The file is damaged.
    pub fn sensors(&self) -> Result<Vec<String>, InputError> {
        if self.format == FileFormat::TextTable {
            return Ok(Vec::new());
        }
        let source = self.source()?;
        Ok(topics::names_of_several(source.as_ref()))
    }

    /// Topics, groups or the array, with columns; empty for text.
    ///
    /// # Errors
    /// The file is damaged.
    pub fn contents(&self) -> Result<Vec<TopicDescription>, InputError> {
        if self.format == FileFormat::TextTable {
            return Ok(Vec::new());
        }
        let source = self.source()?;
        Ok(source.topics().iter().map(TopicDescription::from).collect())
    }

    fn limits(&self) -> FileLimits {
        FileLimits { budget: self.budget, cut: self.parts.iter().find_map(|part| part.bytes.cut()) }
    }

    fn source(&self) -> Result<Box<dyn Source + '_>, InputError> {
        if let Some(arrays) = &self.arrays {
            return Ok(Box::new(arrays.source(&self.name, self.budget)?));
        }
        let mut sources = self.parts.iter().map(|part| self.source_of(part)).collect::<Result<Vec<_>, _>>()?;
        match sources.pop() {
            Some(only) if sources.is_empty() => Ok(only),
            last => Ok(Box::new(SplitBag::new(sources.into_iter().chain(last).collect()))),
        }
    }

    fn source_of<'a>(&self, part: &'a InputPart) -> Result<Box<dyn Source + 'a>, InputError> {
        let (bytes, budget) = (&part.bytes, part.budget.again());
        Ok(match self.format {
            FileFormat::TextTable | FileFormat::Arrays => {
                return Err(bytes.error(Reason::NoTopic { format: self.format.name() }));
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
            format => {
                let what = "which this program was built without; build it with the features hdf5 and sqlite";
                return Err(bytes.error(Reason::other(format!("{}, {what}", format.name()))));
            }
        })
    }
}

impl InputPart {
    fn recognised(origin: FileBytes) -> Result<(Self, FileFormat), InputError> {
        let fail = |error| origin.error(Reason::Io(error));
        let refuse = |reason| Err(origin.error(reason));
        let budget = Budget::of_file(&origin).map_err(fail)?;
        let expanded = |whole: &mut dyn Read, compression| {
            FileBytes::copied(origin.name(), Metered::new(whole, budget.meter()), compression)
                .map_err(|error| origin.error(Reason::from_io(error)))
        };
        let mut bytes = origin.clone();
        // Content of compressed text.
        let mut text = None;
        let mut head = bytes.head(HEAD_BYTES).map_err(fail)?;
        if head.starts_with(&GZIP_MAGIC) {
            let mut inner = GzipMembers::new(BufReader::new(bytes.open().map_err(fail)?));
            let mut start = Vec::new();
            // Reported with its line later.
            let _ = inner.by_ref().take(HEAD_BYTES).read_to_end(&mut start);
            if binary_format(&start).is_some() {
                bytes = expanded(&mut start.as_slice().chain(inner), "gzip")?;
                head = start;
            } else {
                text = Some(start);
            }
        }
        if head.starts_with(&ZSTD_MAGIC) {
            bytes = expanded(&mut ZstdFrames::new(BufReader::new(bytes.open().map_err(fail)?)), "Zstandard data")?;
            head = bytes.head(HEAD_BYTES).map_err(fail)?;
        }
        let format = match binary_format(&head) {
            Some(format) => format,
            None if foreign_format::is_report(&head) => return refuse(foreign_format::REPORT),
            None if foreign_format::is_json_document(&head) => return refuse(foreign_format::JSON_DOCUMENT),
            None if foreign_format::is_binary(text.as_ref().unwrap_or(&head))
                && !(text.is_none() && is_utf16(&head)) =>
            {
                return refuse(foreign_format::refusal(text.as_ref().unwrap_or(&head)));
            }
            None => FileFormat::TextTable,
        };
        Ok((Self { origin, bytes, budget }, format))
    }
}

fn no_bag() -> Reason {
    Reason::other("is a directory, not a file, and not that of one bag of ROS 2 in .mcap or .db3 files")
}

const STOP_INTERVAL: Duration = Duration::from_millis(50);

/// A temporary copy of a pipe, until its end or a stop. A thread reads; after a stop it blocks until the process ends.
fn copied_pipe(input: impl Read + Send + 'static, monitor: &ReadMonitor) -> io::Result<NamedTempFile> {
    monitor.begin();
    let input = ReadAhead::new(Counted::new(input, monitor))?;
    let mut copy = NamedTempFile::new()?;
    while let Some(part) = input.next_part(STOP_INTERVAL)? {
        copy.write_all(&part)?;
        if monitor.take_stop() {
            monitor.cut();
            break;
        }
    }
    copy.flush()?;
    monitor.end();
    Ok(copy)
}

/// The signature may follow 512 bytes, 1024, and so on.
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
