//! Counts instructions on an emulated Arm MPS2 board and prints them over semihosting, one per line.
#![no_std]
#![no_main]

#[allow(dead_code)] // the other images measure the stack too
mod emulator;
mod estimator;
mod functions;
#[path = "../../../allan-core/tests/support/late_state.rs"]
mod late_state;

use cortex_m_rt::entry;

#[entry]
fn main() -> ! {
    emulator::start();
    estimator::count();
    functions::count();
    emulator::success()
}
