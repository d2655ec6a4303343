//! Code shared by the images of all boards; [`observatory!`](crate::observatory) makes an image of a [`Microcontroller`], of the function that
//! starts the board, and of the names of its interrupts.

pub mod context;
pub mod image;
pub mod processor;
#[cfg(feature = "rp2040")]
pub mod rp2040;
pub mod sensor_spi;
pub mod settings_flash;
#[cfg(feature = "stm32f4")]
pub mod stm32f4;

use crate::board::BrownOutLevel;
use crate::receive::{ReceiveBuffer, Receiver, ServedPort};
use crate::transmit::TransmitBuffer;
use crate::usb_port::UsbPort;
use crate::watchdog::{Watchdog, WatchdogExtension};
use core::convert::Infallible;
use core::fmt::Write;
use defmt_rtt as _;
use embedded_hal::digital::OutputPin;
use heapless::String;
use heapless::spsc::{Consumer, Producer};
use link::{BootCause, ClockSource};
use sensor_spi::{SensorSpi, SpiPeripheral};
use settings_flash::FlashMemory;
use usb_device::bus::{UsbBus, UsbBusAllocator};
use usb_device::device::UsbVidPid;

/// The UART's ends of the queues to and from the application.
pub struct UartQueues {
    /// Bytes to be sent.
    pub transmit: Consumer<'static, u8>,
    /// Bytes received.
    pub receive: Receiver<'static>,
}

/// A USB port, and the application's ends of its queues: bytes to be sent, bytes received.
pub type UsbParts<U> = (U, (Producer<'static, u8>, Consumer<'static, u8>));

/// Starts the USB port of a product, with the board's number (at most twelve bytes) in hexadecimal. `reconnect` takes the
/// controller off the bus (false) or starts it again (true). `None` after the first call, or with too few endpoints.
pub fn start_usb<B: UsbBus>(
    bus: &'static UsbBusAllocator<B>,
    product: UsbVidPid,
    board_number: impl IntoIterator<Item = u8>,
    reconnect: fn(bool),
) -> Option<UsbParts<UsbPort<'static, B>>> {
    let serial_number = cortex_m::singleton!(SERIAL_NUMBER: String<24> = String::new())?;
    for byte in board_number {
        write!(serial_number, "{byte:02X}").ok()?;
    }
    let to_port = cortex_m::singleton!(USB_TRANSMIT: TransmitBuffer = TransmitBuffer::new())?;
    let from_port = cortex_m::singleton!(USB_RECEIVE: ReceiveBuffer = ReceiveBuffer::new())?;
    let ((transmit, to_port), (from_port, receive)) = (to_port.split(), from_port.split());
    let port = UsbPort::new(bus, product, serial_number, (to_port, Receiver::new(from_port)), reconnect)?;
    Some((port, (transmit, receive)))
}

/// A port that a microcontroller does not have.
impl ServedPort for Infallible {
    fn serve(&mut self, _now_us: u32) -> u32 {
        match *self {}
    }
}

/// A microcontroller with the pins to which a board connects the sensor and the ports: their types, watchdog and restart.
/// The application knows [`Board`](crate::Board) alone, which hosts implement too.
pub trait Microcontroller: Watchdog {
    /// The pin at DIO1 of the sensor.
    type DataReady: DataReadyPin;
    /// SPI of the sensor.
    type Spi: SpiPeripheral;
    /// Chip select of the sensor.
    type Select: OutputPin<Error = Infallible>;
    /// The serial port to the host on pins.
    type Uart: ServedPort;
    /// The serial port to the host on USB; [`Infallible`] if it has none.
    type Usb: ServedPort;
    /// An output pin of any number.
    type Output: OutputPin;
    /// The flash memory; the memory map leaves a part of it for the settings.
    type Flash: FlashMemory;

    /// Restarts processor and peripherals; the RAM keeps its content.
    fn restart() -> !;
    /// Programs the level of the supply below which the microcontroller is reset.
    fn program_brown_out() -> BrownOutLevel {
        BrownOutLevel::Fixed
    }
    /// Starts the boot loader that takes an image over USB.
    fn start_boot_loader() -> !;
    /// Feeds a watchdog that is shorter than a step of the main loop. To be called [`processor::WAKE_HZ`] times a
    /// second.
    fn extend_watchdog(_extension: &mut WatchdogExtension) {}
}

/// The parts of a board after its start.
pub struct BoardParts<M: Microcontroller> {
    /// Reason for which the microcontroller started.
    pub cause: BootCause,
    /// The source of the clocks.
    pub clock: ClockSource,
    /// Clock of the processor in Hz.
    pub core_hz: u32,
    /// The data-ready pin.
    pub data_ready: M::DataReady,
    /// The sensor's bus.
    pub bus: SensorSpi<M::Spi, M::Select>,
    /// The serial port to the host on pins.
    pub uart: M::Uart,
    /// The serial port to the host on USB.
    pub usb: Option<UsbParts<M::Usb>>,
    /// The LED.
    pub led: M::Output,
    /// The pin at RST of the sensor, if connected: high, and low for a reset.
    pub reset_line: Option<M::Output>,
}

/// The first cause whose flag is set.
fn first_cause<const N: usize>(causes: [(bool, BootCause); N]) -> BootCause {
    causes.into_iter().find(|(is_set, _)| *is_set).map_or(BootCause::Unknown, |(_, cause)| cause)
}

/// The data-ready pin, which raises an interrupt at rising edges.
pub trait DataReadyPin {
    /// Clears the pending interrupt.
    fn clear(&mut self);
    /// Masks edges, or accepts them again; edges in between are lost.
    fn set_masked(&mut self, masked: bool);
    /// The level of the line.
    fn is_active(&mut self) -> bool;
}
