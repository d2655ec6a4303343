//! Code shared by the images of all boards; a board implements [`BoardSupport`] and names its interrupts in
//! [`observatory!`](crate::observatory).

pub mod context;
pub mod image;
pub mod processor;
#[cfg(feature = "rp2040")]
pub mod rp2040;
pub mod sensor_spi;
pub mod settings_flash;
#[cfg(feature = "stm32f4")]
pub mod stm32f4;

use crate::board::{BrownOutLevel, DataReadyLine, SensorBus};
use crate::receive::{ReceiveBuffer, Receiver};
use crate::transmit::TransmitBuffer;
use crate::usb_port::{UsbIdentity, UsbPort};
use crate::watchdog::{Watchdog, WatchdogExtension};
use adis16405_driver::BURST_BYTES;
use core::convert::Infallible;
use core::fmt::Write;
use defmt_rtt as _;
use embedded_hal::digital::OutputPin;
use heapless::String;
use heapless::spsc::{Consumer, Producer};
use link::{BootCause, ClockSource};
use settings_flash::FlashMemory;
use usb_device::bus::{UsbBus, UsbBusAllocator};

/// The UART's ends of the queues to and from the application.
pub struct UartQueues {
    /// Bytes to be sent.
    pub transmit: Consumer<'static, u8>,
    /// Bytes received.
    pub receive: Receiver<'static>,
}

/// A USB port, and the application's ends of its queues.
pub struct UsbParts<U> {
    /// The port.
    pub port: U,
    /// Bytes to be sent.
    pub transmit: Producer<'static, u8>,
    /// Bytes received.
    pub receive: Consumer<'static, u8>,
}

impl<B: UsbBus> UsbParts<UsbPort<'static, B>> {
    /// Starts the port of a `vendor`'s `product`, with the board's number (at most twelve bytes) in hexadecimal.
    /// `reconnect` resets the controller off the bus (false) and starts it again (true). Once; `None` afterwards, or
    /// with too few endpoints.
    pub fn start(
        bus: &'static UsbBusAllocator<B>,
        (vendor, product): (u16, u16),
        board_number: impl IntoIterator<Item = u8>,
        reconnect: fn(bool),
    ) -> Option<Self> {
        let serial_number = cortex_m::singleton!(SERIAL_NUMBER: String<24> = String::new())?;
        for byte in board_number {
            write!(serial_number, "{byte:02X}").ok()?;
        }
        let to_port = cortex_m::singleton!(USB_TRANSMIT: TransmitBuffer = TransmitBuffer::new())?;
        let from_port = cortex_m::singleton!(USB_RECEIVE: ReceiveBuffer = ReceiveBuffer::new())?;
        let ((transmit, to_port), (from_port, receive)) = (to_port.split(), from_port.split());
        let port = UsbPort::new(
            bus,
            UsbIdentity { vendor, product, serial_number },
            (to_port, Receiver::new(from_port)),
            reconnect,
        )?;
        Some(Self { port, transmit, receive })
    }
}

impl<B: UsbBus> ServedPort for UsbPort<'static, B> {
    fn serve(&mut self, now_us: u32) -> u32 {
        UsbPort::serve(self, now_us)
    }
}

impl<U> UsbParts<U> {
    /// Port and queues of a board that has them.
    #[must_use]
    pub fn split(parts: Option<Self>) -> (Option<U>, Option<Producer<'static, u8>>, Option<Consumer<'static, u8>>) {
        parts.map_or((None, None, None), |Self { port, transmit, receive }| (Some(port), Some(transmit), Some(receive)))
    }
}

/// Stands for an absent part: no value exists.
pub enum NotConnected {}

impl embedded_hal::digital::ErrorType for NotConnected {
    type Error = Infallible;
}

impl OutputPin for NotConnected {
    fn set_low(&mut self) -> Result<(), Infallible> {
        match *self {}
    }

    fn set_high(&mut self) -> Result<(), Infallible> {
        match *self {}
    }
}

impl ServedPort for NotConnected {
    fn serve(&mut self, _now_us: u32) -> u32 {
        match *self {}
    }
}

/// A board: its microcontroller, what is connected to which of its pins, and how it starts.
pub trait BoardSupport: Sized {
    /// The peripherals of the microcontroller.
    type Device;
    /// Clock, watchdog and restart.
    type Microcontroller: Microcontroller;
    /// The pin at DIO1 of the sensor.
    type DataReady: DataReadyPin;
    /// SPI with chip select.
    type Bus: BurstBus;
    /// The serial port to the host on pins.
    type Uart: ServedPort;
    /// The serial port to the host on USB, or [`NotConnected`].
    type Usb: ServedPort;
    /// An LED.
    type Led: OutputPin;
    /// The pin at RST of the sensor, low for a reset, or [`NotConnected`].
    type ResetLine: OutputPin;

    /// Starts clocks, watchdog and pins.
    fn start(device: Self::Device, queues: UartQueues) -> BoardParts<Self>;
}

/// The parts of a board after its start.
pub struct BoardParts<B: BoardSupport> {
    /// Why the microcontroller started.
    pub cause: BootCause,
    /// The source of the clocks.
    pub clock: ClockSource,
    /// Clock of the processor in Hz.
    pub core_hz: u32,
    /// The data-ready pin.
    pub data_ready: B::DataReady,
    /// The sensor's bus.
    pub bus: B::Bus,
    /// The serial port to the host on pins.
    pub uart: B::Uart,
    /// The serial port to the host on USB.
    pub usb: Option<UsbParts<B::Usb>>,
    /// The LED.
    pub led: B::Led,
    /// The reset pin of the sensor, high.
    pub reset_line: Option<B::ResetLine>,
}

/// Clock, watchdog and restart of a microcontroller.
pub trait Microcontroller: Watchdog {
    /// The flash memory, of which the memory map leaves a part for the settings.
    type Flash: FlashMemory;

    /// Restarts processor and peripherals; the RAM keeps its content.
    fn restart() -> !;
    /// Programs the level of the supply below which the microcontroller is reset.
    fn program_brown_out() -> BrownOutLevel {
        BrownOutLevel::Fixed
    }
    /// Starts the boot loader that takes an image over USB.
    fn start_boot_loader() -> !;
    /// To be called [`processor::WAKE_HZ`] times a second: prolongs a watchdog that is shorter than a step of the main
    /// loop.
    fn extend_watchdog(_extension: &mut WatchdogExtension) {}
}

/// The data-ready pin, which raises an interrupt at rising edges.
pub trait DataReadyPin: DataReadyLine {
    /// Clears the pending interrupt.
    fn clear(&mut self);
}

/// The sensor's bus, with bursts by DMA.
pub trait BurstBus: SensorBus {
    /// Selects the sensor and starts a burst; an interrupt follows at its end, or at that of a part.
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
    /// The sensor is deselected after a failure; the bus is ready.
    Failed,
}

/// A serial port to the host, served in its interrupt.
pub trait ServedPort {
    /// Moves bytes as far as possible at `now_us`, µs; returns how many received ones were lost.
    fn serve(&mut self, now_us: u32) -> u32;
}
