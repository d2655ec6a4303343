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

use crate::board::{BrownOutLevel, DataReadyLine, SensorBus, WatchdogExtension};
use crate::bus_frame::MicrosecondCounter;
use adis16405_driver::BURST_BYTES;
use defmt_rtt as _;
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
pub trait Microcontroller: MicrosecondCounter {
    /// Feeds the watchdog.
    fn feed(&mut self);
    /// Restarts processor and peripherals; the RAM keeps its content.
    fn restart() -> !;
    /// Programs the level of the supply below which the microcontroller is reset.
    fn program_brown_out() -> BrownOutLevel {
        BrownOutLevel::Fixed
    }
    /// To be called at every interrupt of SysTick, of which there are [`processor::WAKE_HZ`] a second: prolongs the time of a
    /// watchdog that is shorter than a step of the main loop.
    fn extend_watchdog(_extension: &mut WatchdogExtension) {}
}

/// The data-ready pin, which raises an interrupt at rising edges.
pub trait DataReadyPin: DataReadyLine {
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
