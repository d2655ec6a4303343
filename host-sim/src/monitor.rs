//! The host's end of the serial cable.

mod compensation;
mod lesson;
mod wording;

pub use compensation::{Compensated, Compensation};
pub use wording::Narrator;

use link::{Counters, Decoder, Received};
use std::collections::VecDeque;
use std::io::{self, ErrorKind, Read, Write};
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
    pub fn counters(&self) -> Counters {
        self.decoder.counters()
    }
}

/// A pseudo-terminal whose other end was closed answers "input/output error".
fn is_hangup(error: &io::Error) -> bool {
    const EIO: i32 = 5;
    error.kind() == ErrorKind::BrokenPipe || error.raw_os_error() == Some(EIO)
}

/// Shows what comes until the other end hangs up or `deadline`.
///
/// # Errors
/// The port fails, or `out`.
pub fn show<P: Read + Write>(cable: &mut Cable<P>, deadline: Option<Instant>, out: &mut impl Write) -> io::Result<()> {
    let mut narrator = Narrator::default();
    while let Some(received) = cable.next(deadline)? {
        for line in narrator.lines(&received) {
            writeln!(out, "{line}")?;
        }
        out.flush()?;
    }
    writeln!(out, "{}", summary(&cable.counters()))
}

/// One line on what was found and lost.
pub fn summary(counters: &Counters) -> String {
    let Counters { frames, lines, bad_frames, other_version, missing, discarded_bytes } = counters;
    format!(
        "{frames} messages, {missing} missing by their numbers, {lines} lines, {bad_frames} damaged, \
         {other_version} of another version, {discarded_bytes} bytes of noise"
    )
}
