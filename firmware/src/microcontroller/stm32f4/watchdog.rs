//! The independent watchdog.

use stm32f4xx_hal::pac::IWDG;

/// Reloads the counter (RM0090 section 21.4.1).
pub(super) fn feed() {
    // SAFETY: the key that does so, and nothing else.
    unsafe { (*IWDG::ptr()).kr().write(|w| w.bits(0xAAAA)) };
}
