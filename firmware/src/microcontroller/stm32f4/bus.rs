//! The sensor's bus: registers byte by byte, bursts by DMA so that the processor is free meanwhile.

use super::Stm32f4;
use crate::microcontroller::{Bus, transfer};
use crate::spi_clock;
use adis16405_driver::{BURST_BYTES, BURST_REQUEST};
use core::convert::Infallible;
use core::sync::atomic::{Ordering, compiler_fence};
use embedded_hal::digital::OutputPin;
use embedded_hal::spi::{ErrorType, Operation, SpiDevice};
use stm32f4xx_hal::pac::{self, DMA2, SPI1};
use stm32f4xx_hal::rcc::{Enable, Rcc};
use stm32f4xx_hal::spi::{self, Spi};

/// Streams and channel of SPI1 (RM0090 table 43).
const RX: usize = 0;
const TX: usize = 3;
const CHANNEL: u8 = 3;

/// SPI1, its chip select and its two streams.
pub struct SensorBus<S> {
    spi: Spi<SPI1>,
    select: S,
    dma: DMA2,
    answer: &'static mut [u8; BURST_BYTES],
}

impl<S> SensorBus<S> {
    /// A bus whose chip select is high.
    pub fn new(spi: Spi<SPI1>, select: S, dma: DMA2, rcc: &mut Rcc) -> Self {
        DMA2::enable(rcc);
        let answer = cortex_m::singleton!(: [u8; BURST_BYTES] = [0; BURST_BYTES]).expect("the bus is made once");
        Self { spi, select, dma, answer }
    }

    /// The serial clock that the prescaler in CR1 makes of the bus clock.
    pub fn clock_hz(&self, bus_hz: u32) -> u32 {
        spi_clock::of_prescaler(bus_hz, registers().cr1().read().br().bits())
    }

    fn clear_flags(&mut self) {
        self.dma.lifcr().write(|w| {
            w.ctcif0().set_bit().chtif0().set_bit().cteif0().set_bit().cdmeif0().set_bit().cfeif0().set_bit();
            w.ctcif3().set_bit().chtif3().set_bit().cteif3().set_bit().cdmeif3().set_bit().cfeif3().set_bit()
        });
    }
}

impl<S: OutputPin<Error = Infallible>> Bus for SensorBus<S> {
    /// Its end raises DMA2_STREAM0.
    fn start_burst(&mut self) {
        let data = registers().dr().as_ptr() as u32;
        self.clear_flags();
        let Ok(()) = self.select.set_low();
        let (rx, tx) = (self.dma.st(RX), self.dma.st(TX));
        // SAFETY: the streams move as many bytes as both arrays have, from and to this peripheral alone, and `answer` is
        // not looked at before they have stopped.
        unsafe {
            rx.par().write(|w| w.pa().bits(data));
            rx.m0ar().write(|w| w.m0a().bits(self.answer.as_mut_ptr() as u32));
            tx.par().write(|w| w.pa().bits(data));
            tx.m0ar().write(|w| w.m0a().bits(BURST_REQUEST.as_ptr() as u32));
        }
        rx.ndtr().write(|w| w.ndt().set(BURST_BYTES as u16));
        tx.ndtr().write(|w| w.ndt().set(BURST_BYTES as u16));
        compiler_fence(Ordering::SeqCst);
        rx.cr().write(|w| {
            w.chsel()
                .set(CHANNEL)
                .dir()
                .peripheral_to_memory()
                .minc()
                .set_bit()
                .tcie()
                .set_bit()
                .teie()
                .set_bit()
                .en()
                .set_bit()
        });
        tx.cr().write(|w| w.chsel().set(CHANNEL).dir().memory_to_peripheral().minc().set_bit().en().set_bit());
        registers().cr2().modify(|_, w| w.rxdmaen().set_bit().txdmaen().set_bit());
    }

    fn end_burst(&mut self) -> Option<&[u8; BURST_BYTES]> {
        let flags = self.dma.lisr().read();
        let whole = flags.tcif0().bit_is_set() && flags.teif0().bit_is_clear() && flags.teif3().bit_is_clear();
        registers().cr2().modify(|_, w| w.rxdmaen().clear_bit().txdmaen().clear_bit());
        for stream in [RX, TX] {
            self.dma.st(stream).cr().modify(|_, w| w.en().clear_bit());
            while self.dma.st(stream).cr().read().en().bit_is_set() {}
        }
        self.clear_flags();
        let Ok(()) = self.select.set_high();
        compiler_fence(Ordering::SeqCst);
        whole.then_some(&*self.answer)
    }
}

/// The registers of SPI1, for what its HAL does not do.
fn registers() -> &'static pac::spi1::RegisterBlock {
    // SAFETY: `SensorBus` owns the HAL's driver of SPI1, and only it calls this.
    unsafe { &*SPI1::ptr() }
}

impl<S> ErrorType for SensorBus<S> {
    type Error = spi::Error;
}

impl<S: OutputPin<Error = Infallible>> SpiDevice<u8> for SensorBus<S> {
    fn transaction(&mut self, operations: &mut [Operation<'_, u8>]) -> Result<(), spi::Error> {
        let Ok(()) = self.select.set_low();
        let done = transfer::<Stm32f4, _>(&mut self.spi, operations);
        let Ok(()) = self.select.set_high();
        done
    }
}
