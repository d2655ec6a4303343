//! Opening a file, plain or gzip, by its first bytes and not by its name.

use super::{InputError, Reason, frame_log};
use flate2::bufread::MultiGzDecoder;
use std::fs::File;
use std::io::{self, BufRead, BufReader, Cursor, Read};
use std::path::Path;

/// First two bytes of every gzip member (RFC 1952, section 2.3.1).
const GZIP_MAGIC: [u8; 2] = [0x1f, 0x8b];

/// Decompressed bytes of an open file.
pub type Input = BufReader<Box<dyn Read>>;

/// Opens `file`; a gzip stream is decompressed on the way.
///
/// # Errors
/// The file is missing, unreadable, a directory or empty.
pub fn open(file: &Path) -> Result<Input, InputError> {
    let fail = |reason| InputError::file(file, reason);
    let mut raw = File::open(file).map_err(|e| fail(Reason::Io(e)))?;
    if raw.metadata().map_err(|e| fail(Reason::Io(e)))?.is_dir() {
        return Err(fail(Reason::Directory));
    }
    // Read, not seek: the file may be a pipe.
    let mut start = Vec::with_capacity(2);
    raw.by_ref().take(2).read_to_end(&mut start).map_err(|e| fail(Reason::Io(e)))?;
    if start.is_empty() {
        return Err(fail(Reason::Empty));
    }
    let compressed = start == GZIP_MAGIC;
    let whole = BufReader::with_capacity(1 << 16, Cursor::new(start).chain(raw));
    let bytes: Box<dyn Read> = if compressed { Box::new(MultiGzDecoder::new(whole)) } else { Box::new(whole) };
    Ok(BufReader::with_capacity(1 << 16, bytes))
}

/// Whether `file` is a log of bus transactions, by its header line.
///
/// # Errors
/// As [`open`], or the first line cannot be read.
pub fn is_frame_log(file: &Path) -> Result<bool, InputError> {
    let mut header = Vec::new();
    open(file)?
        .take(frame_log::HEADER.len() as u64 + 2)
        .read_until(b'\n', &mut header)
        .map_err(|e| read_error(file, 1, e))?;
    Ok(header.trim_ascii() == frame_log::HEADER.as_bytes())
}

/// A failed read, with the faults of the compression told apart from those of the disk.
pub(super) fn read_error(file: &Path, line: u64, error: io::Error) -> InputError {
    let reason = match error.kind() {
        io::ErrorKind::UnexpectedEof => Reason::TruncatedGzip,
        io::ErrorKind::InvalidInput => Reason::DamagedGzip(error),
        _ => Reason::Io(error),
    };
    InputError::line(file, line, reason)
}
