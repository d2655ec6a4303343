//! allan-core for C: a static library and the header `include/allan_core.h`, which cbindgen makes from these files.
//!
//! Every function checks its pointers (not null, aligned, initialised by the library) and its numbers, and returns an
//! [`allan_status`](status::allan_status). The memory is the caller's, and so is the duty to use an object from one thread
//! of execution at a time. No function panics on any argument; if one did, the host's library would return
//! `ALLAN_ERROR_INTERNAL`, and that of a microcontroller would stop.
#![cfg_attr(target_os = "none", no_std)]
#![allow(non_camel_case_types)] // the names are those of C
#![allow(unreachable_pub)] // called from C
#![deny(clippy::undocumented_unsafe_blocks)]

/// The estimator with 20 octaves and 4-fold overlap: made by `build.rs` of the larger one.
mod cascade_20_4 {
    include!(concat!(env!("OUT_DIR"), "/cascade_20_4.rs"));
}
mod cascade_24_8;
mod curve;
mod estimator;
mod model;
mod quantizer;
mod status;
mod storage;
mod trace;

#[cfg(target_os = "none")]
#[panic_handler]
fn panic(_: &core::panic::PanicInfo) -> ! {
    loop {
        core::hint::spin_loop();
    }
}
