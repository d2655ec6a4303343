//! The part of flash memory for the settings, by the board's memory map.

use crate::settings_store::SettingsStore;
use core::marker::PhantomData;
use core::ops::Range;
pub use embedded_storage_async::nor_flash::NorFlashErrorKind as FlashError;
use embedded_storage_async::nor_flash::{ErrorType, NorFlash, ReadNorFlash};

/// The flash memory of a microcontroller, which reads it as memory.
pub trait FlashMemory {
    /// Address of the first byte.
    const ORIGIN: usize;
    /// Number of bytes that are erased at once; a sector's offset is a multiple of it.
    const SECTOR: usize;
    /// Erases the sector at `offset`.
    ///
    /// # Errors
    /// The flash does not take it.
    fn erase(offset: u32) -> Result<(), FlashError>;
    /// Programs whole words of four bytes from `offset` on, a multiple of four.
    ///
    /// # Errors
    /// The flash does not take them.
    fn program(offset: u32, words: &[u8]) -> Result<(), FlashError>;
}

unsafe extern "C" {
    // The memory map sets these symbols.
    static _settings_start: u8;
    static _settings_end: u8;
}

/// The memory of the settings in the flash memory `M`.
pub struct SettingsFlash<M>(PhantomData<M>);

impl<M: FlashMemory> SettingsFlash<M> {
    /// A store in this memory; `None` if the memory map has no two sectors for it.
    pub fn store() -> Option<SettingsStore<Self>> {
        SettingsStore::new(Self(PhantomData), Self::range())
    }

    fn range() -> Range<u32> {
        let [start, end] = [&raw const _settings_start, &raw const _settings_end];
        (start as usize - M::ORIGIN) as u32..(end as usize - M::ORIGIN) as u32
    }

    /// Checks that a range is in whole units and within the settings.
    fn check(offset: u32, length: usize, unit: usize) -> Result<(), FlashError> {
        let (begin, end, settings) = (offset as usize, (offset as usize).saturating_add(length), Self::range());
        let is_inside = begin >= settings.start as usize && end <= settings.end as usize;
        if is_inside && begin % unit == 0 && end % unit == 0 { Ok(()) } else { Err(FlashError::OutOfBounds) }
    }
}

impl<M> ErrorType for SettingsFlash<M> {
    type Error = FlashError;
}

impl<M: FlashMemory> ReadNorFlash for SettingsFlash<M> {
    const READ_SIZE: usize = 1;

    async fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), FlashError> {
        Self::check(offset, bytes.len(), Self::READ_SIZE)?;
        for (index, byte) in bytes.iter_mut().enumerate() {
            // SAFETY: flash, in the range of the settings, which is readable here.
            *byte = unsafe { ((M::ORIGIN + offset as usize + index) as *const u8).read_volatile() };
        }
        Ok(())
    }

    fn capacity(&self) -> usize {
        Self::range().end as usize
    }
}

impl<M: FlashMemory> NorFlash for SettingsFlash<M> {
    const WRITE_SIZE: usize = 4;
    const ERASE_SIZE: usize = M::SECTOR;

    async fn erase(&mut self, from: u32, to: u32) -> Result<(), FlashError> {
        Self::check(from, to.saturating_sub(from) as usize, M::SECTOR)?;
        (from..to).step_by(M::SECTOR).try_for_each(M::erase)
    }

    async fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), FlashError> {
        Self::check(offset, bytes.len(), Self::WRITE_SIZE)?;
        M::program(offset, bytes)
    }
}
