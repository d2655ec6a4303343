//! Counts instructions on an emulated Arm MPS2 board and prints them over semihosting, one per line.
#![no_std]
#![no_main]

mod end;
mod estimator;
mod functions;
#[path = "../../../allan-core/tests/support/late_state.rs"]
mod late_state;
mod report;
mod timer;

use cortex_m_rt::entry;

#[entry]
fn main() -> ! {
    timer::start();
    estimator::count();
    functions::count();
    end::success()
}
