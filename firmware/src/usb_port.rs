//! The USB serial port (CDC-ACM) of a board, over the [`UsbBus`] of any microcontroller.
//!
//! Nothing here waits: [`UsbPort::serve`] moves what can be moved and returns. A host that is absent, suspended or does not read
//! leaves bytes in the transmit queue, whose other end then [drops and counts](crate::TransmitQueue).

use crate::receive::Receiver;
use heapless::Vec;
use heapless::spsc::Consumer;
use usb_device::bus::{UsbBus, UsbBusAllocator};
use usb_device::device::{StringDescriptors, UsbDevice, UsbDeviceBuilder, UsbDeviceState, UsbVidPid};
use usbd_serial::{SerialPort, USB_CLASS_CDC};

/// Names of the manufacturer and of the product in the descriptors.
pub const MANUFACTURER: &str = "Noise observatory";
/// The same of the product.
pub const PRODUCT: &str = "ADIS16405 noise observatory";
/// Longest packet of a bulk endpoint at full speed (USB 2.0, section 5.8.3).
const PACKET: usize = 64;
/// Current that the device asks for, in mA: 70 for the sensor, which the connector may supply (ADIS16400/ADIS16405 data sheet Rev. B,
/// Table 1), and the board.
const SUPPLY_MA: usize = 250;

/// Time in µs after which a port that is open, and takes nothing of what waits for it, has stalled: the controller of an RP2040 may
/// hang behind a hub and needs a reset (RP2040 data sheet, erratum RP2040-E15). A terminal that is stopped for so long loses the port, too.
const STALL_US: u32 = 30_000_000;
/// Time in µs for which the device then stays off the bus, so that the host sees that it is gone.
const OFF_US: u32 = 500_000;

/// Who makes the board, and which one it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct UsbIdentity<'a> {
    /// Vendor.
    pub vendor: u16,
    /// Product, among those of the vendor.
    pub product: u16,
    /// Serial number, different for every board.
    pub serial_number: &'a str,
}

/// A USB serial port between a transmit and a receive queue.
pub struct UsbPort<'a, B: UsbBus> {
    device: UsbDevice<'a, B>,
    serial: SerialPort<'a, B>,
    transmit: Consumer<'a, u8>,
    receive: Receiver<'a>,
    /// Bytes from the transmit queue that the endpoint has not taken yet.
    waiting: Vec<u8, PACKET>,
    /// A terminal has opened the port.
    is_open: bool,
    /// Resets the controller and keeps it off the bus (false), or starts it again (true).
    reconnect: fn(bool),
    /// When a byte was taken, or none waited, or the device went off the bus.
    moved_us: u32,
    is_off: bool,
}

impl<'a, B: UsbBus> UsbPort<'a, B> {
    /// Connects the device to the bus. `reconnect` resets the controller and keeps it off the bus (false), or starts it again (true). `None`
    /// if the bus has too few endpoints.
    pub fn new(
        bus: &'a UsbBusAllocator<B>,
        identity: UsbIdentity<'a>,
        (transmit, receive): (Consumer<'a, u8>, Receiver<'a>),
        reconnect: fn(bool),
    ) -> Option<Self> {
        let serial = SerialPort::new(bus);
        let strings = StringDescriptors::default()
            .manufacturer(MANUFACTURER)
            .product(PRODUCT)
            .serial_number(identity.serial_number);
        let device = UsbDeviceBuilder::new(bus, UsbVidPid(identity.vendor, identity.product))
            .strings(&[strings])
            .ok()?
            .max_packet_size_0(PACKET as u8)
            .ok()?
            .max_power(SUPPLY_MA)
            .ok()?
            .device_class(USB_CLASS_CDC)
            .build();
        let waiting = Vec::new();
        Some(Self { device, serial, transmit, receive, waiting, is_open: false, reconnect, moved_us: 0, is_off: false })
    }

    /// Answers the host and moves bytes between the endpoints and the queues as far as possible; returns how many received
    /// bytes were lost. To be called when the bus raises an interrupt, when bytes have been queued, and every second or sooner.
    pub fn serve(&mut self, now_us: u32) -> u32 {
        if self.is_off && now_us.wrapping_sub(self.moved_us) < OFF_US {
            return 0;
        }
        if core::mem::take(&mut self.is_off) {
            (self.reconnect)(true);
            self.moved_us = now_us;
        }
        self.device.poll(&mut [&mut self.serial]);
        let lost = self.receive();
        let was_open = core::mem::replace(&mut self.is_open, self.serial.dtr());
        // Discard output while no host is connected, and when a terminal opens the port: old lines would be misleading.
        let is_absent = matches!(self.device.state(), UsbDeviceState::Default | UsbDeviceState::Addressed);
        if is_absent || self.is_open && !was_open {
            self.waiting.clear();
            while self.transmit.dequeue().is_some() {}
        }
        let is_connected = self.device.state() == UsbDeviceState::Configured;
        if !is_connected || self.transmit() || !self.is_open {
            self.moved_us = now_us;
        } else if now_us.wrapping_sub(self.moved_us) > STALL_US {
            (self.reconnect)(false);
            (self.is_off, self.moved_us) = (true, now_us);
        }
        lost
    }

    fn receive(&mut self) -> u32 {
        let (mut packet, mut lost) = ([0; PACKET], 0);
        // Also without room in the queue: a packet that is not taken raises the interrupt again and again.
        while let Ok(length) = self.serial.read(&mut packet)
            && length > 0
        {
            lost += packet[..length].iter().map(|&byte| self.receive.push(Some(byte))).sum::<u32>();
        }
        lost
    }

    /// Returns whether a byte was taken, or none waits.
    fn transmit(&mut self) -> bool {
        let mut has_moved = false;
        loop {
            while !self.waiting.is_full()
                && let Some(byte) = self.transmit.dequeue()
            {
                let _room_was_checked = self.waiting.push(byte);
            }
            let taken = match self.serial.write(&self.waiting) {
                Ok(taken) if taken > 0 => taken,
                _ => return has_moved || self.waiting.is_empty(),
            };
            has_moved = true;
            self.waiting.copy_within(taken.., 0);
            self.waiting.truncate(self.waiting.len() - taken);
        }
    }
}
