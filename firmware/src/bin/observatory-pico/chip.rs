//! The microcontroller itself: time, sleep, watchdog, and what it measures of its own work.

use core::sync::atomic::{AtomicU32, Ordering::Relaxed};
use cortex_m::peripheral::SYST;
use cortex_m::peripheral::syst::SystClkSource;
use firmware::{Chip, Meters};
use rp2040_hal::Watchdog;
use rp2040_hal::clocks::ClocksManager;
use rp2040_hal::fugit::ExtU32;
use rp2040_hal::pac::{self, RESETS, TIMER, WATCHDOG};

/// Longest sampling interrupt in cycles. Only the sampling interrupts write it.
pub(crate) static SAMPLING_CYCLES: AtomicU32 = AtomicU32::new(0);
/// Longest turn of the estimators in cycles. Only they write it.
pub(crate) static ESTIMATOR_CYCLES: AtomicU32 = AtomicU32::new(0);
/// Bytes lost on the way in. Only the serial port's interrupt writes it.
pub(crate) static SERIAL_OVERRUNS: AtomicU32 = AtomicU32::new(0);

/// A report of every channel takes longer, one channel less; the watchdog ends at 8.388 s.
const WATCHDOG_MS: u32 = 8_300;
/// Ten times a second.
const WAKE_HZ: u32 = 10;

/// Runs `work` and remembers how many cycles it took, if more than ever before. SysTick counts down, and wraps ten
/// times a second.
pub(crate) fn measure(longest: &AtomicU32, work: impl FnOnce()) {
    let start = SYST::get_current();
    work();
    let end = SYST::get_current();
    let cycles = if start >= end { start - end } else { start + SYST::get_reload() - end };
    if cycles > longest.load(Relaxed) {
        longest.store(cycles, Relaxed);
    }
}

pub(crate) struct Microcontroller {
    watchdog: Watchdog,
}

impl Microcontroller {
    /// Starts the counter of microseconds, SysTick and the watchdog.
    pub(crate) fn start(
        timer: TIMER,
        mut watchdog: Watchdog,
        core: &mut cortex_m::Peripherals,
        core_hz: u32,
        resets: &mut RESETS,
        clocks: &ClocksManager,
    ) -> Self {
        let _counts_by_itself = rp2040_hal::Timer::new(timer, resets, clocks);
        core.SYST.set_clock_source(SystClkSource::Core);
        core.SYST.set_reload(core_hz / WAKE_HZ - 1);
        core.SYST.clear_current();
        core.SYST.enable_interrupt();
        core.SYST.enable_counter();
        watchdog.start(WATCHDOG_MS.millis());
        Self { watchdog }
    }

    pub(crate) fn counter() -> u32 {
        // SAFETY: a read without side effects.
        unsafe { (*TIMER::ptr()).timerawl().read().bits() }
    }

    /// Lets at least `us` microseconds pass.
    pub(crate) fn wait_us(us: u32) {
        let start = Self::counter();
        while Self::counter().wrapping_sub(start) <= us {}
    }

    /// Has the watchdog restart everything but memory.
    pub(crate) fn restart() -> ! {
        // SAFETY: nothing comes after it.
        unsafe { (*WATCHDOG::ptr()).ctrl().modify(|_, w| w.trigger().set_bit()) };
        loop {
            cortex_m::asm::nop();
        }
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
        rtic::pend(pac::Interrupt::UART0_IRQ);
    }

    fn feed(&mut self) {
        self.watchdog.feed();
    }

    fn restart(&mut self) {
        Microcontroller::restart()
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
