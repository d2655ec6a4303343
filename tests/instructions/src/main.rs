//! Counts instructions on an emulated Arm MPS2 board and says them over semihosting, a line each.
//!
//! With QEMU's `-icount shift=0` an instruction takes 1 ns, and SysTick counts at 25 MHz: a tick is 40 instructions.
#![no_std]
#![no_main]

mod estimator;
mod functions;

use core::hint::black_box;
use cortex_m::peripheral::syst::SystClkSource;
use cortex_m::peripheral::{Peripherals, SYST};
use cortex_m_rt::entry;
use cortex_m_semihosting::{debug, hprintln};

const INSTRUCTIONS_PER_TICK: u32 = 40;
const WRAP: u32 = 1 << 24;

#[entry]
fn main() -> ! {
    let mut timer = Peripherals::take().expect("taken once").SYST;
    timer.set_clock_source(SystClkSource::Core);
    timer.set_reload(WRAP - 1);
    timer.clear_current();
    timer.enable_counter();
    estimator::count();
    functions::count();
    debug::exit(debug::EXIT_SUCCESS);
    loop {
        cortex_m::asm::wfi();
    }
}

#[panic_handler]
fn panic(info: &core::panic::PanicInfo) -> ! {
    hprintln!("{}", info);
    debug::exit(debug::EXIT_FAILURE);
    loop {
        cortex_m::asm::wfi();
    }
}

/// Instructions that `work` takes, up to 600 million.
fn instructions(work: impl FnOnce()) -> u32 {
    let start = SYST::get_current();
    work();
    (start.wrapping_sub(SYST::get_current()) & (WRAP - 1)) * INSTRUCTIONS_PER_TICK
}

/// Says how many instructions each of `times` runs took on average.
fn report(name: &str, times: u32, work: impl FnOnce()) {
    let tenths = instructions(work) / (black_box(times) / 10);
    hprintln!("count {} {}.{}", name, tenths / 10, tenths % 10);
}
