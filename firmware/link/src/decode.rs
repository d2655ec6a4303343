//! From bytes to messages, resynchronising after noise.

use crate::text::{self, Line};
use crate::{CRC, Envelope, MAX_FRAME, Message, VERSION};
use heapless::Vec;

/// What could not be used, and what is known to be missing.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Counters {
    /// Messages that arrived whole.
    pub frames: u64,
    /// Lines of text.
    pub lines: u64,
    /// Stretches between zero bytes that were neither: noise or damage.
    pub bad_frames: u64,
    /// Valid frames of a version that is not understood here.
    pub other_version: u64,
    /// Messages that are missing by their sequence numbers.
    pub missing: u64,
    /// Bytes that belonged to neither frame nor line.
    pub discarded_bytes: u64,
}

/// What was found in the stream.
#[derive(Debug, Clone, PartialEq)]
#[allow(clippy::large_enum_variant, reason = "looked at and dropped one at a time")]
pub enum Received {
    /// A message.
    Message {
        /// Its number, counted modulo 2¹⁶ by the sender.
        sequence: u16,
        /// What was said.
        message: Message,
    },
    /// A line of text.
    Line(Line),
}

impl Received {
    /// The message, if it is one.
    #[must_use]
    pub fn message(self) -> Option<Message> {
        match self {
            Self::Message { message, .. } => Some(message),
            Self::Line(_) => None,
        }
    }
}

/// Finds the frames in a stream of bytes, given in pieces of any length.
#[derive(Debug, Default)]
pub struct Decoder {
    bytes: Vec<u8, MAX_FRAME>,
    overlong: bool,
    expected: Option<u16>,
    counters: Counters,
}

impl Decoder {
    /// A decoder that has seen nothing.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            bytes: Vec::new(),
            overlong: false,
            expected: None,
            counters: Counters { frames: 0, lines: 0, bad_frames: 0, other_version: 0, missing: 0, discarded_bytes: 0 },
        }
    }

    /// What was found and lost so far.
    #[must_use]
    pub const fn counters(&self) -> Counters {
        self.counters
    }

    /// Takes the bytes up to the end of the first valid frame or line: what was completed, and the rest that is still to
    /// be given.
    pub fn feed<'a>(&mut self, bytes: &'a [u8]) -> (Option<Received>, &'a [u8]) {
        let mut rest = bytes;
        while let Some((&byte, tail)) = rest.split_first() {
            rest = tail;
            if let Some(received) = self.push(byte) {
                return (Some(received), rest);
            }
        }
        (None, rest)
    }

    /// Takes one byte: the message or line that it completed, if any.
    pub fn push(&mut self, byte: u8) -> Option<Received> {
        if byte != 0 {
            if self.overlong {
                self.counters.discarded_bytes += 1;
            } else if self.bytes.push(byte).is_err() {
                self.overlong = true;
                self.counters.discarded_bytes += self.bytes.len() as u64 + 1;
                self.bytes.clear();
            }
            return None;
        }
        if core::mem::take(&mut self.overlong) {
            self.counters.bad_frames += 1;
            return None;
        }
        if self.bytes.is_empty() {
            return None; // two zeros in a row: the end of one frame and the start of the next
        }
        let length = self.bytes.len() as u64;
        if let Some(line) = text::line(&self.bytes) {
            self.bytes.clear();
            self.counters.lines += 1;
            return Some(Received::Line(line));
        }
        let outcome = open(&mut self.bytes);
        self.bytes.clear();
        match outcome {
            Ok(envelope) => return Some(self.accept(envelope)),
            Err(Refused::OtherVersion) => self.counters.other_version += 1,
            Err(Refused::Damaged) => {
                self.counters.discarded_bytes += length;
                self.counters.bad_frames += 1;
            }
        }
        None
    }

    fn accept(&mut self, envelope: Envelope<Message>) -> Received {
        let Envelope { sequence, message, .. } = envelope;
        if let Some(expected) = self.expected {
            self.counters.missing += u64::from(sequence.wrapping_sub(expected));
        }
        self.expected = Some(sequence.wrapping_add(1));
        self.counters.frames += 1;
        Received::Message { sequence, message }
    }
}

/// Why the bytes between two zero bytes are no message.
enum Refused {
    OtherVersion,
    Damaged,
}

/// Undoes COBS, checks the CRC-32 in the last four bytes, then the version in the first, and only then looks inside.
fn open(bytes: &mut [u8]) -> Result<Envelope<Message>, Refused> {
    let content = cobs::decode_in_place(bytes).ok().and_then(|length| bytes.get(..length));
    let Some((body, sum)) = content.and_then(<[u8]>::split_last_chunk::<4>) else {
        return Err(Refused::Damaged);
    };
    if CRC.checksum(body) != u32::from_le_bytes(*sum) {
        return Err(Refused::Damaged);
    }
    match body.first() {
        Some(&VERSION) => match postcard::take_from_bytes(body) {
            Ok((envelope, _appended_fields)) => Ok(envelope),
            Err(_) => Err(Refused::Damaged),
        },
        Some(_) => Err(Refused::OtherVersion),
        None => Err(Refused::Damaged),
    }
}

#[cfg(test)]
#[path = "decode_tests.rs"]
mod tests;
