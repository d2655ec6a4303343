//! What all boards share beside the application: the start, the interrupts, what the processor measures of itself, what
//! survives a reset; and the drivers of each microcontroller.
//!
//! A board file names pins and clocks in a function that returns [`Parts`], and the interrupts in
//! [`observatory!`](crate::observatory).

mod image;
mod processor;
#[cfg(feature = "rp2040")]
pub mod rp2040;
#[cfg(feature = "stm32f4")]
pub mod stm32f4;
pub mod survivors;

pub use processor::{ESTIMATOR_CYCLES, Processor, SAMPLING_CYCLES, count_lost_bytes, measure};

use adis16405_driver::BURST_BYTES;
use defmt_rtt as _;
use embedded_hal::spi::{Operation, SpiBus, SpiDevice};
use heapless::spsc::{Consumer, Producer, Queue};
use link::BootCause;

/// The queue from the serial port to the application.
pub type Incoming = Queue<u8, 64>;

/// The application's ends of the serial port.
pub struct Line {
    /// What is to be sent.
    pub outgoing: Consumer<'static, u8>,
    /// What was received.
    pub incoming: Producer<'static, u8>,
}

/// What a board's start leaves for the application.
pub struct Parts<M, D, B, P> {
    /// Why the microcontroller started.
    pub cause: BootCause,
    /// Clock of the processor in Hz.
    pub core_hz: u32,
    /// Serial clock of the sensor's bus that was really set, in Hz.
    pub spi_clock_hz: u32,
    /// The microcontroller, its watchdog running.
    pub microcontroller: M,
    /// The line on which the sensor tells of a new sample.
    pub data_ready: D,
    /// The sensor's bus.
    pub bus: B,
    /// The serial port to the host.
    pub port: P,
}

/// Time, watchdog and restart.
pub trait Microcontroller {
    /// A counter of microseconds that wraps at 2³².
    fn counter() -> u32;
    /// Feeds the watchdog.
    fn feed(&mut self);
    /// Restarts everything but memory.
    fn restart() -> !;
}

/// The data-ready line, set to interrupt at its rising edge.
pub trait DataReady {
    /// Takes the interrupt back.
    fn clear(&mut self);
}

/// The sensor's bus; bursts run by DMA, so that the processor is free meanwhile.
pub trait Bus: SpiDevice<u8> {
    /// Selects the sensor and lets a burst run; its end raises an interrupt.
    fn start_burst(&mut self);
    /// Ends the burst: what came in, or `None` if the transfer failed.
    fn end_burst(&mut self) -> Option<&[u8; BURST_BYTES]>;
}

/// The serial port.
pub trait Port {
    /// Moves what can be moved between the line and its queues; returns how many bytes were lost on the way in.
    fn serve(&mut self) -> u32;
}

/// Lets at least `us` microseconds pass.
fn wait_us<M: Microcontroller>(us: u32) {
    let start = M::counter();
    while M::counter().wrapping_sub(start) <= us {}
}

/// The operations of one frame, pauses by the microcontroller's counter.
fn transfer<M: Microcontroller, S: SpiBus>(spi: &mut S, operations: &mut [Operation<'_, u8>]) -> Result<(), S::Error> {
    for operation in operations {
        match operation {
            Operation::Read(words) => spi.read(words)?,
            Operation::Write(words) => spi.write(words)?,
            Operation::Transfer(read, write) => spi.transfer(read, write)?,
            Operation::TransferInPlace(words) => spi.transfer_in_place(words)?,
            Operation::DelayNs(ns) => {
                spi.flush()?;
                wait_us::<M>(ns.div_ceil(1000));
            }
        }
    }
    spi.flush()
}
