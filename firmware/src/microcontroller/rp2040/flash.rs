//! The flash memory of an RP2040 board, by the boot ROM (RP2040 data sheet, section 2.8.3.1.3); while it takes
//! commands, code runs from RAM without interrupts.

use crate::microcontroller::settings_flash::{FlashError, FlashMemory};
use core::sync::atomic::{Ordering, compiler_fence};
use rp2040_hal::rom_data;

const FLASH: *const u32 = Rp2040Flash::ORIGIN as *const u32;
const BOOT2_WORDS: usize = 64;
/// Unique number of a W25Q16: bytes, instruction, dummy bytes (Winbond, W25Q16JV, Read Unique ID).
const UNIQUE_ID_BYTES: usize = 8;
const READ_UNIQUE_ID: u32 = 0x4B;
const DUMMY_BYTES: usize = 4;

#[derive(Clone, Copy)]
enum Operation {
    ReadUniqueId,
    EraseSector,
    ProgramPage,
}

#[repr(C)]
struct Command {
    operation: Operation,
    connect_internal_flash: unsafe extern "C" fn(),
    flash_exit_xip: unsafe extern "C" fn(),
    flash_flush_cache: unsafe extern "C" fn(),
    flash_range_erase: unsafe extern "C" fn(u32, usize, u32, u8),
    flash_range_program: unsafe extern "C" fn(u32, *const u8, usize),
    boot2: unsafe extern "C" fn(),
    /// Offset from the beginning of the flash, bytes.
    offset: u32,
    data: *mut u8,
}

fn run(operation: Operation, offset: u32, data: *mut u8) {
    // SAFETY: flash, which is readable here.
    let boot2: [u32; BOOT2_WORDS] = core::array::from_fn(|word| unsafe { FLASH.add(word).read_volatile() });
    let command = Command {
        operation,
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
        unsafe { operate_flash(&command) };
        compiler_fence(Ordering::SeqCst);
    });
    core::hint::black_box(&boot2);
}

/// Unique number of flash and board; no DMA transfer may run.
pub fn unique_id() -> [u8; UNIQUE_ID_BYTES] {
    let mut id = [0; UNIQUE_ID_BYTES];
    run(Operation::ReadUniqueId, 0, id.as_mut_ptr());
    id
}

/// Registers of the SSI, words (RP2040 data sheet, section 4.10.13).
const SSI: *mut u32 = 0x1800_0000 as *mut u32;
const CTRLR0: usize = 0;
const CTRLR1: usize = 1;
const SSIENR: usize = 2;
const SR: usize = 10;
const DR0: usize = 24;
/// TMOD of CTRLR0: send, then receive CTRLR1 + 1 bytes.
const EEPROM_READ: u32 = 3 << 8;
/// RFNE of SR: a byte was received.
const RECEIVED: u32 = 1 << 3;

const SECTOR: usize = 4096;
const PAGE: usize = 256;
/// Instruction that erases a sector; the boot ROM takes it as the instruction that erases a block.
const ERASE_SECTOR: u8 = 0x20;

/// Carries out a command, in RAM.
#[inline(never)]
#[unsafe(link_section = ".data.operate_flash")]
unsafe extern "C" fn operate_flash(command: &Command) {
    // SAFETY: the caller has seen to it that nothing else uses the flash, and has checked the offset; `data` has room for the operation.
    unsafe {
        (command.connect_internal_flash)();
        (command.flash_exit_xip)();
        match command.operation {
            Operation::ReadUniqueId => read_unique_id(command.data),
            Operation::EraseSector => (command.flash_range_erase)(command.offset, SECTOR, SECTOR as u32, ERASE_SECTOR),
            Operation::ProgramPage => (command.flash_range_program)(command.offset, command.data, PAGE),
        }
        (command.flash_flush_cache)();
        (command.boot2)();
    }
}

/// Part of [`operate_flash`], in RAM as it is.
///
/// # Safety
/// Nothing else uses the flash, and `id` has room for the number.
#[inline(always)]
unsafe fn read_unique_id(id: *mut u8) {
    // SAFETY: the registers are those of the SSI.
    unsafe {
        SSI.add(SSIENR).write_volatile(0);
        SSI.add(CTRLR0).write_volatile(SSI.add(CTRLR0).read_volatile() | EEPROM_READ);
        SSI.add(CTRLR1).write_volatile((DUMMY_BYTES + UNIQUE_ID_BYTES - 1) as u32);
        SSI.add(SSIENR).write_volatile(1);
        SSI.add(DR0).write_volatile(READ_UNIQUE_ID);
        let mut index = 0;
        while index < DUMMY_BYTES + UNIQUE_ID_BYTES {
            // A byte arrives within some µs.
            while SSI.add(SR).read_volatile() & RECEIVED == 0 {}
            let byte = SSI.add(DR0).read_volatile() as u8;
            if index >= DUMMY_BYTES {
                id.add(index - DUMMY_BYTES).write_volatile(byte);
            }
            index += 1;
        }
        SSI.add(SSIENR).write_volatile(0);
        SSI.add(CTRLR1).write_volatile(0);
    }
}

/// The flash memory; interrupts are disabled during erasure, 45 to 400 ms, and programming, 0.4 to 3 ms (Winbond,
/// W25Q16JV, AC electrical characteristics).
pub struct Rp2040Flash;

impl FlashMemory for Rp2040Flash {
    const ORIGIN: usize = 0x1000_0000;
    const SECTOR: usize = SECTOR;

    fn erase(offset: u32) -> Result<(), FlashError> {
        run(Operation::EraseSector, offset, core::ptr::null_mut());
        Ok(())
    }

    /// Bytes around are written as ones, which changes nothing.
    fn program(offset: u32, words: &[u8]) -> Result<(), FlashError> {
        let (mut at, mut rest) = (offset as usize, words);
        while !rest.is_empty() {
            let (page, begin) = (at - at % PAGE, at % PAGE);
            let (now, later) = rest.split_at(rest.len().min(PAGE - begin));
            let mut contents = [0xFF; PAGE];
            contents[begin..begin + now.len()].copy_from_slice(now);
            run(Operation::ProgramPage, page as u32, contents.as_mut_ptr());
            (at, rest) = (page + PAGE, later);
        }
        Ok(())
    }
}
