//! Start of an RP2040: cause, watchdog, brown-out level, crystal, clocks; and the data-ready input.

use super::flash::Rp2040Flash;
use crate::board::DataReadyLine;
use crate::bus_frame::MicrosecondCounter;
use crate::microcontroller::processor::WAKE_HZ;
use crate::microcontroller::{DataReadyPin, Microcontroller};
use crate::watchdog::{Watchdog, WatchdogExtension};
use core::sync::atomic::{AtomicU32, Ordering::Relaxed};
use embedded_hal::digital::{InputPin, StatefulOutputPin};
use link::BootCause;
use rp2040_hal::Timer;
use rp2040_hal::clocks::{ClocksManager, InitError, init_clocks_and_plls};
use rp2040_hal::fugit::ExtU32;
use rp2040_hal::gpio::{FunctionSioInput, Interrupt, Pin, PinId, PullDown};
use rp2040_hal::pac::{CLOCKS, PLL_SYS, PLL_USB, RESETS, TIMER, VREG_AND_CHIP_RESET, WATCHDOG, XOSC};

/// Crystal of the Pico.
const CRYSTAL_HZ: u32 = 12_000_000;
/// Time after which the watchdog restarts if neither the main loop nor SysTick feeds it; its maximum is 8.388 s.
const WATCHDOG_MS: u32 = 8_300;
/// Time for which SysTick feeds the watchdog after the main loop, in s. The longest step of the main loop is the fit of one
/// channel: with 20 points it takes 118 million instructions (tests/instructions, thumbv6m) and up to three of them follow
/// one another, 2.5 s in the emulator with 12 points; slow flash may double that.
const EXTENSION_S: u32 = 30;
/// Feedings by the main loop.
static FEEDINGS: AtomicU32 = AtomicU32::new(0);
/// Readings of the flag of the crystal, each of at least three cycles of at most 12 MHz: 100 ms. It is set 1 ms after the
/// oscillator runs.
const CRYSTAL_READINGS: u32 = 400_000;
/// Time for which the LED says that the crystal does not start before the next attempt, in half periods of the LED.
const ALARM_BLINKS: u32 = 80;
/// Cycles of a half period of the LED: 62 ms at 6.5 MHz, the typical frequency of the ring oscillator (data sheet, 2.17).
const ALARM_CYCLES: u32 = 400_000;
/// Core voltage below which the brown-out detector resets: 0.946 V of 1.1 V (data sheet, 2.10.6.1; 0.86 V after a reset).
const BROWN_OUT_LEVEL: u8 = 0b1011;

/// Reads the cause of the start (RP2040 data sheet, sections 2.10.6.2 and 4.7.6).
pub fn boot_cause(chip: &VREG_AND_CHIP_RESET, watchdog: &WATCHDOG) -> BootCause {
    let (reason, chip) = (watchdog.reason().read(), chip.chip_reset().read());
    // The chip's flags are those of the last reset of the whole chip, which a reset by the watchdog is not. Power-on and
    // brown-out share one flag.
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

/// An RP2040 with running clock and watchdog.
pub struct Rp2040;

/// The peripherals that clocks are made with.
pub struct ClockParts {
    /// Crystal oscillator.
    pub crystal: XOSC,
    /// Clocks.
    pub clocks: CLOCKS,
    /// Their two PLLs.
    pub plls: (PLL_SYS, PLL_USB),
    /// Timer.
    pub timer: TIMER,
}

impl Rp2040 {
    /// Starts the watchdog, before anything that could wait without end, the clocks and the microsecond counter.
    ///
    /// Without the crystal there is no serial port: the ring oscillator runs at 1.8 to 12 MHz. The LED then blinks fast for
    /// five seconds, and the next attempt follows.
    ///
    /// # Errors
    /// The crystal's frequency makes no clock.
    pub fn start(
        parts: ClockParts,
        (watchdog, chip): (WATCHDOG, &VREG_AND_CHIP_RESET),
        resets: &mut RESETS,
        led: &mut impl StatefulOutputPin,
    ) -> Result<ClocksManager, InitError> {
        let mut watchdog = rp2040_hal::Watchdog::new(watchdog);
        // From the ring oscillator, until the crystal runs: the watchdog's time is then 5.7 s or more.
        watchdog.enable_tick_generation((CRYSTAL_HZ / 1_000_000) as u8);
        // While a debugger has halted the processor.
        watchdog.pause_on_debug(true);
        watchdog.start(WATCHDOG_MS.millis());
        chip.bod().modify(|_, w| {
            // SAFETY: one of the 16 levels.
            unsafe { w.vsel().bits(BROWN_OUT_LEVEL) }
        });
        if !crystal_starts(&parts.crystal) {
            for _ in 0..ALARM_BLINKS {
                let _infallible = led.toggle();
                cortex_m::asm::delay(ALARM_CYCLES);
                watchdog.feed();
            }
            Self::restart();
        }
        let ClockParts { crystal, clocks, plls, timer } = parts;
        let clocks = init_clocks_and_plls(CRYSTAL_HZ, crystal, clocks, plls.0, plls.1, resets, &mut watchdog)?;
        let _timer_runs_on = Timer::new(timer, resets, &clocks);
        Ok(clocks)
    }
}

/// Switches the crystal oscillator on, as the HAL does again without a bound on the time.
fn crystal_starts(crystal: &XOSC) -> bool {
    crystal.ctrl().write(|w| w.freq_range()._1_15mhz());
    crystal.ctrl().modify(|_, w| w.enable().enable());
    (0..CRYSTAL_READINGS).any(|_| crystal.status().read().stable().bit_is_set())
}

impl MicrosecondCounter for Rp2040 {
    fn counter() -> u32 {
        // SAFETY: a read without side effects.
        unsafe { (*TIMER::ptr()).timerawl().read().bits() }
    }
}

impl Watchdog for Rp2040 {
    fn feed() {
        reload_watchdog();
        FEEDINGS.store(FEEDINGS.load(Relaxed).wrapping_add(1), Relaxed);
    }
}

/// The counter falls by two a microsecond (erratum RP2040-E1).
fn reload_watchdog() {
    // SAFETY: feeds the watchdog, and nothing else.
    unsafe { (*WATCHDOG::ptr()).load().write(|w| w.bits(2 * 1000 * WATCHDOG_MS)) };
}

impl Microcontroller for Rp2040 {
    type Flash = Rp2040Flash;

    fn extend_watchdog(extension: &mut WatchdogExtension) {
        if extension.tick(FEEDINGS.load(Relaxed), EXTENSION_S * WAKE_HZ) {
            reload_watchdog();
        }
    }

    /// Restarts by the watchdog, since a reset of the core alone would not reset the peripherals.
    fn restart() -> ! {
        // SAFETY: the write ends the program.
        unsafe { (*WATCHDOG::ptr()).ctrl().modify(|_, w| w.trigger().set_bit()) };
        loop {
            cortex_m::asm::nop();
        }
    }

    /// Has the boot ROM show itself as a drive and to picotool, without an LED for its activity.
    fn start_boot_loader() -> ! {
        // SAFETY: the boot ROM, which does not feed the watchdog, takes over.
        unsafe { (*WATCHDOG::ptr()).ctrl().modify(|_, w| w.enable().clear_bit()) };
        rp2040_hal::rom_data::reset_to_usb_boot(0, 0)
    }
}

impl<I: PinId> DataReadyPin for Pin<I, FunctionSioInput, PullDown> {
    fn clear(&mut self) {
        self.clear_interrupt(Interrupt::EdgeHigh);
    }
}

impl<I: PinId> DataReadyLine for Pin<I, FunctionSioInput, PullDown> {
    fn set_masked(&mut self, masked: bool) {
        if self.is_interrupt_enabled(Interrupt::EdgeHigh) == masked {
            self.clear_interrupt(Interrupt::EdgeHigh);
            self.set_interrupt_enabled(Interrupt::EdgeHigh, !masked);
        }
    }

    fn is_active(&mut self) -> bool {
        let Ok(high) = InputPin::is_high(self);
        high
    }
}
