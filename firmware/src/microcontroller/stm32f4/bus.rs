//! SPI1 with two streams of DMA2, for the sensor.

use super::start::Stm32f4;
use crate::bus_frame::{BusFault, ByteExchange, flag_in_time, wait_for};
use crate::microcontroller::sensor_spi::{SensorSpi, SpiPeripheral};
use crate::sensor::{BURST_LIMIT_HZ, prescaled_clock};
use stm32f4xx_hal::gpio::{Output, PA4, PA5, PA6, PA7, PinState, Pull, Speed};
use stm32f4xx_hal::pac::{self, DMA2, RCC, SPI1};
use stm32f4xx_hal::prelude::*;
use stm32f4xx_hal::rcc::{Enable, Rcc};
use stm32f4xx_hal::spi::{Mode, Phase, Polarity};

/// Streams and channel of SPI1 (RM0090 table 43).
const RX: usize = 0;
const TX: usize = 3;
const CHANNEL: u8 = 3;
const STALE_BYTES: u32 = 2;

/// SPI1 and the two DMA streams that serve it.
pub struct Spi1 {
    bus_hz: u32,
    dma: DMA2,
}

/// SPI1 in mode 3 on PA5 (SCK), PA6 (MISO, pulled down) and PA7 (MOSI), chip select on PA4. Low speed of SCK's pad
/// allows 25 MHz of peripheral clock, medium 75 MHz (ST, errata sheet ES0182, section 2.12.4).
pub(super) fn spi1_bus(
    (spi, dma): (SPI1, DMA2),
    (select, sck, miso, mosi): (PA4, PA5, PA6, PA7),
    rcc: &mut Rcc,
) -> SensorSpi<Spi1, PA4<Output>> {
    let select = select.into_push_pull_output_in_state(PinState::High);
    let bus_hz = rcc.clocks.pclk2().raw();
    let (_field, request) = prescaled_clock(bus_hz, BURST_LIMIT_HZ);
    let mode = Mode { polarity: Polarity::IdleHigh, phase: Phase::CaptureOnSecondTransition };
    let sck = sck.into_alternate::<5>().speed(Speed::Medium);
    let miso = miso.into_alternate::<5>().internal_resistor(Pull::Down);
    let _spi = spi.spi((Some(sck), Some(miso), Some(mosi)), mode, request.Hz(), rcc);
    DMA2::enable(rcc);
    SensorSpi::new(Spi1 { bus_hz, dma }, select)
}

fn registers() -> &'static pac::spi1::RegisterBlock {
    // SAFETY: only this module, whose bus was made of SPI1, uses them.
    unsafe { &*SPI1::ptr() }
}

/// The register that resets peripherals on SPI1's bus.
fn reset_register() -> &'static pac::rcc::APB2RSTR {
    // SAFETY: after the start only this module uses it.
    unsafe { (*RCC::ptr()).apb2rstr() }
}

impl Spi1 {
    fn clear_flags(&mut self) {
        self.dma.lifcr().write(|w| {
            w.ctcif0().set_bit().chtif0().set_bit().cteif0().set_bit().cdmeif0().set_bit().cfeif0().set_bit();
            w.ctcif3().set_bit().chtif3().set_bit().cteif3().set_bit().cdmeif3().set_bit().cfeif3().set_bit()
        });
    }
}

impl SpiPeripheral for Spi1 {
    type Clock = Stm32f4;

    fn set_clock_limit(&mut self, limit_hz: u32) -> u32 {
        let (field, clock_hz) = prescaled_clock(self.bus_hz, limit_hz);
        registers().cr1().modify(|_, w| w.spe().clear_bit());
        registers().cr1().modify(|_, w| w.br().set(field));
        registers().cr1().modify(|_, w| w.spe().set_bit());
        clock_hz
    }

    /// BSY may stay set without a reset (ST, errata sheet ES0182, SPI).
    fn reset(&mut self) {
        let (spi, rcc) = (registers(), reset_register());
        let [control, control_2] = [spi.cr1().read().bits(), spi.cr2().read().bits()];
        rcc.modify(|_, w| w.spi1rst().set_bit());
        rcc.modify(|_, w| w.spi1rst().clear_bit());
        // SAFETY: what the registers held before.
        unsafe {
            spi.cr2().write(|w| w.bits(control_2));
            spi.cr1().write(|w| w.bits(control));
        }
    }

    fn drain(&mut self) {
        let _ended = wait_for(|| registers().sr().read().bsy().bit_is_clear());
        for _ in 0..STALE_BYTES {
            // This read clears an overrun (RM0090 section 28.3.10).
            registers().dr().read();
            registers().sr().read();
        }
    }

    /// The end of the transfer raises the interrupt DMA2_STREAM0.
    fn start(&mut self, request: &'static [u8], received: &mut [u8]) {
        let data = registers().dr().as_ptr() as u32;
        self.clear_flags();
        let (rx, tx) = (self.dma.st(RX), self.dma.st(TX));
        // SAFETY: the streams transfer as many bytes as both slices have, from and to this peripheral only, and the caller does not
        // use them before the streams have stopped.
        unsafe {
            rx.par().write(|w| w.pa().bits(data));
            rx.m0ar().write(|w| w.m0a().bits(received.as_mut_ptr() as u32));
            tx.par().write(|w| w.pa().bits(data));
            tx.m0ar().write(|w| w.m0a().bits(request.as_ptr() as u32));
        }
        rx.ndtr().write(|w| w.ndt().set(received.len() as u16));
        tx.ndtr().write(|w| w.ndt().set(request.len() as u16));
        rx.cr().write(|w| {
            w.chsel().set(CHANNEL).dir().peripheral_to_memory().minc().set_bit();
            w.tcie().set_bit().teie().set_bit().en().set_bit()
        });
        tx.cr().write(|w| w.chsel().set(CHANNEL).dir().memory_to_peripheral().minc().set_bit().en().set_bit());
        registers().cr2().modify(|_, w| w.rxdmaen().set_bit().txdmaen().set_bit());
    }

    /// Disabling a stream also sets its completion flag (RM0090 section 10.3.14), so the number of bytes left decides.
    fn stop(&mut self) -> bool {
        let flags = self.dma.lisr().read();
        let complete = flags.tcif0().bit_is_set() && flags.teif0().bit_is_clear() && flags.teif3().bit_is_clear();
        let complete = complete && self.dma.st(RX).ndtr().read().ndt().bits() == 0;
        registers().cr2().modify(|_, w| w.rxdmaen().clear_bit().txdmaen().clear_bit());
        let stopped = [self.dma.st(RX), self.dma.st(TX)].map(|stream| {
            stream.cr().modify(|_, w| w.en().clear_bit());
            wait_for(|| stream.cr().read().en().bit_is_clear())
        });
        self.clear_flags();
        complete && stopped == [true; 2]
    }
}

impl ByteExchange for Spi1 {
    fn exchange(&mut self, byte: u8) -> Result<u8, BusFault> {
        let spi = registers();
        flag_in_time(|| spi.sr().read().txe().bit_is_set())?;
        spi.dr().write(|w| w.dr().set(u16::from(byte)));
        flag_in_time(|| spi.sr().read().rxne().bit_is_set())?;
        let received = spi.dr().read().dr().bits() as u8;
        if spi.sr().read().ovr().bit_is_set() { Err(BusFault::Overrun) } else { Ok(received) }
    }

    fn finish(&mut self) -> Result<(), BusFault> {
        flag_in_time(|| registers().sr().read().bsy().bit_is_clear())
    }
}
