//! The allocator, and the time for which it keeps released memory.

use mimalloc::MiMalloc;
use std::ffi::c_long;

#[global_allocator]
static ALLOCATOR: MiMalloc = MiMalloc;

/// `mi_option_arena_eager_commit` of mimalloc 2 and 3. With 0, memory is committed where it is used instead of by the region, of which an
/// analysis uses three quarters.
const EAGER_COMMIT: (libmimalloc_sys::mi_option_t, c_long) = (4, 0);
/// `mi_option_purge_delay` of mimalloc 2 and 3: time after which released memory is returned to the system, ms.
const PURGE_DELAY: libmimalloc_sys::mi_option_t = 15;
/// Delay for an analysis, which allocates and releases the memory of a series many times a second. For 10⁶ rows of six channels, 10 ms take
/// a tenth more time, and the 1,000 ms of mimalloc 3 half as much memory again.
const PURGE_DELAY_OF_ANALYSIS_MS: c_long = 60;
/// Delay for a simulation, whose recording is released block by block while it is condensed: with 60 ms an hour takes a quarter more
/// memory.
const PURGE_DELAY_OF_SIMULATION_MS: c_long = 10;

/// Sets the option before the first allocation, which takes the region.
#[ctor::ctor(unsafe)]
fn set_eager_commit() {
    let (option, value) = EAGER_COMMIT;
    // SAFETY: no thread runs yet, and an option that mimalloc does not know has no effect.
    unsafe { libmimalloc_sys::mi_option_set(option, value) };
}

/// Sets the delay. To be called before any other thread runs.
pub(crate) fn prepare(is_simulation: bool) {
    let delay_ms = if is_simulation { PURGE_DELAY_OF_SIMULATION_MS } else { PURGE_DELAY_OF_ANALYSIS_MS };
    // SAFETY: no other thread runs yet, and an option that mimalloc does not know has no effect.
    unsafe { libmimalloc_sys::mi_option_set(PURGE_DELAY, delay_ms) };
}
