//! What survives a reset, and what is left for the next start.

use crate::{LastWords, Retained, retained};
use core::panic::PanicInfo;
use cortex_m_rt::ExceptionFrame;
use link::{Boot, BootCause};

#[unsafe(link_section = ".uninit.retained")]
static RETAINED: retained::Memory = retained::blank();

#[unsafe(link_section = ".uninit.last_words")]
static LAST_WORDS: LastWords = LastWords::blank();

/// What is known of the start, with the last words, and what survived it; nothing when the supply came on.
pub fn recall(cause: BootCause) -> (Boot, Retained) {
    let mut retained = Retained::open(&RETAINED);
    if cause == BootCause::PowerOn {
        retained.clear();
    }
    (Boot { cause, last_words: LAST_WORDS.take(), ..Boot::default() }, retained)
}

/// Leaves the place of a panic.
pub fn panicked(info: &PanicInfo<'_>) {
    let (file, line) = info.location().map_or(("?", 0), |at| (at.file(), at.line()));
    LAST_WORDS.leave(format_args!("panic at {file}:{line}"));
    defmt::error!("panic at {=str}:{=u32}", file, line);
}

/// Leaves the place of a fault; there is no frame if the stack has overflowed.
pub fn faulted(frame: Option<&ExceptionFrame>) {
    match frame {
        Some(frame) => {
            LAST_WORDS.leave(format_args!("hard fault at {:#010x}, called from {:#010x}", frame.pc(), frame.lr()));
        }
        None => LAST_WORDS.leave(format_args!("stack overflow")),
    }
}
