//! The serial link to the firmware, and recording of its raw bursts as a frame log.

use crate::counts::frame_log::{Frame, FrameLogWriter};
use adis16405_driver::{BURST_REQUEST, Register};
use link::{Decoder, DecoderCounters, Message, RawMessage, Received};
#[cfg(feature = "serial")]
use serial2::SerialPort;
use std::collections::VecDeque;
use std::fs::File;
use std::io::{self, ErrorKind, Read, Write};
use std::path::Path;
use std::time::{Duration, Instant};

/// Baud rate of the firmware's boards, Bd.
pub const BAUD: u32 = 460_800;

/// Longest wait of a read, and so the resolution of deadlines.
const READ_TIMEOUT: Duration = Duration::from_millis(50);

/// Longest time without a burst during a recording.
const MAX_SILENCE: Duration = Duration::from_secs(10);

/// Silence after which the raw stream is requested again.
const ASK_AGAIN: Duration = Duration::from_secs(2);

/// Opens a device file or pseudo-terminal at `baud` Bd.
///
/// # Errors
/// There is no such port, or it cannot be set up.
#[cfg(feature = "serial")]
pub fn open(port: &str, baud: u32) -> io::Result<SerialPort> {
    let mut port = SerialPort::open(port, baud)?;
    port.set_read_timeout(READ_TIMEOUT)?;
    Ok(port)
}

/// As far as the system lists them.
#[cfg(feature = "serial")]
#[must_use]
pub fn ports() -> Vec<String> {
    let ports = SerialPort::available_ports().unwrap_or_default();
    ports.into_iter().map(|port| port.display().to_string()).collect()
}

/// Receives the messages and text lines of a device and sends it commands.
pub struct SerialLink<P> {
    port: P,
    decoder: Decoder,
    received: VecDeque<Received>,
    disconnected: bool,
}

impl<P: Read + Write> SerialLink<P> {
    /// Reads of `port` must time out, for the deadline of [`next`](Self::next).
    pub fn new(port: P) -> Self {
        Self { port, decoder: Decoder::new(), received: VecDeque::new(), disconnected: false }
    }

    /// Sends a line, ended by a carriage return.
    pub fn send_command(&mut self, text: &str) -> io::Result<()> {
        self.port.write_all(format!("{text}\r").as_bytes())?;
        self.port.flush()
    }

    /// `None` after a disconnection, or at `deadline`.
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
                Ok(0) => {
                    self.disconnected = true;
                    return Ok(None);
                }
                Ok(count) => self.received.extend(bytes[..count].iter().filter_map(|&byte| self.decoder.push(byte))),
                Err(error) if matches!(error.kind(), ErrorKind::TimedOut | ErrorKind::Interrupted) => {}
                Err(error) if is_hang_up(&error) => {
                    self.disconnected = true;
                    return Ok(None);
                }
                Err(error) => return Err(error),
            }
        }
        Ok(self.received.pop_front())
    }

    /// True if the device has closed the port.
    pub fn is_disconnected(&self) -> bool {
        self.disconnected
    }

    /// Messages received, missing and damaged.
    pub fn counters(&self) -> DecoderCounters {
        self.decoder.counters()
    }
}

/// A closed pseudo-terminal answers EIO.
fn is_hang_up(error: &io::Error) -> bool {
    const EIO: i32 = 5;
    error.kind() == ErrorKind::BrokenPipe || error.raw_os_error() == Some(EIO)
}

/// Why a device gave no recording.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SerialRecordingError {
    #[error("serial port: {0}")]
    Port(io::Error),
    #[error("recording: {0}")]
    Log(io::Error),
    /// No burst came for 10 s.
    #[error("the device sent no bursts for 10 s, after {0} of them")]
    Silent(u64),
    #[error("the device hung up, after {0} bursts")]
    Disconnected(u64),
    #[error("a duration of {0} s: it must be positive and finite")]
    Duration(f64),
}

/// Counts of a recording over the serial link.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SerialRecordingSummary {
    pub bursts: u64,
    /// Sample periods without a burst between first and last, except during restarts.
    pub missing: u64,
    pub restarts: u64,
    /// True if ended early.
    pub interrupted: bool,
    /// Bursts before the device hung up or fell silent.
    pub lost_after: Option<u64>,
    pub counters: DecoderCounters,
}

/// Records `seconds` of the raw stream, by the device's clock, to the frame log `file`. Ends early when
/// `is_interrupted` returns true. The file is created at the first burst.
///
/// # Errors
/// The device is silent or hangs up before its first burst, or the port or the file fails. The bursts that came until
/// then are in the file.
pub fn record<P: Read + Write>(
    link: &mut SerialLink<P>,
    file: &Path,
    seconds: f64,
    is_interrupted: impl Fn() -> bool,
) -> Result<SerialRecordingSummary, SerialRecordingError> {
    if !(seconds.is_finite() && seconds > 0.0) {
        return Err(SerialRecordingError::Duration(seconds));
    }
    let mut recorder: Option<RawStreamRecorder> = None;
    let bursts = |recorder: &Option<RawStreamRecorder>| recorder.as_ref().map_or(0, |recorder| recorder.bursts);
    link.send_command("w 1").map_err(SerialRecordingError::Port)?;
    let mut silent_since = Instant::now();
    let mut asked = silent_since;
    let outcome = loop {
        if recorder.as_ref().is_some_and(|recorder| recorder.seconds() >= seconds) {
            break Ok(false);
        }
        if is_interrupted() {
            break Ok(true);
        }
        match next_raw(link, Instant::now() + READ_TIMEOUT) {
            Ok(Some(raw)) => {
                silent_since = Instant::now();
                if let Err(error) = write(&mut recorder, file, &raw) {
                    break Err(SerialRecordingError::Log(error));
                }
            }
            Ok(None) if link.is_disconnected() => break Err(SerialRecordingError::Disconnected(bursts(&recorder))),
            Ok(None) if silent_since.elapsed() >= MAX_SILENCE => {
                break Err(SerialRecordingError::Silent(bursts(&recorder)));
            }
            Ok(None) => {
                // A restarted device has forgotten the command.
                if asked.elapsed() >= ASK_AGAIN && silent_since.elapsed() >= ASK_AGAIN {
                    let _ = link.send_command("w 1");
                    asked = Instant::now();
                }
            }
            Err(error) => break Err(SerialRecordingError::Port(error)),
        }
    };
    // The outcome already reports a disconnection.
    let _ = link.send_command("w 0");
    let mut summary = SerialRecordingSummary {
        bursts: 0,
        missing: 0,
        restarts: 0,
        interrupted: false,
        lost_after: None,
        counters: link.counters(),
    };
    let mut finished = Ok(());
    if let Some(recorder) = recorder {
        (summary.bursts, summary.missing, summary.restarts) = (recorder.bursts, recorder.missing, recorder.restarts);
        finished = recorder.finish().map_err(SerialRecordingError::Log);
    }
    // The log is good up to here.
    summary.interrupted = match outcome {
        Err(SerialRecordingError::Disconnected(bursts) | SerialRecordingError::Silent(bursts)) if bursts > 0 => {
            summary.lost_after = Some(bursts);
            true
        }
        outcome => outcome?,
    };
    finished?;
    Ok(summary)
}

/// True if `start` has a message of a raw stream.
pub(crate) fn is_capture(start: &[u8]) -> bool {
    let mut decoder = Decoder::new();
    start.iter().any(|&byte| matches!(decoder.push(byte), Some(Received::Message { message: Message::Raw(_), .. })))
}

/// Writes the bursts of `capture`, bytes of a raw stream, as a frame log to `out` (an error of either); restarts take no time.
pub(crate) fn log_of_capture(mut capture: impl Read, out: impl Write) -> io::Result<()> {
    let mut recorder = RawStreamRecorder::new(FrameLogWriter::new(out));
    let mut decoder = Decoder::new();
    let mut bytes = [0; 4096];
    loop {
        let count = match capture.read(&mut bytes) {
            Ok(0) => return recorder.finish(),
            Ok(count) => count,
            Err(error) if error.kind() == ErrorKind::Interrupted => continue,
            Err(error) => return Err(error),
        };
        for &byte in &bytes[..count] {
            if let Some(Received::Message { message: Message::Raw(raw), .. }) = decoder.push(byte) {
                recorder.write_received(&raw, None)?;
            }
        }
    }
}

/// The log is created before the first burst.
fn write(recorder: &mut Option<RawStreamRecorder>, file: &Path, raw: &RawMessage) -> io::Result<()> {
    if recorder.is_none() && !raw.bursts.is_empty() {
        *recorder = Some(RawStreamRecorder::create(file)?);
    }
    recorder.as_mut().map_or(Ok(()), |recorder| recorder.write(raw))
}

fn next_raw<P: Read + Write>(link: &mut SerialLink<P>, deadline: Instant) -> io::Result<Option<RawMessage>> {
    while let Some(received) = link.next(Some(deadline))? {
        if let Received::Message { message: Message::Raw(raw), .. } = received {
            return Ok(Some(raw));
        }
    }
    Ok(None)
}

/// Writes a raw stream to a frame log. After a restart, time goes on by the host's clock.
pub struct RawStreamRecorder<W = File> {
    log: FrameLogWriter<W>,
    /// SENS_AVG as last logged.
    sens_avg: Option<u16>,
    bursts: u64,
    missing: u64,
    restarts: u64,
    /// First burst in the log, µs.
    first_us: Option<u64>,
    last: Option<LastBurst>,
    /// Log time less device time, µs.
    offset_us: i128,
}

struct LastBurst {
    /// Device counter and clock.
    number: u64,
    at_us: u64,
    /// In the log, µs.
    logged_us: u64,
    /// By the host; `None` where it is not known.
    received: Option<Instant>,
}

impl RawStreamRecorder {
    /// Creates the log.
    pub fn create(file: &Path) -> io::Result<Self> {
        FrameLogWriter::create(file).map(Self::new)
    }
}

impl<W: Write> RawStreamRecorder<W> {
    fn new(log: FrameLogWriter<W>) -> Self {
        Self { log, sens_avg: None, bursts: 0, missing: 0, restarts: 0, first_us: None, last: None, offset_us: 0 }
    }

    /// Adds the bursts of a message at their data-ready times. A frame that writes SENS_AVG comes first and at changes,
    /// for the range in a replay.
    pub fn write(&mut self, raw: &RawMessage) -> io::Result<()> {
        self.write_received(raw, Some(Instant::now()))
    }

    /// For a message received at `received`, where it is known.
    fn write_received(&mut self, raw: &RawMessage, received: Option<Instant>) -> io::Result<()> {
        if raw.bursts.is_empty() {
            return Ok(());
        }
        let (mut number, mut at_us) = (raw.first, raw.at_us);
        // New settings restart the device's count.
        if let Some(last) = self.last.as_mut().filter(|last| number < last.number) {
            last.number = number.saturating_sub(1);
        }
        if let Some(last) = self.last.take_if(|last| at_us < last.at_us) {
            self.restarts += 1;
            let passed = received.zip(last.received).map(|(now, before)| now - before);
            let passed_us = passed.unwrap_or_default().as_micros().max(1) as i128;
            self.offset_us = i128::from(last.logged_us) + passed_us - i128::from(at_us);
        }
        let logged = |at_us: u64, offset_us: i128| u64::try_from(i128::from(at_us) + offset_us).unwrap_or(u64::MAX);
        if self.sens_avg.replace(raw.sens_avg) != Some(raw.sens_avg) {
            let mosi = Register::SensAvg.write_high_frame(raw.sens_avg).to_vec();
            self.log.write(&Frame {
                time_s: seconds(logged(at_us, self.offset_us)),
                miso: vec![0; mosi.len()],
                mosi,
            })?;
        }
        for burst in &raw.bursts {
            number = number.saturating_add(u64::from(burst.periods));
            at_us = at_us.saturating_add(u64::from(burst.after_us));
            let logged_us = logged(at_us, self.offset_us);
            let mut miso = vec![0; 2];
            miso.extend_from_slice(burst.words.as_flattened());
            self.log.write(&Frame { time_s: seconds(logged_us), mosi: BURST_REQUEST.to_vec(), miso })?;
            self.bursts += 1;
            self.first_us.get_or_insert(logged_us);
            let before = self.last.replace(LastBurst { number, at_us, logged_us, received });
            self.missing += before.map_or(0, |before| number.saturating_sub(before.number).saturating_sub(1));
        }
        Ok(())
    }

    /// Writes what is buffered and closes the log.
    pub fn finish(self) -> io::Result<()> {
        self.log.finish()
    }

    /// Time from the first burst to the last, s.
    pub fn seconds(&self) -> f64 {
        let last_us = self.last.as_ref().map(|last| last.logged_us);
        self.first_us.zip(last_us).map_or(0.0, |(first, last)| seconds(last.saturating_sub(first)))
    }

    /// Sample periods without a burst, except during restarts.
    pub fn missing(&self) -> u64 {
        self.missing
    }
}

fn seconds(us: u64) -> f64 {
    us as f64 / 1e6
}
