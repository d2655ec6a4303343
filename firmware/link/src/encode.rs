//! From messages to frames, byte by byte as they leave: no frame is held whole.

use crate::{CRC, Envelope, MessageRef, VERSION};
use cobs::{EncoderState, PushResult};
use heapless::Vec;
use postcard::ser_flavors::{Flavor, crc::CrcModifier};

/// Numbers the messages and frames them.
#[derive(Debug, Default)]
pub struct Encoder {
    pub(crate) sequence: u16,
}

impl Encoder {
    /// An encoder whose first frame has the sequence number 0.
    #[must_use]
    pub const fn new() -> Self {
        Self { sequence: 0 }
    }

    /// Numbers a message that is lost before it can be sent, so that the receiver misses it.
    pub fn skip(&mut self) {
        self.sequence = self.sequence.wrapping_add(1);
    }

    /// Gives the frame of a message to `line`, in pieces.
    pub fn encode(&mut self, message: MessageRef<'_>, line: &mut dyn FnMut(&[u8])) {
        line(&[0]);
        let mut stretch = Vec::new();
        let cobs = Cobs { state: EncoderState::default(), stretch: &mut stretch, line };
        let checked = CrcModifier::new(cobs, CRC.digest());
        let envelope = Envelope { version: VERSION, sequence: self.sequence, message };
        // A flavor that takes every byte refuses no message.
        let _ = postcard::serialize_with_flavor(&envelope, checked);
        self.skip();
    }
}

/// Stretches without zeros leave as soon as they are complete, each behind its length.
struct Cobs<'a> {
    state: EncoderState,
    stretch: &'a mut Vec<u8, 254>,
    line: &'a mut dyn FnMut(&[u8]),
}

impl Cobs<'_> {
    fn add(&mut self, byte: u8) -> postcard::Result<()> {
        self.stretch.push(byte).map_err(|_| postcard::Error::SerializeBufferFull)
    }

    fn end_stretch(&mut self, length: u8) {
        (self.line)(&[length]);
        (self.line)(self.stretch);
        self.stretch.clear();
    }
}

impl Flavor for Cobs<'_> {
    type Output = ();

    fn try_push(&mut self, byte: u8) -> postcard::Result<()> {
        match self.state.push(byte) {
            PushResult::AddSingle(byte) => self.add(byte)?,
            PushResult::ModifyFromStartAndSkip((_, length)) => self.end_stretch(length),
            PushResult::ModifyFromStartAndPushAndSkip((_, length, byte)) => {
                self.add(byte)?;
                self.end_stretch(length);
            }
        }
        Ok(())
    }

    fn finalize(mut self) -> postcard::Result<()> {
        let (_, length) = self.state.clone().finalize();
        self.end_stretch(length);
        (self.line)(&[0]);
        Ok(())
    }
}
