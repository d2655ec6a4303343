//! How the microcontroller came to start, what survived, and what is left for the next start.

use core::panic::PanicInfo;
use cortex_m_rt::{ExceptionFrame, exception};
use firmware::{LastWords, Retained, retained};
use link::{Boot, BootCause};
use stm32f4xx_hal::pac::RCC;

#[unsafe(link_section = ".uninit.retained")]
static RETAINED: retained::Memory = retained::blank();

#[unsafe(link_section = ".uninit.last_words")]
static LAST_WORDS: LastWords = LastWords::blank();

/// Reads and clears the reset flags (RM0090 section 6.3.21) and takes the last words.
pub(crate) fn report(rcc: &RCC) -> Boot {
    let flags = rcc.csr().read();
    rcc.csr().modify(|_, w| w.rmvf().set_bit());
    // Coming on raises the brown-out flag too, and everything raises that of the pin.
    let cause = if flags.porrstf().bit_is_set() {
        BootCause::PowerOn
    } else if flags.wdgrstf().bit_is_set() {
        BootCause::Watchdog
    } else if flags.sftrstf().bit_is_set() {
        BootCause::Software
    } else if flags.borrstf().bit_is_set() {
        BootCause::BrownOut
    } else if flags.padrstf().bit_is_set() {
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
    cortex_m::peripheral::SCB::sys_reset()
}

#[exception]
unsafe fn HardFault(frame: &ExceptionFrame) -> ! {
    LAST_WORDS.leave(format_args!("hard fault at {:#010x}, called from {:#010x}", frame.pc(), frame.lr()));
    cortex_m::peripheral::SCB::sys_reset()
}
