//! The images: builds as for flashing, their sizes, and copies with a smaller stack.

use std::path::{Path, PathBuf};
use system_tests::{Image, image_folder};

/// Builds a program of a package for a target, with further arguments of cargo, and returns the path of a copy of its ELF with the name
/// `copy`.
pub(crate) fn build_package((package, program): (&str, &str), target: &str, arguments: &[&str], copy: &str) -> PathBuf {
    Image { package, program, target, profile: "image", arguments, variable: None }.build(copy)
}

/// The vector table of the STM32F405, and the start of its core-coupled memory, which holds the stack (RM0090 section
/// 2.3).
const FLASH_START: u32 = 0x0800_0000;
const STACK_START: u32 = 0x1000_0000;
/// Addresses of RAM on every Cortex-M.
const RAM: std::ops::Range<u32> = 0x2000_0000..0x3000_0000;

/// An ELF of 32 bits, little-endian.
struct Elf(Vec<u8>);

impl Elf {
    fn read(file: &Path) -> Self {
        Self(std::fs::read(file).expect("the image"))
    }

    fn word(&self, at: usize) -> u32 {
        u32::from_le_bytes(self.0[at..at + 4].try_into().expect("4 bytes"))
    }

    fn half(&self, at: usize) -> usize {
        usize::from(u16::from_le_bytes(self.0[at..at + 2].try_into().expect("2 bytes")))
    }
}

/// Flash and memory of an image, in bytes.
#[derive(Debug)]
pub(crate) struct Size {
    pub(crate) flash: u32,
    /// Static variables, including retained memory, without the stack.
    pub(crate) statics: u32,
    /// Static variables whose contents are copied from flash at the start.
    pub(crate) initialised: u32,
}

/// The size of an image by the section headers of its ELF.
pub(crate) fn size(image: &Path) -> Size {
    let elf = Elf::read(image);
    let mut size = Size { flash: 0, statics: 0, initialised: 0 };
    for section in 0..elf.half(48) {
        let header = elf.word(32) as usize + section * elf.half(46);
        let [kind, flags, address, bytes] = [4, 8, 12, 20].map(|field| elf.word(header + field));
        let (allocated, without_bits) = (flags & 2 != 0, kind == 8);
        if allocated && RAM.contains(&address) {
            size.statics += bytes;
            size.initialised += if without_bits { 0 } else { bytes };
        }
        if allocated && !without_bits {
            size.flash += bytes;
        }
    }
    size
}

/// Writes a copy of an image with a stack of `bytes` bytes. It changes the first word of the vector table, from which
/// the processor loads its stack pointer.
pub(crate) fn with_stack(image: &Path, bytes: u32) -> PathBuf {
    let mut elf = Elf::read(image);
    // A program header has the offset in the file at 4, the physical address at 12, the size at 16.
    let mut headers = (0..elf.half(44)).map(|segment| elf.word(28) as usize + 32 * segment);
    let vectors = headers.find(|&header| elf.word(header + 12) == FLASH_START && elf.word(header + 16) > 0);
    let at = elf.word(vectors.expect("a vector table") + 4) as usize;
    elf.0[at..at + 4].copy_from_slice(&(STACK_START + bytes).to_le_bytes());
    let copy = image_folder().join(format!("observatory-h405-stack-{bytes}.elf"));
    std::fs::write(&copy, elf.0).expect("room");
    copy
}
