//! Members of a gzip file (RFC 1952, section 2.2).

use flate2::bufread::GzDecoder;
use std::io::{self, BufRead, ErrorKind, Read};

pub(crate) const GZIP_MAGIC: [u8; 2] = [0x1f, 0x8b];

/// All members; blanks, line ends and zeros behind them are skipped.
pub(crate) struct GzipMembers<R> {
    /// `None` after the last.
    member: Option<GzDecoder<R>>,
}

impl<R: BufRead> GzipMembers<R> {
    pub(crate) fn new(input: R) -> Self {
        Self { member: Some(GzDecoder::new(input)) }
    }
}

impl<R: BufRead> Read for GzipMembers<R> {
    /// # Errors
    /// `UnexpectedEof` for a truncated member, `InvalidInput` for a damaged one, `InvalidData` for other bytes behind a member.
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        while let Some(member) = &mut self.member {
            let count = member.read(buffer)?;
            if count > 0 || buffer.is_empty() {
                return Ok(count);
            }
            let Some(mut input) = self.member.take().map(GzDecoder::into_inner) else { break };
            match skip_padding(&mut input)? {
                None => {}
                Some(first) if first == GZIP_MAGIC[0] => self.member = Some(GzDecoder::new(input)),
                Some(_) => return Err(ErrorKind::InvalidData.into()),
            }
        }
        Ok(0)
    }
}

/// Not consumed; `None` at the end.
fn skip_padding(input: &mut impl BufRead) -> io::Result<Option<u8>> {
    loop {
        let bytes = input.fill_buf()?;
        if bytes.is_empty() {
            return Ok(None);
        }
        let padding = bytes.iter().take_while(|byte| **byte == 0 || byte.is_ascii_whitespace()).count();
        let first = bytes.get(padding).copied();
        input.consume(padding);
        if first.is_some() {
            return Ok(first);
        }
    }
}
