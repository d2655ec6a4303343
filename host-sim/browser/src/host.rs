//! Messages to the page during a function.

/// The task that runs.
#[derive(Debug, Clone, Copy)]
#[repr(u32)]
pub(crate) enum Task {
    /// Reading; progress is in bytes of the recording.
    Reading = 0,
    /// Analysing; progress is in stages of the analysis.
    Analysing = 1,
    /// Simulating; progress is in samples of the virtual sensor.
    Simulating = 2,
}

#[cfg(target_family = "wasm")]
mod page {
    #[link(wasm_import_module = "page")]
    unsafe extern "C" {
        pub(super) safe fn progress(task: u32, done: f64);
        pub(super) safe fn panicked(message: *const u8, length: usize);
    }
}

/// Reports how much of a task is done.
pub(crate) fn progress(task: Task, done: u64) {
    #[cfg(target_family = "wasm")]
    page::progress(task as u32, done as f64);
    #[cfg(not(target_family = "wasm"))]
    let _ = (task, done);
}

/// Sends the message of a panic to the page.
pub(crate) fn set_panic_hook() {
    #[cfg(target_family = "wasm")]
    std::panic::set_hook(Box::new(|panic| {
        let message = panic.to_string();
        page::panicked(message.as_ptr(), message.len());
    }));
}
