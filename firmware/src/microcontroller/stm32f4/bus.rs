//! The sensor's bus: SPI1 with two streams of DMA2.

use super::start::Stm32f4;
use crate::board::{BusTiming, FrameTimes, SensorBus};
use crate::bus_frame::{BusFault, ByteExchange, ChipSelect, transfer, wait_for, wait_ns};
use crate::microcontroller::{BurstBus, BurstEnd};
use crate::sensor::{BURST_LIMIT_HZ, largest_clock_hz, prescaled_clock_hz};
use adis16405_driver::{BURST_BYTES, BURST_REQUEST};
use core::convert::Infallible;
use core::sync::atomic::{Ordering, compiler_fence};
use embedded_hal::digital::OutputPin;
use embedded_hal::spi::{ErrorType, Operation, SpiDevice};
use stm32f4xx_hal::gpio::{Output, PA4, PA5, PA6, PA7, PinState};
use stm32f4xx_hal::pac::{self, DMA2, SPI1};
use stm32f4xx_hal::prelude::*;
use stm32f4xx_hal::rcc::{Enable, Rcc};
use stm32f4xx_hal::spi::{Mode, Phase, Polarity};

/// DMA2 streams and channel of SPI1 (RM0090 table 43).
const RX: usize = 0;
const TX: usize = 3;
const CHANNEL: u8 = 3;
/// Bytes that the receive buffer of SPI1 and its shift register hold at most.
const STALE_BYTES: u32 = 2;

/// The bytes that request a burst. DMA reads them, so they must not be on the stack.
static REQUEST: [u8; BURST_BYTES] = BURST_REQUEST;

/// The sensor on SPI1, with its chip select and two DMA streams: registers byte by byte, bursts by DMA.
pub struct Spi1Bus<S> {
    bus_hz: u32,
    select: ChipSelect<S>,
    dma: DMA2,
    /// In static memory, as DMA does not reach the stack.
    received: &'static mut [u8; BURST_BYTES],
    /// Bytes of the burst that have been transferred, or are being transferred.
    started: usize,
}

/// SPI1 in mode 3 on PA5 (SCK), PA6 (MISO) and PA7 (MOSI), with chip select on PA4. MISO floats, as the data-ready pin does.
pub(super) fn spi1_bus(
    (spi, dma): (SPI1, DMA2),
    (select, sck, miso, mosi): (PA4, PA5, PA6, PA7),
    rcc: &mut Rcc,
    timing: BusTiming,
) -> Spi1Bus<PA4<Output>> {
    let bus_hz = rcc.clocks.pclk2().raw();
    let request = largest_clock_hz(bus_hz, BURST_LIMIT_HZ).expect("a prescaler reaches the burst limit");
    let mode = Mode { polarity: Polarity::IdleHigh, phase: Phase::CaptureOnSecondTransition };
    let _spi = spi.spi((Some(sck), Some(miso), Some(mosi)), mode, request.Hz(), rcc);
    DMA2::enable(rcc);
    let select = ChipSelect::new(select.into_push_pull_output_in_state(PinState::High), timing);
    let received = cortex_m::singleton!(: [u8; BURST_BYTES] = [0; BURST_BYTES]).expect("the bus is created once");
    Spi1Bus { bus_hz, select, dma, received, started: 0 }
}

impl<S: OutputPin<Error = Infallible>> Spi1Bus<S> {
    /// Transfers the next bytes of the burst: all of them, or one word if there is to be a gap between words.
    fn start_bytes(&mut self) {
        let count = if self.select.timing.word_gap_ns == 0 { BURST_BYTES } else { 2 };
        let from = self.started.min(BURST_BYTES - count);
        self.started += count;
        let data = registers().dr().as_ptr() as u32;
        self.clear_flags();
        let (rx, tx) = (self.dma.st(RX), self.dma.st(TX));
        // SAFETY: the streams transfer `count` bytes, which both arrays have from `from` on, from and to this peripheral
        // only, and `received` is not read before they have stopped.
        unsafe {
            rx.par().write(|w| w.pa().bits(data));
            rx.m0ar().write(|w| w.m0a().bits(self.received.as_mut_ptr().wrapping_add(from) as u32));
            tx.par().write(|w| w.pa().bits(data));
            tx.m0ar().write(|w| w.m0a().bits(REQUEST.as_ptr().wrapping_add(from) as u32));
        }
        rx.ndtr().write(|w| w.ndt().set(count as u16));
        tx.ndtr().write(|w| w.ndt().set(count as u16));
        compiler_fence(Ordering::SeqCst);
        rx.cr().write(|w| {
            w.chsel().set(CHANNEL).dir().peripheral_to_memory().minc().set_bit();
            w.tcie().set_bit().teie().set_bit().en().set_bit()
        });
        tx.cr().write(|w| w.chsel().set(CHANNEL).dir().memory_to_peripheral().minc().set_bit().en().set_bit());
        registers().cr2().modify(|_, w| w.rxdmaen().set_bit().txdmaen().set_bit());
    }

    /// Stops both streams. Returns whether all bytes were received without an error. A stream that was disabled sets its
    /// flag of completion too (RM0090 section 10.3.14), so the bytes that it has left decide.
    fn stop_bytes(&mut self) -> bool {
        let flags = self.dma.lisr().read();
        let complete = flags.tcif0().bit_is_set() && flags.teif0().bit_is_clear() && flags.teif3().bit_is_clear();
        let complete = complete && self.dma.st(RX).ndtr().read().ndt().bits() == 0;
        registers().cr2().modify(|_, w| w.rxdmaen().clear_bit().txdmaen().clear_bit());
        let stopped = [self.dma.st(RX), self.dma.st(TX)].map(|stream| {
            stream.cr().modify(|_, w| w.en().clear_bit());
            wait_for(|| stream.cr().read().en().bit_is_clear())
        });
        self.clear_flags();
        compiler_fence(Ordering::SeqCst);
        complete && stopped == [true; 2]
    }

    fn clear_flags(&mut self) {
        self.dma.lifcr().write(|w| {
            w.ctcif0().set_bit().chtif0().set_bit().cteif0().set_bit().cdmeif0().set_bit().cfeif0().set_bit();
            w.ctcif3().set_bit().chtif3().set_bit().cteif3().set_bit().cdmeif3().set_bit().cfeif3().set_bit()
        });
    }
}

/// Waits for a byte under way and drops what was received: a byte left in the receive buffer would shift the next burst.
fn drain() {
    let _ended = wait_for(|| registers().sr().read().bsy().bit_is_clear());
    for _ in 0..STALE_BYTES {
        // Reading DR, then SR, clears an overrun too (RM0090 section 28.3.10).
        registers().dr().read();
        registers().sr().read();
    }
}

impl<S: OutputPin<Error = Infallible>> SensorBus for Spi1Bus<S> {
    fn set_clock_limit(&mut self, limit_hz: u32) -> u32 {
        let field = (0..8).find(|&field| prescaled_clock_hz(self.bus_hz, field) <= limit_hz).unwrap_or(7);
        self.select.set_clock_limit(limit_hz);
        drain();
        registers().cr1().modify(|_, w| w.spe().clear_bit());
        registers().cr1().modify(|_, w| w.br().set(field));
        registers().cr1().modify(|_, w| w.spe().set_bit());
        prescaled_clock_hz(self.bus_hz, registers().cr1().read().br().bits())
    }

    fn set_timing(&mut self, timing: BusTiming) {
        self.select.timing = timing;
    }

    fn take_frame_times(&mut self) -> FrameTimes {
        self.select.take_times()
    }

    fn reset(&mut self) {
        drain();
        registers().cr1().modify(|_, w| w.spe().clear_bit());
        registers().cr1().modify(|_, w| w.spe().set_bit());
    }
}

impl<S: OutputPin<Error = Infallible>> BurstBus for Spi1Bus<S> {
    /// The end of the transfer raises the interrupt DMA2_STREAM0.
    fn start_burst(&mut self) {
        self.select.select::<Stm32f4>();
        self.started = 0;
        self.start_bytes();
    }

    fn end_burst(&mut self) -> BurstEnd<'_> {
        let complete = self.stop_bytes();
        if complete && self.started < BURST_BYTES {
            wait_ns::<Stm32f4>(self.select.timing.word_gap_ns);
            self.start_bytes();
            return BurstEnd::MoreWords;
        }
        if !complete {
            drain();
        }
        self.select.deselect::<Stm32f4>();
        if complete { BurstEnd::Complete(self.received) } else { BurstEnd::Failed }
    }
}

/// The registers of SPI1.
fn registers() -> &'static pac::spi1::RegisterBlock {
    // SAFETY: only this module, whose bus was made of SPI1, uses them.
    unsafe { &*SPI1::ptr() }
}

/// Exchanges bytes by the registers of SPI1.
struct Spi1Bytes;

impl ByteExchange for Spi1Bytes {
    fn exchange(&mut self, byte: u8) -> Result<u8, BusFault> {
        let spi = registers();
        if !wait_for(|| spi.sr().read().txe().bit_is_set()) {
            return Err(BusFault::Timeout);
        }
        spi.dr().write(|w| w.dr().set(u16::from(byte)));
        if !wait_for(|| spi.sr().read().rxne().bit_is_set()) {
            return Err(BusFault::Timeout);
        }
        let received = spi.dr().read().dr().bits() as u8;
        if spi.sr().read().ovr().bit_is_set() { Err(BusFault::Overrun) } else { Ok(received) }
    }

    fn finish(&mut self) -> Result<(), BusFault> {
        let idle = wait_for(|| registers().sr().read().bsy().bit_is_clear());
        if idle { Ok(()) } else { Err(BusFault::Timeout) }
    }
}

impl<S> ErrorType for Spi1Bus<S> {
    type Error = BusFault;
}

impl<S: OutputPin<Error = Infallible>> SpiDevice<u8> for Spi1Bus<S> {
    fn transaction(&mut self, operations: &mut [Operation<'_, u8>]) -> Result<(), BusFault> {
        let done = transfer::<Stm32f4, _>(&mut Spi1Bytes, &mut self.select, operations);
        if done.is_err() {
            drain();
        }
        done
    }
}
