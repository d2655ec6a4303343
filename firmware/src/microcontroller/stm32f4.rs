//! STM32F4: SPI1 with DMA2, USART2, TIM2 as the clock, the independent watchdog.

use super::{BurstBus, DataReadyPin, Microcontroller, UartPort, UartQueues, transfer};
use crate::sensor::prescaled_clock_hz;
use adis16405_driver::{BURST_BYTES, BURST_REQUEST};
use core::convert::Infallible;
use core::sync::atomic::{Ordering, compiler_fence};
use cortex_m::peripheral::SCB;
use embedded_hal::digital::OutputPin;
use embedded_hal::spi::{ErrorType, Operation, SpiDevice};
use link::BootCause;
use stm32f4xx_hal::gpio::{ExtiPin, Input, Pin};
use stm32f4xx_hal::nb;
use stm32f4xx_hal::pac::{self, DMA2, IWDG, RCC, SPI1, TIM2, USART2};
use stm32f4xx_hal::prelude::*;
use stm32f4xx_hal::rcc::{Enable, Rcc, Reset};
use stm32f4xx_hal::serial::{Rx, RxListen, Serial, Tx, TxISR, TxListen};
use stm32f4xx_hal::spi::{self, Spi};
use stm32f4xx_hal::watchdog::IndependentWatchdog;

/// Time without feeding after which the watchdog restarts; a report of all channels takes less.
const WATCHDOG_MS: u32 = 8_000;

/// Reads the cause of the start and clears the reset flags (RM0090 section 6.3.21).
pub fn boot_cause(rcc: &RCC) -> BootCause {
    let flags = rcc.csr().read();
    rcc.csr().modify(|_, w| w.rmvf().set_bit());
    // Power-on also sets the brown-out flag, and every reset sets the flag of the pin.
    if flags.porrstf().bit_is_set() {
        BootCause::PowerOn
    } else if flags.wdgrstf().bit_is_set() {
        BootCause::Watchdog
    } else if flags.sftrstf().bit_is_set() {
        BootCause::Software
    } else if flags.borrstf().bit_is_set() {
        BootCause::BrownOut
    } else if flags.padrstf().bit_is_set() {
        BootCause::Pin
    } else {
        BootCause::Unknown
    }
}

/// An STM32F4 with running clock and watchdog.
pub struct Stm32f4 {
    watchdog: IndependentWatchdog,
}

impl Stm32f4 {
    /// Starts the microsecond counter and the watchdog.
    pub fn start(timer: TIM2, watchdog: IWDG, rcc: &mut Rcc) -> Self {
        TIM2::enable(rcc);
        TIM2::reset(rcc);
        let clock_hz = rcc.clocks.timclk1().raw();
        timer.psc().write(|w| w.psc().set((clock_hz / 1_000_000 - 1) as u16));
        timer.egr().write(|w| w.ug().set_bit()); // loads the prescaler; the counter still wraps at 2³²
        timer.cr1().write(|w| w.cen().set_bit());
        let mut watchdog = IndependentWatchdog::new(watchdog);
        watchdog.start(WATCHDOG_MS.millis());
        Self { watchdog }
    }
}

impl Microcontroller for Stm32f4 {
    fn counter() -> u32 {
        // SAFETY: a read without side effects.
        unsafe { (*TIM2::ptr()).cnt().read().cnt().bits() }
    }

    fn feed(&mut self) {
        self.watchdog.feed();
    }

    fn restart() -> ! {
        SCB::sys_reset()
    }
}

impl<const P: char, const N: u8> DataReadyPin for Pin<P, N, Input> {
    fn clear(&mut self) {
        self.clear_interrupt_pending_bit();
    }
}

/// DMA2 streams and channel of SPI1 (RM0090 table 43).
const RX: usize = 0;
const TX: usize = 3;
const CHANNEL: u8 = 3;

/// The sensor on SPI1, with its chip select and two DMA streams: registers byte by byte, bursts by DMA.
pub struct Spi1Bus<S> {
    spi: Spi<SPI1>,
    select: S,
    dma: DMA2,
    received: &'static mut [u8; BURST_BYTES],
}

impl<S> Spi1Bus<S> {
    /// A bus with the chip select `select`, which must be high.
    pub fn new(spi: Spi<SPI1>, select: S, dma: DMA2, rcc: &mut Rcc) -> Self {
        DMA2::enable(rcc);
        let received = cortex_m::singleton!(: [u8; BURST_BYTES] = [0; BURST_BYTES]).expect("the bus is created once");
        Self { spi, select, dma, received }
    }

    /// The serial clock in Hz that the prescaler in CR1 makes of the bus clock.
    pub fn clock_hz(&self, bus_hz: u32) -> u32 {
        prescaled_clock_hz(bus_hz, registers().cr1().read().br().bits())
    }

    fn clear_flags(&mut self) {
        self.dma.lifcr().write(|w| {
            w.ctcif0().set_bit().chtif0().set_bit().cteif0().set_bit().cdmeif0().set_bit().cfeif0().set_bit();
            w.ctcif3().set_bit().chtif3().set_bit().cteif3().set_bit().cdmeif3().set_bit().cfeif3().set_bit()
        });
    }
}

impl<S: OutputPin<Error = Infallible>> BurstBus for Spi1Bus<S> {
    /// The end of the transfer raises the interrupt DMA2_STREAM0.
    fn start_burst(&mut self) {
        let data = registers().dr().as_ptr() as u32;
        self.clear_flags();
        let Ok(()) = self.select.set_low();
        let (rx, tx) = (self.dma.st(RX), self.dma.st(TX));
        // SAFETY: the streams transfer as many bytes as both arrays have, from and to this peripheral only, and `received`
        // is not read before they have stopped.
        unsafe {
            rx.par().write(|w| w.pa().bits(data));
            rx.m0ar().write(|w| w.m0a().bits(self.received.as_mut_ptr() as u32));
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
        let complete = flags.tcif0().bit_is_set() && flags.teif0().bit_is_clear() && flags.teif3().bit_is_clear();
        registers().cr2().modify(|_, w| w.rxdmaen().clear_bit().txdmaen().clear_bit());
        for stream in [RX, TX] {
            self.dma.st(stream).cr().modify(|_, w| w.en().clear_bit());
            while self.dma.st(stream).cr().read().en().bit_is_set() {}
        }
        self.clear_flags();
        let Ok(()) = self.select.set_high();
        compiler_fence(Ordering::SeqCst);
        complete.then_some(&*self.received)
    }
}

/// The registers of SPI1, for what the HAL has no function for.
fn registers() -> &'static pac::spi1::RegisterBlock {
    // SAFETY: only `Spi1Bus`, which owns the HAL's driver of SPI1, calls this.
    unsafe { &*SPI1::ptr() }
}

impl<S> ErrorType for Spi1Bus<S> {
    type Error = spi::Error;
}

impl<S: OutputPin<Error = Infallible>> SpiDevice<u8> for Spi1Bus<S> {
    fn transaction(&mut self, operations: &mut [Operation<'_, u8>]) -> Result<(), spi::Error> {
        let Ok(()) = self.select.set_low();
        let done = transfer::<Stm32f4, _>(&mut self.spi, operations);
        let Ok(()) = self.select.set_high();
        done
    }
}

/// The serial port to the host on USART2, served in its interrupt.
pub struct Usart2Port {
    tx: Tx<USART2>,
    rx: Rx<USART2>,
    queues: UartQueues,
}

impl Usart2Port {
    /// Enables the receive interrupt.
    pub fn new(usart: Serial<USART2>, queues: UartQueues) -> Self {
        let (tx, mut rx) = usart.split();
        rx.listen();
        Self { tx, rx, queues }
    }
}

impl UartPort for Usart2Port {
    fn serve(&mut self) -> u32 {
        // Read regardless of the flags: an overrun raises the interrupt too, and only a read clears it.
        let lost = match self.rx.read() {
            Ok(byte) => self.queues.receive.enqueue(byte).is_err(),
            Err(nb::Error::Other(_)) => true,
            Err(nb::Error::WouldBlock) => false,
        };
        if self.tx.is_tx_empty() {
            match self.queues.transmit.dequeue() {
                Some(byte) => {
                    let _empty_was_checked = self.tx.write(byte);
                    self.tx.listen();
                }
                None => self.tx.unlisten(),
            }
        }
        u32::from(lost)
    }
}
