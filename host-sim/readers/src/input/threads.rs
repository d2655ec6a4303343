//! Whether readers may begin threads: not in a browser, and not where the caller works on one alone.

use std::cell::Cell;

thread_local! {
    static IS_ALONE: Cell<bool> = const { Cell::new(false) };
}

/// Runs `task`; all that it reads, it reads on the thread of the caller.
pub fn read_on_one_thread<R>(task: impl FnOnce() -> R) -> R {
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

/// True if a reader may begin a thread.
#[must_use]
pub fn may_begin_threads() -> bool {
    !cfg!(target_family = "wasm") && !IS_ALONE.get()
}
