//! An SPI bus on which a recorded transaction is played back.

use embedded_hal::spi::{Error, ErrorKind, ErrorType, Operation, SpiDevice};
use std::cell::RefCell;
use std::rc::Rc;

/// A bus with one device, whose answer is loaded before each transaction. Clones are the same bus.
#[derive(Debug, Clone, Default)]
pub struct ReplayBus(Rc<RefCell<Recorded>>);

#[derive(Debug, Default)]
struct Recorded {
    mosi: Vec<u8>,
    miso: Vec<u8>,
    played: bool,
}

/// A transaction that is not the recorded one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ReplayError {
    /// Nothing was loaded since the last transaction.
    NothingLoaded,
    /// Byte `at` from the host differs from the recorded one.
    OtherRequest {
        /// Position in the transaction, from 0.
        at: usize,
    },
    /// More or fewer bytes than were recorded.
    OtherLength {
        /// Bytes recorded.
        recorded: usize,
    },
}

impl Error for ReplayError {
    fn kind(&self) -> ErrorKind {
        ErrorKind::Other
    }
}

impl ReplayBus {
    /// Loads the next transaction: what the host must send, and what it gets.
    pub fn load(&self, mosi: &[u8], miso: &[u8]) {
        let mut recorded = self.0.borrow_mut();
        recorded.mosi.clear();
        recorded.mosi.extend_from_slice(mosi);
        recorded.miso.clear();
        recorded.miso.extend_from_slice(miso);
        recorded.played = false;
    }
}

impl Recorded {
    /// The answer to byte `at` of the transaction.
    fn exchange(&self, at: usize, byte: u8) -> Result<u8, ReplayError> {
        match (self.mosi.get(at), self.miso.get(at)) {
            (Some(&expected), Some(&answer)) if expected == byte => Ok(answer),
            (Some(_), Some(_)) => Err(ReplayError::OtherRequest { at }),
            _ => Err(ReplayError::OtherLength { recorded: self.mosi.len() }),
        }
    }
}

impl ErrorType for ReplayBus {
    type Error = ReplayError;
}

impl SpiDevice<u8> for ReplayBus {
    fn transaction(&mut self, operations: &mut [Operation<'_, u8>]) -> Result<(), ReplayError> {
        let mut recorded = self.0.borrow_mut();
        if recorded.played || recorded.mosi.is_empty() {
            return Err(ReplayError::NothingLoaded);
        }
        recorded.played = true;
        let mut at = 0;
        for operation in operations {
            match operation {
                Operation::Read(words) => {
                    for word in words.iter_mut() {
                        *word = recorded.exchange(at, 0)?;
                        at += 1;
                    }
                }
                Operation::Write(words) => {
                    for word in words.iter() {
                        recorded.exchange(at, *word)?;
                        at += 1;
                    }
                }
                Operation::Transfer(read, write) => {
                    // The shorter side is padded: zeros go out, surplus answers are lost (embedded-hal's rule).
                    for i in 0..read.len().max(write.len()) {
                        let answer = recorded.exchange(at, write.get(i).copied().unwrap_or(0))?;
                        if let Some(word) = read.get_mut(i) {
                            *word = answer;
                        }
                        at += 1;
                    }
                }
                Operation::TransferInPlace(words) => {
                    for word in words.iter_mut() {
                        *word = recorded.exchange(at, *word)?;
                        at += 1;
                    }
                }
                Operation::DelayNs(_) => {}
            }
        }
        if at == recorded.mosi.len() { Ok(()) } else { Err(ReplayError::OtherLength { recorded: recorded.mosi.len() }) }
    }
}
