//! What the images of all boards share beside the application: traits of a microcontroller and its peripherals, in this
//! file; start-up, interrupts and panics (`image`); load figures and the LED (`processor`); and one module for each
//! microcontroller.
//!
//! A board file sets up pins and clocks in a function that returns [`BoardParts`], and names the interrupts in
//! [`observatory!`](crate::observatory).

pub mod image;
pub mod processor;
#[cfg(feature = "rp2040")]
pub mod rp2040;
#[cfg(feature = "stm32f4")]
pub mod stm32f4;

use crate::board::{BusTiming, SensorBus, WatchdogExtension};
use crate::sensor::LOW_POWER_LIMIT_HZ;
use adis16405_driver::BURST_BYTES;
use core::convert::Infallible;
use defmt_rtt as _;
use embedded_hal::digital::OutputPin;
use embedded_hal::spi::{self, Operation};
use heapless::spsc::{Consumer, Producer, Queue};
use link::{BootCause, ClockSource};

/// The bytes from the serial port to the application.
pub type ReceiveBuffer = Queue<u8, 64>;

/// The serial port's ends of the queues to and from the application.
pub struct UartQueues {
    /// Bytes to be sent.
    pub transmit: Consumer<'static, u8>,
    /// Bytes received.
    pub receive: Producer<'static, u8>,
}

/// What a board's start-up function returns.
pub struct BoardParts<M, D, B, P, L> {
    /// Why the microcontroller started.
    pub cause: BootCause,
    /// What the clocks are derived from.
    pub clock: ClockSource,
    /// Clock of the processor in Hz.
    pub core_hz: u32,
    /// The microcontroller, with running watchdog.
    pub microcontroller: M,
    /// The data-ready pin.
    pub data_ready: D,
    /// The sensor's bus.
    pub bus: B,
    /// The serial port to the host.
    pub port: P,
    /// The LED.
    pub led: L,
}

/// Clock, watchdog and restart of a microcontroller.
pub trait Microcontroller {
    /// A counter of microseconds that wraps at 2³².
    fn counter() -> u32;
    /// Feeds the watchdog.
    fn feed(&mut self);
    /// Restarts processor and peripherals; the RAM keeps its content.
    fn restart() -> !;
    /// To be called at every interrupt of SysTick, of which there are [`processor::WAKE_HZ`] a second: prolongs the time of a
    /// watchdog that is shorter than a step of the main loop.
    fn extend_watchdog(_extension: &mut WatchdogExtension) {}
}

/// The data-ready pin, which raises an interrupt at rising edges.
pub trait DataReadyPin {
    /// Clears the pending interrupt.
    fn clear(&mut self);
}

/// The sensor's bus. Bursts are transferred by DMA while the processor does other work.
pub trait BurstBus: SensorBus {
    /// Selects the sensor and starts the transfer of a burst, the end of which, or of a part of which, raises an interrupt.
    fn start_burst(&mut self);
    /// To be called in that interrupt.
    fn end_burst(&mut self) -> BurstEnd<'_>;
}

/// How a transfer has ended.
pub enum BurstEnd<'a> {
    /// A word was transferred, and the next one has been started.
    MoreWords,
    /// The sensor is deselected; these bytes were received.
    Complete(&'a [u8; BURST_BYTES]),
    /// The sensor is deselected, and the transfer failed. The bus is ready for the next one.
    Failed,
}

/// The serial port to the host.
pub trait UartPort {
    /// Moves bytes between the peripheral and its queues as far as possible; returns how many received bytes were lost.
    fn serve(&mut self) -> u32;
}

/// Why a register access over the bus has failed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum BusFault {
    /// The SPI peripheral did not transfer a byte in ten times the time that it takes.
    Timeout,
    /// A received byte was lost.
    Overrun,
}

impl spi::Error for BusFault {
    fn kind(&self) -> spi::ErrorKind {
        match self {
            Self::Timeout => spi::ErrorKind::Other,
            Self::Overrun => spi::ErrorKind::Overrun,
        }
    }
}

/// Readings of a flag before [`wait_for`] gives up. A reading takes at least three cycles, so that this is 0.4 ms at 168 MHz;
/// a byte takes 49 µs at the slowest serial clock.
const READINGS: u32 = 25_000;

/// Waits until a flag of a peripheral is set; returns false if that takes longer than [`READINGS`] readings.
fn wait_for(mut flag: impl FnMut() -> bool) -> bool {
    (0..READINGS).any(|_| flag())
}

/// Waits for at least `ns`; a microcontroller whose counter stands still waits for a bounded time.
fn wait_ns<M: Microcontroller>(ns: u32) {
    if ns > 0 {
        let (start, us) = (M::counter(), ns.div_ceil(1000));
        // A reading takes at least three cycles of 6 ns.
        let readings = us.saturating_mul(64).saturating_add(64);
        let _elapsed = (0..readings).any(|_| M::counter().wrapping_sub(start) > us);
    }
}

/// Exchanges single bytes with the sensor, without chip select.
trait ByteExchange {
    /// Sends a byte and returns the one received meanwhile.
    fn exchange(&mut self, byte: u8) -> Result<u8, BusFault>;
    /// Waits until the last clock period of the last byte has ended.
    fn finish(&mut self) -> Result<(), BusFault>;
}

/// The chip-select pin, active low, which stays high between two frames for the time that the settings ask for.
struct ChipSelect<S> {
    pin: S,
    timing: BusTiming,
    /// Least time high in ns, by the serial clock.
    high_ns: u32,
    /// The counter when the pin has risen.
    risen_at: u32,
}

impl<S: OutputPin<Error = Infallible>> ChipSelect<S> {
    /// `pin` must be high.
    fn new(pin: S, timing: BusTiming) -> Self {
        Self { pin, timing, high_ns: timing.low_power_select_high_ns, risen_at: 0 }
    }

    /// To be called when the limit of the serial clock has changed.
    fn set_clock_limit(&mut self, limit_hz: u32) {
        let low_power = limit_hz <= LOW_POWER_LIMIT_HZ;
        self.high_ns = if low_power { self.timing.low_power_select_high_ns } else { self.timing.select_high_ns };
    }

    fn select<M: Microcontroller>(&mut self) {
        let high_us = M::counter().wrapping_sub(self.risen_at);
        let rest_ns = self.high_ns.saturating_sub(high_us.saturating_sub(1).saturating_mul(1000));
        wait_ns::<M>(rest_ns);
        let Ok(()) = self.pin.set_low();
    }

    fn deselect<M: Microcontroller>(&mut self) {
        let Ok(()) = self.pin.set_high();
        self.risen_at = M::counter();
    }
}

/// Performs the operations of one frame. Delays are timed by the microcontroller's counter. A delay at the end, the sensor's
/// stall, is kept while chip select is high, as other drivers for this part do.
fn transfer<M: Microcontroller, S: OutputPin<Error = Infallible>>(
    bytes: &mut impl ByteExchange,
    select: &mut ChipSelect<S>,
    operations: &mut [Operation<'_, u8>],
) -> Result<(), BusFault> {
    let (frame, stall_ns) = match operations {
        [frame @ .., Operation::DelayNs(ns)] => (frame, *ns),
        frame => (frame, 0),
    };
    select.select::<M>();
    let done = frame.iter_mut().try_for_each(|operation| perform::<M>(bytes, operation)).and_then(|()| bytes.finish());
    select.deselect::<M>();
    wait_ns::<M>(stall_ns);
    done
}

fn perform<M: Microcontroller>(
    bytes: &mut impl ByteExchange,
    operation: &mut Operation<'_, u8>,
) -> Result<(), BusFault> {
    match operation {
        Operation::Read(read) => read.iter_mut().try_for_each(|byte| {
            *byte = bytes.exchange(0)?;
            Ok(())
        }),
        Operation::Write(write) => write.iter().try_for_each(|&byte| bytes.exchange(byte).map(|_| ())),
        Operation::Transfer(read, write) => (0..read.len().max(write.len())).try_for_each(|index| {
            let received = bytes.exchange(write.get(index).copied().unwrap_or(0))?;
            if let Some(byte) = read.get_mut(index) {
                *byte = received;
            }
            Ok(())
        }),
        Operation::TransferInPlace(words) => words.iter_mut().try_for_each(|byte| {
            *byte = bytes.exchange(*byte)?;
            Ok(())
        }),
        Operation::DelayNs(ns) => {
            wait_ns::<M>(*ns);
            Ok(())
        }
    }
}
