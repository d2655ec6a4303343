//! SPI0 with two DMA channels, for the sensor.

use super::start::Rp2040;
use crate::bus_frame::{BusFault, ByteExchange, flag_in_time, wait_for};
use crate::microcontroller::sensor_spi::SpiPeripheral;
use rp2040_hal::fugit::{HertzU32, RateExtU32};
use rp2040_hal::pac::{self, DMA, RESETS, SPI0};
use rp2040_hal::spi::{self, Spi, ValidSpiPinout};

const RX: usize = 0;
const TX: usize = 1;
/// Entries of the receive buffer of SPI0.
const BUFFER: u32 = 8;
/// READ_ERROR and WRITE_ERROR, which are cleared by writing ones.
const ERRORS: u32 = 1 << 30 | 1 << 29;

/// SPI0 and the two DMA channels that serve it.
pub struct Spi0<W: ValidSpiPinout<SPI0>> {
    spi: Spi<spi::Enabled, SPI0, W, 8>,
    clock: HertzU32,
    dma: DMA,
}

impl<W: ValidSpiPinout<SPI0>> Spi0<W> {
    /// Takes SPI0, whose clock is `clock`, and starts the DMA.
    pub fn new(spi: Spi<spi::Enabled, SPI0, W, 8>, clock: HertzU32, dma: DMA, resets: &mut RESETS) -> Self {
        resets.reset().modify(|_, w| w.dma().clear_bit());
        let _in_reset_otherwise = wait_for(|| resets.reset_done().read().dma().bit_is_set());
        // SAFETY: an interrupt enable of a channel that only this bus uses.
        dma.inte0().write(|w| unsafe { w.bits(1 << RX) });
        registers().sspdmacr().write(|w| w.rxdmae().set_bit().txdmae().set_bit());
        Self { spi, clock, dma }
    }
}

fn registers() -> &'static pac::spi0::RegisterBlock {
    // SAFETY: only this module, whose bus owns the HAL's driver of SPI0, uses them.
    unsafe { &*SPI0::ptr() }
}

impl<W: ValidSpiPinout<SPI0>> SpiPeripheral for Spi0<W> {
    type Clock = Rp2040;

    fn set_clock_limit(&mut self, limit_hz: u32) -> u32 {
        self.spi.set_baudrate(self.clock, limit_hz.Hz());
        // The clock has two dividers, rounded up (data sheet, section 4.4.3.4).
        let prescale = u32::from(registers().sspcpsr().read().cpsdvsr().bits());
        let rate = u32::from(registers().sspcr0().read().scr().bits());
        self.clock.to_Hz().div_ceil(prescale.max(1) * (rate + 1))
    }

    fn reset(&mut self) {
        registers().sspcr1().modify(|_, w| w.sse().clear_bit());
        registers().sspcr1().modify(|_, w| w.sse().set_bit());
    }

    fn drain(&mut self) {
        let spi = registers();
        let _ended = wait_for(|| spi.sspsr().read().bsy().bit_is_clear());
        for _ in 0..BUFFER {
            if spi.sspsr().read().rne().bit_is_set() {
                spi.sspdr().read();
            }
        }
        spi.sspicr().write(|w| w.roric().clear_bit_by_one().rtic().clear_bit_by_one());
    }

    /// The end of the transfer raises the interrupt DMA_IRQ_0.
    fn start(&mut self, request: &'static [u8], received: &mut [u8]) {
        let data = registers().sspdr().as_ptr() as u32;
        let (request_at, received_at) = (request.as_ptr() as u32, received.as_mut_ptr() as u32);
        let channels = [(RX, self.dma.ch(RX), data, received_at), (TX, self.dma.ch(TX), request_at, data)];
        for (channel, registers, read, write) in channels {
            // SAFETY: the channels transfer as many bytes as both slices have, from and to SPI0 only, and the caller does not use
            // them before the channels have stopped.
            unsafe {
                registers.ch_read_addr().write(|w| w.bits(read));
                registers.ch_write_addr().write(|w| w.bits(write));
                registers.ch_trans_count().write(|w| w.bits(request.len() as u32));
            }
            registers.ch_ctrl_trig().write(|w| {
                w.data_size().size_byte().incr_read().bit(channel == TX).incr_write().bit(channel == RX);
                // The errors are cleared by writing ones (data sheet, section 2.5.7).
                w.read_error().clear_bit_by_one().write_error().clear_bit_by_one();
                // SAFETY: a channel that is chained to itself triggers no other.
                unsafe { w.chain_to().bits(channel as u8) };
                if channel == RX { w.treq_sel().spi0_rx() } else { w.treq_sel().spi0_tx() }.en().set_bit()
            });
        }
    }

    fn stop(&mut self) -> bool {
        // SAFETY: clears the request of a channel that only this bus uses.
        self.dma.ints0().write(|w| unsafe { w.bits(1 << RX) });
        let channels = [self.dma.ch(RX), self.dma.ch(TX)];
        let complete = channels.iter().all(|registers| {
            let control = registers.ch_ctrl_trig().read();
            control.read_error().bit_is_clear()
                && control.write_error().bit_is_clear()
                && control.busy().bit_is_clear()
                && registers.ch_trans_count().read().bits() == 0
        });
        if !complete {
            // SAFETY: aborts the two channels that only this bus uses.
            self.dma.chan_abort().write(|w| unsafe { w.bits(1 << RX | 1 << TX) });
            let _aborted = wait_for(|| self.dma.chan_abort().read().bits() == 0);
            for registers in channels {
                // SAFETY: disables the channel and clears its errors; nothing is triggered through this alias.
                registers.ch_al1_ctrl().write(|w| unsafe { w.bits(ERRORS) });
            }
            // An abort may also complete the transfer (erratum RP2040-E13).
            // SAFETY: as above.
            self.dma.ints0().write(|w| unsafe { w.bits(1 << RX) });
        }
        complete
    }
}

impl<W: ValidSpiPinout<SPI0>> ByteExchange for Spi0<W> {
    fn exchange(&mut self, byte: u8) -> Result<u8, BusFault> {
        let spi = registers();
        flag_in_time(|| spi.sspsr().read().tnf().bit_is_set())?;
        // SAFETY: the register takes any 16 bits.
        spi.sspdr().write(|w| unsafe { w.data().bits(u16::from(byte)) });
        flag_in_time(|| spi.sspsr().read().rne().bit_is_set())?;
        let received = spi.sspdr().read().data().bits() as u8;
        if spi.sspris().read().rorris().bit_is_set() { Err(BusFault::Overrun) } else { Ok(received) }
    }

    fn finish(&mut self) -> Result<(), BusFault> {
        flag_in_time(|| registers().sspsr().read().bsy().bit_is_clear())
    }
}
