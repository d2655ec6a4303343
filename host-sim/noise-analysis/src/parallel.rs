//! How many threads an analysis may use: as many as there are cores, or one where the recordings themselves are analysed side by
//! side. The result does not depend on it.

use std::cell::Cell;
use std::num::NonZero;

thread_local! {
    static IS_ALONE: Cell<bool> = const { Cell::new(false) };
}

/// Runs `task`, and all that it analyses, on the thread of the caller alone.
pub fn on_one_thread<R>(task: impl FnOnce() -> R) -> R {
    /// Takes the restriction away again, also where the task panics.
    struct Restore(bool);
    impl Drop for Restore {
        fn drop(&mut self) {
            IS_ALONE.set(self.0);
        }
    }
    let _restore = Restore(IS_ALONE.replace(true));
    task()
}

/// Threads that the analysis may use on this thread.
#[must_use]
pub fn threads() -> usize {
    if IS_ALONE.get() { 1 } else { std::thread::available_parallelism().map_or(1, NonZero::get) }
}
