//! The serial link to a device that runs the firmware, and the recording of its raw bursts as a frame log.

use crate::frame_log::{Frame, FrameLogWriter};
use adis16405_driver::{BURST_REQUEST, Register};
use link::{Decoder, DecoderCounters, Message, RawMessage, Received};
use std::collections::VecDeque;
use std::io::{self, ErrorKind, Read, Write};
use std::path::Path;
use std::time::{Duration, Instant};

/// Baud rate of the firmware's boards, Bd.
pub const BAUD: u32 = 460_800;

/// Longest time that a read waits for bytes. Deadlines are checked as often.
const READ_TIMEOUT: Duration = Duration::from_millis(50);

/// Longest time without a burst during a recording.
const MAX_SILENCE: Duration = Duration::from_secs(10);

/// Opens the serial port `port`, a device file or a pseudo-terminal, at `baud` Bd.
///
/// # Errors
/// There is no such port, or it cannot be set up.
pub fn open(port: &str, baud: u32) -> io::Result<Box<dyn serialport::SerialPort>> {
    serialport::new(port, baud).timeout(READ_TIMEOUT).open().map_err(io::Error::from)
}

/// Receives the messages and text lines of a device and sends it commands.
pub struct SerialLink<P> {
    port: P,
    decoder: Decoder,
    received: VecDeque<Received>,
}

impl<P: Read + Write> SerialLink<P> {
    /// A link over `port`. Its reads must time out, or [`next`](Self::next) does not return at its deadline.
    pub fn new(port: P) -> Self {
        Self { port, decoder: Decoder::new(), received: VecDeque::new() }
    }

    /// Sends a command line, ended by a carriage return.
    ///
    /// # Errors
    /// The port cannot be written.
    pub fn send_command(&mut self, text: &str) -> io::Result<()> {
        self.port.write_all(format!("{text}\r").as_bytes())?;
        self.port.flush()
    }

    /// The next message or text line; `None` when the device has disconnected, or at `deadline`.
    ///
    /// # Errors
    /// The port fails.
    pub fn next(&mut self, deadline: Option<Instant>) -> io::Result<Option<Received>> {
        let mut bytes = [0; 4096];
        while self.received.is_empty() {
            if deadline.is_some_and(|deadline| Instant::now() >= deadline) {
                return Ok(None);
            }
            match self.port.read(&mut bytes) {
                Ok(0) => return Ok(None),
                Ok(count) => self.received.extend(bytes[..count].iter().filter_map(|&byte| self.decoder.push(byte))),
                Err(error) if matches!(error.kind(), ErrorKind::TimedOut | ErrorKind::Interrupted) => {}
                Err(error) if is_disconnected(&error) => return Ok(None),
                Err(error) => return Err(error),
            }
        }
        Ok(self.received.pop_front())
    }

    /// Numbers of messages received, missing and damaged so far.
    pub fn counters(&self) -> DecoderCounters {
        self.decoder.counters()
    }
}

/// Whether the other end has closed the port: a pseudo-terminal then answers EIO.
fn is_disconnected(error: &io::Error) -> bool {
    const EIO: i32 = 5;
    error.kind() == ErrorKind::BrokenPipe || error.raw_os_error() == Some(EIO)
}

/// Why a device gave no recording.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SerialRecordingError {
    /// The port failed.
    #[error("serial port: {0}")]
    Port(io::Error),
    /// The log could not be written.
    #[error("recording: {0}")]
    Log(io::Error),
    /// No burst came for 10 s, or the device disconnected.
    #[error("the device sent no bursts for 10 s, after {0} of them")]
    Silent(u64),
}

/// Counts of a recording over the serial link.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SerialRecordingSummary {
    /// Bursts in the log.
    pub bursts: u64,
    /// Sample periods between the first and the last burst of which no burst came: lost on the device or on the link.
    pub missing: u64,
    /// Of the link.
    pub counters: DecoderCounters,
}

/// Turns the raw stream on, writes `seconds` of it, by the device's clock, to the frame log `file`, and turns it off.
///
/// # Errors
/// The device is silent, or the port or the file fails. The bursts that came until then are in the file.
pub fn record<P: Read + Write>(
    link: &mut SerialLink<P>,
    file: &Path,
    seconds: f64,
) -> Result<SerialRecordingSummary, SerialRecordingError> {
    let mut recorder = RawStreamRecorder::create(file).map_err(SerialRecordingError::Log)?;
    link.send_command("w 1").map_err(SerialRecordingError::Port)?;
    let outcome = loop {
        if recorder.seconds() >= seconds {
            break Ok(());
        }
        match next_raw(link, Instant::now() + MAX_SILENCE) {
            Ok(Some(raw)) => recorder.write(&raw).map_err(SerialRecordingError::Log)?,
            Ok(None) => break Err(SerialRecordingError::Silent(recorder.bursts)),
            Err(error) => break Err(SerialRecordingError::Port(error)),
        }
    };
    // A device that has disconnected cannot be told; the outcome says so already.
    let _ = link.send_command("w 0");
    let (bursts, missing) = (recorder.bursts, recorder.missing());
    recorder.finish().map_err(SerialRecordingError::Log)?;
    outcome.map(|()| SerialRecordingSummary { bursts, missing, counters: link.counters() })
}

fn next_raw<P: Read + Write>(link: &mut SerialLink<P>, deadline: Instant) -> io::Result<Option<RawMessage>> {
    while let Some(received) = link.next(Some(deadline))? {
        if let Received::Message { message: Message::Raw(raw), .. } = received {
            return Ok(Some(raw));
        }
    }
    Ok(None)
}

/// Writes the raw stream of a device to a frame log.
pub struct RawStreamRecorder {
    log: FrameLogWriter,
    /// Register SENS_AVG as last written to the log.
    sens_avg: Option<u16>,
    bursts: u64,
    /// Sample number and time in µs of the first and the last burst.
    span: Option<[(u64, u64); 2]>,
}

impl RawStreamRecorder {
    /// Creates the log.
    ///
    /// # Errors
    /// The file cannot be created.
    pub fn create(file: &Path) -> io::Result<Self> {
        Ok(Self { log: FrameLogWriter::create(file)?, sens_avg: None, bursts: 0, span: None })
    }

    /// Adds the bursts of one message, each at the time of its data-ready edge. At the start and where SENS_AVG changes, a
    /// frame that writes it comes first, from which a replay takes the gyroscopes' range.
    ///
    /// # Errors
    /// The file cannot be written.
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
    /// The file cannot be written.
    pub fn finish(self) -> io::Result<()> {
        self.log.finish()
    }

    /// Time from the first burst to the last, s.
    pub fn seconds(&self) -> f64 {
        self.span.map_or(0.0, |[(_, first), (_, last)]| seconds(last.saturating_sub(first)))
    }

    /// Sample periods between the first and the last burst of which no burst came.
    pub fn missing(&self) -> u64 {
        self.span.map_or(0, |[(first, _), (last, _)]| (last.saturating_sub(first) + 1).saturating_sub(self.bursts))
    }
}

fn seconds(us: u64) -> f64 {
    us as f64 / 1e6
}
