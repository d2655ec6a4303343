//! RP2040: SPI0 with two DMA channels, UART0, the timer as the clock, the watchdog.

use super::{BurstBus, DataReadyPin, Microcontroller, UartPort, UartQueues, transfer};
use adis16405_driver::{BURST_BYTES, BURST_REQUEST};
use core::convert::Infallible;
use core::sync::atomic::{Ordering, compiler_fence};
use embedded_hal::digital::OutputPin;
use embedded_hal::spi::{ErrorType, Operation, SpiDevice};
use link::BootCause;
use rp2040_hal::Watchdog;
use rp2040_hal::clocks::ClocksManager;
use rp2040_hal::fugit::ExtU32;
use rp2040_hal::gpio::{FunctionSioInput, Interrupt, Pin, PinId, PullDown};
use rp2040_hal::pac::{self, DMA, RESETS, SPI0, TIMER, UART0, VREG_AND_CHIP_RESET, WATCHDOG};
use rp2040_hal::spi::{self, Spi, ValidSpiPinout};
use rp2040_hal::uart::{self, UartPeripheral, ValidUartPinout};

/// Time without feeding after which the watchdog restarts; its maximum is 8.388 s. The report of one channel takes less; that
/// of all channels takes longer, but the watchdog is fed after each.
const WATCHDOG_MS: u32 = 8_300;

/// Reads the cause of the start (RP2040 data sheet, sections 2.10.6.2 and 4.7.6).
pub fn boot_cause(chip: &VREG_AND_CHIP_RESET, watchdog: &WATCHDOG) -> BootCause {
    let (reason, chip) = (watchdog.reason().read(), chip.chip_reset().read());
    // The chip's flags are those of the last reset of the whole chip, which a reset by the watchdog is not. Power-on and
    // brown-out share one flag.
    if reason.timer().bit_is_set() {
        BootCause::Watchdog
    } else if reason.force().bit_is_set() {
        BootCause::Software
    } else if chip.had_por().bit_is_set() {
        BootCause::PowerOn
    } else if chip.had_run().bit_is_set() {
        BootCause::Pin
    } else {
        BootCause::Unknown
    }
}

/// An RP2040 with running clock and watchdog.
pub struct Rp2040 {
    watchdog: Watchdog,
}

impl Rp2040 {
    /// Starts the microsecond counter and the watchdog.
    pub fn start(timer: TIMER, mut watchdog: Watchdog, resets: &mut RESETS, clocks: &ClocksManager) -> Self {
        let _timer_runs_on = rp2040_hal::Timer::new(timer, resets, clocks);
        watchdog.start(WATCHDOG_MS.millis());
        Self { watchdog }
    }
}

impl Microcontroller for Rp2040 {
    fn counter() -> u32 {
        // SAFETY: a read without side effects.
        unsafe { (*TIMER::ptr()).timerawl().read().bits() }
    }

    fn feed(&mut self) {
        self.watchdog.feed();
    }

    /// Restarts by the watchdog, since a reset of the core alone would not reset the peripherals.
    fn restart() -> ! {
        // SAFETY: the write ends the program.
        unsafe { (*WATCHDOG::ptr()).ctrl().modify(|_, w| w.trigger().set_bit()) };
        loop {
            cortex_m::asm::nop();
        }
    }
}

impl<I: PinId> DataReadyPin for Pin<I, FunctionSioInput, PullDown> {
    fn clear(&mut self) {
        self.clear_interrupt(Interrupt::EdgeHigh);
    }
}

/// DMA channels.
const RX: usize = 0;
const TX: usize = 1;

/// The sensor on SPI0, with its chip select and two DMA channels: registers byte by byte, bursts by DMA.
pub struct Spi0Bus<W: ValidSpiPinout<SPI0>, S> {
    spi: Spi<spi::Enabled, SPI0, W, 8>,
    select: S,
    dma: DMA,
    received: &'static mut [u8; BURST_BYTES],
}

impl<W: ValidSpiPinout<SPI0>, S> Spi0Bus<W, S> {
    /// A bus with the chip select `select`, which must be high.
    pub fn new(spi: Spi<spi::Enabled, SPI0, W, 8>, select: S, dma: DMA, resets: &mut RESETS) -> Self {
        resets.reset().modify(|_, w| w.dma().clear_bit());
        while resets.reset_done().read().dma().bit_is_clear() {}
        // SAFETY: an interrupt enable of a channel that only this bus uses.
        dma.inte0().write(|w| unsafe { w.bits(1 << RX) });
        registers().sspdmacr().write(|w| w.rxdmae().set_bit().txdmae().set_bit());
        let received = cortex_m::singleton!(: [u8; BURST_BYTES] = [0; BURST_BYTES]).expect("the bus is created once");
        Self { spi, select, dma, received }
    }

    /// The serial clock in Hz that the two dividers make of the peripheral clock, rounded up (data sheet, section 4.4.3.4).
    pub fn clock_hz(&self, peripheral_hz: u32) -> u32 {
        let prescale = u32::from(registers().sspcpsr().read().cpsdvsr().bits());
        let rate = u32::from(registers().sspcr0().read().scr().bits());
        peripheral_hz.div_ceil(prescale.max(1) * (rate + 1))
    }
}

impl<W: ValidSpiPinout<SPI0>, S: OutputPin<Error = Infallible>> BurstBus for Spi0Bus<W, S> {
    /// The end of the transfer raises the interrupt DMA_IRQ_0.
    fn start_burst(&mut self) {
        let Ok(()) = self.select.set_low();
        let data = registers().sspdr().as_ptr() as u32;
        compiler_fence(Ordering::SeqCst);
        for (channel, from, to) in
            [(RX, data, self.received.as_mut_ptr() as u32), (TX, BURST_REQUEST.as_ptr() as u32, data)]
        {
            let registers = self.dma.ch(channel);
            // SAFETY: the channels transfer as many bytes as both arrays have, from and to SPI0 only, and `received` is
            // not read before they have stopped.
            unsafe {
                registers.ch_read_addr().write(|w| w.bits(from));
                registers.ch_write_addr().write(|w| w.bits(to));
                registers.ch_trans_count().write(|w| w.bits(BURST_BYTES as u32));
            }
            registers.ch_ctrl_trig().write(|w| {
                w.data_size().size_byte().incr_read().bit(channel == TX).incr_write().bit(channel == RX);
                // SAFETY: a channel that is chained to itself triggers no other.
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
        (failed == [false; 2]).then_some(&*self.received)
    }
}

/// The registers of SPI0, for what the HAL has no function for.
fn registers() -> &'static pac::spi0::RegisterBlock {
    // SAFETY: only `Spi0Bus`, which owns the HAL's driver of SPI0, calls this.
    unsafe { &*SPI0::ptr() }
}

impl<W: ValidSpiPinout<SPI0>, S> ErrorType for Spi0Bus<W, S> {
    type Error = Infallible;
}

impl<W: ValidSpiPinout<SPI0>, S: OutputPin<Error = Infallible>> SpiDevice<u8> for Spi0Bus<W, S> {
    fn transaction(&mut self, operations: &mut [Operation<'_, u8>]) -> Result<(), Infallible> {
        self.select.set_low()?;
        transfer::<Rp2040, _>(&mut self.spi, operations)?;
        self.select.set_high()
    }
}

/// The serial port to the host on UART0, served in its interrupt.
pub struct Uart0Port<W: ValidUartPinout<UART0>> {
    uart: UartPeripheral<uart::Enabled, UART0, W>,
    queues: UartQueues,
}

impl<W: ValidUartPinout<UART0>> Uart0Port<W> {
    /// Enables the receive interrupt.
    pub fn new(mut uart: UartPeripheral<uart::Enabled, UART0, W>, queues: UartQueues) -> Self {
        uart.enable_rx_interrupt();
        Self { uart, queues }
    }
}

impl<W: ValidUartPinout<UART0>> UartPort for Uart0Port<W> {
    fn serve(&mut self) -> u32 {
        let mut byte = [0];
        let mut lost = 0;
        while self.uart.uart_is_readable() {
            let queued = self.uart.read_raw(&mut byte).is_ok() && self.queues.receive.enqueue(byte[0]).is_ok();
            lost += u32::from(!queued);
        }
        while self.uart.uart_is_writable()
            && let Some(byte) = self.queues.transmit.dequeue()
        {
            let _writable_was_checked = self.uart.write_raw(&[byte]);
        }
        if self.queues.transmit.ready() {
            self.uart.enable_tx_interrupt();
        } else {
            self.uart.disable_tx_interrupt();
        }
        lost
    }
}
