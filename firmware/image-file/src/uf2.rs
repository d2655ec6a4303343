//! An image for a Raspberry Pi Pico as UF2, the file that its boot loader takes by drag and drop.
//!
//! The format is <https://github.com/microsoft/uf2>: blocks of 512 bytes, each with a page of 256 bytes of flash.

use crate::flash_contents::{ImageError, segments};
use std::collections::{BTreeMap, BTreeSet};

/// Bytes of flash in a block.
const PAGE_BYTES: usize = 256;
/// Bytes of flash that are erased at once.
const SECTOR_BYTES: u32 = 4096;
/// Length of a block, bytes.
const BLOCK_BYTES: usize = 512;
/// First two and last word of every block.
const MAGIC: [u32; 3] = [0x0A32_4655, 0x9E5D_5157, 0x0AB1_6F30];
/// Flag: the word before the payload is the family of the processor.
const FAMILY_PRESENT: u32 = 0x2000;
/// The family RP2040.
const RP2040: u32 = 0xE48B_FF56;
/// Addresses at which the RP2040 maps its flash: 16 MiB at most.
const FLASH: std::ops::Range<u32> = 0x1000_0000..0x1100_0000;

/// Converts the loadable segments of an ELF image that lie in flash to the blocks of a UF2 file, in the order of their addresses. Bytes
/// that no segment fills are zero, up to the ends of the sectors: the boot ROM erases a sector with its first block, and may program pages
/// of a sector with gaps without erasing it (github.com/raspberrypi/pico-sdk, pull request 800).
///
/// # Errors
/// Those of [`segments`].
pub fn from_elf(elf: &[u8]) -> Result<Vec<u8>, ImageError> {
    let mut pages = BTreeMap::<u32, [u8; PAGE_BYTES]>::new();
    for (address, bytes) in segments(elf, FLASH)? {
        for (at, &byte) in (address..FLASH.end).zip(bytes) {
            let page = pages.entry(at & !(PAGE_BYTES as u32 - 1)).or_insert([0; PAGE_BYTES]);
            page[at as usize % PAGE_BYTES] = byte;
        }
    }
    let sectors: BTreeSet<u32> = pages.keys().map(|page| page & !(SECTOR_BYTES - 1)).collect();
    for page in sectors.into_iter().flat_map(|sector| (sector..sector + SECTOR_BYTES).step_by(PAGE_BYTES)) {
        pages.entry(page).or_insert([0; PAGE_BYTES]);
    }
    let count = pages.len() as u32;
    let block = |(number, (address, page)): (u32, (u32, [u8; PAGE_BYTES]))| {
        let head = [MAGIC[0], MAGIC[1], FAMILY_PRESENT, address, PAGE_BYTES as u32, number, count, RP2040];
        let mut block = Vec::with_capacity(BLOCK_BYTES);
        head.iter().for_each(|word| block.extend(word.to_le_bytes()));
        block.extend(page);
        block.resize(BLOCK_BYTES - 4, 0);
        block.extend(MAGIC[2].to_le_bytes());
        block
    };
    Ok((0..).zip(pages).flat_map(block).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An ELF with one segment of `bytes` at `address`.
    fn elf(address: u32, bytes: &[u8]) -> Vec<u8> {
        elf_of(&[(address, bytes)])
    }

    fn elf_of(segments: &[(u32, &[u8])]) -> Vec<u8> {
        let mut elf = vec![0; 52];
        elf[..7].copy_from_slice(b"\x7FELF\x01\x01\x01");
        elf[20] = 1; // version
        elf[28..32].copy_from_slice(&52_u32.to_le_bytes());
        elf[40] = 52; // length of the header
        elf[42] = 32; // length of a program header
        elf[44] = segments.len() as u8;
        let mut offset = 52 + 32 * segments.len() as u32;
        for (address, bytes) in segments {
            let length = bytes.len() as u32;
            let header = [1, offset, *address, *address, length, length, 5, 4];
            elf.extend(header.into_iter().flat_map(u32::to_le_bytes));
            offset += length;
        }
        segments.iter().for_each(|(_, bytes)| elf.extend(*bytes));
        elf
    }

    /// Offsets and numbers are those of the table in the UF2 specification.
    #[test]
    fn the_blocks_follow_the_specification() {
        let bytes: Vec<u8> = (0..300_u32).map(|k| k as u8).collect();
        let uf2 = from_elf(&elf(0x1000_0100, &bytes)).unwrap();
        assert_eq!(uf2.len(), 16 * 512, "a sector");
        for (number, block) in uf2.chunks(512).enumerate() {
            let word = |at: usize| u32::from_le_bytes(block[at..at + 4].try_into().unwrap());
            assert_eq!((word(0), word(4), word(508)), (0x0A324655, 0x9E5D5157, 0x0AB16F30));
            assert_eq!((word(8), word(28)), (0x2000, 0xE48BFF56));
            assert_eq!((word(12), word(16)), (0x1000_0000 + 256 * number as u32, 256));
            assert_eq!((word(20), word(24)), (number as u32, 16));
        }
        assert_eq!(uf2[512 + 32..512 + 288], bytes[..256]);
        assert_eq!(uf2[1024 + 32..1024 + 32 + 44], bytes[256..]);
        assert!(uf2[1024 + 76..1532].iter().all(|&byte| byte == 0));
    }

    /// The two segments are 8 KiB apart. Each sector that they touch has all of its pages, and the sector between has
    /// none.
    #[test]
    fn sectors_have_no_gaps() {
        let segments: [(u32, &[u8]); 3] = [(0x1000_0010, &[1; 8]), (0x1000_0F00, &[2; 8]), (0x1000_2100, &[3; 300])];
        let uf2 = from_elf(&elf_of(&segments)).unwrap();
        let address = |block: &[u8]| u32::from_le_bytes(block[12..16].try_into().unwrap());
        let pages: Vec<u32> = uf2.chunks(512).map(address).collect();
        let expected = (0..16).chain(32..48).map(|page| 0x1000_0000 + 256 * page);
        assert_eq!(pages, expected.collect::<Vec<u32>>());
        assert_eq!((uf2[32 + 16], uf2[15 * 512 + 32], uf2[17 * 512 + 32], uf2[16 * 512 + 32]), (1, 2, 3, 0));
    }

    #[test]
    fn a_file_that_is_no_image_for_the_pico_is_refused() {
        assert!(matches!(from_elf(b"MZ"), Err(ImageError::Elf(_))));
        assert_eq!(from_elf(&elf(0x0800_0000, &[1])), Err(ImageError::NoFlash(0x1000_0000)));
        let whole = elf(0x1000_0000, &[1, 2, 3]);
        for length in 0..whole.len() {
            assert!(from_elf(&whole[..length]).is_err(), "{length} bytes");
        }
    }

    /// An ELF with `count` segments, each of the same `bytes` of the file at `address`.
    fn repeated(count: u16, address: u32, bytes: u32) -> Vec<u8> {
        let mut elf = elf(address, &[]);
        let offset = 52 + 32 * u32::from(count);
        let header: Vec<u8> =
            [1, offset, address, address, bytes, bytes, 5, 4].into_iter().flat_map(u32::to_le_bytes).collect();
        elf.truncate(52);
        elf[44..46].copy_from_slice(&count.to_le_bytes());
        (0..count).for_each(|_| elf.extend(&header));
        elf.resize((offset + bytes) as usize, 0xA5);
        elf
    }

    #[test]
    fn segments_that_overlap_or_do_not_fit_are_refused_at_once() {
        // Copying 250 GB byte by byte would take half an hour.
        assert_eq!(from_elf(&repeated(60_000, 0x1000_0000, 4 << 20)), Err(ImageError::Overlap(0x1000_0000)));
        assert_eq!(from_elf(&elf(0x10FF_FFFE, &[1, 2, 3])), Err(ImageError::BeyondFlash(0x10FF_FFFE)));
        assert!(from_elf(&elf(0x10FF_FFFD, &[1, 2, 3])).is_ok());
    }

    /// Damage gives an error or another image, never a panic.
    #[test]
    fn every_single_bit_error_in_the_headers_is_survived() {
        let whole = elf(0x1000_0000, &[1, 2, 3]);
        for bit in 0..8 * 84 {
            let mut damaged = whole.clone();
            damaged[bit / 8] ^= 1 << (bit % 8);
            let _ = from_elf(&damaged);
        }
    }
}
