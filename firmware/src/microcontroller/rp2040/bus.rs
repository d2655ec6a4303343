//! The sensor's bus: SPI0 with two DMA channels.

use super::start::Rp2040;
use crate::board::{BusTiming, FrameTimes, SensorBus};
use crate::bus_frame::{BusFault, ByteExchange, ChipSelect, transfer, wait_for, wait_ns};
use crate::microcontroller::{BurstBus, BurstEnd};
use adis16405_driver::{BURST_BYTES, BURST_REQUEST};
use core::convert::Infallible;
use core::sync::atomic::{Ordering, compiler_fence};
use embedded_hal::digital::OutputPin;
use embedded_hal::spi::{ErrorType, Operation, SpiDevice};
use rp2040_hal::fugit::{HertzU32, RateExtU32};
use rp2040_hal::pac::{self, DMA, RESETS, SPI0};
use rp2040_hal::spi::{self, Spi, ValidSpiPinout};

/// DMA channels.
const RX: usize = 0;
const TX: usize = 1;
/// Entries of the receive buffer of SPI0.
const BUFFER: u32 = 8;

/// The bytes that request a burst, for DMA.
static REQUEST: [u8; BURST_BYTES] = BURST_REQUEST;

/// The sensor on SPI0, with its chip select and two DMA channels: registers byte by byte, bursts by DMA.
pub struct Spi0Bus<W: ValidSpiPinout<SPI0>, S> {
    spi: Spi<spi::Enabled, SPI0, W, 8>,
    peripheral: HertzU32,
    select: ChipSelect<S>,
    dma: DMA,
    received: &'static mut [u8; BURST_BYTES],
    /// Bytes of the burst that have been transferred, or are being transferred.
    started: usize,
}

impl<W: ValidSpiPinout<SPI0>, S: OutputPin<Error = Infallible>> Spi0Bus<W, S> {
    /// A bus with the chip select `select`, which must be high; `peripheral` is the clock of SPI0.
    pub fn new(
        (spi, peripheral): (Spi<spi::Enabled, SPI0, W, 8>, HertzU32),
        select: S,
        dma: DMA,
        resets: &mut RESETS,
        timing: BusTiming,
    ) -> Self {
        resets.reset().modify(|_, w| w.dma().clear_bit());
        let _in_reset_otherwise = wait_for(|| resets.reset_done().read().dma().bit_is_set());
        // SAFETY: an interrupt enable of a channel that only this bus uses.
        dma.inte0().write(|w| unsafe { w.bits(1 << RX) });
        registers().sspdmacr().write(|w| w.rxdmae().set_bit().txdmae().set_bit());
        let received = cortex_m::singleton!(: [u8; BURST_BYTES] = [0; BURST_BYTES]).expect("the bus is created once");
        Self { spi, peripheral, select: ChipSelect::new(select, timing), dma, received, started: 0 }
    }

    /// Transfers the next bytes of the burst: all of them, or one word if there is to be a gap between words.
    fn start_bytes(&mut self) {
        let count = if self.select.timing.word_gap_ns == 0 { BURST_BYTES } else { 2 };
        let from = self.started.min(BURST_BYTES - count);
        self.started += count;
        let data = registers().sspdr().as_ptr() as u32;
        let received = self.received.as_mut_ptr().wrapping_add(from) as u32;
        let request = REQUEST.as_ptr().wrapping_add(from) as u32;
        compiler_fence(Ordering::SeqCst);
        let channels = [(RX, self.dma.ch(RX), data, received), (TX, self.dma.ch(TX), request, data)];
        for (channel, registers, read, write) in channels {
            // SAFETY: the channels transfer `count` bytes, which both arrays have from `from` on, from and to SPI0 only, and
            // `received` is not read before they have stopped.
            unsafe {
                registers.ch_read_addr().write(|w| w.bits(read));
                registers.ch_write_addr().write(|w| w.bits(write));
                registers.ch_trans_count().write(|w| w.bits(count as u32));
            }
            registers.ch_ctrl_trig().write(|w| {
                w.data_size().size_byte().incr_read().bit(channel == TX).incr_write().bit(channel == RX);
                // Errors of the transfer before are cleared by writing ones (data sheet, section 2.5.7).
                w.read_error().clear_bit_by_one().write_error().clear_bit_by_one();
                // SAFETY: a channel that is chained to itself triggers no other.
                unsafe { w.chain_to().bits(channel as u8) };
                if channel == RX { w.treq_sel().spi0_rx() } else { w.treq_sel().spi0_tx() }.en().set_bit()
            });
        }
    }

    /// Stops both channels. Returns whether all bytes were received without an error.
    fn stop_bytes(&mut self) -> bool {
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
            // An abort may complete the transfer, too (erratum RP2040-E13).
            // SAFETY: as above.
            self.dma.ints0().write(|w| unsafe { w.bits(1 << RX) });
        }
        compiler_fence(Ordering::SeqCst);
        complete
    }
}

/// READ_ERROR and WRITE_ERROR of a channel's control register, cleared by writing ones.
const ERRORS: u32 = 1 << 30 | 1 << 29;

/// Waits for a byte under way and drops what was received: a byte left in the receive buffer would shift the next burst.
fn drain() {
    let spi = registers();
    let _ended = wait_for(|| spi.sspsr().read().bsy().bit_is_clear());
    for _ in 0..BUFFER {
        if spi.sspsr().read().rne().bit_is_set() {
            spi.sspdr().read();
        }
    }
    spi.sspicr().write(|w| w.roric().clear_bit_by_one().rtic().clear_bit_by_one());
}

impl<W: ValidSpiPinout<SPI0>, S: OutputPin<Error = Infallible>> SensorBus for Spi0Bus<W, S> {
    fn set_clock_limit(&mut self, limit_hz: u32) -> u32 {
        self.select.set_clock_limit(limit_hz);
        drain();
        self.spi.set_baudrate(self.peripheral, limit_hz.Hz());
        // By the two dividers of the peripheral clock, rounded up (data sheet, section 4.4.3.4).
        let prescale = u32::from(registers().sspcpsr().read().cpsdvsr().bits());
        let rate = u32::from(registers().sspcr0().read().scr().bits());
        self.peripheral.to_Hz().div_ceil(prescale.max(1) * (rate + 1))
    }

    fn set_timing(&mut self, timing: BusTiming) {
        self.select.timing = timing;
    }

    fn take_frame_times(&mut self) -> FrameTimes {
        self.select.take_times()
    }

    fn reset(&mut self) {
        drain();
        registers().sspcr1().modify(|_, w| w.sse().clear_bit());
        registers().sspcr1().modify(|_, w| w.sse().set_bit());
    }
}

impl<W: ValidSpiPinout<SPI0>, S: OutputPin<Error = Infallible>> BurstBus for Spi0Bus<W, S> {
    /// The end of the transfer raises the interrupt DMA_IRQ_0.
    fn start_burst(&mut self) {
        self.select.select::<Rp2040>();
        self.started = 0;
        self.start_bytes();
    }

    fn end_burst(&mut self) -> BurstEnd<'_> {
        let complete = self.stop_bytes();
        if complete && self.started < BURST_BYTES {
            wait_ns::<Rp2040>(self.select.timing.word_gap_ns);
            self.start_bytes();
            return BurstEnd::MoreWords;
        }
        if !complete {
            drain();
        }
        self.select.deselect::<Rp2040>();
        if complete { BurstEnd::Complete(self.received) } else { BurstEnd::Failed }
    }
}

/// The registers of SPI0, for what the HAL has no function for.
fn registers() -> &'static pac::spi0::RegisterBlock {
    // SAFETY: only this module, whose bus owns the HAL's driver of SPI0, uses them.
    unsafe { &*SPI0::ptr() }
}

/// Exchanges bytes by the registers of SPI0.
struct Spi0Bytes;

impl ByteExchange for Spi0Bytes {
    fn exchange(&mut self, byte: u8) -> Result<u8, BusFault> {
        let spi = registers();
        if !wait_for(|| spi.sspsr().read().tnf().bit_is_set()) {
            return Err(BusFault::Timeout);
        }
        // SAFETY: the register takes any 16 bits.
        spi.sspdr().write(|w| unsafe { w.data().bits(u16::from(byte)) });
        if !wait_for(|| spi.sspsr().read().rne().bit_is_set()) {
            return Err(BusFault::Timeout);
        }
        let received = spi.sspdr().read().data().bits() as u8;
        if spi.sspris().read().rorris().bit_is_set() { Err(BusFault::Overrun) } else { Ok(received) }
    }

    fn finish(&mut self) -> Result<(), BusFault> {
        let idle = wait_for(|| registers().sspsr().read().bsy().bit_is_clear());
        if idle { Ok(()) } else { Err(BusFault::Timeout) }
    }
}

impl<W: ValidSpiPinout<SPI0>, S> ErrorType for Spi0Bus<W, S> {
    type Error = BusFault;
}

impl<W: ValidSpiPinout<SPI0>, S: OutputPin<Error = Infallible>> SpiDevice<u8> for Spi0Bus<W, S> {
    fn transaction(&mut self, operations: &mut [Operation<'_, u8>]) -> Result<(), BusFault> {
        let done = transfer::<Rp2040, _>(&mut Spi0Bytes, &mut self.select, operations);
        if done.is_err() {
            drain();
        }
        done
    }
}
