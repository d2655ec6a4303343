//! An STM32F4: SPI1 with DMA2, USART2, TIM2 for the time, the independent watchdog.

mod bus;
mod port;

pub use bus::SensorBus;
pub use port::SerialPort;

use super::{DataReady, Microcontroller};
use cortex_m::peripheral::SCB;
use link::BootCause;
use stm32f4xx_hal::gpio::{ExtiPin, Input, Pin};
use stm32f4xx_hal::pac::{IWDG, RCC, TIM2};
use stm32f4xx_hal::prelude::*;
use stm32f4xx_hal::rcc::{Enable, Rcc, Reset};
use stm32f4xx_hal::watchdog::IndependentWatchdog;

/// A report of every channel takes less.
const WATCHDOG_MS: u32 = 8_000;

/// Reads and clears the reset flags (RM0090 section 6.3.21).
pub fn boot_cause(rcc: &RCC) -> BootCause {
    let flags = rcc.csr().read();
    rcc.csr().modify(|_, w| w.rmvf().set_bit());
    // Coming on raises the brown-out flag too, and everything raises that of the pin.
    if flags.porrstf().bit_is_set() {
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
    }
}

/// The microcontroller.
pub struct Stm32f4 {
    watchdog: IndependentWatchdog,
}

impl Stm32f4 {
    /// Starts the counter of microseconds and the watchdog.
    pub fn start(timer: TIM2, watchdog: IWDG, rcc: &mut Rcc) -> Self {
        TIM2::enable(rcc);
        TIM2::reset(rcc);
        let clock_hz = rcc.clocks.timclk1().raw();
        timer.psc().write(|w| w.psc().set((clock_hz / 1_000_000 - 1) as u16));
        timer.egr().write(|w| w.ug().set_bit()); // takes the prescaler over; the counter's end stays at 2³² − 1
        timer.cr1().write(|w| w.cen().set_bit());
        let mut watchdog = IndependentWatchdog::new(watchdog);
        watchdog.start(WATCHDOG_MS.millis());
        Self { watchdog }
    }
}

impl Microcontroller for Stm32f4 {
    fn counter() -> u32 {
        // SAFETY: a read without side effects.
        unsafe { (*TIM2::ptr()).cnt().read().cnt().bits() }
    }

    fn feed(&mut self) {
        self.watchdog.feed();
    }

    fn restart() -> ! {
        SCB::sys_reset()
    }
}

impl<const P: char, const N: u8> DataReady for Pin<P, N, Input> {
    fn clear(&mut self) {
        self.clear_interrupt_pending_bit();
    }
}
