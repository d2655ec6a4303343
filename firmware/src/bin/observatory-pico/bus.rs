//! The sensor's bus: registers byte by byte, bursts by DMA so that the processor is free meanwhile.

use crate::chip::Microcontroller;
use adis16405_driver::{BURST_BYTES, BURST_REQUEST};
use core::convert::Infallible;
use core::sync::atomic::{Ordering, compiler_fence};
use embedded_hal::digital::OutputPin;
use embedded_hal::spi::{ErrorType, Operation, SpiBus, SpiDevice};
use rp2040_hal::gpio::bank0::{Gpio16, Gpio17, Gpio18, Gpio19};
use rp2040_hal::gpio::{FunctionSio, FunctionSpi, Pin, PullDown, SioOutput};
use rp2040_hal::pac::{self, DMA, RESETS, SPI0};
use rp2040_hal::spi::{Enabled, Spi};

/// DMA channels.
const RX: usize = 0;
const TX: usize = 1;

type Wire<I> = Pin<I, FunctionSpi, PullDown>;
type Wires = (Wire<Gpio19>, Wire<Gpio16>, Wire<Gpio18>);

/// SPI0, its chip select and two DMA channels.
pub struct Bus {
    spi: Spi<Enabled, SPI0, Wires, 8>,
    select: Pin<Gpio17, FunctionSio<SioOutput>, PullDown>,
    dma: DMA,
    answer: &'static mut [u8; BURST_BYTES],
}

impl Bus {
    pub(crate) fn new(
        spi: Spi<Enabled, SPI0, Wires, 8>,
        select: Pin<Gpio17, FunctionSio<SioOutput>, PullDown>,
        dma: DMA,
        resets: &mut RESETS,
    ) -> Self {
        resets.reset().modify(|_, w| w.dma().clear_bit());
        while resets.reset_done().read().dma().bit_is_clear() {}
        // SAFETY: an interrupt enable of a channel that only `Bus` uses.
        dma.inte0().write(|w| unsafe { w.bits(1 << RX) });
        registers().sspdmacr().write(|w| w.rxdmae().set_bit().txdmae().set_bit());
        let answer = cortex_m::singleton!(: [u8; BURST_BYTES] = [0; BURST_BYTES]).expect("the bus is made once");
        Self { spi, select, dma, answer }
    }

    /// The serial clock that the two dividers make of the peripheral clock, rounded up (data sheet, section 4.4.3.4).
    pub(crate) fn clock_hz(&self, peripheral_hz: u32) -> u32 {
        let prescale = u32::from(registers().sspcpsr().read().cpsdvsr().bits());
        let rate = u32::from(registers().sspcr0().read().scr().bits());
        peripheral_hz.div_ceil(prescale.max(1) * (rate + 1))
    }

    /// Selects the sensor and lets a burst run; its end raises DMA_IRQ_0.
    pub(crate) fn start_burst(&mut self) {
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

    /// Ends the burst: what came in, or `None` if the transfer failed.
    pub(crate) fn end_burst(&mut self) -> Option<&[u8; BURST_BYTES]> {
        // SAFETY: clears the request of a channel that only `Bus` uses.
        self.dma.ints0().write(|w| unsafe { w.bits(1 << RX) });
        let failed = [RX, TX].map(|channel| self.dma.ch(channel).ch_ctrl_trig().read().ahb_error().bit_is_set());
        let Ok(()) = self.select.set_high();
        compiler_fence(Ordering::SeqCst);
        (failed == [false; 2]).then_some(&*self.answer)
    }
}

/// The registers of SPI0, for what its HAL does not do.
fn registers() -> &'static pac::spi0::RegisterBlock {
    // SAFETY: `Bus` owns the HAL's driver of SPI0, and only `Bus` calls this.
    unsafe { &*SPI0::ptr() }
}

impl ErrorType for Bus {
    type Error = Infallible;
}

impl SpiDevice<u8> for Bus {
    fn transaction(&mut self, operations: &mut [Operation<'_, u8>]) -> Result<(), Infallible> {
        self.select.set_low()?;
        for operation in operations {
            match operation {
                Operation::Read(words) => self.spi.read(words)?,
                Operation::Write(words) => self.spi.write(words)?,
                Operation::Transfer(read, write) => self.spi.transfer(read, write)?,
                Operation::TransferInPlace(words) => self.spi.transfer_in_place(words)?,
                Operation::DelayNs(ns) => {
                    self.spi.flush()?;
                    Microcontroller::wait_us(ns.div_ceil(1000));
                }
            }
        }
        self.spi.flush()?;
        self.select.set_high()
    }
}
