//! The USB port of an RP2040.

use super::flash::unique_id;
use crate::microcontroller::{ReceiveBuffer, ServedPort, UsbParts};
use crate::transmit::TransmitBuffer;
use crate::usb_port::{UsbIdentity, UsbPort};
use core::fmt::Write;
use heapless::String;
use rp2040_hal::clocks::UsbClock;
use rp2040_hal::pac::{RESETS, USBCTRL_DPRAM, USBCTRL_REGS};
use rp2040_hal::usb::UsbBus;
use usb_device::bus::UsbBusAllocator;

/// Vendor and product that Raspberry Pi gives to devices with an RP2040 and a serial port (github.com/raspberrypi/usb-pid:
/// Raspberry Pi Pico SDK CDC UART).
const VENDOR: u16 = 0x2E8A;
const PRODUCT_ID: u16 = 0x000A;

/// The USB port, served in the interrupt USBCTRL_IRQ.
pub type Rp2040UsbPort = UsbPort<'static, UsbBus>;

impl ServedPort for Rp2040UsbPort {
    fn serve(&mut self) -> u32 {
        UsbPort::serve(self)
    }
}

/// Starts the USB port, with the serial number of the board: the unique number of its flash memory in hexadecimal, as the
/// manufacturer's tools give it. To be called once, while no DMA transfer runs.
pub fn usb_port(
    (registers, memory): (USBCTRL_REGS, USBCTRL_DPRAM),
    clock: UsbClock,
    resets: &mut RESETS,
) -> Option<UsbParts<Rp2040UsbPort>> {
    let mut hexadecimal = String::<16>::new();
    for byte in unique_id() {
        let _two_digits_fit = write!(hexadecimal, "{byte:02X}");
    }
    let serial_number = cortex_m::singleton!(SERIAL_NUMBER: String<16> = hexadecimal)?;
    let bus = UsbBus::new(registers, memory, clock, true, resets);
    let bus = cortex_m::singleton!(USB_BUS: UsbBusAllocator<UsbBus> = UsbBusAllocator::new(bus))?;
    let to_port = cortex_m::singleton!(USB_TRANSMIT: TransmitBuffer = TransmitBuffer::new())?;
    let from_port = cortex_m::singleton!(USB_RECEIVE: ReceiveBuffer = ReceiveBuffer::new())?;
    let ((transmit, to_port), (from_port, receive)) = (to_port.split(), from_port.split());
    let identity = UsbIdentity { vendor: VENDOR, product: PRODUCT_ID, serial_number };
    let port = UsbPort::new(bus, identity, (to_port, from_port))?;
    Some(UsbParts { port, transmit, receive })
}
