//! The virtual part behind an embedded-hal SPI device, on virtual time.

use std::cell::{Ref, RefCell, RefMut};
use std::convert::Infallible;
use std::rc::Rc;

use embedded_hal::delay::DelayNs;
use embedded_hal::digital::OutputPin;
use embedded_hal::spi::{ErrorType, Operation, SpiDevice};

use crate::part::VirtualAdis16405;

/// The highest SCK that a burst read allows, Hz.
const DEFAULT_SCK_HZ: u32 = 1_000_000;

/// An SPI bus with the virtual part on it. Clones are handles on the same part.
///
/// A byte takes eight SCK periods of virtual time, a delay its duration; nothing else takes time.
#[derive(Clone, Debug)]
pub struct EmulatedBus {
    part: Rc<RefCell<VirtualAdis16405>>,
}

impl EmulatedBus {
    /// Puts the part on a bus with an SCK of 1 MHz.
    pub fn new(part: VirtualAdis16405) -> Self {
        Self::with_sck_hz(part, DEFAULT_SCK_HZ)
    }

    /// Puts the part on a bus with the given SCK in Hz (at least 1).
    pub fn with_sck_hz(mut part: VirtualAdis16405, sck_hz: u32) -> Self {
        part.set_sck_hz(Some(sck_hz));
        Self { part: Rc::new(RefCell::new(part)) }
    }

    /// The part. The borrow must end before the bus is used again, or that use panics.
    pub fn part(&self) -> Ref<'_, VirtualAdis16405> {
        self.part.borrow()
    }

    /// The part, to inject faults or to drive pins. The borrow must end before the bus is used again, or that use
    /// panics.
    pub fn part_mut(&self) -> RefMut<'_, VirtualAdis16405> {
        self.part.borrow_mut()
    }

    /// A delay in the part's virtual time.
    pub fn delay(&self) -> VirtualDelay {
        VirtualDelay { part: Rc::clone(&self.part) }
    }

    /// The reset line of the part, RST, active low.
    pub fn reset_line(&self) -> VirtualResetLine {
        VirtualResetLine { part: Rc::clone(&self.part) }
    }

    /// Advances time to the next data-ready pulse and returns that time, ns; `None` if no pulse will come.
    pub fn wait_for_data(&self) -> Option<u64> {
        let mut part = self.part.borrow_mut();
        let at_ns = part.next_data_ready();
        if at_ns == u64::MAX {
            return None;
        }
        part.advance_to(at_ns);
        Some(at_ns)
    }

    /// Advances virtual time to `ns`.
    pub fn advance_to(&self, ns: u64) {
        self.part.borrow_mut().advance_to(ns);
    }
}

impl ErrorType for EmulatedBus {
    type Error = Infallible;
}

impl SpiDevice<u8> for EmulatedBus {
    fn transaction(&mut self, operations: &mut [Operation<'_, u8>]) -> Result<(), Infallible> {
        let mut part = self.part.borrow_mut();
        part.select();
        for operation in operations {
            match operation {
                Operation::Read(read) => read.fill_with(|| part.transfer_byte(0)),
                Operation::Write(write) => {
                    for byte in write.iter() {
                        part.transfer_byte(*byte);
                    }
                }
                Operation::Transfer(read, write) => {
                    for index in 0..read.len().max(write.len()) {
                        let answer = part.transfer_byte(write.get(index).copied().unwrap_or(0));
                        if let Some(byte) = read.get_mut(index) {
                            *byte = answer;
                        }
                    }
                }
                Operation::TransferInPlace(bytes) => {
                    for byte in bytes.iter_mut() {
                        *byte = part.transfer_byte(*byte);
                    }
                }
                Operation::DelayNs(ns) => {
                    let until = part.now() + u64::from(*ns);
                    part.advance_to(until);
                }
            }
        }
        part.deselect();
        Ok(())
    }
}

/// Every future is ready at once, since a transaction advances virtual time itself.
impl embedded_hal_async::spi::SpiDevice<u8> for EmulatedBus {
    async fn transaction(&mut self, operations: &mut [Operation<'_, u8>]) -> Result<(), Infallible> {
        SpiDevice::transaction(self, operations)
    }
}

/// A delay that advances virtual time.
#[derive(Clone, Debug)]
pub struct VirtualDelay {
    part: Rc<RefCell<VirtualAdis16405>>,
}

impl DelayNs for VirtualDelay {
    fn delay_ns(&mut self, ns: u32) {
        let mut part = self.part.borrow_mut();
        let until = part.now() + u64::from(ns);
        part.advance_to(until);
    }
}

impl embedded_hal_async::delay::DelayNs for VirtualDelay {
    async fn delay_ns(&mut self, ns: u32) {
        DelayNs::delay_ns(self, ns);
    }
}

/// The reset line of the virtual part, active low ([`VirtualAdis16405::drive_reset`]).
#[derive(Clone, Debug)]
pub struct VirtualResetLine {
    part: Rc<RefCell<VirtualAdis16405>>,
}

impl embedded_hal::digital::ErrorType for VirtualResetLine {
    type Error = Infallible;
}

impl OutputPin for VirtualResetLine {
    fn set_low(&mut self) -> Result<(), Infallible> {
        self.part.borrow_mut().drive_reset(false);
        Ok(())
    }

    fn set_high(&mut self) -> Result<(), Infallible> {
        self.part.borrow_mut().drive_reset(true);
        Ok(())
    }
}
