//! The flash memory of an STM32F405 (RM0090 chapter 3), whose last sectors keep the settings; the processor waits
//! during erasure and programming (section 3.6).

use super::watchdog;
use crate::bus_frame::wait_for;
use crate::microcontroller::settings_flash::{FlashError, FlashMemory};
use stm32f4xx_hal::pac::{FLASH, flash::RegisterBlock};

/// Bytes programmed at once at 2.7 to 3.6 V (Table 7), and the PSIZE for it.
const WORD: usize = 4;
const PSIZE_32: u8 = 0b10;
/// Number of sector 4: sectors 0 to 4 are together as large as each of sectors 5 to 11 (Table 5).
const SECTORS_BEFORE: usize = 4;
/// Keys that unlock FLASH_CR (section 3.6.1).
const KEYS: [u32; 2] = [0x4567_0123, 0xCDEF_89AB];
/// OPERR, WRPERR, PGAERR, PGPERR and PGSERR of FLASH_SR (section 3.9.4).
const ERRORS: u32 = 0b1111_0010;
/// Number of waits of 0.4 ms; a sector takes 2 s, a word 0.1 ms (STM32F405 data sheet, flash memory programming).
const WAITS: u32 = 10_000;

/// The flash memory; sectors 0 to 4 are too short for settings.
pub struct Stm32Flash;

impl FlashMemory for Stm32Flash {
    const ORIGIN: usize = 0x0800_0000;
    const SECTOR: usize = 128 << 10;

    fn erase(offset: u32) -> Result<(), FlashError> {
        let sector = SECTORS_BEFORE + offset as usize / Self::SECTOR;
        watchdog::feed();
        operate(|flash| {
            // SAFETY: a width that the supply allows, and the number of a sector.
            flash.cr().modify(|_, w| unsafe { w.psize().bits(PSIZE_32).snb().bits(sector as u8).ser().set_bit() });
            flash.cr().modify(|_, w| w.strt().set_bit());
            finish(flash)
        })
    }

    fn program(offset: u32, words: &[u8]) -> Result<(), FlashError> {
        operate(|flash| {
            // SAFETY: a width that the supply allows.
            flash.cr().modify(|_, w| unsafe { w.psize().bits(PSIZE_32).pg().set_bit() });
            let (words, _no_rest) = words.as_chunks::<WORD>();
            words.iter().enumerate().try_for_each(|(index, word)| {
                let address = (Self::ORIGIN + offset as usize + index * WORD) as *mut u32;
                // SAFETY: the caller programs the memory of the settings alone.
                unsafe { address.write_volatile(u32::from_le_bytes(*word)) };
                finish(flash)
            })
        })
    }
}

/// Runs an operation with the controller unlocked and errors cleared.
fn operate(operation: impl FnOnce(&RegisterBlock) -> Result<(), FlashError>) -> Result<(), FlashError> {
    // SAFETY: after the start only the main loop uses the registers of the flash memory.
    let flash = unsafe { &*FLASH::ptr() };
    if flash.cr().read().lock().bit_is_set() {
        for key in KEYS {
            // SAFETY: the values that unlock the register.
            flash.keyr().write(|w| unsafe { w.bits(key) });
        }
    }
    // SAFETY: flags, each cleared by a one.
    flash.sr().modify(|r, w| unsafe { w.bits(r.bits()) });
    let done = if flash.cr().read().lock().bit_is_clear() { operation(flash) } else { Err(FlashError::Other) };
    flash.cr().modify(|_, w| w.ser().clear_bit().pg().clear_bit().lock().set_bit());
    // The data cache is stale (section 3.5.2); it must be off while it is emptied.
    flash.acr().modify(|_, w| w.dcen().clear_bit());
    flash.acr().modify(|_, w| w.dcrst().set_bit());
    flash.acr().modify(|_, w| w.dcrst().clear_bit());
    flash.acr().modify(|_, w| w.dcen().set_bit());
    done
}

fn finish(flash: &RegisterBlock) -> Result<(), FlashError> {
    let is_ready = (0..WAITS).any(|_| wait_for(|| flash.sr().read().bsy().bit_is_clear()));
    if is_ready && flash.sr().read().bits() & ERRORS == 0 { Ok(()) } else { Err(FlashError::Other) }
}
