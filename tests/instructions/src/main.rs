//! Counts instructions on an emulated Arm MPS2 board and prints them over semihosting, one per line.
#![no_std]
#![no_main]

#[allow(dead_code, unreachable_pub, reason = "a file of the firmware, of which the gate needs the channels alone")]
#[path = "../../../firmware/src/channels.rs"]
mod channels;
#[allow(dead_code)] // the other images measure the stack too
mod emulator;
mod estimator;
mod functions;
mod gate;
#[allow(dead_code, reason = "a file of the firmware, which asks the gate for its state, too")]
#[path = "../../../firmware/src/gross_error_gate.rs"]
mod gross_error_gate;
#[path = "../../../allan-core/tests/support/late_state.rs"]
mod late_state;

use cortex_m_rt::entry;

#[entry]
fn main() -> ! {
    emulator::start();
    estimator::count();
    gate::count();
    functions::count();
    emulator::success()
}
