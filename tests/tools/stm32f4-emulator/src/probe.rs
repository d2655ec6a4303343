//! A debug probe that reads the log (RTT) in the memory of an image.

use crate::microcontroller::RAM;
use defmt_decoder::{DecodeError, Table};
use emulation::{LogLine, Probe as Conduct};
use rigless::emulator::Host;
use rigless::soc::Width;
use std::path::Path;

/// The first words of the block by which a probe finds the buffers: "SEGGER R".
const IDENTIFIER: [u64; 2] = [0x4747_4553, 0x5220_5245];
/// Offsets in the block of the first buffer from the target: address, size, write offset of the target, read offset of the probe.
const BUFFER: u64 = 28;
const SIZE: u64 = 32;
const WRITTEN: u64 = 36;
const READ: u64 = 40;
/// Offset of the mode of that buffer, and the mode in which the target waits while the buffer is full.
const MODE: u64 = 44;
const BLOCKS: u64 = 2;

/// Reads the bytes of the log from the memory of the image at each call.
#[derive(Debug)]
pub(crate) struct Probe {
    conduct: Conduct,
    block: Option<u64>,
    bytes: Vec<u8>,
}

impl Probe {
    pub(crate) const fn new(conduct: Conduct) -> Self {
        Self { conduct, block: None, bytes: Vec::new() }
    }

    pub(crate) fn poll(&mut self, host: &mut dyn Host) {
        let word = |host: &mut dyn Host, at| host.read(at, Width::W32).expect("memory");
        if self.block.is_none() {
            self.block = RAM.step_by(4).find(|at| [0, 4].map(|offset| word(host, at + offset)) == IDENTIFIER);
        }
        let Some(block) = self.block else { return };
        if self.conduct == Conduct::Stalls {
            host.write(block + MODE, Width::W32, BLOCKS).expect("memory");
            return;
        }
        let [buffer, size, written, mut read] = [BUFFER, SIZE, WRITTEN, READ].map(|offset| word(host, block + offset));
        while read != written {
            self.bytes.push(host.read(buffer + read, Width::W8).expect("memory") as u8);
            read = (read + 1) % size;
        }
        host.write(block + READ, Width::W32, read).expect("memory");
    }
    /// The lines of the log in these bytes, by the table of formats in the image.
    pub(crate) fn lines(&self, image: &Path) -> Vec<LogLine> {
        let elf = std::fs::read(image).expect("the image");
        let table = Table::parse(&elf).expect("an ELF").expect("a table of formats");
        let mut decoder = table.new_stream_decoder();
        decoder.received(&self.bytes);
        let mut lines = Vec::new();
        loop {
            match decoder.decode() {
                Ok(frame) => lines.push(LogLine {
                    level: frame.level().expect("a level").as_str().to_owned(),
                    text: frame.display_message().to_string(),
                }),
                Err(DecodeError::UnexpectedEof) => return lines,
                Err(DecodeError::Malformed) => panic!("the log is malformed after {lines:#?}"),
            }
        }
    }
}
