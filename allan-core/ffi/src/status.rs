//! Status codes and their texts.

use core::ffi::{CStr, c_char};

/// What a function returns: 0, or why it did nothing.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(C)]
pub enum allan_status {
    /** Done. */
    ALLAN_OK = 0,
    /** A pointer is null. */
    ALLAN_ERROR_NULL = 1,
    /** A pointer is not aligned to ALLAN_ALIGNMENT bytes, or as its type needs it. */
    ALLAN_ERROR_ALIGNMENT = 2,
    /** A buffer is smaller than it must be. */
    ALLAN_ERROR_SIZE = 3,
    /** An object was not initialised, or was overwritten. */
    ALLAN_ERROR_UNINITIALISED = 4,
    /** Two arguments are the same object. */
    ALLAN_ERROR_SAME_OBJECT = 5,
    /** A number is outside its range. */
    ALLAN_ERROR_RANGE = 6,
    /** There is no such kind of term, it is given twice, or there are too many terms. */
    ALLAN_ERROR_KIND = 7,
    /** An index is beyond the last. */
    ALLAN_ERROR_INDEX = 8,
    /** A saved state is damaged, or that of another type or version. */
    ALLAN_ERROR_STATE = 9,
    /** The callback ended the search; the result holds what was found. */
    ALLAN_CANCELLED = 10,
    /** A fault of the library. */
    ALLAN_ERROR_INTERNAL = 11,
}

use allan_status::*;

/// What a status means, in English. Never null; the text is constant.
#[unsafe(no_mangle)]
pub extern "C" fn allan_status_text(status: i32) -> *const c_char {
    const TEXTS: [(allan_status, &CStr); 12] = [
        (ALLAN_OK, c"done"),
        (ALLAN_ERROR_NULL, c"a pointer is null"),
        (ALLAN_ERROR_ALIGNMENT, c"a pointer is not aligned as its type needs it"),
        (ALLAN_ERROR_SIZE, c"a buffer is too small"),
        (ALLAN_ERROR_UNINITIALISED, c"the object was not initialised, or was overwritten"),
        (ALLAN_ERROR_SAME_OBJECT, c"two arguments are the same object"),
        (ALLAN_ERROR_RANGE, c"a number is outside its range"),
        (ALLAN_ERROR_KIND, c"no such kind of term, a kind given twice, or too many terms"),
        (ALLAN_ERROR_INDEX, c"an index is beyond the last"),
        (ALLAN_ERROR_STATE, c"the saved state is damaged or of another type or version"),
        (ALLAN_CANCELLED, c"the callback ended the search"),
        (ALLAN_ERROR_INTERNAL, c"a fault of the library"),
    ];
    let known = TEXTS.iter().find(|&&(known, _)| known as i32 == status);
    known.map_or(c"no status of this library", |&(_, text)| text).as_ptr()
}

/// The status of `work`.
pub(crate) fn status(work: impl FnOnce() -> Result<(), allan_status>) -> allan_status {
    contained(|| work().err().unwrap_or(ALLAN_OK), ALLAN_ERROR_INTERNAL)
}

/// The result of `work`, or `failed` if it panics: no panic may unwind into C.
#[cfg(not(target_os = "none"))]
pub(crate) fn contained<T>(work: impl FnOnce() -> T, failed: T) -> T {
    // Objects are plain numbers: every state of them is valid, that of an interrupted function too.
    std::panic::catch_unwind(std::panic::AssertUnwindSafe(work)).unwrap_or(failed)
}

/// The result of `work`. On a microcontroller a panic does not unwind.
#[cfg(target_os = "none")]
pub(crate) fn contained<T>(work: impl FnOnce() -> T, _: T) -> T {
    work()
}
