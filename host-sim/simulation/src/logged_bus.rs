//! The emulated bus with a frame log of every transaction.

use crate::fault_injector::FaultyBus;
use embedded_hal::spi::{Error, ErrorKind, ErrorType, Operation, SpiDevice};
use recordings::frame_log::{Frame, FrameLogWriter};
use std::cell::RefCell;
use std::io;
use std::rc::Rc;

/// The emulated bus; every transaction is written to a frame log.
#[derive(Debug)]
pub(crate) struct LoggedBus {
    bus: FaultyBus,
    log: Rc<RefCell<FrameLogWriter>>,
    failure: Rc<RefCell<Option<io::Error>>>,
    frame: Frame,
}

/// The log could not be written; [`LoggedBus::failure`] has the error of the operating system.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct LoggedBusError;

impl Error for LoggedBusError {
    fn kind(&self) -> ErrorKind {
        ErrorKind::Other
    }
}

impl LoggedBus {
    /// Logs the transactions of `bus` to `log`.
    pub(crate) fn new(bus: FaultyBus, log: Rc<RefCell<FrameLogWriter>>) -> Self {
        Self { bus, log, failure: Rc::default(), frame: Frame::default() }
    }

    /// The latest error of writing the log. It is shared, so that it can be read after a driver has taken the bus.
    pub(crate) fn failure(&self) -> Rc<RefCell<Option<io::Error>>> {
        Rc::clone(&self.failure)
    }
}

impl ErrorType for LoggedBus {
    type Error = LoggedBusError;
}

impl SpiDevice<u8> for LoggedBus {
    fn transaction(&mut self, operations: &mut [Operation<'_, u8>]) -> Result<(), LoggedBusError> {
        let frame = &mut self.frame;
        frame.time_s = seconds(self.bus.bus().part().now());
        frame.mosi.clear();
        frame.miso.clear();
        // MOSI is copied before the transaction, which overwrites it in place.
        for operation in operations.iter() {
            match operation {
                Operation::Read(words) => frame.mosi.resize(frame.mosi.len() + words.len(), 0),
                Operation::Write(words) => frame.mosi.extend_from_slice(words),
                Operation::Transfer(read, write) => {
                    let end = frame.mosi.len() + read.len().max(write.len());
                    frame.mosi.extend_from_slice(write);
                    frame.mosi.resize(end, 0);
                }
                Operation::TransferInPlace(words) => frame.mosi.extend_from_slice(words),
                Operation::DelayNs(_) => {}
            }
        }
        let Ok(()) = self.bus.transaction(operations);
        for operation in operations.iter() {
            match operation {
                Operation::Read(words) => frame.miso.extend_from_slice(words),
                // A write discards the answer, and the log has zeros for it.
                Operation::Write(words) => frame.miso.resize(frame.miso.len() + words.len(), 0),
                Operation::Transfer(read, write) => {
                    let end = frame.miso.len() + read.len().max(write.len());
                    frame.miso.extend_from_slice(read);
                    frame.miso.resize(end, 0);
                }
                Operation::TransferInPlace(words) => frame.miso.extend_from_slice(words),
                Operation::DelayNs(_) => {}
            }
        }
        self.log.borrow_mut().write(frame).map_err(|reason| {
            *self.failure.borrow_mut() = Some(reason);
            LoggedBusError
        })
    }
}

/// Virtual time in s.
pub(crate) fn seconds(ns: u64) -> f64 {
    ns as f64 / 1e9
}
