//! Transmission: the queues to the ports, and raw messages.

use adis16405_driver::Burst;
use heapless::{Vec, spsc};
use link::{Encoder, MAX_FRAME, MAX_RAW_FRAME, MAX_TEXT, MessageRef, RawBurst, RawMessage, TextLine, wire_bytes};

/// Size of the queue: the longest message, the reserve and an enclosed text line; one slot stays empty.
const BUFFER_SLOTS: usize = MAX_FRAME + RAW_RESERVE + MAX_TEXT + 8;

/// The bytes from the application to a serial port.
pub type TransmitBuffer = spsc::Queue<u8, BUFFER_SLOTS>;

/// Room that reports leave for two raw messages, bytes.
const RAW_RESERVE: usize = 2 * MAX_RAW_FRAME;

/// Encodes messages and text for the UART, whole or not at all. Copies that USB has no room for are dropped and
/// counted.
pub struct TransmitQueue<'q> {
    encoder: Encoder,
    uart: spsc::Producer<'q, u8>,
    usb: Option<spsc::Producer<'q, u8>>,
    usb_dropped: u32,
}

impl<'q> TransmitQueue<'q> {
    /// A queue to a UART alone; its first message has the sequence number 0.
    pub fn new(uart: spsc::Producer<'q, u8>) -> Self {
        Self { encoder: Encoder::new(), uart, usb: None, usb_dropped: 0 }
    }

    /// Adds a queue for copies to USB, if there is one.
    pub fn with_usb(self, usb: Option<spsc::Producer<'q, u8>>) -> Self {
        Self { usb, ..self }
    }

    /// True if there is room for the longest message and the raw reserve.
    pub fn has_room(&self) -> bool {
        free(&self.uart) >= MAX_FRAME + RAW_RESERVE
    }

    /// Messages and text lines for which the USB port had no room.
    pub fn usb_dropped(&self) -> u32 {
        self.usb_dropped
    }

    /// Queues a message. It is dropped, and the result false, if the longest of its kind would not fit; the receiver
    /// notices the missing sequence number.
    pub fn send(&mut self, message: MessageRef<'_>) -> bool {
        let longest = match message {
            MessageRef::Log(_) | MessageRef::Raw(_) => MAX_RAW_FRAME,
            _ => MAX_FRAME,
        };
        let fits = free(&self.uart) >= longest;
        if fits {
            let mut usb = room(&mut self.usb, longest, &mut self.usb_dropped);
            let uart = &mut self.uart;
            self.encoder.encode(message, &mut |bytes| {
                put(uart, bytes);
                if let Some(usb) = &mut usb {
                    put(usb, bytes);
                }
            });
        } else {
            self.encoder.skip();
        }
        fits
    }

    /// Queues a line; false if it does not fit.
    pub fn send_text(&mut self, line: &TextLine) -> bool {
        let bytes = wire_bytes(line);
        let fits = free(&self.uart) >= bytes.len();
        if fits {
            put(&mut self.uart, &bytes);
            if let Some(usb) = room(&mut self.usb, bytes.len(), &mut self.usb_dropped) {
                put(usb, &bytes);
            }
        }
        fits
    }
}

fn free(queue: &spsc::Producer<'_, u8>) -> usize {
    queue.capacity() - queue.len()
}

fn room<'a, 'q>(
    queue: &'a mut Option<spsc::Producer<'q, u8>>,
    length: usize,
    dropped: &mut u32,
) -> Option<&'a mut spsc::Producer<'q, u8>> {
    let queue = queue.as_mut()?;
    if free(queue) >= length {
        return Some(queue);
    }
    *dropped = dropped.saturating_add(1);
    None
}

fn put(buffer: &mut spsc::Producer<'_, u8>, bytes: &[u8]) {
    for &byte in bytes {
        let _room_was_checked = buffer.enqueue(byte);
    }
}

/// The raw stream: bursts, usable or not, in raw messages.
pub(crate) struct RawStream {
    /// The message being filled; `None` while the stream is off.
    message: Option<RawMessage>,
    last: (u64, u64),
}

impl RawStream {
    pub(crate) const fn off() -> Self {
        Self { message: None, last: (0, 0) }
    }

    pub(crate) fn is_on(&self) -> bool {
        self.message.is_some()
    }

    /// Switches the stream off, or on at `sens_avg`; unsent bursts are dropped.
    pub(crate) fn set(&mut self, on: bool, sens_avg: u16) {
        // The message is built in place: a move would take 560 bytes of stack.
        self.message = None;
        if on {
            self.message = Some(RawMessage { first: 0, at_us: 0, sens_avg, bursts: Vec::new() });
        }
    }

    pub(crate) fn message(&self) -> Option<&RawMessage> {
        self.message.as_ref()
    }

    /// Adds a burst; true if the message is full.
    pub(crate) fn push(&mut self, burst: &Burst, number: u64, at_us: u64) -> bool {
        let Some(message) = self.message.as_mut() else { return false };
        if message.bursts.is_full() {
            message.bursts.clear();
        }
        let (last_number, last_us) = self.last;
        self.last = (number, at_us);
        let (periods, after_us) = if message.bursts.is_empty() {
            (message.first, message.at_us) = (number, at_us);
            (0, 0)
        } else {
            (number - last_number, at_us - last_us)
        };
        let saturated = |value: u64| u32::try_from(value).unwrap_or(u32::MAX);
        let words = burst.words.map(|word| word.0.to_be_bytes());
        let burst = RawBurst { after_us: saturated(after_us), periods: saturated(periods), words };
        let _room_was_checked = message.bursts.push(burst);
        message.bursts.is_full()
    }
}
