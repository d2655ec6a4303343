//! The USB serial port (CDC-ACM) of a board, over the [`UsbBus`] of any microcontroller.
//!
//! Nothing here waits: [`UsbPort::serve`] moves what can be moved and returns. A host that is absent, suspended or does not read
//! leaves bytes in the transmit queue, whose other end then [drops and counts](crate::TransmitQueue).

use heapless::Vec;
use heapless::spsc::{Consumer, Producer};
use usb_device::bus::{UsbBus, UsbBusAllocator};
use usb_device::device::{StringDescriptors, UsbDevice, UsbDeviceBuilder, UsbDeviceState, UsbVidPid};
use usbd_serial::{SerialPort, USB_CLASS_CDC};

/// Name of the product in its descriptors.
pub const PRODUCT: &str = "ADIS16405 noise observatory";
/// Longest packet of a bulk endpoint at full speed (USB 2.0, section 5.8.3).
const PACKET: usize = 64;
/// Current that the device asks for, in mA: 70 for the sensor, which the connector may supply (ADIS16400/ADIS16405 data sheet Rev. B,
/// Table 1), and the board.
const SUPPLY_MA: usize = 250;

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
    receive: Producer<'a, u8>,
    /// Bytes from the transmit queue that the endpoint has not taken yet.
    waiting: Vec<u8, PACKET>,
    /// A terminal has opened the port.
    is_open: bool,
}

impl<'a, B: UsbBus> UsbPort<'a, B> {
    /// Connects the device to the bus. `None` if the bus has too few endpoints.
    pub fn new(
        bus: &'a UsbBusAllocator<B>,
        identity: UsbIdentity<'a>,
        (transmit, receive): (Consumer<'a, u8>, Producer<'a, u8>),
    ) -> Option<Self> {
        let serial = SerialPort::new(bus);
        let strings =
            StringDescriptors::default().manufacturer(PRODUCT).product(PRODUCT).serial_number(identity.serial_number);
        let device = UsbDeviceBuilder::new(bus, UsbVidPid(identity.vendor, identity.product))
            .strings(&[strings])
            .ok()?
            .max_packet_size_0(PACKET as u8)
            .ok()?
            .max_power(SUPPLY_MA)
            .ok()?
            .device_class(USB_CLASS_CDC)
            .build();
        Some(Self { device, serial, transmit, receive, waiting: Vec::new(), is_open: false })
    }

    /// Answers the host and moves bytes between the endpoints and the queues as far as possible; returns how many received
    /// bytes were lost. To be called when the bus raises an interrupt, and when bytes have been queued.
    pub fn serve(&mut self) -> u32 {
        self.device.poll(&mut [&mut self.serial]);
        let lost = self.receive();
        let was_open = core::mem::replace(&mut self.is_open, self.serial.dtr());
        // Without a host nobody is to be told later what happened now; and a terminal begins with what happens after it was opened.
        let is_absent = matches!(self.device.state(), UsbDeviceState::Default | UsbDeviceState::Addressed);
        if is_absent || self.is_open && !was_open {
            self.waiting.clear();
            while self.transmit.dequeue().is_some() {}
        }
        if self.device.state() == UsbDeviceState::Configured {
            self.transmit();
        }
        lost
    }

    fn receive(&mut self) -> u32 {
        let (mut packet, mut lost) = ([0; PACKET], 0);
        // Also without room in the queue: a packet that is not taken raises the interrupt again and again.
        while let Ok(length) = self.serial.read(&mut packet)
            && length > 0
        {
            lost += packet[..length].iter().filter(|&&byte| self.receive.enqueue(byte).is_err()).count();
        }
        lost as u32
    }

    fn transmit(&mut self) {
        loop {
            while !self.waiting.is_full()
                && let Some(byte) = self.transmit.dequeue()
            {
                let _room_was_checked = self.waiting.push(byte);
            }
            let taken = match self.serial.write(&self.waiting) {
                Ok(taken) if taken > 0 => taken,
                _ => return,
            };
            self.waiting.copy_within(taken.., 0);
            self.waiting.truncate(self.waiting.len() - taken);
        }
    }
}
