//! The allocator, and how much memory it holds back from the system.

use mimalloc::MiMalloc;
use std::ffi::c_long;

#[global_allocator]
static ALLOCATOR: MiMalloc = MiMalloc;

/// `mi_option_arena_eager_commit` of mimalloc 2 and 3: with 0 memory is taken from the system where it is used, not by the region, of
/// which an analysis uses three quarters.
const EAGER_COMMIT: (libmimalloc_sys::mi_option_t, c_long) = (4, 0);
/// `mi_option_purge_delay` of mimalloc 2 and 3: released memory is returned to the system after so many ms.
const PURGE_DELAY: libmimalloc_sys::mi_option_t = 15;
/// An analysis takes and releases the memory of a series many times a second: 10⁶ rows of six channels take a tenth longer with 10 ms,
/// and half as much memory again with the 1,000 ms of mimalloc 3.
const PURGE_DELAY_OF_ANALYSIS_MS: c_long = 60;
/// The recording of a simulation is released block by block while it is condensed: with 60 ms an hour of it takes a quarter more memory.
const PURGE_DELAY_OF_SIMULATION_MS: c_long = 10;

/// Before the first allocation, which takes the region.
#[ctor::ctor(unsafe)]
fn set_eager_commit() {
    let (option, value) = EAGER_COMMIT;
    // SAFETY: no thread runs yet, and an option that mimalloc does not know has no effect.
    unsafe { libmimalloc_sys::mi_option_set(option, value) };
}

/// Before any other thread runs.
pub(crate) fn prepare(is_simulation: bool) {
    let delay_ms = if is_simulation { PURGE_DELAY_OF_SIMULATION_MS } else { PURGE_DELAY_OF_ANALYSIS_MS };
    // SAFETY: no other thread runs yet, and an option that mimalloc does not know has no effect.
    unsafe { libmimalloc_sys::mi_option_set(PURGE_DELAY, delay_ms) };
}
