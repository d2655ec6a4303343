//! The Cortex-M: sleep, its clock of cycles, and what it measures of its own work.

use super::Microcontroller;
use crate::{Chip, Meters};
use core::sync::atomic::{AtomicU32, Ordering::Relaxed};
use cortex_m::peripheral::SYST;
use cortex_m::peripheral::syst::SystClkSource;

/// Longest sampling interrupt in cycles. Only the sampling interrupts write it.
pub static SAMPLING_CYCLES: AtomicU32 = AtomicU32::new(0);
/// Longest turn of the estimators in cycles. Only they write it.
pub static ESTIMATOR_CYCLES: AtomicU32 = AtomicU32::new(0);
/// Bytes lost on the way in. Only the serial port's interrupt writes it.
static SERIAL_OVERRUNS: AtomicU32 = AtomicU32::new(0);

/// So often the main loop goes round, without a sensor too. SysTick's 24 bits take 168 MHz.
const WAKE_HZ: u32 = 16;

/// Runs `work` and remembers how many cycles it took, if more than ever before. It must end before SysTick, which counts
/// down, has wrapped twice.
pub fn measure(longest: &AtomicU32, work: impl FnOnce()) {
    let start = SYST::get_current();
    work();
    let end = SYST::get_current();
    let cycles = if start >= end { start - end } else { start + SYST::get_reload() + 1 - end };
    if cycles > longest.load(Relaxed) {
        longest.store(cycles, Relaxed);
    }
}

/// Counts bytes lost on the way in.
pub fn count_lost_bytes(lost: u32) {
    SERIAL_OVERRUNS.store(SERIAL_OVERRUNS.load(Relaxed).saturating_add(lost), Relaxed);
}

/// The processor of a microcontroller, as the main loop sees it.
pub struct Processor<M> {
    microcontroller: M,
    /// Requests the serial port's interrupt.
    transmit: fn(),
}

impl<M: Microcontroller> Processor<M> {
    /// Starts SysTick.
    pub fn new(microcontroller: M, core_hz: u32, mut systick: SYST, transmit: fn()) -> Self {
        systick.set_clock_source(SystClkSource::Core);
        systick.set_reload(core_hz / WAKE_HZ - 1);
        systick.clear_current();
        systick.enable_interrupt();
        systick.enable_counter();
        Self { microcontroller, transmit }
    }
}

impl<M: Microcontroller> Chip for &mut Processor<M> {
    fn microseconds(&mut self) -> u32 {
        M::counter()
    }

    fn sleep(&mut self, mut clock: impl FnMut(u32)) {
        cortex_m::interrupt::free(|_| {
            clock(M::counter());
            cortex_m::asm::wfi();
            clock(M::counter());
        });
    }

    fn transmit(&mut self) {
        (self.transmit)();
    }

    fn feed(&mut self) {
        self.microcontroller.feed();
    }

    fn restart(&mut self) {
        M::restart()
    }

    fn meters(&mut self) -> Meters {
        let (stack_bytes, stack_size) = stack();
        Meters {
            asleep_us: 0,
            serial_overruns: SERIAL_OVERRUNS.load(Relaxed),
            sampling_cycles: SAMPLING_CYCLES.load(Relaxed),
            estimator_cycles: ESTIMATOR_CYCLES.load(Relaxed),
            stack_bytes,
            stack_size,
        }
    }
}

/// How much of the stack was ever used, from its start down to the first word that the paint of the start-up code is gone
/// from, and how much there is.
fn stack() -> (u32, u32) {
    unsafe extern "C" {
        static _stack_start: u32;
        static _stack_end: u32;
    }
    const PAINT: u32 = 0xCCCC_CCCC;
    let (start, end) = (&raw const _stack_start as usize, &raw const _stack_end as usize);
    // SAFETY: between these symbols of the linker lies the stack, all of it readable RAM.
    let is_painted = |&address: &usize| unsafe { (address as *const u32).read_volatile() } == PAINT;
    let size = start - end;
    ((size - (end..start).step_by(4).take_while(is_painted).count() * 4) as u32, size as u32)
}
