//! Instructions by the clock of the emulated board.
//!
//! With QEMU's `-icount shift=0` an instruction takes 1 ns, and SysTick counts at 25 MHz: a tick is 40 instructions.

use core::sync::atomic::{AtomicU32, Ordering};
use cortex_m::peripheral::syst::SystClkSource;
use cortex_m::peripheral::{Peripherals, SYST};
use cortex_m_rt::exception;

const INSTRUCTIONS_PER_TICK: u64 = 40;
const WRAP: u32 = 1 << 24;

/// How often the timer has wrapped.
static WRAPS: AtomicU32 = AtomicU32::new(0);

#[exception]
fn SysTick() {
    WRAPS.store(WRAPS.load(Ordering::Relaxed) + 1, Ordering::Relaxed);
}

pub(crate) fn start() {
    let mut timer = Peripherals::take().expect("taken once").SYST;
    timer.set_clock_source(SystClkSource::Core);
    timer.set_reload(WRAP - 1);
    timer.clear_current();
    timer.enable_counter();
    timer.enable_interrupt();
}

fn ticks() -> u64 {
    loop {
        let wraps = WRAPS.load(Ordering::Relaxed);
        let passed = WRAP - SYST::get_current();
        if WRAPS.load(Ordering::Relaxed) == wraps {
            return u64::from(wraps) * u64::from(WRAP) + u64::from(passed);
        }
    }
}

/// Instructions that `work` takes.
pub(crate) fn instructions(work: impl FnOnce()) -> u64 {
    let start = ticks();
    work();
    (ticks() - start) * INSTRUCTIONS_PER_TICK
}
