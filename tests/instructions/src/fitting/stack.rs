//! Stack that a piece of work takes: painted before, looked at afterwards.

use cortex_m::register::msp;

const PAINT: u32 = 0xCCCC_CCCC;
/// As far down as anything reaches, and far above the data at the other end of the board's 4 MB.
const REACH: u32 = 256 * 1024;
/// What painting itself may need.
const MARGIN: u32 = 256;

/// Bytes of stack that `work` takes beyond its caller's, interrupts included.
#[inline(never)]
pub(crate) fn deepest(work: impl FnOnce()) -> u32 {
    let top = msp::read();
    let words = || (top - REACH..top - MARGIN).step_by(4);
    // SAFETY: below the stack pointer lies RAM that nobody uses.
    words().for_each(|address| unsafe { (address as *mut u32).write_volatile(PAINT) });
    run(work);
    // SAFETY: as above.
    let touched = words().find(|&address| unsafe { (address as *const u32).read_volatile() } != PAINT);
    touched.map_or(MARGIN, |address| top - address)
}

#[inline(never)]
fn run(work: impl FnOnce()) {
    work();
}
