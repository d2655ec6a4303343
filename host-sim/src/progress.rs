//! Progress of an analysis on standard error if that is a terminal, and its interruption.

use crate::interrupt;
use crate::output::progress_bar;
use indicatif::ProgressBar;
use noise_analysis::analysis::Stage;
use recordings::{ReadMonitor, ReadPass};
use std::fs;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::thread::{self, JoinHandle};
use std::time::Duration;

/// Time between two updates of the bar.
const INTERVAL: Duration = Duration::from_millis(100);
const READING: &str = "{msg} {wide_bar} {bytes}/{total_bytes} {eta}";
const READING_PIPE: &str = "{msg} {spinner} {bytes} {elapsed}";
const FITTING: &str = "fitting {wide_bar} {pos}/{len} channels {elapsed}";
const ANALYSING: &str = "analysing {wide_bar} {pos}/{len} {msg} {elapsed}";

/// The bar of one recording: first the bytes read, then the finished parts of the analysis.
pub(crate) struct Progress {
    monitor: ReadMonitor,
    is_over: Arc<AtomicBool>,
    watcher: Option<JoinHandle<()>>,
}

impl Progress {
    /// Starts the bar for the reading of `file`. An interrupt ends the reading. A second interrupt, or one at any other time, ends the
    /// program.
    pub(crate) fn reading(file: &Path) -> Self {
        let monitor = ReadMonitor::default();
        let of_handler = monitor.clone();
        let mut is_first = true;
        interrupt::on_signal(move || {
            let is_taken_up = is_first && of_handler.is_reading();
            if is_taken_up {
                is_first = false;
                of_handler.stop();
            }
            is_taken_up
        });
        let length = fs::metadata(file).ok().filter(fs::Metadata::is_file).map(|file| file.len());
        let bar = match length {
            Some(length) => progress_bar(length, READING),
            None => progress_bar(0, READING_PIPE),
        };
        let is_over = Arc::new(AtomicBool::new(false));
        let (of_watcher, is_ended) = (monitor.clone(), Arc::clone(&is_over));
        let watcher = thread::spawn(move || {
            let mut pass = None;
            while !is_ended.load(Relaxed) {
                if pass.replace(of_watcher.pass()) != Some(of_watcher.pass()) {
                    bar.set_message(purpose(of_watcher.pass()));
                    bar.reset_eta();
                }
                if of_watcher.is_reading() {
                    bar.set_position(of_watcher.bytes());
                }
                bar.tick();
                thread::park_timeout(INTERVAL);
            }
            bar.finish_and_clear();
        });
        Self { monitor, is_over, watcher: Some(watcher) }
    }

    /// The monitor for the readers.
    pub(crate) fn monitor(&self) -> &ReadMonitor {
        &self.monitor
    }

    /// Ends the bar of the reading; returns true if the reading was interrupted.
    pub(crate) fn end_reading(&mut self) -> bool {
        self.is_over.store(true, Relaxed);
        if let Some(watcher) = self.watcher.take() {
            watcher.thread().unpark();
            // A failure of the bar is not an error.
            let _ended = watcher.join();
        }
        self.monitor.is_interrupted()
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        self.end_reading();
    }
}

/// Purpose of a pass over a recording, shown beside the bar.
fn purpose(pass: ReadPass) -> &'static str {
    match pass {
        ReadPass::FirstRows => "reading",
        ReadPass::Survey => "reading, 1 of 2: rate and length",
        ReadPass::Samples => "reading, 2 of 2: samples",
    }
}

/// The bar, with a thread that draws it if it is visible.
fn ticking(bar: ProgressBar) -> ProgressBar {
    if !bar.is_hidden() {
        bar.enable_steady_tick(INTERVAL);
    }
    bar
}

/// The bar of the fits of `channels` channels, one after the other.
pub(crate) fn fitting(channels: usize) -> ProgressBar {
    ticking(progress_bar(channels as u64, FITTING))
}

/// Runs `analyze` with a bar of its stages.
pub(crate) fn analysing<R>(analyze: impl FnOnce(&dyn Fn(Stage)) -> R) -> R {
    let bar = ticking(progress_bar(Stage::COUNT as u64, ANALYSING));
    let result = analyze(&|stage| {
        bar.set_position(stage as u64);
        bar.set_message(stage.to_string());
    });
    bar.finish_and_clear();
    result
}
