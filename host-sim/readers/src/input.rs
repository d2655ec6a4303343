//! Bytes and lines as they are read, and their errors.

pub(crate) mod budget;
pub mod delimited_text;
pub(crate) mod file_bytes;
pub(crate) mod file_hash;
pub(crate) mod gzip_members;
pub(crate) mod input_error;
pub(crate) mod read_ahead;
pub(crate) mod read_monitor;
pub(crate) mod threads;
pub(crate) mod utf16_reader;
pub(crate) mod zstd_frames;
