//! The USB port of an RP2040. The feature `rp2040-e5` of the HAL, which works around RP2040-E5, is off: it would drive GPIO15.

use super::flash::unique_id;
use crate::bus_frame::wait_for;
use crate::microcontroller::{UsbParts, start_usb};
use crate::usb_port::UsbPort;
use rp2040_hal::clocks::UsbClock;
use rp2040_hal::pac::{RESETS, USBCTRL_DPRAM, USBCTRL_REGS};
use rp2040_hal::usb::UsbBus;
use usb_device::bus::UsbBusAllocator;
use usb_device::device::UsbVidPid;

/// Identification of the Raspberry Pi Pico SDK CDC UART (github.com/raspberrypi/usb-pid).
const PRODUCT_ID: UsbVidPid = UsbVidPid(0x2E8A, 0x000A);

/// The USB port, served in the interrupt USBCTRL_IRQ.
pub type Rp2040UsbPort = UsbPort<'static, UsbBus>;

/// Starts the USB port with the flash's unique number in hexadecimal. To be called once, while no DMA transfer runs.
pub fn usb_port(
    (registers, memory): (USBCTRL_REGS, USBCTRL_DPRAM),
    clock: UsbClock,
    resets: &mut RESETS,
) -> Option<UsbParts<Rp2040UsbPort>> {
    let bus = UsbBus::new(registers, memory, clock, true, resets);
    let bus = cortex_m::singleton!(USB_BUS: UsbBusAllocator<UsbBus> = UsbBusAllocator::new(bus))?;
    start_usb(bus, PRODUCT_ID, unique_id(), reconnect)
}

/// Takes the controller off the bus, or starts it as [`UsbBus::new`] does; endpoints and address follow a bus reset.
fn reconnect(connected: bool) {
    // SAFETY: no other program part uses the reset of the controller, and the interrupt that uses the controller waits meanwhile.
    let (resets, controller) = unsafe { (&*RESETS::ptr(), &*USBCTRL_REGS::ptr()) };
    resets.reset().modify(|_, w| w.usbctrl().bit(!connected));
    if !connected {
        return;
    }
    let _in_reset_otherwise = wait_for(|| resets.reset_done().read().usbctrl().bit_is_set());
    controller.usb_muxing().write(|w| w.to_phy().set_bit().softcon().set_bit());
    controller.usb_pwr().write(|w| w.vbus_detect().set_bit().vbus_detect_override_en().set_bit());
    controller.main_ctrl().write(|w| w.controller_en().set_bit());
    controller.inte().write(|w| {
        w.buff_status().set_bit().bus_reset().set_bit().dev_resume_from_host().set_bit();
        w.dev_suspend().set_bit().setup_req().set_bit()
    });
    controller.sie_ctrl().write(|w| w.ep0_int_1buf().set_bit().pullup_en().set_bit());
}
