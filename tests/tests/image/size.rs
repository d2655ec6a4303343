//! What an image takes of flash and memory, by the section headers of its ELF (32 bits, little endian).

use std::path::Path;

/// Bytes.
#[derive(Debug)]
pub(crate) struct Size {
    pub(crate) flash: u32,
    /// Without the stack.
    pub(crate) statics: u32,
    /// From the start of memory, where the stack is, to the end of what is used.
    pub(crate) ram: u32,
}

const RAM: std::ops::Range<u32> = 0x2000_0000..0x3000_0000;

pub(crate) fn size(elf: &Path) -> Size {
    let elf = std::fs::read(elf).expect("the image");
    let word = |at: usize| u32::from_le_bytes(elf[at..at + 4].try_into().expect("4 bytes"));
    let half = |at: usize| usize::from(u16::from_le_bytes(elf[at..at + 2].try_into().expect("2 bytes")));
    let mut size = Size { flash: 0, statics: 0, ram: 0 };
    for section in 0..half(48) {
        let header = word(32) as usize + section * half(46);
        let [kind, flags, address, bytes] = [4, 8, 12, 20].map(|field| word(header + field));
        let (allocated, without_bits) = (flags & 2 != 0, kind == 8);
        if allocated && RAM.contains(&address) {
            size.statics += bytes;
            size.ram = size.ram.max(address + bytes - RAM.start);
        }
        if allocated && !without_bits {
            size.flash += bytes;
        }
    }
    size
}
