//! Progress of a reading, and the request to end it.

use std::fmt;
use std::io::{self, Read, Seek, SeekFrom};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU8, AtomicU64, Ordering::Relaxed};

/// Purpose of a reading.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ReadPass {
    /// Tells the clock; all of a recording in memory.
    FirstRows,
    /// Rate, length and counts of a streamed recording.
    Survey,
    /// Samples of a streamed recording.
    Samples,
}

/// Shared between reader and watchers.
#[derive(Debug, Clone, Default)]
pub struct ReadMonitor(Arc<State>);

type Question = dyn Fn() -> bool + Send + Sync;

#[derive(Default)]
struct State {
    question: Option<Box<Question>>,
    bytes: AtomicU64,
    pass: AtomicU8,
    is_reading: AtomicBool,
    stop: AtomicBool,
    is_interrupted: AtomicBool,
    is_cut: AtomicBool,
    watch: Option<fn(u64)>,
}

impl fmt::Debug for State {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("State").field("bytes", &self.bytes).field("pass", &self.pass).finish_non_exhaustive()
    }
}

impl ReadMonitor {
    /// On the reading thread, as [`bytes`](Self::bytes) grow.
    #[must_use]
    pub fn watched(watch: fn(u64)) -> Self {
        Self(Arc::new(State { watch: Some(watch), ..State::default() }))
    }

    /// With each batch, on its thread; true [stops](Self::stop).
    #[must_use]
    pub fn asking(question: impl Fn() -> bool + Send + Sync + 'static) -> Self {
        Self(Arc::new(State { question: Some(Box::new(question)), ..State::default() }))
    }

    /// Asks whether the reading shall end.
    pub fn ask(&self) {
        if self.0.question.as_ref().is_some_and(|question| question()) {
            self.stop();
        }
    }

    /// Since the last opening; compressed ones if compressed.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        self.0.bytes.load(Relaxed)
    }

    #[must_use]
    pub fn pass(&self) -> ReadPass {
        let passes = [ReadPass::FirstRows, ReadPass::Survey, ReadPass::Samples];
        let pass = self.0.pass.load(Relaxed);
        passes.into_iter().find(|of| *of as u8 == pass).unwrap_or(ReadPass::FirstRows)
    }

    pub fn begin_pass(&self, pass: ReadPass) {
        self.0.pass.store(pass as u8, Relaxed);
    }

    /// True if a stoppable file is being read.
    #[must_use]
    pub fn is_reading(&self) -> bool {
        self.0.is_reading.load(Relaxed)
    }

    /// As if the file ended behind this row.
    pub fn stop(&self) {
        self.0.stop.store(true, Relaxed);
    }

    /// By [`stop`](Self::stop).
    #[must_use]
    pub fn is_interrupted(&self) -> bool {
        self.0.is_interrupted.load(Relaxed)
    }

    pub(crate) fn begin(&self) {
        self.0.bytes.store(0, Relaxed);
        self.0.is_reading.store(true, Relaxed);
    }

    pub(crate) fn end(&self) {
        self.0.is_reading.store(false, Relaxed);
    }

    pub(crate) fn take_stop(&self) -> bool {
        let is_stopped = self.0.stop.load(Relaxed) && self.0.stop.swap(false, Relaxed);
        if is_stopped {
            self.0.is_interrupted.store(true, Relaxed);
        }
        is_stopped
    }

    /// A stopped pipe: may end within a line or compressed data.
    pub(crate) fn cut(&self) {
        self.0.is_cut.store(true, Relaxed);
    }

    pub(crate) fn is_cut(&self) -> bool {
        self.0.is_cut.load(Relaxed)
    }

    pub(crate) fn count(&self, bytes: usize) {
        let before = self.0.bytes.fetch_add(bytes as u64, Relaxed);
        if let Some(watch) = self.0.watch {
            watch(before + bytes as u64);
        }
    }
}

pub(crate) struct Counted<R> {
    input: R,
    monitor: ReadMonitor,
}

impl<R> Counted<R> {
    pub(crate) fn new(input: R, monitor: &ReadMonitor) -> Self {
        Self { input, monitor: monitor.clone() }
    }
}

impl<R: Seek> Seek for Counted<R> {
    fn seek(&mut self, position: SeekFrom) -> io::Result<u64> {
        self.input.seek(position)
    }
}

impl<R: Read> Read for Counted<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let count = self.input.read(buffer)?;
        self.monitor.count(count);
        Ok(count)
    }
}
