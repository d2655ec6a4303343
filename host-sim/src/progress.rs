//! How far an analysis is, on standard error where that is a terminal; and its interruption.

use crate::output::progress_bar;
use anyhow::{Context, Result};
use indicatif::ProgressBar;
use recordings::ReadMonitor;
use std::fs;
use std::path::Path;
use std::process;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::thread::{self, JoinHandle};
use std::time::Duration;

/// Time between two looks at the reader.
const INTERVAL: Duration = Duration::from_millis(100);
const READING: &str = "reading {wide_bar} {bytes}/{total_bytes} {eta}";
const READING_PIPE: &str = "reading {spinner} {bytes} {elapsed}";
const FITTING: &str = "fitting {wide_bar} {pos}/{len} channels {elapsed}";
const ANALYSING: &str = "analysing {spinner} {elapsed}";
/// Exit status of a program that an interrupt has ended, as shells have it.
const INTERRUPTED: i32 = 130;

/// The bar of one recording: first bytes that were read, then parts of the analysis that are done.
pub(crate) struct Progress {
    monitor: ReadMonitor,
    is_over: Arc<AtomicBool>,
    watcher: Option<JoinHandle<()>>,
}

impl Progress {
    /// Begins to show how far the reading of `file` is. An interrupt then ends the reading, and a second one, or one at any other
    /// time, the program.
    pub(crate) fn reading(file: &Path) -> Result<Self> {
        let monitor = ReadMonitor::default();
        let of_handler = monitor.clone();
        let mut is_first = true;
        ctrlc::set_handler(move || {
            if is_first && of_handler.is_reading() {
                is_first = false;
                of_handler.stop();
            } else {
                process::exit(INTERRUPTED);
            }
        })
        .context("the interrupt of the terminal")?;
        let length = fs::metadata(file).ok().filter(fs::Metadata::is_file).map(|file| file.len());
        let bar = match length {
            Some(length) => progress_bar(length, READING),
            None => progress_bar(0, READING_PIPE),
        };
        let is_over = Arc::new(AtomicBool::new(false));
        let (of_watcher, is_ended) = (monitor.clone(), Arc::clone(&is_over));
        let watcher = thread::spawn(move || {
            while !is_ended.load(Relaxed) {
                if of_watcher.is_reading() {
                    bar.set_position(of_watcher.bytes());
                }
                bar.tick();
                thread::park_timeout(INTERVAL);
            }
            bar.finish_and_clear();
        });
        Ok(Self { monitor, is_over, watcher: Some(watcher) })
    }

    /// What the readers tell how far they are.
    pub(crate) fn monitor(&self) -> &ReadMonitor {
        &self.monitor
    }

    /// Ends the bar of the reading; whether that was interrupted.
    pub(crate) fn end_reading(&mut self) -> bool {
        self.is_over.store(true, Relaxed);
        if let Some(watcher) = self.watcher.take() {
            watcher.thread().unpark();
            // The bar is no reason to fail.
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

/// The bar of an analysis of which `channels` channels are fitted one after the other; of one that does not tell how far it is, where
/// that is `None`.
pub(crate) fn analysing(channels: Option<usize>) -> ProgressBar {
    let bar = match channels {
        Some(channels) => progress_bar(channels as u64, FITTING),
        None => progress_bar(0, ANALYSING),
    };
    bar.enable_steady_tick(INTERVAL);
    bar
}
