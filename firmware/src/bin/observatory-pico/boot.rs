//! How the microcontroller came to start, what survived, and what is left for the next start.

use crate::chip::Microcontroller;
use core::panic::PanicInfo;
use cortex_m_rt::{ExceptionFrame, exception};
use firmware::{LastWords, Retained, retained};
use link::{Boot, BootCause};
use rp2040_hal::pac::{VREG_AND_CHIP_RESET, WATCHDOG};

#[unsafe(link_section = ".uninit.retained")]
static RETAINED: retained::Memory = retained::blank();

#[unsafe(link_section = ".uninit.last_words")]
static LAST_WORDS: LastWords = LastWords::blank();

/// Reads the reasons (RP2040 data sheet, sections 2.10.6.2 and 4.7.6) and takes the last words.
pub(crate) fn report(chip: &VREG_AND_CHIP_RESET, watchdog: &WATCHDOG) -> Boot {
    let (reason, chip) = (watchdog.reason().read(), chip.chip_reset().read());
    // The chip's flags tell of the last reset of the whole chip, which the watchdog's is not. Power-on and brown-out
    // have one flag.
    let cause = if reason.timer().bit_is_set() {
        BootCause::Watchdog
    } else if reason.force().bit_is_set() {
        BootCause::Software
    } else if chip.had_por().bit_is_set() {
        BootCause::PowerOn
    } else if chip.had_run().bit_is_set() {
        BootCause::Pin
    } else {
        BootCause::Unknown
    };
    Boot { cause, last_words: LAST_WORDS.take(), ..Boot::default() }
}

/// What survived; nothing when the supply came on.
pub(crate) fn retained(cause: BootCause) -> Retained {
    let mut retained = Retained::open(&RETAINED);
    if cause == BootCause::PowerOn {
        retained.clear();
    }
    retained
}

#[panic_handler]
fn panic(info: &PanicInfo<'_>) -> ! {
    let (file, line) = info.location().map_or(("?", 0), |at| (at.file(), at.line()));
    LAST_WORDS.leave(format_args!("panic at {file}:{line}"));
    defmt::error!("panic at {=str}:{=u32}", file, line);
    Microcontroller::restart()
}

#[exception]
unsafe fn HardFault(frame: &ExceptionFrame) -> ! {
    LAST_WORDS.leave(format_args!("hard fault at {:#010x}, called from {:#010x}", frame.pc(), frame.lr()));
    Microcontroller::restart()
}
