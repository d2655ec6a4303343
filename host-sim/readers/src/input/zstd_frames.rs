//! Zstandard, all frames.

use ruzstd::decoding::{FrameDecoder, StreamingDecoder};
use std::io::{self, BufRead, Read};

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
            self.frame = Some(StreamingDecoder::new(input).map_err(io::Error::other)?);
            return Ok(true);
        }
        Ok(false)
    }
}

impl<R: BufRead> Read for ZstdFrames<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        loop {
            if let Some(frame) = &mut self.frame {
                let read = frame.read(buffer)?;
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
