//! How far the reading of a file is, and the request to end it before the end of the file.

use std::fmt;
use std::io::{self, Read, Seek, SeekFrom};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU8, AtomicU64, Ordering::Relaxed};

/// Purpose of a reading.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ReadPass {
    /// The first rows, which tell the clock of the time stamps: all of a recording that is held in memory.
    FirstRows,
    /// The first reading of a recording that is read in blocks: its rate, its length, and the size of its counts.
    Survey,
    /// The second reading of such a recording: its samples.
    Samples,
}

/// Shared by the reader of a file and by those who watch it. All clones are one monitor.
#[derive(Debug, Clone, Default)]
pub struct ReadMonitor(Arc<State>);

/// Says whether the reading shall end.
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
    /// Calls `watch` with [`bytes`](Self::bytes) whenever it grows, on the thread that reads.
    #[must_use]
    pub fn watched(watch: fn(u64)) -> Self {
        Self(Arc::new(State { watch: Some(watch), ..State::default() }))
    }

    /// Asks `question` with each batch of rows, on the thread that takes them; the reading [stops](Self::stop) where it says so.
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

    /// Bytes that were read from the file since it was opened last; compressed ones, where the file is compressed.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        self.0.bytes.load(Relaxed)
    }

    /// Purpose of the reading of the file.
    #[must_use]
    pub fn pass(&self) -> ReadPass {
        let passes = [ReadPass::FirstRows, ReadPass::Survey, ReadPass::Samples];
        let pass = self.0.pass.load(Relaxed);
        passes.into_iter().find(|of| *of as u8 == pass).unwrap_or(ReadPass::FirstRows)
    }

    /// Begins a reading.
    pub fn begin_pass(&self, pass: ReadPass) {
        self.0.pass.store(pass as u8, Relaxed);
    }

    /// True if a file is being read that can be stopped.
    #[must_use]
    pub fn is_reading(&self) -> bool {
        self.0.is_reading.load(Relaxed)
    }

    /// Ends the reading after the row that is read now, as if the file ended there.
    pub fn stop(&self) {
        self.0.stop.store(true, Relaxed);
    }

    /// True if the reading was ended by [`stop`](Self::stop).
    #[must_use]
    pub fn is_interrupted(&self) -> bool {
        self.0.is_interrupted.load(Relaxed)
    }

    /// Begins a file.
    pub(crate) fn begin(&self) {
        self.0.bytes.store(0, Relaxed);
        self.0.is_reading.store(true, Relaxed);
    }

    /// Ends a file.
    pub(crate) fn end(&self) {
        self.0.is_reading.store(false, Relaxed);
    }

    /// True if the reading has to end here. The request is served by this: the next file is read to its end.
    pub(crate) fn take_stop(&self) -> bool {
        let is_stopped = self.0.stop.load(Relaxed) && self.0.stop.swap(false, Relaxed);
        if is_stopped {
            self.0.is_interrupted.store(true, Relaxed);
        }
        is_stopped
    }

    /// Notes that the file is a copy of a pipe whose reading was stopped: it may end within a line or within compressed data.
    pub(crate) fn cut(&self) {
        self.0.is_cut.store(true, Relaxed);
    }

    pub(crate) fn is_cut(&self) -> bool {
        self.0.is_cut.load(Relaxed)
    }

    /// Counts bytes that were read.
    pub(crate) fn count(&self, bytes: usize) {
        let before = self.0.bytes.fetch_add(bytes as u64, Relaxed);
        if let Some(watch) = self.0.watch {
            watch(before + bytes as u64);
        }
    }
}

/// Counts what is read through it.
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
