//! An RP2040: SPI0 with two DMA channels, UART0, the timer, the watchdog.

mod bus;
mod port;

pub use bus::SensorBus;
pub use port::SerialPort;

use super::{DataReady, Microcontroller};
use link::BootCause;
use rp2040_hal::Watchdog;
use rp2040_hal::clocks::ClocksManager;
use rp2040_hal::fugit::ExtU32;
use rp2040_hal::gpio::{FunctionSioInput, Interrupt, Pin, PinId, PullDown};
use rp2040_hal::pac::{RESETS, TIMER, VREG_AND_CHIP_RESET, WATCHDOG};

/// A report of every channel takes longer, one channel less; the watchdog ends at 8.388 s.
const WATCHDOG_MS: u32 = 8_300;

/// Reads the reasons (RP2040 data sheet, sections 2.10.6.2 and 4.7.6).
pub fn boot_cause(chip: &VREG_AND_CHIP_RESET, watchdog: &WATCHDOG) -> BootCause {
    let (reason, chip) = (watchdog.reason().read(), chip.chip_reset().read());
    // The chip's flags tell of the last reset of the whole chip, which the watchdog's is not. Power-on and brown-out
    // have one flag.
    if reason.timer().bit_is_set() {
        BootCause::Watchdog
    } else if reason.force().bit_is_set() {
        BootCause::Software
    } else if chip.had_por().bit_is_set() {
        BootCause::PowerOn
    } else if chip.had_run().bit_is_set() {
        BootCause::Pin
    } else {
        BootCause::Unknown
    }
}

/// The microcontroller.
pub struct Rp2040 {
    watchdog: Watchdog,
}

impl Rp2040 {
    /// Starts the counter of microseconds and the watchdog.
    pub fn start(timer: TIMER, mut watchdog: Watchdog, resets: &mut RESETS, clocks: &ClocksManager) -> Self {
        let _counts_by_itself = rp2040_hal::Timer::new(timer, resets, clocks);
        watchdog.start(WATCHDOG_MS.millis());
        Self { watchdog }
    }
}

impl Microcontroller for Rp2040 {
    fn counter() -> u32 {
        // SAFETY: a read without side effects.
        unsafe { (*TIMER::ptr()).timerawl().read().bits() }
    }

    fn feed(&mut self) {
        self.watchdog.feed();
    }

    /// By the watchdog: a reset of the core alone would leave the peripherals as they are.
    fn restart() -> ! {
        // SAFETY: nothing comes after it.
        unsafe { (*WATCHDOG::ptr()).ctrl().modify(|_, w| w.trigger().set_bit()) };
        loop {
            cortex_m::asm::nop();
        }
    }
}

impl<I: PinId> DataReady for Pin<I, FunctionSioInput, PullDown> {
    fn clear(&mut self) {
        self.clear_interrupt(Interrupt::EdgeHigh);
    }
}
