//! Reception from the host: the queues that the serial ports fill.

use heapless::spsc;

/// The bytes from a serial port to the application.
pub type ReceiveBuffer = spsc::Queue<u8, 256>;

/// Marks lost bytes in the queue (ASCII cancel), so that their line is not a command.
pub(crate) const LOST: u8 = 0x18;

/// A serial port's end of the queue of received bytes.
pub struct Receiver<'q> {
    queue: spsc::Producer<'q, u8>,
    /// True if bytes were lost and the queue had no room for the mark.
    has_lost: bool,
}

impl<'q> Receiver<'q> {
    /// A receiver that fills a queue.
    pub const fn new(queue: spsc::Producer<'q, u8>) -> Self {
        Self { queue, has_lost: false }
    }

    /// Queues a byte, or for `None` marks a lost one; returns how many bytes were lost.
    pub fn push(&mut self, byte: Option<u8>) -> u32 {
        self.has_lost |= byte.is_none();
        if self.has_lost && self.queue.enqueue(LOST).is_ok() {
            self.has_lost = false;
        }
        let is_queued = byte.is_some_and(|byte| !self.has_lost && self.queue.enqueue(byte).is_ok());
        self.has_lost |= byte.is_some() && !is_queued;
        u32::from(!is_queued)
    }
}

/// A serial port to the host, served in its interrupt.
pub trait ServedPort {
    /// Moves as many bytes as possible at `now_us`, µs; returns how many received ones were lost.
    fn serve(&mut self, now_us: u32) -> u32;
}

/// A serial port to the host.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum HostPort {
    /// The port on pins of the board.
    Uart,
    /// The port on the USB connector.
    Usb,
}

impl HostPort {
    /// Number of ports.
    pub const COUNT: usize = 2;
}

/// The application's ends of the queues.
pub struct ReceivedBytes<'q> {
    /// Bytes from the UART.
    pub uart: spsc::Consumer<'q, u8>,
    /// Bytes from the USB port of a board that has one.
    pub usb: Option<spsc::Consumer<'q, u8>>,
}

impl ReceivedBytes<'_> {
    #[cfg_attr(not(target_os = "none"), allow(dead_code, reason = "a board on a host has its own queue"))]
    pub(crate) fn next(&mut self) -> Option<(HostPort, u8)> {
        let usb = || self.usb.as_mut().and_then(|queue| queue.dequeue()).map(|byte| (HostPort::Usb, byte));
        self.uart.dequeue().map(|byte| (HostPort::Uart, byte)).or_else(usb)
    }
}

#[cfg(test)]
mod tests {
    extern crate std;

    use super::*;
    use crate::command::{Command, CommandParser};
    use std::vec::Vec;

    /// With lost bytes, `e 3600` would become `e 36` or `e 36boot`.
    #[test]
    fn a_line_that_has_lost_bytes_is_no_command() {
        for lost in [1, 2, 4] {
            let mut buffer = spsc::Queue::<u8, 8>::new();
            let (queue, mut received) = buffer.split();
            let (mut receiver, mut parser) = (Receiver::new(queue), CommandParser::default());
            let typed = &b"i 9\re 3600\r"[..7 + lost];
            let not_queued: u32 = typed.iter().map(|&byte| receiver.push(Some(byte))).sum();
            assert_eq!(not_queued as usize, lost);
            let mut parse = |received: &mut spsc::Consumer<'_, u8>| -> Vec<_> {
                core::iter::from_fn(|| received.dequeue()).filter_map(|byte| parser.push(byte)).collect()
            };
            let mut commands = parse(&mut received);
            b"\ri 8\r".iter().for_each(|&byte| assert_eq!(receiver.push(Some(byte)), 0));
            commands.extend(parse(&mut received));
            let commands: Vec<Command> = commands.into_iter().filter_map(Result::ok).collect();
            assert_eq!(commands, [Command::Interval(9), Command::Interval(8)], "{lost} bytes lost");
        }
    }
}
