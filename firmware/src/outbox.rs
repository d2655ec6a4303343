//! The way out: messages and lines of text into the queue that the serial port empties.

use heapless::spsc;
use link::{Encoder, Line, MAX_FRAME, MAX_RAW_FRAME, MessageRef, line_bytes};

/// Bytes that may wait for the serial port, and the one slot that the queue needs: the longest message, the reserve, and a
/// line of text.
pub const OUTGOING_SLOTS: usize = MAX_FRAME + RESERVE + link::MAX_TEXT + 8;

/// The queue from the application to the serial port.
pub type Outgoing = spsc::Queue<u8, OUTGOING_SLOTS>;

/// Room that a report leaves for the raw stream, in bytes: two of its messages.
const RESERVE: usize = 2 * MAX_RAW_FRAME;

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

    /// Queues a message. False if the longest of its kind would not fit: then it is lost, and the
    /// receiver sees a number missing.
    pub fn send(&mut self, message: MessageRef<'_>) -> bool {
        let longest = match message {
            MessageRef::Log(_) | MessageRef::Raw(_) => MAX_RAW_FRAME,
            _ => MAX_FRAME,
        };
        let fits = self.room() >= longest;
        if fits {
            let queue = &mut self.queue;
            self.encoder.encode(message, &mut |bytes| put(queue, bytes));
        } else {
            self.encoder.skip();
        }
        fits
    }

    /// Queues a line of text; false if there was no room for it.
    pub fn line(&mut self, line: &Line) -> bool {
        let bytes = line_bytes(line);
        let fits = self.room() >= bytes.len();
        if fits {
            put(&mut self.queue, &bytes);
        }
        fits
    }

    fn room(&self) -> usize {
        self.queue.capacity() - self.queue.len()
    }
}

fn put(queue: &mut spsc::Producer<'_, u8>, bytes: &[u8]) {
    for &byte in bytes {
        let _room_was_checked = queue.enqueue(byte);
    }
}
