//! Messages to the page while a function runs.

/// Task under way.
#[derive(Debug, Clone, Copy)]
#[repr(u32)]
pub(crate) enum Task {
    /// Bytes of the recording.
    Reading = 0,
    /// Stages of the analysis.
    Analysing = 1,
    /// Samples of the virtual sensor.
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

/// Tells how much of a task is done.
pub(crate) fn progress(task: Task, done: u64) {
    #[cfg(target_family = "wasm")]
    page::progress(task as u32, done as f64);
    #[cfg(not(target_family = "wasm"))]
    let _ = (task, done);
}

/// Tells the page why the program ends, where it does.
pub(crate) fn set_panic_hook() {
    #[cfg(target_family = "wasm")]
    std::panic::set_hook(Box::new(|panic| {
        let message = panic.to_string();
        page::panicked(message.as_ptr(), message.len());
    }));
}
