//! The USB port of an STM32F405: its full-speed controller (OTG_FS), as a device.

use crate::microcontroller::{ReceiveBuffer, ServedPort, UsbParts};
use crate::transmit::TransmitBuffer;
use crate::usb_port::{UsbIdentity, UsbPort};
use core::fmt::Write;
use heapless::String;
use stm32f4xx_hal::gpio::alt::otg_fs::{Dm, Dp};
use stm32f4xx_hal::otg_fs::{USB, UsbBus};
use stm32f4xx_hal::pac::{OTG_FS_DEVICE, OTG_FS_GLOBAL, OTG_FS_PWRCLK};
use stm32f4xx_hal::rcc::Clocks;
use usb_device::bus::UsbBusAllocator;

/// Vendor and product of STMicroelectronics' virtual COM port.
const VENDOR: u16 = 0x0483;
const PRODUCT_ID: u16 = 0x5740;
/// The unique number of the microcontroller, in words (RM0090 section 39.1).
const UNIQUE_ID: *const u32 = 0x1FFF_7A10 as *const u32;
const UNIQUE_ID_WORDS: usize = 3;
/// Words of the driver's copies of received packets: one of 64 bytes for each endpoint that receives, of which there are two.
const PACKET_WORDS: usize = 2 * 64 / 4;

/// The USB port, served in the interrupt OTG_FS.
pub type Stm32UsbPort = UsbPort<'static, UsbBus<USB>>;

impl ServedPort for Stm32UsbPort {
    fn serve(&mut self) -> u32 {
        UsbPort::serve(self)
    }
}

/// Starts the USB port, with the unique number of the microcontroller as the serial number of the board. To be called once. Its
/// clock is the 48 MHz of the main PLL.
pub fn usb_port(
    registers: (OTG_FS_GLOBAL, OTG_FS_DEVICE, OTG_FS_PWRCLK),
    wires: (impl Into<Dm>, impl Into<Dp>),
    clocks: &Clocks,
) -> Option<UsbParts<Stm32UsbPort>> {
    let mut hexadecimal = String::<24>::new();
    for word in 0..UNIQUE_ID_WORDS {
        // SAFETY: read-only memory.
        let value = unsafe { UNIQUE_ID.add(word).read_volatile() };
        let _eight_digits_fit = write!(hexadecimal, "{value:08X}");
    }
    let serial_number = cortex_m::singleton!(SERIAL_NUMBER: String<24> = hexadecimal)?;
    let packets = cortex_m::singleton!(USB_PACKETS: [u32; PACKET_WORDS] = [0; PACKET_WORDS])?;
    let bus = UsbBus::new(USB::new(registers, wires, clocks), packets);
    let bus = cortex_m::singleton!(USB_BUS: UsbBusAllocator<UsbBus<USB>> = bus)?;
    let to_port = cortex_m::singleton!(USB_TRANSMIT: TransmitBuffer = TransmitBuffer::new())?;
    let from_port = cortex_m::singleton!(USB_RECEIVE: ReceiveBuffer = ReceiveBuffer::new())?;
    let ((transmit, to_port), (from_port, receive)) = (to_port.split(), from_port.split());
    let identity = UsbIdentity { vendor: VENDOR, product: PRODUCT_ID, serial_number };
    let port = UsbPort::new(bus, identity, (to_port, from_port))?;
    Some(UsbParts { port, transmit, receive })
}
