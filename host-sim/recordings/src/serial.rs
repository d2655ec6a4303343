//! A recording off the serial cable: the firmware's stream of raw bursts as a frame log.

use crate::frame_log::{Frame, FrameLog};
use adis16405_driver::{BURST_REQUEST, Register};
use link::{Decoder, DecoderCounters, Message, RawMessage, Received};
use std::collections::VecDeque;
use std::io::{self, ErrorKind, Read, Write};
use std::path::Path;
use std::time::{Duration, Instant};

/// What the firmware's boards speak, Bd.
pub const BAUD: u32 = 460_800;

/// How long a read waits before the clock is looked at.
const PATIENCE: Duration = Duration::from_millis(50);

/// A port that a device hangs on, real or a pseudo-terminal.
///
/// # Errors
/// There is no such port, or it cannot be set up.
pub fn open(port: &str, baud: u32) -> io::Result<Box<dyn serialport::SerialPort>> {
    serialport::new(port, baud).timeout(PATIENCE).open().map_err(io::Error::from)
}

/// Finds messages and lines in what a device sends, and sends it commands.
pub struct Cable<P> {
    port: P,
    decoder: Decoder,
    found: VecDeque<Received>,
}

impl<P: Read + Write> Cable<P> {
    /// A cable in `port`, whose reads should time out now and then.
    pub fn new(port: P) -> Self {
        Self { port, decoder: Decoder::new(), found: VecDeque::new() }
    }

    /// Sends a command and Enter.
    ///
    /// # Errors
    /// The port does not take it.
    pub fn command(&mut self, text: &str) -> io::Result<()> {
        self.port.write_all(format!("{text}\r").as_bytes())?;
        self.port.flush()
    }

    /// The next message or line; `None` when the other end has hung up, or at `deadline`.
    ///
    /// # Errors
    /// The port fails.
    pub fn next(&mut self, deadline: Option<Instant>) -> io::Result<Option<Received>> {
        let mut bytes = [0; 4096];
        while self.found.is_empty() {
            if deadline.is_some_and(|deadline| Instant::now() >= deadline) {
                return Ok(None);
            }
            match self.port.read(&mut bytes) {
                Ok(0) => return Ok(None),
                Ok(count) => self.found.extend(bytes[..count].iter().filter_map(|&byte| self.decoder.push(byte))),
                Err(error) if matches!(error.kind(), ErrorKind::TimedOut | ErrorKind::Interrupted) => {}
                Err(error) if is_hangup(&error) => return Ok(None),
                Err(error) => return Err(error),
            }
        }
        Ok(self.found.pop_front())
    }

    /// What was found and lost so far.
    pub fn counters(&self) -> DecoderCounters {
        self.decoder.counters()
    }
}

/// A pseudo-terminal whose other end was closed answers "input/output error".
fn is_hangup(error: &io::Error) -> bool {
    const EIO: i32 = 5;
    error.kind() == ErrorKind::BrokenPipe || error.raw_os_error() == Some(EIO)
}

/// How long the device may be silent.
const SILENCE: Duration = Duration::from_secs(10);

/// Why a device gave no recording.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CableError {
    /// The port failed.
    #[error("serial port: {0}")]
    Port(io::Error),
    /// The log could not be written.
    #[error("recording: {0}")]
    Log(io::Error),
    /// No raw stream came for [`SILENCE`], or the device hung up.
    #[error("the device sent no bursts for 10 s, after {0} of them")]
    Silent(u64),
}

/// What a recording off the cable holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Recorded {
    /// Bursts in the log.
    pub bursts: u64,
    /// Sample periods between the first and the last of which no burst came: lost on the device or on the line.
    pub missing: u64,
    /// What became of the bytes.
    pub counters: DecoderCounters,
}

/// Turns the stream on, writes `seconds` of it, by the device's clock, to the frame log `file`, and turns it off.
///
/// # Errors
/// The device is silent, or the port or the file fails; what came until then is in the file.
pub fn record<P: Read + Write>(cable: &mut Cable<P>, file: &Path, seconds: f64) -> Result<Recorded, CableError> {
    let mut tape = Tape::create(file).map_err(CableError::Log)?;
    cable.command("w 1").map_err(CableError::Port)?;
    let outcome = loop {
        if tape.seconds() >= seconds {
            break Ok(());
        }
        let deadline = Instant::now() + SILENCE;
        match next_raw(cable, deadline) {
            Ok(Some(raw)) => tape.write(&raw).map_err(CableError::Log)?,
            Ok(None) => break Err(CableError::Silent(tape.bursts)),
            Err(error) => break Err(CableError::Port(error)),
        }
    };
    // A device that hung up cannot be told any more.
    let _ = cable.command("w 0");
    let (bursts, missing) = (tape.bursts, tape.missing());
    tape.finish().map_err(CableError::Log)?;
    outcome.map(|()| Recorded { bursts, missing, counters: cable.counters() })
}

fn next_raw<P: Read + Write>(cable: &mut Cable<P>, deadline: Instant) -> io::Result<Option<RawMessage>> {
    while let Some(received) = cable.next(Some(deadline))? {
        if let Received::Message { message: Message::Raw(raw), .. } = received {
            return Ok(Some(raw));
        }
    }
    Ok(None)
}

/// A frame log that is written from the raw stream.
pub struct Tape {
    log: FrameLog,
    sens_avg: Option<u16>,
    bursts: u64,
    /// Number and time of the first and the last burst.
    span: Option<[(u64, u64); 2]>,
}

impl Tape {
    /// Creates the log.
    ///
    /// # Errors
    /// As the operating system answers.
    pub fn create(file: &Path) -> io::Result<Self> {
        Ok(Self { log: FrameLog::create(file)?, sens_avg: None, bursts: 0, span: None })
    }

    /// Adds the bursts of one message, each at the time of its data-ready edge. Where the range changes, and at the
    /// start, the write to SENS_AVG that set it is put in front, so that a replay knows it.
    ///
    /// # Errors
    /// As the operating system answers.
    pub fn write(&mut self, raw: &RawMessage) -> io::Result<()> {
        let (mut number, mut at_us) = (raw.first, raw.at_us);
        if self.sens_avg.replace(raw.sens_avg) != Some(raw.sens_avg) {
            let mosi = Register::SensAvg.write_high_frame(raw.sens_avg).to_vec();
            self.log.write(&Frame { time_s: seconds(at_us), miso: vec![0; mosi.len()], mosi })?;
        }
        for burst in &raw.bursts {
            number += u64::from(burst.periods);
            at_us += u64::from(burst.after_us);
            let mut miso = vec![0; 2];
            miso.extend_from_slice(burst.words.as_flattened());
            self.log.write(&Frame { time_s: seconds(at_us), mosi: BURST_REQUEST.to_vec(), miso })?;
            self.bursts += 1;
            let first = self.span.map_or((number, at_us), |[first, _]| first);
            self.span = Some([first, (number, at_us)]);
        }
        Ok(())
    }

    /// Writes what is buffered and closes the log.
    ///
    /// # Errors
    /// As the operating system answers.
    pub fn finish(self) -> io::Result<()> {
        self.log.finish()
    }

    /// Time from the first burst to the last, s.
    pub fn seconds(&self) -> f64 {
        self.span.map_or(0.0, |[(_, first), (_, last)]| seconds(last.saturating_sub(first)))
    }

    /// Sample periods of which no burst came.
    pub fn missing(&self) -> u64 {
        self.span.map_or(0, |[(first, _), (last, _)]| (last.saturating_sub(first) + 1).saturating_sub(self.bursts))
    }
}

fn seconds(us: u64) -> f64 {
    us as f64 / 1e6
}
