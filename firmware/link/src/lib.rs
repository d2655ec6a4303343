//! The wire format between the firmware and the host, version 4.
//!
//! **Frames.** A frame carries one [`Message`]: format version (`u8`), sequence number (`u16`) and message, serialised by
//! postcard, then the CRC-32 (ISO-HDLC, little endian) of these bytes. The whole is COBS-encoded, so that it contains no
//! zero byte, and enclosed in a zero byte at either end. The leading zero byte terminates noise or text before the frame, so that the
//! receiver discards that and not the frame.
//!
//! **Text lines.** Between frames there may be lines of plain text for a terminal program: printable ASCII that ends in CR
//! LF, also enclosed in zero bytes.
//!
//! [`Encoder`] turns messages into frames. [`Decoder`] finds frames and text lines in a stream of bytes and counts what it
//! could not use. Neither panics on any input.
#![no_std]
#![forbid(unsafe_code)]
#![deny(missing_docs)]

mod frame;
mod message;
mod text;

pub use frame::{Decoder, DecoderCounters, Encoder, MAX_FRAME, MAX_RAW_FRAME, Received, VERSION};
pub use message::{
    Boot, BootCause, ChannelMessage, ClockSource, Counter, Health, Hello, LearnedMessage, MAX_ADDED_TERMS,
    MAX_COEFFICIENTS, MAX_COVARIATES, MAX_DEVIATIONS, MAX_OCTAVES, MAX_RAW_BURSTS, Message, MessageRef, RawBurst,
    RawMessage, ReportedAddedTerm, ReportedCoefficient, ReportedDeviations, ReportedModelError, ReportedOctave,
    ReportedParameter, ReportedRegressor, ReportedShift, ReportedTerm, ValidationMessage,
};
pub use text::{MAX_TEXT, TextLine, text_line, wire_bytes};
