//! Start of an RP2040: cause, watchdog, brown-out level, crystal; and the data-ready input.

use super::flash::Rp2040Flash;
use super::usb::Rp2040UsbPort;
use crate::bus_frame::MicrosecondCounter;
use crate::microcontroller::processor::WAKE_HZ;
use crate::microcontroller::sensor_spi::SpiPeripheral;
use crate::microcontroller::{DataReadyPin, Microcontroller, first_cause};
use crate::receive::ServedPort;
use crate::watchdog::{Watchdog, WatchdogExtension};
use core::convert::Infallible;
use core::marker::PhantomData;
use core::sync::atomic::{AtomicU32, Ordering::Relaxed};
use embedded_hal::digital::{InputPin, OutputPin, StatefulOutputPin};
use link::BootCause;
use rp2040_hal::fugit::ExtU32;
use rp2040_hal::gpio::{DynPinId, FunctionSioInput, FunctionSioOutput, Interrupt, Pin, PinId, PullDown};
use rp2040_hal::pac::{TIMER, VREG_AND_CHIP_RESET, WATCHDOG, XOSC};

pub(super) const CRYSTAL_HZ: u32 = 12_000_000;
/// Time of the watchdog, fed by the main loop and SysTick; at most 8.388 s.
const WATCHDOG_MS: u32 = 8_300;
/// Time for which SysTick feeds the watchdog after the main loop, s; the longest step, a channel's fit, takes 2.5 s in
/// the emulator.
const EXTENSION_S: u32 = 30;
static FEEDINGS: AtomicU32 = AtomicU32::new(0);
/// Readings of the crystal's flag, 100 ms at 12 MHz; it is set after 1 ms.
const CRYSTAL_READINGS: u32 = 400_000;
/// Duration of the alarm before the next attempt, half periods of the LED.
const ALARM_BLINKS: u32 = 80;
/// Half period of the alarm: 62 ms at 6.5 MHz, the typical ring oscillator (data sheet, 2.17).
const ALARM_CYCLES: u32 = 400_000;
/// Brown-out level: 0.946 V of 1.1 V (data sheet, 2.10.6.1; 0.86 V after a reset).
const BROWN_OUT_LEVEL: u8 = 0b1011;

/// Reads the cause of the start (RP2040 data sheet, sections 2.10.6.2 and 4.7.6).
pub(super) fn boot_cause(chip: &VREG_AND_CHIP_RESET, watchdog: &WATCHDOG) -> BootCause {
    let (reason, chip) = (watchdog.reason().read(), chip.chip_reset().read());
    // The chip's flags do not show a watchdog reset; power-on and brown-out share one flag.
    let causes = [
        (reason.timer().bit_is_set(), BootCause::Watchdog),
        (reason.force().bit_is_set(), BootCause::Software),
        (chip.had_por().bit_is_set(), BootCause::PowerOn),
        (chip.had_run().bit_is_set(), BootCause::Pin),
    ];
    first_cause(causes)
}

/// An RP2040 with running clock and watchdog: data-ready pin `D`, SPI `P` with chip select `S`, serial port `U`.
pub struct Rp2040<D = (), P = (), S = (), U = ()>(PhantomData<(D, P, S, U)>);

/// Starts the watchdog with its clock, and sets the brown-out level. Until the crystal runs, the ring oscillator clocks the
/// watchdog: 5.7 s or more.
pub(super) fn start_watchdog(watchdog: WATCHDOG, chip: &VREG_AND_CHIP_RESET) -> rp2040_hal::Watchdog {
    let mut watchdog = rp2040_hal::Watchdog::new(watchdog);
    watchdog.enable_tick_generation((CRYSTAL_HZ / 1_000_000) as u8);
    // The watchdog pauses while a debugger halts the processor.
    watchdog.pause_on_debug(true);
    watchdog.start(WATCHDOG_MS.millis());
    chip.bod().modify(|_, w| {
        // SAFETY: one of the 16 levels.
        unsafe { w.vsel().bits(BROWN_OUT_LEVEL) }
    });
    watchdog
}

/// Waits for the crystal; the HAL would wait without a time limit. Without it the LED blinks fast, and the next attempt
/// follows.
pub(super) fn start_crystal(crystal: &XOSC, led: &mut impl StatefulOutputPin, watchdog: &rp2040_hal::Watchdog) {
    crystal.ctrl().write(|w| w.freq_range()._1_15mhz());
    crystal.ctrl().modify(|_, w| w.enable().enable());
    if (0..CRYSTAL_READINGS).any(|_| crystal.status().read().stable().bit_is_set()) {
        return;
    }
    for _ in 0..ALARM_BLINKS {
        let _infallible = led.toggle();
        cortex_m::asm::delay(ALARM_CYCLES);
        watchdog.feed();
    }
    restart();
}

impl<D, P, S, U> MicrosecondCounter for Rp2040<D, P, S, U> {
    fn counter() -> u32 {
        // SAFETY: a read without side effects.
        unsafe { (*TIMER::ptr()).timerawl().read().bits() }
    }
}

impl<D, P, S, U> Watchdog for Rp2040<D, P, S, U> {
    fn feed() {
        reload_watchdog();
        FEEDINGS.store(FEEDINGS.load(Relaxed).wrapping_add(1), Relaxed);
    }
}

/// Reloads the watchdog, which falls by two a microsecond (erratum RP2040-E1).
fn reload_watchdog() {
    // SAFETY: feeds the watchdog, and nothing else.
    unsafe { (*WATCHDOG::ptr()).load().write(|w| w.bits(2 * 1000 * WATCHDOG_MS)) };
}

/// The watchdog restarts, since a core reset would not reset the peripherals.
fn restart() -> ! {
    // SAFETY: the write ends the program.
    unsafe { (*WATCHDOG::ptr()).ctrl().modify(|_, w| w.trigger().set_bit()) };
    loop {
        cortex_m::asm::nop();
    }
}

impl<D: DataReadyPin, P: SpiPeripheral, S: OutputPin<Error = Infallible>, U: ServedPort> Microcontroller
    for Rp2040<D, P, S, U>
{
    type DataReady = D;
    type Spi = P;
    type Select = S;
    type Uart = U;
    type Usb = Rp2040UsbPort;
    type Output = Pin<DynPinId, FunctionSioOutput, PullDown>;
    type Flash = Rp2040Flash;

    fn extend_watchdog(extension: &mut WatchdogExtension) {
        if extension.tick(FEEDINGS.load(Relaxed), EXTENSION_S * WAKE_HZ) {
            reload_watchdog();
        }
    }

    fn restart() -> ! {
        restart()
    }

    /// The boot loader offers a drive and an interface for picotool, without an activity LED.
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
