//! The messages of a device on the serial port, shown as text while they arrive.

use observatory::message_text::{MessageFormatter, SILENCE, summary};
use recordings::Printable;
use recordings::serial::SerialLink;
use std::io::{self, Read, Write};
use std::time::{Duration, Instant};

pub use observatory::message_text::LONG_SILENCE;

/// Writes every message to `out` until the device disconnects or `deadline`, then the [`summary`]. After `silence` without a message it
/// writes that nothing comes.
///
/// # Errors
/// The port fails, or `out` cannot be written.
pub fn show<P: Read + Write>(
    cable: &mut SerialLink<P>,
    deadline: Option<Instant>,
    silence: Duration,
    out: &mut impl Write,
) -> io::Result<()> {
    let mut formatter = MessageFormatter::default();
    loop {
        let silent = Instant::now() + silence;
        match cable.next(Some(deadline.map_or(silent, |deadline| deadline.min(silent))))? {
            Some(received) => {
                for line in formatter.lines(&received) {
                    writeln!(out, "{}", Printable(&line))?;
                }
            }
            None if cable.is_disconnected() || deadline.is_some_and(|deadline| Instant::now() >= deadline) => break,
            None => writeln!(out, "nothing received for {} s: {SILENCE}", silence.as_secs())?,
        }
        out.flush()?;
    }
    writeln!(out, "{}", summary(&cable.counters()))
}
