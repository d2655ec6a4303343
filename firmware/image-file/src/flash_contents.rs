//! The bytes that an image writes to flash, from its ELF.

use object::Endianness::Little;
use object::elf::{FileHeader32, PT_LOAD};
use object::read::elf::{FileHeader, ProgramHeader};
use std::ops::Range;

/// The reason for which an image was not converted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ImageError {
    /// The file is not a complete little-endian 32-bit ELF.
    #[error("no complete 32-bit little-endian ELF: {0}")]
    Elf(#[from] object::read::Error),
    /// The contents of a segment lie outside of the file.
    #[error("the ELF is cut short: the segment at {0:#010x} is not in it")]
    CutShort(u32),
    /// A segment ends beyond the flash.
    #[error("the segment at {0:#010x} ends beyond the flash")]
    BeyondFlash(u32),
    /// Two segments fill the same bytes.
    #[error("the segment at {0:#010x} overlaps another")]
    Overlap(u32),
    /// No segment is loaded to the flash.
    #[error("nothing in it is for the flash at {0:#010x}: is it an image for this board?")]
    NoFlash(u32),
}

/// The loadable segments of an ELF image that lie in `flash`, in the order of their addresses; at least one.
///
/// # Errors
/// The file is no complete ELF, it has nothing for the flash, or its segments overlap or do not fit there.
pub fn segments(elf: &[u8], flash: Range<u32>) -> Result<Vec<(u32, &[u8])>, ImageError> {
    let header = FileHeader32::<object::Endianness>::parse(elf)?;
    let endian = header.endian()?;
    let mut segments: Vec<(u32, &[u8])> = Vec::new();
    for segment in header.program_headers(endian, elf)? {
        let address = segment.p_paddr(endian);
        if endian != Little || segment.p_type(endian) != PT_LOAD || !flash.contains(&address) {
            continue;
        }
        let bytes = segment.data(endian, elf).map_err(|()| ImageError::CutShort(address))?;
        if bytes.len() > (flash.end - address) as usize {
            return Err(ImageError::BeyondFlash(address));
        }
        if !bytes.is_empty() {
            segments.push((address, bytes));
        }
    }
    // This check precedes any copy: the headers of a small file can name the same bytes so often that copying takes minutes.
    segments.sort_by_key(|(address, _)| *address);
    for pair in segments.windows(2) {
        if let [(first, bytes), (second, _)] = pair
            && (*second as usize) < *first as usize + bytes.len()
        {
            return Err(ImageError::Overlap(*second));
        }
    }
    if segments.is_empty() { Err(ImageError::NoFlash(flash.start)) } else { Ok(segments) }
}

/// Addresses of the flash of an STM32F405xG (RM0090 section 3.4).
const STM32F405: Range<u32> = 0x0800_0000..0x0810_0000;

/// The bytes of an image for an STM32F405 from the beginning of its flash. Bytes that no segment fills are 0xFF, as in erased flash.
///
/// # Errors
/// Those of [`segments`].
pub fn stm32f405(elf: &[u8]) -> Result<Vec<u8>, ImageError> {
    let mut contents = Vec::new();
    for (address, bytes) in segments(elf, STM32F405)? {
        contents.resize((address - STM32F405.start) as usize, 0xFF);
        contents.extend(bytes);
    }
    Ok(contents)
}
