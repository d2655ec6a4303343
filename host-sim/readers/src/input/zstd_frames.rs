//! Zstandard, all frames.

use ruzstd::decoding::{FrameDecoder, StreamingDecoder};
use std::error::Error;
use std::io::{self, BufRead, ErrorKind, Read};

/// RFC 8878, 3.1.1.
pub(crate) const ZSTD_MAGIC: [u8; 4] = [0x28, 0xB5, 0x2F, 0xFD];
/// Less four bits, and header size.
const SKIPPABLE: [u8; 3] = [0x2A, 0x4D, 0x18];
const SKIPPABLE_HEADER: usize = 8;

pub(crate) struct ZstdFrames<R: BufRead> {
    frame: Option<StreamingDecoder<R, FrameDecoder>>,
    input: Option<R>,
}

impl<R: BufRead> ZstdFrames<R> {
    pub(crate) fn new(input: R) -> Self {
        Self { frame: None, input: Some(input) }
    }

    fn begin(&mut self) -> io::Result<bool> {
        while let Some(mut input) = self.input.take() {
            let start = input.fill_buf()?;
            if start.is_empty() {
                break;
            }
            if let [first, rest @ ..] = start
                && first & 0xF0 == 0x50
                && rest.starts_with(&SKIPPABLE)
            {
                let mut header = [0; SKIPPABLE_HEADER];
                input.read_exact(&mut header)?;
                let [.., a, b, c, d] = header;
                io::copy(&mut input.by_ref().take(u64::from(u32::from_le_bytes([a, b, c, d]))), &mut io::sink())?;
                self.input = Some(input);
                continue;
            }
            let frame = StreamingDecoder::new(input);
            self.frame = Some(frame.map_err(|error| ended_early(&error).unwrap_or_else(|| io::Error::other(error)))?);
            return Ok(true);
        }
        Ok(false)
    }
}

/// `UnexpectedEof` if that is the cause of `error`.
fn ended_early(error: &(dyn Error + 'static)) -> Option<io::Error> {
    let is_end = |error: &io::Error| error.kind() == ErrorKind::UnexpectedEof;
    // An `io::Error` has the source of the error inside of it.
    let inner =
        error.downcast_ref::<io::Error>().and_then(io::Error::get_ref).map(|inner| inner as &(dyn Error + 'static));
    let mut causes = std::iter::successors(inner.or(Some(error)), |&error| error.source());
    causes.any(|cause| cause.downcast_ref().is_some_and(is_end)).then(|| ErrorKind::UnexpectedEof.into())
}

impl<R: BufRead> Read for ZstdFrames<R> {
    /// # Errors
    /// `UnexpectedEof` if the data end early.
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        loop {
            if let Some(frame) = &mut self.frame {
                let read = frame.read(buffer).map_err(|error| ended_early(&error).unwrap_or(error))?;
                if read > 0 || buffer.is_empty() {
                    return Ok(read);
                }
                self.input = self.frame.take().map(StreamingDecoder::into_inner);
            }
            if !self.begin()? {
                return Ok(0);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::ZstdFrames;
    use ruzstd::encoding::{CompressionLevel, compress_to_vec};
    use std::io::Read;

    #[test]
    fn frames_one_after_the_other_are_one_text() {
        let parts = ["t,gx\n".repeat(3000), "0.01,2\n".repeat(9000)];
        let [one, other] = parts.each_ref().map(|part| compress_to_vec(part.as_bytes(), CompressionLevel::Fastest));
        // Skipped.
        let skipped = [&[0x53, 0x2A, 0x4D, 0x18, 3, 0, 0, 0][..], b"abc"].concat();
        let all = [&skipped[..], &one, &skipped, &other].concat();
        let read = |bytes: &[u8]| {
            let mut text = String::new();
            ZstdFrames::new(bytes).read_to_string(&mut text).map(|_| text)
        };
        assert_eq!(read(&all).expect("whole"), parts.concat());
        assert!(read(&all[..all.len() - 9]).is_err());
        assert!(read(b"no frame").is_err());
    }
}
