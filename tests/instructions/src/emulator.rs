//! The emulated board: its clock, which counts instructions, and the end of a run, which QEMU returns as its exit
//! status.
//!
//! QEMU's `-icount shift=0` makes an instruction take 1 ns. SysTick counts at 25 MHz, so a tick is 40 instructions.

use core::sync::atomic::{AtomicU32, Ordering};
use cortex_m::peripheral::syst::SystClkSource;
use cortex_m::peripheral::{Peripherals, SYST};
use cortex_m::register::msp;
use cortex_m_rt::exception;
use cortex_m_semihosting::debug::{self, ExitStatus};
use cortex_m_semihosting::hprintln;

const INSTRUCTIONS_PER_TICK: u64 = 40;
const WRAP: u32 = 1 << 24;
/// Value of an unused word of stack.
const PAINT: u32 = 0xCCCC_CCCC;
/// Bytes of stack that are painted: more than any call here uses, and far from the data at the other end of the board's
/// 4 MB.
const PAINTED_BYTES: u32 = 64 * 1024;

/// Number of times that the timer has wrapped.
static WRAPS: AtomicU32 = AtomicU32::new(0);

#[exception]
fn SysTick() {
    WRAPS.store(WRAPS.load(Ordering::Relaxed) + 1, Ordering::Relaxed);
}

/// Starts the clock. To be called once.
pub(crate) fn start() {
    let mut timer = Peripherals::take().expect("taken once").SYST;
    timer.set_clock_source(SystClkSource::Core);
    timer.set_reload(WRAP - 1);
    timer.clear_current();
    timer.enable_counter();
    timer.enable_interrupt();
}

/// Ticks since [`start`].
fn ticks() -> u64 {
    loop {
        let wraps = WRAPS.load(Ordering::Relaxed);
        let passed = WRAP - SYST::get_current();
        if WRAPS.load(Ordering::Relaxed) == wraps {
            return u64::from(wraps) * u64::from(WRAP) + u64::from(passed);
        }
    }
}

/// Number of instructions of `work`.
pub(crate) fn instructions(work: impl FnOnce()) -> u64 {
    let start = ticks();
    work();
    (ticks() - start) * INSTRUCTIONS_PER_TICK
}

/// Bytes of stack that `work` uses below its caller's, including interrupts. The stack is painted before and searched
/// after.
#[inline(never)]
pub(crate) fn stack_bytes(work: impl FnOnce()) -> u32 {
    let top = msp::read();
    let words = || (top - PAINTED_BYTES..top).step_by(4);
    // SAFETY: this RAM lies below the stack pointer and above the static variables, so nothing uses it: an interrupt has
    // released its part before it returns here.
    words().for_each(|address| unsafe { (address as *mut u32).write_volatile(PAINT) });
    run(work);
    // SAFETY: as above.
    let used = words().find(|&address| unsafe { (address as *const u32).read_volatile() } != PAINT);
    used.map_or(0, |address| top - address)
}

#[inline(never)]
fn run(work: impl FnOnce()) {
    work();
}

/// Ends the run with success.
pub(crate) fn success() -> ! {
    exit(debug::EXIT_SUCCESS)
}

#[panic_handler]
fn panic(info: &core::panic::PanicInfo) -> ! {
    hprintln!("{}", info);
    exit(debug::EXIT_FAILURE)
}

fn exit(status: ExitStatus) -> ! {
    debug::exit(status);
    loop {
        cortex_m::asm::wfi();
    }
}
