//! How a run ends: the emulator's exit status tells.

use cortex_m_semihosting::debug::{self, ExitStatus};
use cortex_m_semihosting::hprintln;

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
