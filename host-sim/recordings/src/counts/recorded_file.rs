//! Transactions of the SPI bus: [logs](crate::frame_log) of this program, and exports of logic analyzers.
//!
//! - Saleae Logic 2, data table: `name,type,start_time,duration,…,mosi,miso` with rows of type `enable`, `result` and
//!   `disable`.
//! - sigrok-cli: `-A spi=mosi-transfer:miso-transfer --protocol-decoder-jsontrace`, one line an event.

use crate::counts::frame_log::{self, Fault, Frame, HEADER, TIME, bytes, not_hex};
use readers::delimited_text::{self, Lines};
use readers::{FileBytes, InputError, Reason};
use serde_json::Value;
use std::collections::VecDeque;
use std::path::PathBuf;

/// Times of the events of sigrok, s.
const MICROSECOND: f64 = 1e-6;

/// A transaction on the bus.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct CapturedFrame {
    /// Bytes, and fall of chip select.
    pub frame: Frame,
    /// Rise of chip select, s; `None` if not exported.
    pub end_s: Option<f64>,
}

#[derive(Debug, Clone, PartialEq)]
enum Layout {
    Log,
    SaleaeTable {
        /// Positions of the columns.
        kind: usize,
        start: usize,
        duration: usize,
        mosi: usize,
        miso: usize,
    },
    SigrokTrace,
}

impl Layout {
    fn of_header(header: &str) -> Option<Self> {
        if header == HEADER {
            return Some(Self::Log);
        }
        let names: Vec<String> = header.split(',').map(|name| delimited_text::field(name).to_lowercase()).collect();
        let position = |wanted: &str| names.iter().position(|name| name == wanted);
        if header.starts_with("{\"traceEvents\"") {
            return Some(Self::SigrokTrace);
        }
        Some(Self::SaleaeTable {
            kind: position("type")?,
            start: position("start_time")?,
            duration: position("duration")?,
            mosi: position("mosi")?,
            miso: position("miso")?,
        })
    }
}

/// True for an export.
pub(crate) fn is_export(header: &str) -> bool {
    Layout::of_header(header).is_some_and(|layout| layout != Layout::Log)
}

/// An open log or export, read transaction by transaction.
pub struct FrameReader {
    file: PathBuf,
    lines: Lines,
    layout: Layout,
    line: u64,
    last_s: f64,
    open: Option<CapturedFrame>,
    /// Sigrok transactions without their other line.
    waiting: VecDeque<(bool, CapturedFrame)>,
}

impl FrameReader {
    /// Opens `file`, plain or gzip; `None` for a table.
    ///
    /// # Errors
    /// The file cannot be read.
    pub fn open(file: &FileBytes) -> Result<Option<Self>, InputError> {
        let mut lines = Lines::open(file)?;
        let header = lines.next_line()?.and_then(|(line, header)| Some((line, Layout::of_header(header)?)));
        Ok(header.map(|(line, layout)| Self {
            file: file.name().to_owned(),
            lines,
            layout,
            line,
            last_s: f64::NEG_INFINITY,
            open: None,
            waiting: VecDeque::new(),
        }))
    }

    /// A sentence on the reason for an early end behind `bursts`, at the end.
    pub fn take_damage(&mut self, bursts: u64) -> Option<String> {
        let damage = self.lines.take_damage();
        damage.map(|reason| format!("{reason}; the {bursts} bursts before that are used"))
    }

    /// Line of the transaction that was read last, from 1.
    pub fn line(&self) -> u64 {
        self.line
    }

    /// The next transaction; `None` at the end.
    ///
    /// # Errors
    /// A line has a time that is no number or decreases, or no equally long rows of 16-bit words of both lines of the bus.
    #[expect(clippy::should_implement_trait, reason = "fallible: an iterator would yield errors for ever")]
    pub fn next(&mut self) -> Result<Option<CapturedFrame>, InputError> {
        loop {
            let Some((line, text)) = self.lines.next_line()? else {
                let last = self.open.take();
                return last.map(|last| self.checked(last)).transpose().map_err(|fault| self.error(fault));
            };
            self.line = line;
            let text = text.to_owned();
            let step = match self.layout.clone() {
                Layout::Log => frame_log::parse(&text).map(|frame| Some(CapturedFrame { frame, end_s: None })),
                Layout::SaleaeTable { kind, start, duration, mosi, miso } => {
                    self.table_row(&text, [kind, start, duration, mosi, miso]).map_err(|reason| (None, reason))
                }
                Layout::SigrokTrace => self.event(&text).map_err(|reason| (None, reason)),
            };
            let checked = step.and_then(|frame| {
                let frame = frame.filter(|captured| !captured.frame.mosi.is_empty());
                frame.map(|frame| self.checked(frame)).transpose()
            });
            match checked {
                Ok(None) => {}
                Err(_) if self.lines.ends_within(line) => {}
                Ok(frame) => return Ok(frame),
                Err(fault) => return Err(self.error(fault)),
            }
        }
    }

    fn error(&self, (column, reason): Fault) -> InputError {
        match column {
            Some(column) => InputError::field(&self.file, self.line, column, reason),
            None => InputError::line(&self.file, self.line, reason),
        }
    }

    fn checked(&mut self, captured: CapturedFrame) -> Result<CapturedFrame, Fault> {
        let Frame { time_s: now, mosi, miso } = &captured.frame;
        let (last_s, mosi, miso) = (self.last_s, mosi.len(), miso.len());
        if *now < last_s {
            let column = Some(TIME).filter(|_| self.layout == Layout::Log);
            return Err((column, Reason::other(format!("time {now} s is before {last_s} s of the row above"))));
        }
        if mosi != miso {
            return Err((None, Reason::other(format!("{mosi} bytes out but {miso} bytes in"))));
        }
        if mosi % 2 == 1 {
            return Err((None, Reason::other(format!("{mosi} bytes are no whole number of 16-bit words"))));
        }
        self.last_s = *now;
        Ok(captured)
    }

    /// From `enable` to `disable`.
    fn table_row(&mut self, text: &str, positions: [usize; 5]) -> Result<Option<CapturedFrame>, Reason> {
        let fields: Vec<&str> = text.split(',').map(delimited_text::field).collect();
        let expected = positions.into_iter().max().unwrap_or(0) + 1;
        if fields.len() < expected {
            return Err(Reason::FieldCount { found: fields.len(), expected });
        }
        let [kind, start, duration, mosi, miso] = positions.map(|position| fields[position]);
        let start_s = delimited_text::time(start)?;
        match kind {
            "enable" => {
                let before = self.open.replace(starting_at(start_s));
                Ok(before)
            }
            "result" => {
                let end_s = start_s + delimited_text::time(duration)?;
                let frame = self.open.get_or_insert_with(|| starting_at(start_s));
                frame.frame.mosi.extend(word(mosi)?);
                frame.frame.miso.extend(word(miso)?);
                frame.end_s = Some(end_s);
                Ok(None)
            }
            "disable" => Ok(self.open.take().map(|frame| CapturedFrame { end_s: Some(start_s), ..frame })),
            _ => Ok(None),
        }
    }

    /// Bytes of one line; MISO and MOSI begin together.
    fn event(&mut self, text: &str) -> Result<Option<CapturedFrame>, Reason> {
        let text = text.trim_end_matches(',');
        if !text.starts_with("{\"ph\"") {
            return Ok(None);
        }
        let damaged =
            |error: serde_json::Error| Reason::Format { format: "sigrok trace", error: error.to_string().into() };
        let event: Value = serde_json::from_str(text).map_err(damaged)?;
        let (Some(phase), Some(ticks), Some(row), Some(bytes)) =
            (event["ph"].as_str(), event["ts"].as_f64(), event["tid"].as_str(), event["name"].as_str())
        else {
            return Ok(None);
        };
        let is_mosi = match row {
            "MOSI transfer" => true,
            "MISO transfer" => false,
            _ => return Ok(None),
        };
        let time_s = ticks * MICROSECOND;
        if phase == "B" {
            let bytes = bytes.split_ascii_whitespace().map(word).collect::<Result<Vec<_>, _>>()?.concat();
            let mut captured = starting_at(time_s);
            *if is_mosi { &mut captured.frame.mosi } else { &mut captured.frame.miso } = bytes;
            self.waiting.push_back((is_mosi, captured));
            return Ok(None);
        }
        match (self.waiting.pop_front(), self.waiting.pop_front()) {
            (Some((first_is_mosi, first)), Some((second_is_mosi, second)))
                if first_is_mosi != second_is_mosi && first.frame.time_s == second.frame.time_s =>
            {
                let (mosi, miso) = if first_is_mosi { (first, second) } else { (second, first) };
                let frame = Frame { miso: miso.frame.miso, ..mosi.frame };
                Ok(Some(CapturedFrame { frame, end_s: Some(time_s) }))
            }
            (Some(first), second) => {
                self.waiting.extend(second);
                self.waiting.push_front(first);
                Ok(None)
            }
            (None, _) => Ok(None),
        }
    }
}

fn starting_at(time_s: f64) -> CapturedFrame {
    CapturedFrame { frame: Frame { time_s, ..Frame::default() }, end_s: None }
}

/// `0x3E`, `0x3E00` or `3E`.
fn word(text: &str) -> Result<Vec<u8>, Reason> {
    let digits = text.strip_prefix("0x").unwrap_or(text);
    if digits.is_empty() { Err(not_hex(text)) } else { bytes(digits) }
}
