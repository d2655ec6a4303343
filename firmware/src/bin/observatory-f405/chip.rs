//! The microcontroller itself: time, sleep, watchdog, and what it measures of its own work.

use core::sync::atomic::{AtomicU32, Ordering::Relaxed};
use cortex_m::peripheral::syst::SystClkSource;
use cortex_m::peripheral::{DWT, SCB};
use firmware::{Chip, Meters};
use stm32f4xx_hal::pac::{self, IWDG, TIM2};
use stm32f4xx_hal::prelude::*;
use stm32f4xx_hal::rcc::{Enable, Rcc, Reset};
use stm32f4xx_hal::watchdog::IndependentWatchdog;

/// Longest sampling interrupt in cycles. Only the sampling interrupts write it.
pub(crate) static SAMPLING_CYCLES: AtomicU32 = AtomicU32::new(0);
/// Longest turn of the estimators in cycles. Only they write it.
pub(crate) static ESTIMATOR_CYCLES: AtomicU32 = AtomicU32::new(0);
/// Bytes lost on the way in. Only the serial port's interrupt writes it.
pub(crate) static SERIAL_OVERRUNS: AtomicU32 = AtomicU32::new(0);

/// A report of every channel takes less.
const WATCHDOG_MS: u32 = 8_000;
/// Ten times a second.
const WAKE_HZ: u32 = 10;

/// Runs `work` and remembers how many cycles it took, if more than ever before.
pub(crate) fn measure(longest: &AtomicU32, work: impl FnOnce()) {
    let start = DWT::cycle_count();
    work();
    let cycles = DWT::cycle_count().wrapping_sub(start);
    if cycles > longest.load(Relaxed) {
        longest.store(cycles, Relaxed);
    }
}

pub(crate) struct Microcontroller {
    watchdog: IndependentWatchdog,
}

impl Microcontroller {
    /// Starts the counter of microseconds, the cycle counter, SysTick and the watchdog.
    pub(crate) fn start(timer: TIM2, watchdog: IWDG, core: &mut cortex_m::Peripherals, rcc: &mut Rcc) -> Self {
        TIM2::enable(rcc);
        TIM2::reset(rcc);
        let clock_hz = rcc.clocks.timclk1().raw();
        timer.psc().write(|w| w.psc().set((clock_hz / 1_000_000 - 1) as u16));
        timer.egr().write(|w| w.ug().set_bit()); // takes the prescaler over; the counter's end stays at 2³² − 1
        timer.cr1().write(|w| w.cen().set_bit());

        core.DCB.enable_trace();
        core.DWT.enable_cycle_counter();
        core.SYST.set_clock_source(SystClkSource::External);
        core.SYST.set_reload(rcc.clocks.hclk().raw() / 8 / WAKE_HZ - 1);
        core.SYST.clear_current();
        core.SYST.enable_interrupt();
        core.SYST.enable_counter();

        let mut watchdog = IndependentWatchdog::new(watchdog);
        watchdog.start(WATCHDOG_MS.millis());
        Self { watchdog }
    }

    pub(crate) fn counter() -> u32 {
        // SAFETY: a read without side effects.
        unsafe { (*TIM2::ptr()).cnt().read().cnt().bits() }
    }

    /// Lets at least `us` microseconds pass.
    pub(crate) fn wait_us(us: u32) {
        let start = Self::counter();
        while Self::counter().wrapping_sub(start) <= us {}
    }
}

impl Chip for &mut Microcontroller {
    fn microseconds(&mut self) -> u32 {
        Microcontroller::counter()
    }

    fn sleep(&mut self, mut clock: impl FnMut(u32)) {
        cortex_m::interrupt::free(|_| {
            clock(Microcontroller::counter());
            cortex_m::asm::wfi();
            clock(Microcontroller::counter());
        });
    }

    fn transmit(&mut self) {
        rtic::pend(pac::Interrupt::USART2);
    }

    fn feed(&mut self) {
        self.watchdog.feed();
    }

    fn restart(&mut self) {
        SCB::sys_reset()
    }

    fn meters(&mut self) -> Meters {
        Meters {
            asleep_us: 0,
            serial_overruns: SERIAL_OVERRUNS.load(Relaxed),
            sampling_cycles: SAMPLING_CYCLES.load(Relaxed),
            estimator_cycles: ESTIMATOR_CYCLES.load(Relaxed),
            stack_bytes: stack_bytes(),
        }
    }
}

/// How much of the stack was ever used: from its start down to the first word that the paint of the start-up code is
/// gone from.
fn stack_bytes() -> u32 {
    unsafe extern "C" {
        static _stack_start: u32;
        static _stack_end: u32;
    }
    const PAINT: u32 = 0xCCCC_CCCC;
    let (start, end) = (&raw const _stack_start as usize, &raw const _stack_end as usize);
    // SAFETY: between these symbols of the linker lies the stack, all of it readable RAM.
    let is_painted = |&address: &usize| unsafe { (address as *const u32).read_volatile() } == PAINT;
    (start - (end..start).step_by(4).take_while(is_painted).count() * 4 - end) as u32
}
