//! Frames: messages to bytes and back, resynchronising after noise.

use crate::message::{Message, MessageRef};
use crate::text::{self, TextLine};
use cobs::{EncoderState, PushResult};
use heapless::Vec;
use postcard::ser_flavors::{Flavor, crc::CrcModifier};

/// Version of the format. Within a version, messages and their fields are only ever appended.
pub const VERSION: u8 = 4;

/// Longest frame in bytes, both zero bytes included.
///
/// A channel message with [`MAX_OCTAVES`](crate::MAX_OCTAVES) octaves and [`MAX_COEFFICIENTS`](crate::MAX_COEFFICIENTS)
/// coefficients, every integer in its longest encoding, takes 1539 bytes before COBS, which adds one byte in 254.
pub const MAX_FRAME: usize = 1551;

/// Longest frame of a raw or log message in bytes: [`MAX_RAW_BURSTS`](crate::MAX_RAW_BURSTS) bursts, every integer in its
/// longest encoding.
pub const MAX_RAW_FRAME: usize = 584;

/// Content of a frame between the COBS code and the checksum.
#[derive(serde::Serialize, serde::Deserialize)]
struct Envelope<M> {
    version: u8,
    sequence: u16,
    message: M,
}

const CRC: crc::Crc<u32> = crc::Crc::<u32>::new(&crc::CRC_32_ISO_HDLC);

/// Numbers messages and encodes them as frames.
///
/// A frame is emitted in pieces while it is encoded: the device has no buffer for a whole one.
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

    /// Uses up a sequence number for a message that is dropped, so that the receiver counts it as missing.
    pub fn skip(&mut self) {
        self.sequence = self.sequence.wrapping_add(1);
    }

    /// Passes the frame of a message to `output`, in pieces.
    pub fn encode(&mut self, message: MessageRef<'_>, output: &mut dyn FnMut(&[u8])) {
        output(&[0]);
        let mut block = Vec::new();
        let cobs = CobsFlavor { state: EncoderState::default(), block: &mut block, output };
        let with_crc = CrcModifier::new(cobs, CRC.digest());
        let envelope = Envelope { version: VERSION, sequence: self.sequence, message };
        // The flavor accepts every byte, so serialisation does not fail.
        let _ = postcard::serialize_with_flavor(&envelope, with_crc);
        self.skip();
    }
}

/// COBS encoder: every block of bytes without a zero is emitted as soon as it is complete, after its length byte.
struct CobsFlavor<'a> {
    state: EncoderState,
    block: &'a mut Vec<u8, 254>,
    output: &'a mut dyn FnMut(&[u8]),
}

impl CobsFlavor<'_> {
    fn add(&mut self, byte: u8) -> postcard::Result<()> {
        self.block.push(byte).map_err(|_| postcard::Error::SerializeBufferFull)
    }

    fn end_block(&mut self, length: u8) {
        (self.output)(&[length]);
        (self.output)(self.block);
        self.block.clear();
    }
}

impl Flavor for CobsFlavor<'_> {
    type Output = ();

    fn try_push(&mut self, byte: u8) -> postcard::Result<()> {
        match self.state.push(byte) {
            PushResult::AddSingle(byte) => self.add(byte)?,
            PushResult::ModifyFromStartAndSkip((_, length)) => self.end_block(length),
            PushResult::ModifyFromStartAndPushAndSkip((_, length, byte)) => {
                self.add(byte)?;
                self.end_block(length);
            }
        }
        Ok(())
    }

    fn finalize(mut self) -> postcard::Result<()> {
        let (_, length) = self.state.clone().finalize();
        self.end_block(length);
        (self.output)(&[0]);
        Ok(())
    }
}

/// Counts of the items that a [`Decoder`] has received and discarded.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct DecoderCounters {
    /// Valid messages.
    pub frames: u64,
    /// Text lines.
    pub lines: u64,
    /// Byte sequences between zero bytes that were neither: noise, or damaged frames.
    pub bad_frames: u64,
    /// Frames with a valid checksum but another format version.
    pub other_version: u64,
    /// Messages missing, by the sequence numbers of those that arrived.
    pub missing: u64,
    /// Bytes that belonged to neither a frame nor a text line.
    pub discarded_bytes: u64,
}

/// A message or text line from the stream.
#[derive(Debug, Clone, PartialEq)]
#[allow(clippy::large_enum_variant, reason = "values are processed and dropped one at a time")]
pub enum Received {
    /// A message.
    Message {
        /// Sequence number, counted modulo 2¹⁶ by the sender.
        sequence: u16,
        /// Content of the message.
        message: Message,
    },
    /// A text line.
    Text(TextLine),
}

impl Received {
    /// The message, if it is one.
    #[must_use]
    pub fn message(self) -> Option<Message> {
        match self {
            Self::Message { message, .. } => Some(message),
            Self::Text(_) => None,
        }
    }
}

/// Finds frames and text lines in a stream of bytes.
#[derive(Debug, Default)]
pub struct Decoder {
    bytes: Vec<u8, MAX_FRAME>,
    overlong: bool,
    expected_sequence: Option<u16>,
    counters: DecoderCounters,
}

impl Decoder {
    /// A decoder at the start of a stream.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            bytes: Vec::new(),
            overlong: false,
            expected_sequence: None,
            counters: DecoderCounters {
                frames: 0,
                lines: 0,
                bad_frames: 0,
                other_version: 0,
                missing: 0,
                discarded_bytes: 0,
            },
        }
    }

    /// Received and discarded items so far.
    #[must_use]
    pub const fn counters(&self) -> DecoderCounters {
        self.counters
    }

    /// Takes one byte and returns the message or text line that it completes, if any.
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
            return None; // two zero bytes in a row: the end of one frame and the start of the next
        }
        let length = self.bytes.len() as u64;
        if let Some(line) = text::parse(&self.bytes) {
            self.bytes.clear();
            self.counters.lines += 1;
            return Some(Received::Text(line));
        }
        let outcome = open(&mut self.bytes);
        self.bytes.clear();
        match outcome {
            Ok(envelope) => return Some(self.accept(envelope)),
            Err(FrameError::OtherVersion) => self.counters.other_version += 1,
            Err(FrameError::Damaged) => {
                self.counters.discarded_bytes += length;
                self.counters.bad_frames += 1;
            }
        }
        None
    }

    fn accept(&mut self, envelope: Envelope<Message>) -> Received {
        let Envelope { sequence, message, .. } = envelope;
        if let Some(expected) = self.expected_sequence {
            self.counters.missing += u64::from(sequence.wrapping_sub(expected));
        }
        self.expected_sequence = Some(sequence.wrapping_add(1));
        self.counters.frames += 1;
        Received::Message { sequence, message }
    }
}

/// The reason for which the bytes between two zero bytes are not a message.
enum FrameError {
    OtherVersion,
    Damaged,
}

/// Undoes COBS, checks the CRC-32 in the last four bytes, then the version in the first byte, and deserialises the rest.
fn open(bytes: &mut [u8]) -> Result<Envelope<Message>, FrameError> {
    let content = cobs::decode_in_place(bytes).ok().and_then(|length| bytes.get(..length));
    let Some((body, checksum)) = content.and_then(<[u8]>::split_last_chunk::<4>) else {
        return Err(FrameError::Damaged);
    };
    if CRC.checksum(body) != u32::from_le_bytes(*checksum) {
        return Err(FrameError::Damaged);
    }
    match body.first() {
        Some(&VERSION) => match postcard::take_from_bytes(body) {
            Ok((envelope, _appended_fields)) => Ok(envelope),
            Err(_) => Err(FrameError::Damaged),
        },
        Some(_) => Err(FrameError::OtherVersion),
        None => Err(FrameError::Damaged),
    }
}
