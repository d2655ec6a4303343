//! The USB port of an STM32F405: its full-speed controller (OTG_FS), as a device.

use crate::microcontroller::{UsbParts, start_usb};
use crate::usb_port::UsbPort;
use stm32f4xx_hal::gpio::alt::otg_fs::{Dm, Dp};
use stm32f4xx_hal::otg_fs::{USB, UsbBus};
use stm32f4xx_hal::pac::{OTG_FS_DEVICE, OTG_FS_GLOBAL, OTG_FS_PWRCLK};
use stm32f4xx_hal::rcc::Clocks;
use usb_device::bus::UsbBusAllocator;
use usb_device::device::UsbVidPid;

/// Identification of STMicroelectronics' virtual COM port.
const PRODUCT_ID: UsbVidPid = UsbVidPid(0x0483, 0x5740);
/// Unique number of the microcontroller, three words (RM0090 section 39.1).
const UNIQUE_ID: *const [u32; 3] = 0x1FFF_7A10 as *const [u32; 3];
/// Memory for a packet of 64 bytes for each of two receiving endpoints, words.
const PACKET_WORDS: usize = 2 * 64 / 4;

/// The USB port, served in the interrupt OTG_FS.
pub type Stm32UsbPort = UsbPort<'static, UsbBus<USB>>;

/// Starts the USB port, on 48 MHz of the main PLL, with the microcontroller's unique number. To be called once.
pub fn usb_port(
    registers: (OTG_FS_GLOBAL, OTG_FS_DEVICE, OTG_FS_PWRCLK),
    wires: (impl Into<Dm>, impl Into<Dp>),
    clocks: &Clocks,
) -> Option<UsbParts<Stm32UsbPort>> {
    let packets = cortex_m::singleton!(USB_PACKETS: [u32; PACKET_WORDS] = [0; PACKET_WORDS])?;
    let bus = UsbBus::new(USB::new(registers, wires, clocks), packets);
    let bus = cortex_m::singleton!(USB_BUS: UsbBusAllocator<UsbBus<USB>> = bus)?;
    // SAFETY: read-only memory.
    let unique_id = unsafe { UNIQUE_ID.read_volatile() };
    start_usb(bus, PRODUCT_ID, unique_id.into_iter().flat_map(u32::to_be_bytes), reconnect)
}

/// Sets or clears SDIS (RM0090 section 34.16.4); the host then resets the bus.
fn reconnect(connected: bool) {
    // SAFETY: the interrupt that uses the controller waits meanwhile.
    unsafe { (*OTG_FS_DEVICE::ptr()).dctl().modify(|_, w| w.sdis().bit(!connected)) };
}
