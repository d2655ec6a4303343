//! The host's end of the serial cable.

mod compensation;
mod lesson;
mod wording;

pub use compensation::{Compensated, Compensation};
pub use wording::Narrator;

use link::DecoderCounters;
use recordings::serial::Cable;
use std::io::{self, Read, Write};
use std::time::Instant;

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
pub fn summary(counters: &DecoderCounters) -> String {
    let DecoderCounters { frames, lines, bad_frames, other_version, missing, discarded_bytes } = counters;
    format!(
        "{frames} messages, {missing} missing by their numbers, {lines} lines, {bad_frames} damaged, \
         {other_version} of another version, {discarded_bytes} bytes of noise"
    )
}
