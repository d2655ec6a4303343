//! Logs of the SPI bus: a line per transaction, `time_s,mosi,miso`, bytes in hexadecimal; times read back exactly.

use flate2::Compression;
use flate2::write::GzEncoder;
use readers::delimited_text::{self, Lines};
use readers::{FileBytes, InputError, Reason};
use std::fmt::Write as _;
use std::fs::File;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// First line of every log.
pub const HEADER: &str = "time_s,mosi,miso";

/// Longest delay of a line, and most pending bytes.
const MAX_DELAY: Duration = Duration::from_secs(1);
const MAX_BUFFERED: usize = 1 << 22;
const CLOCK_BYTES: usize = 1 << 12;

const TIME: &str = "time_s";
const MOSI: &str = "mosi";
const MISO: &str = "miso";

/// One SPI transaction.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Frame {
    /// Fall of chip select, s.
    pub time_s: f64,
    pub mosi: Vec<u8>,
    pub miso: Vec<u8>,
}

/// An open log, read frame by frame.
pub struct FrameLogReader {
    file: PathBuf,
    lines: Lines,
    line: u64,
    last_s: f64,
}

impl FrameLogReader {
    /// Opens a log, plain or gzip.
    ///
    /// # Errors
    /// The file cannot be read or does not start with [`HEADER`].
    pub fn open(file: impl Into<FileBytes>) -> Result<Self, InputError> {
        let file = file.into();
        Self::new(file.name(), Lines::open(&file)?)
    }

    pub(crate) fn new(file: &Path, mut lines: Lines) -> Result<Self, InputError> {
        match lines.next_line()? {
            None => Err(InputError::file(file, Reason::Empty)),
            Some((_, HEADER)) => Ok(Self { file: file.to_owned(), lines, line: 1, last_s: f64::NEG_INFINITY }),
            Some((line, _)) => Err(InputError::line(file, line, Reason::NotFrameLog)),
        }
    }

    /// Line of the frame that was read last, from 1.
    pub fn line(&self) -> u64 {
        self.line
    }

    /// The next frame; `None` at the end of the log.
    ///
    /// # Errors
    /// A line does not have a finite time, not before that of the last line, and two equally long rows of 16-bit words.
    #[expect(clippy::should_implement_trait, reason = "fallible: an iterator would yield errors for ever")]
    pub fn next(&mut self) -> Result<Option<Frame>, InputError> {
        let Some((line, text)) = self.lines.next_line()? else {
            return Ok(None);
        };
        let frame = parse(text, self.last_s).map_err(|(column, reason)| match column {
            Some(column) => InputError::field(&self.file, line, column, reason),
            None => InputError::line(&self.file, line, reason),
        })?;
        self.line = line;
        self.last_s = frame.time_s;
        Ok(Some(frame))
    }
}

fn parse(text: &str, last_s: f64) -> Result<Frame, (Option<&'static str>, Reason)> {
    let fields: Vec<&str> = text.split(',').map(delimited_text::field).collect();
    let &[time, mosi, miso] = fields.as_slice() else {
        return Err((None, Reason::FieldCount { found: fields.len(), expected: 3 }));
    };
    let time_s = delimited_text::time(time).map_err(|reason| (Some(TIME), reason))?;
    if time_s < last_s {
        return Err((Some(TIME), Reason::TimeBackwards { before: last_s, now: time_s }));
    }
    let mosi = bytes(mosi).map_err(|reason| (Some(MOSI), reason))?;
    let miso = bytes(miso).map_err(|reason| (Some(MISO), reason))?;
    if mosi.len() != miso.len() {
        return Err((None, Reason::UnequalLengths { mosi: mosi.len(), miso: miso.len() }));
    }
    if mosi.is_empty() || mosi.len() % 2 == 1 {
        return Err((None, Reason::OddBytes(mosi.len())));
    }
    Ok(Frame { time_s, mosi, miso })
}

pub(crate) fn bytes(text: &str) -> Result<Vec<u8>, Reason> {
    let nibble = |digit: u8| (digit as char).to_digit(16).map(|value| value as u8);
    if text.len() % 2 == 1 {
        return Err(Reason::NotHex(delimited_text::quote(text)));
    }
    text.as_bytes()
        .chunks_exact(2)
        .map(|pair| Some(nibble(pair[0])? << 4 | nibble(pair[1])?))
        .collect::<Option<Vec<u8>>>()
        .ok_or_else(|| Reason::NotHex(delimited_text::quote(text)))
}

/// A log being written, gzip for a name in `.gz`; complete up to the last second without [`finish`](Self::finish).
#[derive(Debug)]
pub struct FrameLogWriter<W = File> {
    out: W,
    is_gzip: bool,
    text: String,
    /// `None` where there is no clock.
    written: Option<Instant>,
}

impl FrameLogWriter {
    /// Creates `file` and writes the header.
    pub fn create(file: &Path) -> io::Result<Self> {
        let is_gzip = file.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("gz"));
        Ok(Self { is_gzip, written: Some(Instant::now()), ..FrameLogWriter::new(File::create(file)?) })
    }
}

impl<W: Write> FrameLogWriter<W> {
    /// Writes the header into `out`, and frames as they are buffered.
    pub fn new(out: W) -> Self {
        Self { out, is_gzip: false, text: format!("{HEADER}\n"), written: None }
    }

    /// Adds one frame.
    pub fn write(&mut self, frame: &Frame) -> io::Result<()> {
        let (before, text) = (self.text.len(), &mut self.text);
        let _ = write!(text, "{},", frame.time_s);
        for byte in &frame.mosi {
            let _ = write!(text, "{byte:02X}");
        }
        text.push(',');
        for byte in &frame.miso {
            let _ = write!(text, "{byte:02X}");
        }
        text.push('\n');
        let looks = before / CLOCK_BYTES != self.text.len() / CLOCK_BYTES;
        if self.text.len() >= MAX_BUFFERED
            || looks && self.written.is_some_and(|written| written.elapsed() >= MAX_DELAY)
        {
            self.flush()
        } else {
            Ok(())
        }
    }

    /// Writes what is buffered, and ends the log.
    pub fn finish(mut self) -> io::Result<()> {
        self.flush()
    }

    fn flush(&mut self) -> io::Result<()> {
        if self.is_gzip {
            let mut member = GzEncoder::new(Vec::new(), Compression::default());
            member.write_all(self.text.as_bytes())?;
            self.out.write_all(&member.finish()?)?;
        } else {
            self.out.write_all(self.text.as_bytes())?;
        }
        self.text.clear();
        self.written = self.written.map(|_| Instant::now());
        Ok(())
    }
}
