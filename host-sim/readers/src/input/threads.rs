//! Permission for threads: not in a browser.

use std::cell::Cell;

thread_local! {
    static IS_ALONE: Cell<bool> = const { Cell::new(false) };
}

/// Reads on the caller's thread.
pub fn read_on_one_thread<R>(task: impl FnOnce() -> R) -> R {
    struct Restore(bool);
    impl Drop for Restore {
        fn drop(&mut self) {
            IS_ALONE.set(self.0);
        }
    }
    let _restore = Restore(IS_ALONE.replace(true));
    task()
}

#[must_use]
pub fn may_begin_threads() -> bool {
    !cfg!(target_family = "wasm") && !IS_ALONE.get()
}
