//! From the data-ready edge to the queue: what runs in the two interrupts of a burst.

use adis16405_driver::{BURST_BYTES, Burst};
use heapless::spsc;

/// Bursts that may wait for the estimators, and the one slot that the queue needs: 38 ms at 819.2 samples a second.
pub const QUEUE_SLOTS: usize = 32;

/// The queue from sampling to the estimators.
pub type Arrivals = spsc::Queue<Arrival, QUEUE_SLOTS>;

/// One data-ready edge.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Arrival {
    /// Time of the edge in microseconds since the start.
    pub at_us: u64,
    /// Edges before this one whose bursts found the queue full.
    pub dropped: u32,
    /// The burst, or `None` if the bus refused.
    pub burst: Option<Burst>,
}

/// Starts a burst at each data-ready edge and queues what it brought. It never waits.
pub struct Sampler<'q> {
    queue: spsc::Producer<'q, Arrival>,
    running: bool,
    /// Time of the edge whose burst is on the bus.
    reading: Option<u64>,
    dropped: u32,
}

impl<'q> Sampler<'q> {
    /// A sampler that ignores edges until it is told to [`run`](Self::run).
    pub fn new(queue: spsc::Producer<'q, Arrival>) -> Self {
        Self { queue, running: false, reading: None, dropped: 0 }
    }

    /// Starts or stops taking notice of edges. A burst that is on the bus goes on.
    pub fn run(&mut self, on: bool) {
        self.running = on;
    }

    /// Whether a burst is on the bus.
    #[must_use]
    pub fn is_reading(&self) -> bool {
        self.reading.is_some()
    }

    /// To be called at every data-ready edge: whether a burst is to be started now.
    ///
    /// An edge during a burst starts none; its sample shows as lost by the time to the next.
    #[must_use]
    pub fn edge(&mut self, at_us: u64) -> bool {
        let start = self.running && self.reading.is_none();
        if start {
            self.reading = Some(at_us);
        }
        start
    }

    /// To be called when the burst has ended, with what came in, or `None` if the bus failed.
    pub fn burst(&mut self, answer: Option<&[u8; BURST_BYTES]>) {
        let Some(at_us) = self.reading.take() else { return };
        let arrival = Arrival { at_us, dropped: self.dropped, burst: answer.map(Burst::from_bytes) };
        match self.queue.enqueue(arrival) {
            Ok(()) => self.dropped = 0,
            Err(_full) => self.dropped = self.dropped.saturating_add(1),
        }
    }
}
