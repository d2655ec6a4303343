//! The far end of the serial port: keeps what the image says, and presses keys.

use rigless::chip::{Timeline, uart};
use rigless::snapshot::Store;
use rigless::time::VirtualNanos;
use std::collections::VecDeque;

#[derive(Debug, Default)]
pub(crate) struct Terminal {
    /// Every byte received, with the time its stop bit ended.
    pub(crate) received: Vec<(u64, u8)>,
    /// Keys still to be pressed, by rising time in ns.
    pub(crate) keys: VecDeque<(u64, u8)>,
}

impl Store for Terminal {}

impl uart::Peer for Terminal {
    fn receive(&mut self, word: u16, context: &mut Timeline<'_, '_>) {
        self.received.push((context.now().0, word as u8));
    }

    fn transmit(&mut self, now: VirtualNanos) -> Option<u16> {
        if self.keys.front()?.0 > now.0 {
            return None;
        }
        self.keys.pop_front().map(|(_, key)| u16::from(key))
    }
}
