//! An image for a Raspberry Pi Pico as UF2, the file that its boot loader takes by drag and drop.
//!
//! The conversion is that of the crate `elf2flash-core`: a block of 512 bytes for each page of 256 bytes of flash
//! (<https://github.com/microsoft/uf2>).

use elf2flash_core::boards::RP2040;
use elf2flash_core::{Elf2Uf2Error, NoProgress, elf2uf2};

/// Addresses at which the RP2040 maps its flash: 16 MiB at most.
const FLASH: std::ops::Range<u32> = 0x1000_0000..0x1100_0000;
/// Length of a block, bytes.
const BLOCK_BYTES: usize = 512;
/// Offset of the flash address in a block.
const ADDRESS_OFFSET: usize = 12;

/// Why an image was not converted.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Uf2Error {
    /// The file is no ELF, is cut short, or has nothing to load.
    #[error("no complete ELF image")]
    Elf(#[from] Elf2Uf2Error),
    /// A segment is loaded to an address that is not flash of an RP2040.
    #[error("the page at {0:#010x} is outside the flash at 0x10000000: is it an image for the Pico?")]
    OutsideFlash(u32),
}

/// Converts the loadable segments of an ELF image to the blocks of a UF2 file, in the order of their addresses.
/// Bytes of a page that no segment fills are zero.
///
/// # Errors
/// The file is no complete ELF, or not all of it is for the flash of an RP2040.
///
/// # Panics
/// Two segments of the ELF overlap, which no linker writes.
pub fn from_elf(elf: &[u8]) -> Result<Vec<u8>, Uf2Error> {
    let mut blocks = Vec::new();
    elf2uf2(elf, &mut blocks, &RP2040, NoProgress)?;
    let addresses = blocks.chunks_exact(BLOCK_BYTES).filter_map(|block| block[ADDRESS_OFFSET..].first_chunk());
    match addresses.map(|bytes| u32::from_le_bytes(*bytes)).find(|address| !FLASH.contains(address)) {
        Some(address) => Err(Uf2Error::OutsideFlash(address)),
        None => Ok(blocks),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An ELF with one segment of `bytes` at `address`.
    fn elf(address: u32, bytes: &[u8]) -> Vec<u8> {
        let mut elf = vec![0; 52];
        elf[..7].copy_from_slice(b"\x7FELF\x01\x01\x01");
        elf[20] = 1; // version
        elf[28..32].copy_from_slice(&52_u32.to_le_bytes());
        elf[42] = 32; // length of a program header
        elf[44] = 1;
        for field in [1, 84, address, address, bytes.len() as u32, bytes.len() as u32, 5, 4] {
            elf.extend(u32::to_le_bytes(field));
        }
        elf.extend(bytes);
        elf
    }

    /// The offsets and numbers are those of the specification's table.
    #[test]
    fn blocks_are_as_the_specification_says() {
        let bytes: Vec<u8> = (0..300_u32).map(|k| k as u8).collect();
        let uf2 = from_elf(&elf(0x1000_0100, &bytes)).unwrap();
        assert_eq!(uf2.len(), 2 * 512);
        for (number, block) in uf2.chunks(512).enumerate() {
            let word = |at: usize| u32::from_le_bytes(block[at..at + 4].try_into().unwrap());
            assert_eq!((word(0), word(4), word(508)), (0x0A324655, 0x9E5D5157, 0x0AB16F30));
            assert_eq!((word(8), word(28)), (0x2000, 0xE48BFF56));
            assert_eq!((word(12), word(16)), (0x1000_0100 + 256 * number as u32, 256));
            assert_eq!((word(20), word(24)), (number as u32, 2));
        }
        assert_eq!(uf2[32..288], bytes[..256]);
        assert_eq!(uf2[512 + 32..512 + 32 + 44], bytes[256..]);
        assert!(uf2[512 + 76..1020].iter().all(|&byte| byte == 0));
    }

    #[test]
    fn files_that_are_no_image_for_the_pico_are_refused() {
        assert!(matches!(from_elf(b"MZ"), Err(Uf2Error::Elf(_))));
        assert!(matches!(from_elf(&elf(0x0800_0000, &[1])), Err(Uf2Error::OutsideFlash(0x0800_0000))));
        let whole = elf(0x1000_0000, &[1, 2, 3]);
        for length in 6..whole.len() {
            assert!(matches!(from_elf(&whole[..length]), Err(Uf2Error::Elf(_))), "{length} bytes");
        }
    }
}
