//! A USB bus without wires: the device's side is a [`UsbBus`], the host's side makes requests and moves packets.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard};
use usb_device::bus::{PollResult, UsbBus};
use usb_device::endpoint::{EndpointAddress, EndpointType};
use usb_device::{Result, UsbDirection, UsbError};

const ENDPOINTS: usize = 8;

#[derive(Default)]
struct Wires {
    /// Number of endpoints allocated beside endpoint 0, out and in.
    allocated: [usize; 2],
    /// Packets that the device has written and the host has not read.
    to_host: [Option<Vec<u8>>; ENDPOINTS],
    /// Packets that the host has sent and the device has not read.
    to_device: [VecDeque<Vec<u8>>; ENDPOINTS],
    setup: bool,
    /// Packets that the host has read since the last poll, a bit for each endpoint.
    read: u16,
    stalled: bool,
    /// Events other than packets, in order.
    events: VecDeque<PollResult>,
}

/// Both ends of the wires.
#[derive(Clone, Default)]
pub(crate) struct MockBus(Arc<Mutex<Wires>>);

impl MockBus {
    fn wires(&self) -> MutexGuard<'_, Wires> {
        self.0.lock().unwrap()
    }

    /// Resets the bus, as a host does with a newly plugged device. Packets under way are lost.
    pub(crate) fn reset_bus(&self) {
        self.wires().events.push_back(PollResult::Reset);
    }

    /// Suspends the bus: no frame starts, since the host sleeps or the device was unplugged.
    pub(crate) fn suspend_bus(&self) {
        self.wires().events.push_back(PollResult::Suspend);
    }

    pub(crate) fn resume_bus(&self) {
        self.wires().events.push_back(PollResult::Resume);
    }

    /// Sends a packet to an endpoint.
    pub(crate) fn send(&self, endpoint: usize, packet: &[u8]) {
        self.wires().to_device[endpoint].push_back(packet.to_vec());
    }

    /// Reads the packet that an endpoint has.
    pub(crate) fn read(&self, endpoint: usize) -> Option<Vec<u8>> {
        let mut wires = self.wires();
        let packet = wires.to_host[endpoint].take();
        wires.read |= u16::from(packet.is_some()) << endpoint;
        packet
    }

    /// Makes a control transfer with the host's data, if any; `serve` runs the device. Returns the device's data, or `None` if it refuses
    /// the request.
    pub(crate) fn control(&self, setup: [u8; 8], data: &[u8], mut serve: impl FnMut()) -> Option<Vec<u8>> {
        let length = usize::from(u16::from_le_bytes([setup[6], setup[7]]));
        {
            let mut wires = self.wires();
            (wires.setup, wires.stalled) = (true, false);
            wires.to_host[0] = None;
            wires.to_device[0] = VecDeque::from([setup.to_vec()]);
        }
        serve();
        if !data.is_empty() {
            self.send(0, data);
            serve();
        }
        let mut answer = Vec::new();
        for _ in 0..100 {
            if self.wires().stalled {
                return None;
            }
            let Some(packet) = self.read(0) else { break };
            serve();
            answer.extend(&packet);
            if packet.len() < 64 || answer.len() >= length {
                break;
            }
        }
        if setup[0] & 0x80 != 0 {
            self.send(0, &[]); // status stage
            serve();
        }
        Some(answer)
    }
}

impl UsbBus for MockBus {
    fn alloc_ep(
        &mut self,
        direction: UsbDirection,
        address: Option<EndpointAddress>,
        _: EndpointType,
        _: u16,
        _: u8,
    ) -> Result<EndpointAddress> {
        let mut wires = self.wires();
        let next = &mut wires.allocated[usize::from(direction == UsbDirection::In)];
        let index = address.map_or(*next + 1, |address| address.index());
        *next = (*next).max(index);
        if index < ENDPOINTS {
            Ok(EndpointAddress::from_parts(index, direction))
        } else {
            Err(UsbError::EndpointOverflow)
        }
    }

    fn enable(&mut self) {}

    fn reset(&self) {
        let mut wires = self.wires();
        wires.to_host = Default::default();
        wires.to_device = Default::default();
        wires.read = 0;
    }

    fn set_device_address(&self, _: u8) {}

    fn write(&self, endpoint: EndpointAddress, packet: &[u8]) -> Result<usize> {
        let slot = &mut self.wires().to_host[endpoint.index()];
        if slot.is_some() {
            return Err(UsbError::WouldBlock);
        }
        *slot = Some(packet.to_vec());
        Ok(packet.len())
    }

    fn read(&self, endpoint: EndpointAddress, buffer: &mut [u8]) -> Result<usize> {
        let mut wires = self.wires();
        wires.setup &= endpoint.index() != 0;
        let packet = wires.to_device[endpoint.index()].pop_front().ok_or(UsbError::WouldBlock)?;
        buffer[..packet.len()].copy_from_slice(&packet);
        Ok(packet.len())
    }

    fn set_stalled(&self, endpoint: EndpointAddress, stalled: bool) {
        if endpoint.index() == 0 {
            self.wires().stalled = stalled;
        }
    }

    fn is_stalled(&self, _: EndpointAddress) -> bool {
        self.wires().stalled
    }

    fn suspend(&self) {}

    fn resume(&self) {}

    fn poll(&self) -> PollResult {
        let mut wires = self.wires();
        if let Some(event) = wires.events.pop_front() {
            return event;
        }
        let ep_in_complete = std::mem::take(&mut wires.read);
        let ep_setup = u16::from(wires.setup);
        let waiting = |packets: &VecDeque<_>, index: usize| u16::from(!packets.is_empty()) << index;
        let ep_out = (0..).zip(&wires.to_device).map(|(index, packets)| waiting(packets, index)).sum();
        if (ep_out | ep_in_complete | ep_setup) == 0 {
            return PollResult::None;
        }
        PollResult::Data { ep_out, ep_in_complete, ep_setup }
    }
}
