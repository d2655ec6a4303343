//! Logs of the SPI bus: a line per transaction, `time_s,mosi,miso`, bytes in hexadecimal; times read back exactly.

use flate2::Compression;
use flate2::write::GzEncoder;
use readers::{Reason, delimited_text};
use std::fmt::Write as _;
use std::fs::File;
use std::io::{self, Write};
use std::path::Path;
use std::time::{Duration, Instant};

/// First line of every log.
pub const HEADER: &str = "time_s,mosi,miso";

/// Longest delay of a line, and most pending bytes.
const MAX_DELAY: Duration = Duration::from_secs(1);
const MAX_BUFFERED: usize = 1 << 22;
const CLOCK_BYTES: usize = 1 << 12;

pub(crate) const TIME: &str = "time_s";

/// One SPI transaction.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Frame {
    /// Fall of chip select, s.
    pub time_s: f64,
    pub mosi: Vec<u8>,
    pub miso: Vec<u8>,
}

/// Column and reason.
pub(crate) type Fault = (Option<&'static str>, Reason);

/// A line of a log; its time may go back.
pub(crate) fn parse(text: &str) -> Result<Frame, Fault> {
    let fields: Vec<&str> = text.split(',').map(delimited_text::field).collect();
    let &[time, mosi, miso] = fields.as_slice() else {
        return Err((None, Reason::FieldCount { found: fields.len(), expected: 3 }));
    };
    let time_s = delimited_text::time(time).map_err(|reason| (Some(TIME), reason))?;
    let mosi = bytes(mosi).map_err(|reason| (Some("mosi"), reason))?;
    let miso = bytes(miso).map_err(|reason| (Some("miso"), reason))?;
    if mosi.is_empty() {
        return Err((None, Reason::other("0 bytes are no whole number of 16-bit words")));
    }
    Ok(Frame { time_s, mosi, miso })
}

pub(crate) fn bytes(text: &str) -> Result<Vec<u8>, Reason> {
    let nibble = |digit: u8| (digit as char).to_digit(16).map(|value| value as u8);
    let pairs = text.as_bytes().chunks(2).map(|pair| match *pair {
        [high, low] => Some(nibble(high)? << 4 | nibble(low)?),
        _ => None,
    });
    pairs.collect::<Option<_>>().ok_or_else(|| not_hex(text))
}

pub(crate) fn not_hex(text: &str) -> Reason {
    Reason::other(format!("{:?} is not a row of hexadecimal bytes", delimited_text::quote(text)))
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
