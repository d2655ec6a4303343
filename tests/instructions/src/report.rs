//! One line of output for each count.

use crate::timer::instructions;
use core::hint::black_box;
use cortex_m_semihosting::hprintln;

/// Prints how many instructions each of `times` runs of `work` took on average.
pub(crate) fn report(name: &str, times: u32, work: impl FnOnce()) {
    let tenths = instructions(work) / u64::from(black_box(times) / 10);
    hprintln!("count {} {}.{}", name, tenths / 10, tenths % 10);
}
