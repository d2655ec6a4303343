//! Counts instructions on an emulated Arm MPS2 board and says them over semihosting, a line each.
#![no_std]
#![no_main]

mod end;
mod estimator;
mod functions;
mod timer;

use core::hint::black_box;
use cortex_m_rt::entry;
use cortex_m_semihosting::hprintln;
use timer::instructions;

#[entry]
fn main() -> ! {
    timer::start();
    estimator::count();
    functions::count();
    end::success()
}

/// Says how many instructions each of `times` runs took on average.
fn report(name: &str, times: u32, work: impl FnOnce()) {
    let tenths = instructions(work) / u64::from(black_box(times) / 10);
    hprintln!("count {} {}.{}", name, tenths / 10, tenths % 10);
}
