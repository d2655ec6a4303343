//! The wire format between the firmware and the host.
//!
//! A frame is a [`Message`] with the format's version and a sequence number, as postcard, followed by its CRC-32 (ISO-HDLC, little
//! endian), made free of zero bytes by COBS and enclosed in a zero byte at either end. The leading zero ends
//! whatever noise or text came before, so that it costs a receiver the noise and never the frame.
//!
//! Between frames there may be lines of plain text, for a person with any terminal program: printable ASCII that ends in
//! CR LF, enclosed in zero bytes too.
//!
//! [`Encoder`] turns messages into frames, [`Decoder`] finds the frames in a stream of bytes and counts what it
//! could not use. Neither panics, whatever it is fed.
#![no_std]
#![forbid(unsafe_code)]
#![deny(missing_docs)]

mod decode;
mod encode;
mod message;
mod text;

pub use decode::{Counters, Decoder, Received};
pub use encode::Encoder;
pub use message::{
    Boot, BootCause, Bounded, Cause, ChannelReport, Checked, Coefficient, Drift, Effect, Health, Hello, Learnt,
    MAX_CAUSES, MAX_COEFFICIENTS, MAX_DRIFTS, MAX_EFFECTS, MAX_POINTS, MAX_RAW, MAX_TEXT, Message, MessageRef,
    ModelError, Point, Raw, RawBurst, Shift, Term,
};
pub use text::{Line, line_bytes};

/// Version of the format. Messages and their fields are only ever appended to within a version.
pub const VERSION: u8 = 3;

/// Longest frame in bytes, both zero bytes included.
///
/// A channel report with [`MAX_POINTS`] points and [`MAX_COEFFICIENTS`] coefficients, every integer in its longest
/// encoding, takes 1 397 bytes before COBS, which adds one byte in 254.
pub const MAX_FRAME: usize = 1408;

/// Longest frame of the raw stream in bytes: [`MAX_RAW`] bursts, every integer in its longest encoding.
pub const MAX_RAW_FRAME: usize = 584;

/// What COBS encloses: the message between the version and sequence number and the checksum.
#[derive(serde::Serialize, serde::Deserialize)]
struct Envelope<M> {
    version: u8,
    sequence: u16,
    message: M,
}

const CRC: crc::Crc<u32> = crc::Crc::<u32>::new(&crc::CRC_32_ISO_HDLC);
