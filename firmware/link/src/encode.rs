//! From messages to frames.

use crate::{CRC, Envelope, MAX_FRAME, Message, VERSION};
use heapless::Vec;
use postcard::ser_flavors::{Cobs, Slice, crc::CrcModifier};

/// The bytes of one frame, zero bytes at either end included.
pub type Frame = Vec<u8, MAX_FRAME>;

/// Numbers the messages and frames them.
#[derive(Debug, Default)]
pub struct Encoder {
    sequence: u16,
}

impl Encoder {
    /// An encoder whose first frame has the sequence number 0.
    #[must_use]
    pub const fn new() -> Self {
        Self { sequence: 0 }
    }

    /// The frame of a message, or `None` if it would be longer than [`MAX_FRAME`]; a message that was refused takes no
    /// sequence number.
    pub fn encode(&mut self, message: &Message) -> Option<Frame> {
        let mut frame = Frame::new();
        frame.resize(MAX_FRAME, 0).ok()?;
        let (_leading_zero, rest) = frame.split_first_mut()?;
        let cobs = Cobs::try_new(Slice::new(rest)).ok()?;
        let checked = CrcModifier::new(cobs, CRC.digest());
        let envelope = Envelope { version: VERSION, sequence: self.sequence, message };
        let length = postcard::serialize_with_flavor(&envelope, checked).ok()?.len();
        frame.truncate(1 + length);
        self.sequence = self.sequence.wrapping_add(1);
        Some(frame)
    }
}
