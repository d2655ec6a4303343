//! An image for a Raspberry Pi Pico as UF2, the file that its boot loader takes by drag and drop.
//!
//! <https://github.com/microsoft/uf2>: blocks of 512 bytes, each with 256 bytes for a page of flash.

/// Bytes of flash in a block.
const PAGE: usize = 256;
const BLOCK: usize = 512;
/// First two and last word of every block.
const MAGIC: [u32; 3] = [0x0A32_4655, 0x9E5D_5157, 0x0AB1_6F30];
/// The word before the payload names the kind of processor.
const FAMILY_PRESENT: u32 = 0x2000;
const RP2040: u32 = 0xE48B_FF56;
/// Where flash is mapped, 16 MiB at most.
const FLASH: std::ops::Range<u32> = 0x1000_0000..0x1100_0000;

/// Why an image is not turned into UF2.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum Uf2Error {
    /// The file does not begin as a little-endian 32-bit ELF.
    #[error("no 32-bit little-endian ELF")]
    NotElf,
    /// A header points outside the file.
    #[error("the ELF is cut short at byte {0}")]
    Short(usize),
    /// There is nothing for the flash of an RP2040.
    #[error("nothing in it is for the flash at 0x10000000: is it an image for the Pico?")]
    NoFlash,
}

/// The UF2 file of an ELF image: its loadable segments, page by page, gaps filled with zeros.
///
/// # Errors
/// It is no ELF for an RP2040.
pub fn of_elf(elf: &[u8]) -> Result<Vec<u8>, Uf2Error> {
    if !elf.starts_with(b"\x7FELF\x01\x01") {
        return Err(Uf2Error::NotElf);
    }
    let table = word(elf, 28)? as usize;
    let mut pages = std::collections::BTreeMap::<u32, [u8; PAGE]>::new();
    for index in 0..half(elf, 44)? {
        let header = table + usize::from(index) * 32;
        let [kind, offset, _, address, size] = [0, 4, 8, 12, 16].map(|field| word(elf, header + field));
        let (offset, address, size) = (offset? as usize, address?, size? as usize);
        if kind? != 1 || !FLASH.contains(&address) {
            continue;
        }
        let bytes = elf.get(offset..offset.saturating_add(size)).ok_or(Uf2Error::Short(elf.len()))?;
        for (at, &byte) in (address..).zip(bytes) {
            let page = pages.entry(at & !(PAGE as u32 - 1)).or_insert([0; PAGE]);
            page[at as usize % PAGE] = byte;
        }
    }
    if pages.is_empty() {
        return Err(Uf2Error::NoFlash);
    }
    let count = pages.len() as u32;
    let block = |(number, (address, page)): (u32, (u32, [u8; PAGE]))| {
        let head = [MAGIC[0], MAGIC[1], FAMILY_PRESENT, address, PAGE as u32, number, count, RP2040];
        let mut block = Vec::with_capacity(BLOCK);
        head.iter().for_each(|word| block.extend(word.to_le_bytes()));
        block.extend(page);
        block.resize(BLOCK - 4, 0);
        block.extend(MAGIC[2].to_le_bytes());
        block
    };
    Ok((0..).zip(pages).flat_map(block).collect())
}

fn word(bytes: &[u8], at: usize) -> Result<u32, Uf2Error> {
    bytes.get(at..).and_then(<[u8]>::first_chunk).map(|word| u32::from_le_bytes(*word)).ok_or(Uf2Error::Short(at))
}

fn half(bytes: &[u8], at: usize) -> Result<u16, Uf2Error> {
    bytes.get(at..).and_then(<[u8]>::first_chunk).map(|half| u16::from_le_bytes(*half)).ok_or(Uf2Error::Short(at))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An ELF with one segment of `bytes` at `address`.
    fn elf(address: u32, bytes: &[u8]) -> Vec<u8> {
        let mut elf = vec![0; 52];
        elf[..6].copy_from_slice(b"\x7FELF\x01\x01");
        elf[28..32].copy_from_slice(&52_u32.to_le_bytes());
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
        let uf2 = of_elf(&elf(0x1000_0100, &bytes)).unwrap();
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
    fn what_is_no_image_is_refused() {
        assert_eq!(of_elf(b"MZ"), Err(Uf2Error::NotElf));
        assert_eq!(of_elf(&elf(0x0800_0000, &[1])), Err(Uf2Error::NoFlash));
        let whole = elf(0x1000_0000, &[1, 2, 3]);
        for length in 6..whole.len() {
            assert!(matches!(of_elf(&whole[..length]), Err(Uf2Error::Short(_))), "{length} bytes");
        }
    }
}
