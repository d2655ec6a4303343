//! The sensor's bus: registers byte by byte, bursts by DMA so that the processor is free meanwhile.

use super::Rp2040;
use crate::microcontroller::{Bus, transfer};
use adis16405_driver::{BURST_BYTES, BURST_REQUEST};
use core::convert::Infallible;
use core::sync::atomic::{Ordering, compiler_fence};
use embedded_hal::digital::OutputPin;
use embedded_hal::spi::{ErrorType, Operation, SpiDevice};
use rp2040_hal::pac::{self, DMA, RESETS, SPI0};
use rp2040_hal::spi::{Enabled, Spi, ValidSpiPinout};

/// DMA channels.
const RX: usize = 0;
const TX: usize = 1;

/// SPI0, its chip select and two DMA channels.
pub struct SensorBus<W: ValidSpiPinout<SPI0>, S> {
    spi: Spi<Enabled, SPI0, W, 8>,
    select: S,
    dma: DMA,
    answer: &'static mut [u8; BURST_BYTES],
}

impl<W: ValidSpiPinout<SPI0>, S> SensorBus<W, S> {
    /// A bus whose chip select is high.
    pub fn new(spi: Spi<Enabled, SPI0, W, 8>, select: S, dma: DMA, resets: &mut RESETS) -> Self {
        resets.reset().modify(|_, w| w.dma().clear_bit());
        while resets.reset_done().read().dma().bit_is_clear() {}
        // SAFETY: an interrupt enable of a channel that only this bus uses.
        dma.inte0().write(|w| unsafe { w.bits(1 << RX) });
        registers().sspdmacr().write(|w| w.rxdmae().set_bit().txdmae().set_bit());
        let answer = cortex_m::singleton!(: [u8; BURST_BYTES] = [0; BURST_BYTES]).expect("the bus is made once");
        Self { spi, select, dma, answer }
    }

    /// The serial clock that the two dividers make of the peripheral clock, rounded up (data sheet, section 4.4.3.4).
    pub fn clock_hz(&self, peripheral_hz: u32) -> u32 {
        let prescale = u32::from(registers().sspcpsr().read().cpsdvsr().bits());
        let rate = u32::from(registers().sspcr0().read().scr().bits());
        peripheral_hz.div_ceil(prescale.max(1) * (rate + 1))
    }
}

impl<W: ValidSpiPinout<SPI0>, S: OutputPin<Error = Infallible>> Bus for SensorBus<W, S> {
    /// Its end raises DMA_IRQ_0.
    fn start_burst(&mut self) {
        let Ok(()) = self.select.set_low();
        let data = registers().sspdr().as_ptr() as u32;
        compiler_fence(Ordering::SeqCst);
        for (channel, from, to) in
            [(RX, data, self.answer.as_mut_ptr() as u32), (TX, BURST_REQUEST.as_ptr() as u32, data)]
        {
            let registers = self.dma.ch(channel);
            // SAFETY: the channels move as many bytes as both arrays have, from and to SPI0 alone, and `answer` is not
            // looked at before they have stopped.
            unsafe {
                registers.ch_read_addr().write(|w| w.bits(from));
                registers.ch_write_addr().write(|w| w.bits(to));
                registers.ch_trans_count().write(|w| w.bits(BURST_BYTES as u32));
            }
            registers.ch_ctrl_trig().write(|w| {
                w.data_size().size_byte().incr_read().bit(channel == TX).incr_write().bit(channel == RX);
                // SAFETY: a channel chained to itself is chained to none.
                unsafe { w.chain_to().bits(channel as u8) };
                if channel == RX { w.treq_sel().spi0_rx() } else { w.treq_sel().spi0_tx() }.en().set_bit()
            });
        }
    }

    fn end_burst(&mut self) -> Option<&[u8; BURST_BYTES]> {
        // SAFETY: clears the request of a channel that only this bus uses.
        self.dma.ints0().write(|w| unsafe { w.bits(1 << RX) });
        let failed = [RX, TX].map(|channel| self.dma.ch(channel).ch_ctrl_trig().read().ahb_error().bit_is_set());
        let Ok(()) = self.select.set_high();
        compiler_fence(Ordering::SeqCst);
        (failed == [false; 2]).then_some(&*self.answer)
    }
}

/// The registers of SPI0, for what its HAL does not do.
fn registers() -> &'static pac::spi0::RegisterBlock {
    // SAFETY: `SensorBus` owns the HAL's driver of SPI0, and only it calls this.
    unsafe { &*SPI0::ptr() }
}

impl<W: ValidSpiPinout<SPI0>, S> ErrorType for SensorBus<W, S> {
    type Error = Infallible;
}

impl<W: ValidSpiPinout<SPI0>, S: OutputPin<Error = Infallible>> SpiDevice<u8> for SensorBus<W, S> {
    fn transaction(&mut self, operations: &mut [Operation<'_, u8>]) -> Result<(), Infallible> {
        self.select.set_low()?;
        transfer::<Rp2040, _>(&mut self.spi, operations)?;
        self.select.set_high()
    }
}
