//! Transmission to the host: the queues that the serial ports empty, and the packing of bursts into raw messages.

use adis16405_driver::Burst;
use heapless::{Vec, spsc};
use link::{Encoder, MAX_FRAME, MAX_RAW_FRAME, MAX_TEXT, MessageRef, RawBurst, RawMessage, TextLine, wire_bytes};

/// Slots of the transmit buffer, one of which stays empty: the longest message, the reserve, and a text line with its
/// enclosing bytes.
const BUFFER_SLOTS: usize = MAX_FRAME + RAW_RESERVE + MAX_TEXT + 8;

/// The bytes from the application to a serial port.
pub type TransmitBuffer = spsc::Queue<u8, BUFFER_SLOTS>;

/// Room in bytes that reports leave for the raw stream: two raw messages.
const RAW_RESERVE: usize = 2 * MAX_RAW_FRAME;

/// Encodes messages and text lines for the UART, each completely or not at all, and copies them to the USB port of a board that
/// has one.
///
/// The UART, which is always emptied at its baud rate, decides what is sent. A message for which the USB port has no room is
/// dropped there alone, and counted: a host that does not read costs what it does not read.
pub struct TransmitQueue<'q> {
    encoder: Encoder,
    uart: spsc::Producer<'q, u8>,
    usb: Option<spsc::Producer<'q, u8>>,
    usb_dropped: u32,
}

impl<'q> TransmitQueue<'q> {
    /// A queue to a UART alone, whose first message has the sequence number 0.
    pub fn new(uart: spsc::Producer<'q, u8>) -> Self {
        Self { encoder: Encoder::new(), uart, usb: None, usb_dropped: 0 }
    }

    /// Copies everything to a USB port too, if there is one.
    #[must_use]
    pub fn with_usb(self, usb: Option<spsc::Producer<'q, u8>>) -> Self {
        Self { usb, ..self }
    }

    /// Whether there is room for the longest message and, after it, for the raw stream's reserve.
    #[must_use]
    pub fn has_room(&self) -> bool {
        free(&self.uart) >= MAX_FRAME + RAW_RESERVE
    }

    /// Messages and text lines that the USB port had no room for.
    #[must_use]
    pub fn usb_dropped(&self) -> u32 {
        self.usb_dropped
    }

    /// Queues a message. Returns false, and drops it, if the longest message of its kind would not fit; the receiver counts
    /// it as missing by its sequence number.
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

    /// Queues a text line. Returns false if it does not fit.
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

/// The queue if it has room for `length` bytes; counts what is dropped otherwise.
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

/// Packs bursts, usable or not, into raw messages while the raw stream is on.
pub(crate) struct RawStream {
    /// The message that is being filled; `None` while the stream is off.
    message: Option<RawMessage>,
    /// Sample number and time of the burst before.
    last: (u64, u64),
}

impl RawStream {
    /// A stream that is off.
    pub(crate) const fn off() -> Self {
        Self { message: None, last: (0, 0) }
    }

    pub(crate) fn is_on(&self) -> bool {
        self.message.is_some()
    }

    /// Turns the stream off, or on with bursts read at `sens_avg`. Bursts that were not sent yet are dropped.
    pub(crate) fn set(&mut self, on: bool, sens_avg: u16) {
        // In place: a moved message would take its 560 bytes of stack once more.
        self.message = None;
        if on {
            self.message = Some(RawMessage { first: 0, at_us: 0, sens_avg, bursts: Vec::new() });
        }
    }

    /// The message that is being filled, or has just been filled.
    pub(crate) fn message(&self) -> Option<&RawMessage> {
        self.message.as_ref()
    }

    /// Adds the burst of sample `number`. Returns true if that fills the message; the next burst begins a new one.
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
