//! The USB port of an RP2040.

use super::flash::unique_id;
use crate::microcontroller::UsbParts;
use crate::usb_port::UsbPort;
use rp2040_hal::clocks::UsbClock;
use rp2040_hal::pac::{RESETS, USBCTRL_DPRAM, USBCTRL_REGS};
use rp2040_hal::usb::UsbBus;
use usb_device::bus::UsbBusAllocator;

/// Vendor and product that Raspberry Pi gives to devices with an RP2040 and a serial port (github.com/raspberrypi/usb-pid:
/// Raspberry Pi Pico SDK CDC UART).
const PRODUCT_ID: (u16, u16) = (0x2E8A, 0x000A);

/// The USB port, served in the interrupt USBCTRL_IRQ.
pub type Rp2040UsbPort = UsbPort<'static, UsbBus>;

/// Starts the USB port, with the serial number of the board: the unique number of its flash memory in hexadecimal, as the
/// manufacturer's tools give it. To be called once, while no DMA transfer runs.
pub fn usb_port(
    (registers, memory): (USBCTRL_REGS, USBCTRL_DPRAM),
    clock: UsbClock,
    resets: &mut RESETS,
) -> Option<UsbParts<Rp2040UsbPort>> {
    let bus = UsbBus::new(registers, memory, clock, true, resets);
    let bus = cortex_m::singleton!(USB_BUS: UsbBusAllocator<UsbBus> = UsbBusAllocator::new(bus))?;
    UsbParts::start(bus, PRODUCT_ID, unique_id())
}
