//! Start of an STM32F4: cause, watchdog, brown-out level, clocks.

use super::flash::Stm32Flash;
use super::watchdog;
use crate::board::BrownOutLevel;
use crate::bus_frame::{MicrosecondCounter, wait_for};
use crate::microcontroller::sensor_spi::SpiPeripheral;
use crate::microcontroller::{DataReadyPin, Microcontroller, first_cause};
use crate::receive::ServedPort;
use crate::watchdog::Watchdog;
use core::convert::Infallible;
use core::marker::PhantomData;
use core::sync::atomic::{AtomicU32, Ordering::Relaxed};
use cortex_m::peripheral::{NVIC, SCB};
use embedded_hal::digital::OutputPin;
use link::{BootCause, ClockSource};
use stm32f4xx_hal::gpio::{ErasedPin, Output};
use stm32f4xx_hal::pac::{DBGMCU, FLASH, IWDG, RCC, SYSCFG, TIM2};
use stm32f4xx_hal::prelude::*;
use stm32f4xx_hal::rcc::{Config, Enable, Rcc, Reset};
use stm32f4xx_hal::watchdog::IndependentWatchdog;

/// Time of the watchdog with an oscillator of 32 kHz, 5.4 s at 47 kHz (STM32F405 data sheet, LSI); a report takes less.
const WATCHDOG_MS: u32 = 8_000;
/// Clock of the processor, from crystal or internal oscillator.
const CORE_HZ: u32 = 168_000_000;
/// Clock of both peripheral buses; 84 MHz would make the slowest clock of SPI1 328 kHz, too fast for low-power mode.
const PERIPHERAL_HZ: u32 = 42_000_000;
/// Readings of the crystal's flag at 16 MHz: 100 ms.
const CRYSTAL_READINGS: u32 = 550_000;
/// Brown-out level 3, 2.7 V (RM0090 section 3.9.10); the names of the definitions are reversed.
const BROWN_OUT_LEVEL_3: u8 = 0b00;
/// Keys that unlock the option bytes (RM0090 section 3.7.2).
const OPTION_KEYS: [u32; 2] = [0x0819_2A3B, 0x4C5D_6E7F];

/// Reads the cause of the start and clears the reset flags (RM0090 section 6.3.21).
fn boot_cause(rcc: &RCC) -> BootCause {
    let flags = rcc.csr().read();
    rcc.csr().modify(|_, w| w.rmvf().set_bit());
    // Power-on also sets the brown-out flag, and every reset the flag of the pin.
    let causes = [
        (flags.porrstf().bit_is_set(), BootCause::PowerOn),
        (flags.wdgrstf().bit_is_set(), BootCause::Watchdog),
        (flags.sftrstf().bit_is_set(), BootCause::Software),
        (flags.borrstf().bit_is_set(), BootCause::BrownOut),
        (flags.padrstf().bit_is_set(), BootCause::Pin),
    ];
    first_cause(causes)
}

/// An STM32F4 with running clock and watchdog: data-ready pin `D`, SPI `P` with chip select `S`, serial port `U`.
pub struct Stm32f4<D = (), P = (), S = (), U = ()>(PhantomData<(D, P, S, U)>);

impl<D, P, S, U> Watchdog for Stm32f4<D, P, S, U> {
    fn feed() {
        watchdog::feed();
    }
}

/// The result of a start.
pub struct Started {
    pub(super) cause: BootCause,
    pub(super) clock: ClockSource,
    /// The clocks.
    pub rcc: Rcc,
}

impl Stm32f4 {
    /// Starts the watchdog first, then clocks and microsecond counter; the internal oscillator replaces a dead crystal.
    pub fn start((rcc, flash, timer, watchdog): (RCC, FLASH, TIM2, IWDG), crystal_hz: u32) -> Started {
        let cause = boot_cause(&rcc);
        if cause == BootCause::Software && REQUEST.load(Relaxed) == BOOT_LOADER_REQUEST {
            enter_boot_loader(&rcc);
        }
        IndependentWatchdog::new(watchdog).start(WATCHDOG_MS.millis());
        stop_watchdog_with_debugger();
        // The option bytes are written only on request.
        let programmed = flash.optcr().read().bor_lev().bits() == BROWN_OUT_LEVEL_3;
        defmt::info!("brown-out level of 2.7 V {=str}", if programmed { "set" } else { "not set: command brownout" });
        let clock = start_crystal(&rcc);
        let source = match clock {
            ClockSource::Crystal => Config::hse(crystal_hz.Hz()),
            ClockSource::Internal => Config::hsi(),
        };
        // USB needs 48 MHz.
        let source = source.require_pll48clk();
        let config = source.sysclk(CORE_HZ.Hz()).pclk1(PERIPHERAL_HZ.Hz()).pclk2(PERIPHERAL_HZ.Hz());
        let mut rcc = rcc.freeze(config);
        TIM2::enable(&mut rcc);
        TIM2::reset(&mut rcc);
        let timer_hz = rcc.clocks.timclk1().raw();
        timer.psc().write(|w| w.psc().set((timer_hz / 1_000_000 - 1) as u16));
        timer.egr().write(|w| w.ug().set_bit()); // loads the prescaler; the counter still wraps at 2³²
        timer.cr1().write(|w| w.cen().set_bit());
        Started { cause, clock, rcc }
    }
}

fn start_crystal(rcc: &RCC) -> ClockSource {
    rcc.cr().modify(|_, w| w.hseon().on());
    if (0..CRYSTAL_READINGS).any(|_| rcc.cr().read().hserdy().is_ready()) {
        ClockSource::Crystal
    } else {
        rcc.cr().modify(|_, w| w.hseon().off());
        ClockSource::Internal
    }
}

/// Stops the watchdog while a debugger halts the processor: DBG_IWDG_STOP (RM0090 section 38.16.4).
fn stop_watchdog_with_debugger() {
    // SAFETY: a register that nothing else uses.
    unsafe { (*DBGMCU::ptr()).apb1_fz().modify(|_, w| w.dbg_iwdg_stop().set_bit()) };
}

#[unsafe(link_section = ".uninit.request")]
static REQUEST: AtomicU32 = AtomicU32::new(0);
/// Value of [`REQUEST`] for the boot loader; any number that is unlikely in memory.
const BOOT_LOADER_REQUEST: u32 = 0xB007_10AD;
/// The boot loader, which begins with its vector table (RM0090 section 2.4; AN2606).
const SYSTEM_MEMORY: *const u32 = 0x1FFF_0000 as *const u32;
/// The mode that maps the boot loader to address 0 (RM0090 section 9.2.1).
const SYSTEM_MEMORY_AT_0: u8 = 0b01;

/// Enters the boot loader as a reset with BOOT0 high does: reset peripherals, no interrupts, system memory at address
/// 0.
fn enter_boot_loader(rcc: &RCC) -> ! {
    REQUEST.store(0, Relaxed);
    rcc.apb2enr().modify(|_, w| w.syscfgen().set_bit());
    // SAFETY: one of the modes; nothing else runs, and the boot loader never returns.
    unsafe {
        (*SYSCFG::ptr()).memrmp().write(|w| w.mem_mode().bits(SYSTEM_MEMORY_AT_0));
        (*NVIC::PTR).icer.iter().for_each(|enabled| enabled.write(u32::MAX));
        let [stack, reset] = [SYSTEM_MEMORY, SYSTEM_MEMORY.add(1)].map(|vector| vector.read_volatile());
        (*SCB::PTR).vtor.write(SYSTEM_MEMORY as u32);
        cortex_m::interrupt::enable();
        cortex_m::asm::bootstrap(stack as *const u32, reset as *const u32)
    }
}

impl<D, P, S, U> MicrosecondCounter for Stm32f4<D, P, S, U> {
    fn counter() -> u32 {
        // SAFETY: a read without side effects.
        unsafe { (*TIM2::ptr()).cnt().read().cnt().bits() }
    }
}

impl<D: DataReadyPin, P: SpiPeripheral, S: OutputPin<Error = Infallible>, U: ServedPort> Microcontroller
    for Stm32f4<D, P, S, U>
{
    type DataReady = D;
    type Spi = P;
    type Select = S;
    type Uart = U;
    type Output = ErasedPin<Output>;
    type Flash = Stm32Flash;
    #[cfg(feature = "feather-usb")]
    type Usb = super::usb::Stm32UsbPort;
    #[cfg(not(feature = "feather-usb"))]
    type Usb = Infallible;

    fn restart() -> ! {
        SCB::sys_reset()
    }

    /// The boot loader is entered at the next start, when everything is as after a reset.
    fn start_boot_loader() -> ! {
        REQUEST.store(BOOT_LOADER_REQUEST, Relaxed);
        Self::restart()
    }

    fn program_brown_out() -> BrownOutLevel {
        program_brown_out()
    }
}

/// Programs brown-out level 3, 2.7 V for 168 MHz, in the option bytes (RM0090 sections 3.7.2 and 3.7.3); takes
/// milliseconds.
fn program_brown_out() -> BrownOutLevel {
    // SAFETY: only this function uses the flash memory's registers after the start.
    let flash = unsafe { &*FLASH::ptr() };
    if flash.optcr().read().bor_lev().bits() == BROWN_OUT_LEVEL_3 {
        return BrownOutLevel::Set;
    }
    for key in OPTION_KEYS {
        // SAFETY: the values that unlock the option bytes.
        flash.optkeyr().write(|w| unsafe { w.bits(key) });
    }
    let is_ready = || (0..1000).any(|_| wait_for(|| flash.sr().read().bsy().bit_is_clear()));
    let done = is_ready() && {
        // SAFETY: one of the four levels.
        flash.optcr().modify(|_, w| unsafe { w.bor_lev().bits(BROWN_OUT_LEVEL_3) });
        flash.optcr().modify(|_, w| w.optstrt().set_bit());
        is_ready()
    };
    flash.optcr().modify(|_, w| w.optlock().set_bit());
    if done { BrownOutLevel::Programmed } else { BrownOutLevel::Failed }
}
