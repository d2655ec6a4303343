//! The way out: messages and lines of text into the queue that the serial port empties.

use heapless::spsc;
use link::{Encoder, Line, MAX_FRAME, Message, line_bytes};

/// Bytes that may wait for the serial port, and the one slot that the queue needs: the longest message, the reserve, and a
/// line of text.
pub const OUTGOING_SLOTS: usize = 2560;

/// The queue from the application to the serial port.
pub type Outgoing = spsc::Queue<u8, OUTGOING_SLOTS>;

/// Room that a report leaves for the raw stream, in bytes: two of its messages.
const RESERVE: usize = 1024;

const _: () = assert!(OUTGOING_SLOTS > MAX_FRAME + RESERVE + link::MAX_TEXT);

/// Numbers messages, frames them, and queues them whole or not at all.
pub struct Outbox<'q> {
    encoder: Encoder,
    queue: spsc::Producer<'q, u8>,
}

impl<'q> Outbox<'q> {
    /// Starts with sequence number 0.
    pub fn new(queue: spsc::Producer<'q, u8>) -> Self {
        Self { encoder: Encoder::new(), queue }
    }

    /// Whether any message would find room, and the raw stream after it.
    #[must_use]
    pub fn has_room(&self) -> bool {
        self.room() >= MAX_FRAME + RESERVE
    }

    /// Queues a message. False if it did not fit: then it is lost, and the receiver sees a number missing.
    pub fn send(&mut self, message: &Message) -> bool {
        self.encoder.encode(message).is_some_and(|frame| self.queue_whole(&frame))
    }

    /// Queues a line of text; false if there was no room for it.
    pub fn line(&mut self, line: &Line) -> bool {
        self.queue_whole(&line_bytes(line))
    }

    fn room(&self) -> usize {
        self.queue.capacity() - self.queue.len()
    }

    fn queue_whole(&mut self, bytes: &[u8]) -> bool {
        let fits = self.room() >= bytes.len();
        if fits {
            for &byte in bytes {
                let _room_was_checked = self.queue.enqueue(byte);
            }
        }
        fits
    }
}
