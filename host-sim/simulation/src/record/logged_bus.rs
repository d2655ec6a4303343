//! A layer over the emulated bus that writes every transaction to a frame log.

use super::seconds;
use embedded_hal::spi::{Error, ErrorKind, ErrorType, Operation, SpiDevice};
use recordings::frame_log::{Frame, FrameLog};
use std::cell::RefCell;
use std::io;
use std::rc::Rc;
use virtual_sensor::EmulatedBus;

/// The emulated bus, logged.
#[derive(Debug)]
pub struct LoggedBus {
    bus: EmulatedBus,
    log: Rc<RefCell<FrameLog>>,
    failure: Rc<RefCell<Option<io::Error>>>,
    frame: Frame,
}

/// The log could not be written; [`LoggedBus::failure`] has the operating system's answer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct LoggedBusError;

impl Error for LoggedBusError {
    fn kind(&self) -> ErrorKind {
        ErrorKind::Other
    }
}

impl LoggedBus {
    /// Logs what crosses `bus` to `log`.
    pub fn new(bus: EmulatedBus, log: Rc<RefCell<FrameLog>>) -> Self {
        Self { bus, log, failure: Rc::default(), frame: Frame::default() }
    }

    /// Where the reason of a failed write is left.
    pub fn failure(&self) -> Rc<RefCell<Option<io::Error>>> {
        Rc::clone(&self.failure)
    }
}

impl ErrorType for LoggedBus {
    type Error = LoggedBusError;
}

impl SpiDevice<u8> for LoggedBus {
    fn transaction(&mut self, operations: &mut [Operation<'_, u8>]) -> Result<(), LoggedBusError> {
        let frame = &mut self.frame;
        frame.time_s = seconds(self.bus.part().now());
        frame.mosi.clear();
        frame.miso.clear();
        // What goes out must be noted before the answer overwrites it.
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
                // The answer to bytes that are only written is not kept by anyone: the log shows zeros.
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
