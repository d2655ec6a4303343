//! An image that uses as much of the driver as its features say, and counts the instructions of a burst.
//!
//! With QEMU's `-icount shift=0` an instruction takes 1 ns, and SysTick counts at 25 MHz: a tick is 40 instructions.
#![no_std]
#![no_main]

#[cfg(feature = "asynchronous")]
mod asynchronous;
#[cfg(feature = "burst")]
mod burst;
mod bus;
#[cfg(feature = "counted")]
mod counted;
#[cfg(feature = "everything")]
mod everything;

use cortex_m_rt::entry;
use cortex_m_semihosting::debug;

#[entry]
fn main() -> ! {
    let bus = bus::Bus::new();
    #[cfg(feature = "burst")]
    core::hint::black_box(burst::sample(bus).is_ok());
    #[cfg(feature = "counted")]
    counted::count(bus);
    #[cfg(feature = "everything")]
    core::hint::black_box(everything::use_all(bus).is_ok());
    #[cfg(feature = "asynchronous")]
    core::hint::black_box(asynchronous::use_all(bus));
    core::hint::black_box(bus);
    debug::exit(debug::EXIT_SUCCESS);
    loop {}
}

#[panic_handler]
fn panic(_: &core::panic::PanicInfo) -> ! {
    debug::exit(debug::EXIT_FAILURE);
    loop {}
}
