//! What can happen to the memory of a microcontroller behind its back.

use rigless::emulator::{Access, AccessKind, Host};
use rigless::machine::Board;
use rigless::session::Session;
use rigless::soc::Width;

/// RM0090 section 2.3.1: SRAM1 and SRAM2.
const RAM: std::ops::Range<u64> = 0x2000_0000..0x2002_0000;

/// All of it holds what a linear congruential generator says (Knuth's MMIX constants).
pub(crate) fn fill_with_noise(host: &mut dyn Host) {
    let mut state = 1_u64;
    for address in RAM.step_by(4) {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        host.write(address, Width::W32, state >> 32).expect("memory");
    }
}

/// Every aligned pair of words that holds `value` becomes 0; there must be one.
pub(crate) fn lose(host: &mut dyn Host, value: u64) {
    let mut found = 0;
    for address in RAM.step_by(8) {
        let word = |host: &mut dyn Host, at| host.read(at, Width::W32).expect("memory");
        if word(host, address) | word(host, address + 4) << 32 == value {
            host.write(address, Width::W32, 0).expect("memory");
            host.write(address + 4, Width::W32, 0).expect("memory");
            found += 1;
        }
    }
    assert!(found > 0, "{value} is not in memory");
}

/// Bits of a peripheral's register are cleared, as a debugger would.
pub(crate) fn clear_bits<D: Board>(session: &mut Session<D>, host: &mut dyn Host, address: u64, bits: u64) {
    let (value, _) = session.access(Access::new(AccessKind::Read, address, Width::W32, 0), host);
    session.access(Access::new(AccessKind::Write, address, Width::W32, value & !bits), host);
}
