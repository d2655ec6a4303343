//! The flash memory of the board by the functions of the boot ROM (RP2040 data sheet, section 2.8.3.1.3).
//!
//! While the flash takes commands nothing can be read from it: what runs meanwhile lies in RAM, with interrupts disabled. Then the
//! second stage of the boot loader, copied to RAM, makes it readable again.

use crate::settings_store::{SettingsStore, StoreError};
use core::ops::Range;
use core::sync::atomic::{Ordering, compiler_fence};
use embedded_storage_async::nor_flash::{ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash};
use rp2040_hal::rom_data;

/// Where the flash is read; the second stage of the boot loader is at its beginning.
const FLASH: *const u32 = 0x1000_0000 as *const u32;
/// Words of the second stage.
const BOOT2_WORDS: usize = 64;
/// Bytes of the unique number of a W25Q16, the instruction that reads it, and the dummy bytes after that (Winbond, W25Q16JV,
/// instruction Read Unique ID).
const UNIQUE_ID_BYTES: usize = 8;
const READ_UNIQUE_ID: u32 = 0x4B;
const DUMMY_BYTES: usize = 4;

/// What runs while the flash takes commands.
#[repr(C)]
struct Command {
    connect_internal_flash: unsafe extern "C" fn(),
    flash_exit_xip: unsafe extern "C" fn(),
    flash_flush_cache: unsafe extern "C" fn(),
    flash_range_erase: unsafe extern "C" fn(u32, usize, u32, u8),
    flash_range_program: unsafe extern "C" fn(u32, *const u8, usize),
    /// The second stage, in RAM.
    boot2: unsafe extern "C" fn(),
    /// Address in the flash, from its beginning.
    offset: u32,
    data: *mut u8,
}

/// Runs `function`, which must lie in RAM, on `data`.
fn run(function: unsafe extern "C" fn(&Command), offset: u32, data: *mut u8) {
    // SAFETY: flash, which is readable here.
    let boot2: [u32; BOOT2_WORDS] = core::array::from_fn(|word| unsafe { FLASH.add(word).read_volatile() });
    let command = Command {
        connect_internal_flash: rom_data::connect_internal_flash::ptr(),
        flash_exit_xip: rom_data::flash_exit_xip::ptr(),
        flash_flush_cache: rom_data::flash_flush_cache::ptr(),
        flash_range_erase: rom_data::flash_range_erase::ptr(),
        flash_range_program: rom_data::flash_range_program::ptr(),
        // SAFETY: Thumb code that runs at any address and returns to its caller, unless that is the boot ROM.
        boot2: unsafe { core::mem::transmute::<usize, unsafe extern "C" fn()>(boot2.as_ptr() as usize | 1) },
        offset,
        data,
    };
    cortex_m::interrupt::free(|_| {
        compiler_fence(Ordering::SeqCst);
        // SAFETY: no interrupt, no second core and no DMA transfer reads the flash meanwhile.
        unsafe { function(&command) };
        compiler_fence(Ordering::SeqCst);
    });
    core::hint::black_box(&boot2);
}

/// The unique number of the flash memory, and with it of the board. To be read while no DMA transfer runs.
pub fn unique_id() -> [u8; UNIQUE_ID_BYTES] {
    let mut id = [0; UNIQUE_ID_BYTES];
    run(read_unique_id, 0, id.as_mut_ptr());
    id
}

/// Registers of the SSI, which drives the flash, in words (RP2040 data sheet, section 4.10.13).
const SSI: *mut u32 = 0x1800_0000 as *mut u32;
const CTRLR0: usize = 0;
const CTRLR1: usize = 1;
const SSIENR: usize = 2;
const SR: usize = 10;
const DR0: usize = 24;
/// TMOD of CTRLR0: EEPROM read, in which the SSI sends what is written to it and then receives CTRLR1 + 1 bytes.
const EEPROM_READ: u32 = 3 << 8;
/// RFNE of SR: a byte has been received.
const RECEIVED: u32 = 1 << 3;

/// Reads the unique number to `data`.
#[inline(never)]
#[unsafe(link_section = ".data.read_unique_id")]
unsafe extern "C" fn read_unique_id(command: &Command) {
    // SAFETY: the caller has seen to it that nothing else uses the flash; the registers are those of the SSI, and `data` has room.
    unsafe {
        (command.connect_internal_flash)();
        (command.flash_exit_xip)();
        SSI.add(SSIENR).write_volatile(0);
        SSI.add(CTRLR0).write_volatile(SSI.add(CTRLR0).read_volatile() | EEPROM_READ);
        SSI.add(CTRLR1).write_volatile((DUMMY_BYTES + UNIQUE_ID_BYTES - 1) as u32);
        SSI.add(SSIENR).write_volatile(1);
        SSI.add(DR0).write_volatile(READ_UNIQUE_ID);
        let mut index = 0;
        while index < DUMMY_BYTES + UNIQUE_ID_BYTES {
            // The SSI clocks the flash without pauses: a byte comes within some µs.
            while SSI.add(SR).read_volatile() & RECEIVED == 0 {}
            let byte = SSI.add(DR0).read_volatile() as u8;
            if index >= DUMMY_BYTES {
                command.data.add(index - DUMMY_BYTES).write_volatile(byte);
            }
            index += 1;
        }
        SSI.add(SSIENR).write_volatile(0);
        SSI.add(CTRLR1).write_volatile(0);
        (command.flash_flush_cache)();
        (command.boot2)();
    }
}

/// Bytes of the flash of a Pico, of a sector, which is erased at once, and of a page, which is programmed at once.
const FLASH_BYTES: usize = 2 << 20;
const SECTOR: usize = 4096;
const PAGE: usize = 256;
/// The instruction that erases a sector, for the boot ROM, which also takes a larger block and its instruction.
const ERASE_SECTOR: u8 = 0x20;
/// The last sectors, which the memory map leaves free: for what survives the loss of power.
const SETTINGS: Range<u32> = (FLASH_BYTES - 16 * SECTOR) as u32..FLASH_BYTES as u32;

/// Erases the sector at the command's offset.
#[inline(never)]
#[unsafe(link_section = ".data.erase_sector")]
unsafe extern "C" fn erase_sector(command: &Command) {
    // SAFETY: as in `read_unique_id`; the caller has checked the offset.
    unsafe {
        (command.connect_internal_flash)();
        (command.flash_exit_xip)();
        (command.flash_range_erase)(command.offset, SECTOR, SECTOR as u32, ERASE_SECTOR);
        (command.flash_flush_cache)();
        (command.boot2)();
    }
}

/// Programs the page at the command's offset.
#[inline(never)]
#[unsafe(link_section = ".data.program_page")]
unsafe extern "C" fn program_page(command: &Command) {
    // SAFETY: as in `read_unique_id`; the caller has checked the offset, and `data` has a page.
    unsafe {
        (command.connect_internal_flash)();
        (command.flash_exit_xip)();
        (command.flash_range_program)(command.offset, command.data, PAGE);
        (command.flash_flush_cache)();
        (command.boot2)();
    }
}

/// The flash memory, of which the settings have the last sectors. Interrupts are disabled while a sector is erased, 45 ms typically and
/// 400 ms at most, or a page is programmed, 0.4 and 3 ms (Winbond, W25Q16JV, AC electrical characteristics).
struct SettingsFlash;

/// The bytes are not of the memory of the settings.
#[derive(Debug)]
struct OutOfBounds;

impl NorFlashError for OutOfBounds {
    fn kind(&self) -> NorFlashErrorKind {
        NorFlashErrorKind::OutOfBounds
    }
}

/// Whether `length` bytes from `offset` on are of the memory of the settings, and whole `units`.
fn check(offset: u32, length: usize, unit: usize) -> Result<(), OutOfBounds> {
    let (begin, end) = (offset as usize, (offset as usize).saturating_add(length));
    let is_inside = begin >= SETTINGS.start as usize && end <= SETTINGS.end as usize;
    if is_inside && begin % unit == 0 && end % unit == 0 { Ok(()) } else { Err(OutOfBounds) }
}

impl ErrorType for SettingsFlash {
    type Error = OutOfBounds;
}

impl ReadNorFlash for SettingsFlash {
    const READ_SIZE: usize = 1;

    async fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), OutOfBounds> {
        check(offset, bytes.len(), Self::READ_SIZE)?;
        for (index, byte) in bytes.iter_mut().enumerate() {
            // SAFETY: flash, which is readable here.
            *byte = unsafe { FLASH.cast::<u8>().add(offset as usize + index).read_volatile() };
        }
        Ok(())
    }

    fn capacity(&self) -> usize {
        FLASH_BYTES
    }
}

impl NorFlash for SettingsFlash {
    /// Fewer bytes than a page can be programmed: those around them are written as ones, which changes nothing.
    const WRITE_SIZE: usize = 4;
    const ERASE_SIZE: usize = SECTOR;

    async fn erase(&mut self, from: u32, to: u32) -> Result<(), OutOfBounds> {
        check(from, to.saturating_sub(from) as usize, SECTOR)?;
        (from..to).step_by(SECTOR).for_each(|offset| run(erase_sector, offset, core::ptr::null_mut()));
        Ok(())
    }

    async fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), OutOfBounds> {
        check(offset, bytes.len(), Self::WRITE_SIZE)?;
        let (mut at, mut rest) = (offset as usize, bytes);
        while !rest.is_empty() {
            let (page, begin) = (at - at % PAGE, at % PAGE);
            let (now, later) = rest.split_at(rest.len().min(PAGE - begin));
            let mut contents = [0xFF; PAGE];
            contents[begin..begin + now.len()].copy_from_slice(now);
            run(program_page, page as u32, contents.as_mut_ptr());
            (at, rest) = (page + PAGE, later);
        }
        Ok(())
    }
}

/// The store of the settings.
fn settings() -> Option<SettingsStore<SettingsFlash>> {
    SettingsStore::new(SettingsFlash, SETTINGS)
}

/// Copies the record of the settings to `record` and returns its length.
pub fn read_record(record: &mut [u8]) -> Option<usize> {
    settings()?.read(record)
}

/// Replaces the record, or erases it if `record` is empty. To be used while no DMA transfer runs.
///
/// # Errors
/// The flash does not take it.
pub fn write_record(record: &[u8]) -> Result<(), StoreError> {
    let mut settings = settings().ok_or(StoreError::NoMemory)?;
    if record.is_empty() { settings.erase() } else { settings.write(record) }
}
