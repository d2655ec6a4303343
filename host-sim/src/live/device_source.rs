//! A device on a serial port as the live view.

use super::LiveSource;
use anyhow::Result;
use observatory::latest_messages::LatestMessages;
use recordings::serial::SerialLink;
use reports::live::LiveView;
use std::io::{Read, Write};
use std::time::Instant;

/// A device and the latest of each of its messages.
pub(crate) struct DeviceSource<'a, P> {
    cable: &'a mut SerialLink<P>,
    messages: LatestMessages,
    /// When something was received last.
    received: Instant,
}

impl<'a, P: Read + Write> DeviceSource<'a, P> {
    /// The device at the other end of `cable`, which is called `name`.
    pub(crate) fn new(cable: &'a mut SerialLink<P>, name: String) -> Self {
        Self { cable, messages: LatestMessages::new(name), received: Instant::now() }
    }
}

impl<P: Read + Write> LiveSource for DeviceSource<'_, P> {
    fn advance(&mut self, deadline: Instant) -> Result<bool> {
        while let Some(received) = self.cable.next(Some(deadline))? {
            self.messages.take(received);
            self.received = Instant::now();
        }
        Ok(!self.cable.is_disconnected())
    }

    fn view(&self) -> LiveView {
        self.messages.view(self.received.elapsed(), &self.cable.counters())
    }
}
