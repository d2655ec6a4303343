//! A bus that always gives the same answer, but not one that the compiler can predict.

use core::convert::Infallible;
use core::hint::black_box;
use embedded_hal::delay::DelayNs;
use embedded_hal::spi::{ErrorType, Operation, SpiDevice};

/// A bus that answers 0x8814 to every word: new data, no error and, as a supply, 5 V.
#[derive(Clone, Copy)]
pub(crate) struct Bus {
    answer: [u8; 2],
}

impl Bus {
    pub(crate) fn new() -> Self {
        Self { answer: black_box([0x88, 0x14]) }
    }
}

impl ErrorType for Bus {
    type Error = Infallible;
}

impl SpiDevice for Bus {
    #[inline(never)]
    fn transaction(&mut self, operations: &mut [Operation<'_, u8>]) -> Result<(), Infallible> {
        for operation in operations {
            if let Operation::Transfer(read, write) = operation {
                black_box(&*write);
                for (at, byte) in read.iter_mut().enumerate() {
                    *byte = self.answer[at % 2];
                }
            }
        }
        Ok(())
    }
}

impl embedded_hal_async::spi::SpiDevice for Bus {
    async fn transaction(&mut self, operations: &mut [Operation<'_, u8>]) -> Result<(), Infallible> {
        SpiDevice::transaction(self, operations)
    }
}

impl DelayNs for Bus {
    fn delay_ns(&mut self, ns: u32) {
        black_box(ns);
    }
}

impl embedded_hal_async::delay::DelayNs for Bus {
    async fn delay_ns(&mut self, ns: u32) {
        black_box(ns);
    }
}
