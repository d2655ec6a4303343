//! The USB serial port (CDC-ACM) over any [`UsbBus`]. Bytes for an absent host stay queued, and later ones are [dropped
//! and counted](crate::TransmitQueue).

use crate::receive::{Receiver, ServedPort};
use heapless::Vec;
use heapless::spsc::Consumer;
use usb_device::bus::{UsbBus, UsbBusAllocator};
use usb_device::device::{StringDescriptors, UsbDevice, UsbDeviceBuilder, UsbDeviceState, UsbVidPid};
use usbd_serial::{SerialPort, USB_CLASS_CDC};

/// Name of the manufacturer in the descriptors.
pub const MANUFACTURER: &str = "Noise observatory";
/// Name of the product in the descriptors.
pub const PRODUCT: &str = "ADIS16405 noise observatory";
/// Bytes of a packet at full speed (USB 2.0, section 5.8.3).
const PACKET: usize = 64;
/// Supply current, mA: 70 for the sensor (ADIS16400/ADIS16405 data sheet Rev. B, Table 1), and the board.
const SUPPLY_MA: usize = 250;

/// Time without progress after which an open port counts as stalled, µs: an RP2040 may hang behind a hub (RP2040 data
/// sheet, erratum RP2040-E15).
const STALL_US: u32 = 30_000_000;
/// Time for which a stalled port stays off the bus, µs.
const OFF_US: u32 = 500_000;

/// A USB serial port between a transmit and a receive queue.
pub struct UsbPort<'a, B: UsbBus> {
    device: UsbDevice<'a, B>,
    serial: SerialPort<'a, B>,
    transmit: Consumer<'a, u8>,
    receive: Receiver<'a>,
    waiting: Vec<u8, PACKET>,
    is_open: bool,
    /// Takes the controller off the bus (false), or starts it again (true).
    reconnect: fn(bool),
    /// Last time at which a byte was taken, none was waiting, or the port was off the bus, µs.
    moved_us: u32,
    is_off: bool,
}

impl<'a, B: UsbBus> UsbPort<'a, B> {
    /// Connects; every board has its own `serial_number`. `reconnect` takes the controller off the bus (false), or on
    /// again (true). `None` with too few endpoints.
    pub fn new(
        bus: &'a UsbBusAllocator<B>,
        product: UsbVidPid,
        serial_number: &'a str,
        (transmit, receive): (Consumer<'a, u8>, Receiver<'a>),
        reconnect: fn(bool),
    ) -> Option<Self> {
        let serial = SerialPort::new(bus);
        let names = StringDescriptors::default().manufacturer(MANUFACTURER).product(PRODUCT);
        let device = UsbDeviceBuilder::new(bus, product)
            .strings(&[names.serial_number(serial_number)])
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

    fn receive(&mut self) -> u32 {
        let (mut packet, mut lost) = ([0; PACKET], 0);
        // Packets are read even without room, since an unread packet raises the interrupt again.
        while let Ok(length) = self.serial.read(&mut packet)
            && length > 0
        {
            lost += packet[..length].iter().map(|&byte| self.receive.push(Some(byte))).sum::<u32>();
        }
        lost
    }

    /// True if a byte was taken or none waits.
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

impl<B: UsbBus> ServedPort for UsbPort<'_, B> {
    /// Must be called at bus interrupts, for queued bytes, and at least every second.
    fn serve(&mut self, now_us: u32) -> u32 {
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
        // Queued lines are dropped, since old ones would mislead a new terminal.
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
}
