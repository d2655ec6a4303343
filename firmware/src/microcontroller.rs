//! What the images of all boards share beside the application: traits of a microcontroller and its peripherals, in this
//! file; start-up, interrupts and panics (`image`); load figures (`processor`); and one module for each microcontroller.
//!
//! A board file sets up pins and clocks in a function that returns [`BoardParts`], and names the interrupts in
//! [`observatory!`](crate::observatory).

pub mod image;
pub mod processor;
#[cfg(feature = "rp2040")]
pub mod rp2040;
#[cfg(feature = "stm32f4")]
pub mod stm32f4;

use adis16405_driver::BURST_BYTES;
use defmt_rtt as _;
use embedded_hal::spi::{Operation, SpiBus, SpiDevice};
use heapless::spsc::{Consumer, Producer, Queue};
use link::BootCause;

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
pub struct BoardParts<M, D, B, P> {
    /// Why the microcontroller started.
    pub cause: BootCause,
    /// Clock of the processor in Hz.
    pub core_hz: u32,
    /// Serial clock of the sensor's bus as set in the hardware, in Hz.
    pub spi_clock_hz: u32,
    /// The microcontroller, with running watchdog.
    pub microcontroller: M,
    /// The data-ready pin.
    pub data_ready: D,
    /// The sensor's bus.
    pub bus: B,
    /// The serial port to the host.
    pub port: P,
}

/// Clock, watchdog and restart of a microcontroller.
pub trait Microcontroller {
    /// A counter of microseconds that wraps at 2³².
    fn counter() -> u32;
    /// Feeds the watchdog.
    fn feed(&mut self);
    /// Restarts processor and peripherals; the RAM keeps its content.
    fn restart() -> !;
}

/// The data-ready pin, which raises an interrupt at rising edges.
pub trait DataReadyPin {
    /// Clears the pending interrupt.
    fn clear(&mut self);
}

/// The sensor's bus. Bursts are transferred by DMA while the processor does other work.
pub trait BurstBus: SpiDevice<u8> {
    /// Selects the sensor and starts the transfer of a burst, the end of which raises an interrupt.
    fn start_burst(&mut self);
    /// Deselects the sensor after the transfer and returns the bytes received, or `None` if the transfer failed.
    fn end_burst(&mut self) -> Option<&[u8; BURST_BYTES]>;
}

/// The serial port to the host.
pub trait UartPort {
    /// Moves bytes between the peripheral and its queues as far as possible; returns how many received bytes were lost.
    fn serve(&mut self) -> u32;
}

/// Waits for at least `us` microseconds.
fn wait_us<M: Microcontroller>(us: u32) {
    let start = M::counter();
    while M::counter().wrapping_sub(start) <= us {}
}

/// Performs the operations of one frame; delays are timed by the microcontroller's counter.
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
