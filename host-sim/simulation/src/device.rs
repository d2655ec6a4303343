//! The firmware's application on the host: the code of the image, with the virtual sensor, in virtual time.

use crate::fault_injector::{FaultEnd, FaultyBus, InjectedFaults};
use crate::sample_audit::{Received, SampleAudit, lengths};
use adis16405_driver::{BURST_BYTES, BURST_REQUEST, Burst};
use embedded_hal::delay::DelayNs;
use embedded_hal::spi::SpiDevice;
use firmware::retained::{RetainedMemory, blank_memory};
use firmware::settings_store::StoreError;
use firmware::{
    App, Board, BurstQueue, BusTiming, EdgeAction, Estimators, FIRST_CONFIG, FinishedEpoch, FrameTimes, HostPort,
    RetainedRam, Sampler, SamplingActivity, Start, Statistics, TimedBurst, TransmitBuffer, TransmitQueue, estimate,
};
use heapless::spsc::Consumer;
use link::{Boot, BootCause, Health};
use std::cell::RefMut;
use std::collections::VecDeque;
use virtual_sensor::{EmulatedBus, VirtualAdis16405};

/// SCK of the sensor's bus, Hz.
const SCK_HZ: u32 = 1_000_000;

/// Longest time between two passes of the main loop, µs.
const WAKE_US: u64 = 100_000;

/// Time after which the watchdog restarts the microcontroller if it is not fed, µs.
const WATCHDOG_US: u64 = 8_000_000;

/// Stall before the first frame after a burst, µs. It is that of low-power mode and 1 µs more, since the time of the part is truncated.
const STALL_US: u64 = 76;

/// Time in which the flash memory takes a record, µs: one sector is erased and ten pages are programmed (Winbond,
/// W25Q16JV).
const FLASH_WRITE_US: u64 = 50_000;

/// A simulated device: the application, the virtual sensor, and both ends of the serial link. Serial transfers take no
/// virtual time.
pub struct Device {
    app: App,
    board: SimulatedBoard,
    memory: &'static RetainedMemory,
    /// True if restarts are carried out and the watchdog runs.
    restarting: bool,
}

/// The simulated board: everything but the application.
struct SimulatedBoard {
    bus: FaultyBus,
    now_us: u64,
    sampler: Sampler<'static>,
    estimators: Estimators<'static>,
    arrivals: Consumer<'static, TimedBurst>,
    transmit_queue: TransmitQueue<'static>,
    outgoing: Consumer<'static, u8>,
    sent: Vec<u8>,
    received: VecDeque<u8>,
    restarts: u32,
    fed_us: u64,
    /// The serial clock in Hz if it cannot be changed.
    fixed_sck_hz: Option<u32>,
    /// True if the sensor's RST line is connected.
    reset_line: bool,
    /// Time for which the sensor delivered usable samples, µs.
    usable_us: u64,
    /// Data-ready edges that have raised an interrupt.
    edges: u64,
    audit: SampleAudit,
    /// The record that survives a loss of power.
    record: Option<Vec<u8>>,
    meter_readings: u32,
}

impl Device {
    /// Starts the application as after a reset by the pin, with a running sensor and the contents of the retained
    /// memory.
    ///
    /// Queues and statistics, 50 kB, are leaked: on the target they are statics.
    pub fn new(part: VirtualAdis16405, memory: &'static RetainedMemory) -> Self {
        Self::started_by(BootCause::Pin, part, memory)
    }

    /// Starts the application with this cause.
    pub fn started_by(cause: BootCause, part: VirtualAdis16405, memory: &'static RetainedMemory) -> Self {
        let now_us = part.now() / 1000;
        let mut board = SimulatedBoard::new(FaultyBus::new(EmulatedBus::with_sck_hz(part, SCK_HZ)), now_us);
        let app = board.boot(cause, memory);
        Self { app, board, memory, restarting: false }
    }

    /// Makes the device carry out restarts, including those by the watchdog.
    #[must_use]
    pub fn with_restarts(mut self) -> Self {
        self.restarting = true;
        self
    }

    /// Makes a device whose serial clock cannot be changed, Hz.
    #[must_use]
    pub fn with_fixed_clock(mut self, sck_hz: u32) -> Self {
        self.board.fixed_sck_hz = Some(sck_hz);
        self
    }

    /// Makes a device that connects the sensor's RST line.
    #[must_use]
    pub fn with_reset_line(mut self) -> Self {
        self.board.reset_line = true;
        self
    }

    /// Makes a device with a USB port whose host does not read.
    #[must_use]
    pub fn with_unread_usb(mut self) -> Self {
        let (to_port, _unread) = Box::leak(Box::new(TransmitBuffer::new())).split();
        self.board.transmit_queue = self.board.transmit_queue.with_usb(Some(to_port));
        self
    }

    /// The injected faults, for changes.
    pub fn faults(&self) -> RefMut<'_, InjectedFaults> {
        self.board.bus.faults().borrow_mut()
    }

    /// Time for which the sensor delivered usable samples, µs: it was sampling and no fault hid the samples.
    pub fn usable_us(&self) -> u64 {
        self.board.usable_us
    }

    /// The audit of the samples since the last call.
    pub fn take_audit(&mut self) -> SampleAudit {
        std::mem::take(&mut self.board.audit)
    }

    /// Number of times that the application has read the load figures of the board.
    pub fn meter_readings(&self) -> u32 {
        self.board.meter_readings
    }

    /// Data-ready edges that have raised an interrupt.
    pub fn edges(&self) -> u64 {
        self.board.edges
    }

    /// Retained memory without valid contents.
    pub fn blank_memory() -> &'static RetainedMemory {
        Box::leak(Box::new(blank_memory()))
    }

    /// Sends `keys` to the device, as a terminal does.
    pub fn press(&mut self, keys: &[u8]) {
        self.board.received.extend(keys);
    }

    /// Advances virtual time to `until_us` and returns the bytes that the device sent meanwhile.
    pub fn run_until(&mut self, until_us: u64) -> Vec<u8> {
        self.turn();
        while self.board.now_us < until_us {
            let ready_us = self.board.bus.bus().part().next_data_ready() / 1000 + 1;
            let next_us = ready_us.min(self.board.now_us + WAKE_US).min(until_us);
            let before = self.board.bus.bus().part().samples();
            self.board.advance_to(next_us);
            if self.board.bus.bus().part().samples() > before {
                let edges = self.faults().edges();
                (0..edges).for_each(|_| self.board.data_ready());
            }
            self.turn();
        }
        std::mem::take(&mut self.board.sent)
    }

    /// The bus and the part on it.
    pub fn bus(&self) -> &EmulatedBus {
        self.board.bus.bus()
    }

    /// Number of restarts by the application and by the watchdog.
    pub fn restarts(&self) -> u32 {
        self.board.restarts
    }

    /// Switches the supply of board and sensor off and on. Only what is stored without power is kept.
    #[must_use]
    pub fn power_cycled(self, part: VirtualAdis16405) -> Self {
        let record = self.board.record;
        let memory = Self::blank_memory();
        let mut board = SimulatedBoard::new(FaultyBus::new(EmulatedBus::with_sck_hz(part, SCK_HZ)), 0);
        board.record = record;
        let app = board.boot(BootCause::PowerOn, memory);
        Self { app, board, memory, restarting: self.restarting }
    }

    fn turn(&mut self) {
        let restarts = self.board.restarts;
        while self.app.turn(&mut self.board) && self.board.restarts == restarts {
            self.board.transmit();
        }
        self.board.transmit();
        if !self.restarting {
            return;
        }
        let starved = self.board.now_us > self.board.fed_us + WATCHDOG_US;
        self.board.restarts += u32::from(starved);
        if self.board.restarts > restarts {
            let cause = if starved { BootCause::Watchdog } else { BootCause::Software };
            self.app = self.board.boot(cause, self.memory);
        }
    }
}

impl SimulatedBoard {
    fn new(bus: FaultyBus, now_us: u64) -> Self {
        let (to_estimators, arrivals) = Box::leak(Box::new(BurstQueue::new())).split();
        let (to_port, outgoing) = Box::leak(Box::new(TransmitBuffer::new())).split();
        let statistics = Box::leak(Box::new(Statistics::new()));
        Self {
            bus,
            now_us,
            sampler: Sampler::new(to_estimators),
            estimators: Estimators::new(statistics, FIRST_CONFIG),
            arrivals,
            transmit_queue: TransmitQueue::new(to_port),
            outgoing,
            sent: Vec::new(),
            received: VecDeque::new(),
            restarts: 0,
            fed_us: now_us,
            fixed_sck_hz: None,
            reset_line: false,
            usable_us: 0,
            edges: 0,
            audit: SampleAudit::default(),
            record: None,
            meter_readings: 0,
        }
    }

    /// Starts the application; everything that is not retained is new.
    fn boot(&mut self, cause: BootCause, memory: &'static RetainedMemory) -> App {
        let fresh = Self::new(self.bus.clone(), self.now_us);
        let (sent, received) = (std::mem::take(&mut self.sent), std::mem::take(&mut self.received));
        let record = self.record.take();
        let Self { restarts, fixed_sck_hz, reset_line, usable_us, edges, audit, .. } = *self;
        *self = Self { sent, received, restarts, fixed_sck_hz, reset_line, usable_us, edges, audit, record, ..fresh };
        let start = Start {
            boot: Boot { cause, ..Boot::default() },
            retained: RetainedRam::open(memory),
            finished: Box::leak(Box::new(FinishedEpoch::EMPTY)),
        };
        App::new(start, self)
    }

    fn advance_to(&mut self, us: u64) {
        let sampling = self.bus.bus().part().next_data_ready() != u64::MAX;
        if sampling && !self.bus.faults().borrow().hide_samples() {
            self.usable_us += us.saturating_sub(self.now_us);
        }
        self.bus.bus().advance_to(us * 1000);
        self.now_us = self.now_us.max(us);
    }

    /// Takes over the time of the part, which transactions and delays advance. True if it has advanced.
    fn follow_part(&mut self) -> bool {
        let now_us = self.now_us.max(self.bus.bus().part().now() / 1000);
        if !self.bus.faults().borrow().hide_samples() {
            self.usable_us += now_us - self.now_us;
        }
        std::mem::replace(&mut self.now_us, now_us) < now_us
    }

    /// Runs the two sampling interrupts and the interrupt of the estimators.
    fn data_ready(&mut self) {
        let mut received = None;
        if self.edge() == EdgeAction::StartBurst {
            let (sent, sample) = (*self.bus.bus().part().counts(), self.bus.bus().part().samples());
            let mut answer = [0; BURST_BYTES];
            let Ok(()) = self.bus.transfer(&mut answer, &BURST_REQUEST);
            let fails = self.bus.faults().borrow_mut().fails_transfer();
            self.sampler.transfer_ended((!fails).then_some(&answer));
            self.follow_part();
            let burst = (!fails).then(|| Burst::from_bytes(&answer));
            received = burst.map(|burst| Received { sent, sample, burst, lengths: lengths(&self.estimators) });
        }
        if !self.bus.faults().borrow().no_estimators {
            estimate(&mut self.estimators, &mut self.transmit_queue, &mut self.arrivals);
            if let Some(received) = received {
                self.audit.add(&received, self.now_us, &self.estimators);
            }
        }
    }

    /// Passes one edge, or many in a row if the line oscillates, or none while it is masked.
    fn edge(&mut self) -> EdgeAction {
        let edges = if self.bus.faults().borrow().oscillates { 1000 } else { 1 };
        let mut first = EdgeAction::Ignore;
        for k in 0..edges {
            if self.sampler.activity().is_masked {
                break;
            }
            let action = self.sampler.data_ready(self.now_us);
            self.edges += 1;
            first = if k == 0 { action } else { first };
        }
        first
    }

    fn transmit(&mut self) {
        if !self.bus.faults().borrow().no_transmission {
            self.sent.extend(std::iter::from_fn(|| self.outgoing.dequeue()));
        }
    }
}

impl Board for SimulatedBoard {
    fn now_us(&mut self) -> u64 {
        if self.follow_part() {
            // A delay of the driver feeds the watchdog, as on a board.
            self.fed_us = self.now_us;
        }
        self.now_us
    }

    fn sensor_bus(&mut self) -> (impl SpiDevice<u8>, impl DelayNs) {
        (self.bus.clone(), self.bus.bus().delay())
    }

    fn set_clock_limit(&mut self, limit_hz: u32) -> u32 {
        let sck_hz = self.fixed_sck_hz.unwrap_or(limit_hz.min(SCK_HZ));
        self.bus.bus().part_mut().set_sck_hz(Some(sck_hz));
        sck_hz
    }

    fn set_sampling(&mut self, enabled: bool) {
        self.sampler.set_enabled(enabled);
        if !enabled {
            let stalled_us = self.now_us() + STALL_US;
            self.advance_to(stalled_us);
        }
    }

    /// Nothing is left to reset: transfers of the emulated bus are complete when they return.
    fn reset_bus(&mut self) {}

    fn reset_sensor(&mut self) -> bool {
        if self.reset_line {
            self.bus.reset_part();
        }
        self.reset_line
    }

    fn set_bus_timing(&mut self, timing: BusTiming) {
        if timing == BusTiming::SLOW {
            let mut faults = self.bus.faults().borrow_mut();
            faults.frames = faults.frames.filter(|(_, end)| *end != FaultEnd::SlowBus);
        }
    }

    fn frame_times(&mut self) -> FrameTimes {
        self.bus.take_frame_times()
    }

    fn data_ready_width_us(&mut self, limit_us: u32) -> Option<u32> {
        let (now_us, next_us) = (self.now_us(), self.bus.bus().part().next_data_ready() / 1000 + 1);
        if self.bus.faults().borrow().no_data_ready || next_us > now_us + u64::from(limit_us) {
            self.advance_to(now_us + u64::from(limit_us));
            return None;
        }
        self.advance_to(next_us);
        while self.bus.bus().part().pin(1) {
            self.advance_to(self.now_us + 1);
        }
        Some((self.now_us - next_us) as u32)
    }

    fn sampling_activity(&mut self) -> SamplingActivity {
        self.sampler.activity()
    }

    fn estimators<R>(&mut self, access: impl FnOnce(&mut Estimators<'static>) -> R) -> R {
        access(&mut self.estimators)
    }

    fn transmit_queue<R>(&mut self, access: impl FnOnce(&mut TransmitQueue<'static>) -> R) -> R {
        access(&mut self.transmit_queue)
    }

    fn receive(&mut self) -> Option<(HostPort, u8)> {
        self.received.pop_front().map(|byte| (HostPort::Uart, byte))
    }

    fn health(&mut self) -> Health {
        self.meter_readings += 1;
        Health::default()
    }

    fn feed_watchdog(&mut self) {
        self.fed_us = self.now_us;
    }

    fn restart(&mut self) {
        self.restarts += 1;
    }

    fn keeps_record(&mut self) -> bool {
        true
    }

    fn read_record(&mut self, record: &mut [u8]) -> Option<usize> {
        let kept = self.record.as_ref()?;
        record.get_mut(..kept.len())?.copy_from_slice(kept);
        Some(kept.len())
    }

    fn write_record(&mut self, record: &[u8]) -> Result<(), StoreError> {
        let written_us = self.now_us() + FLASH_WRITE_US;
        self.advance_to(written_us);
        self.record = (!record.is_empty()).then(|| record.to_vec());
        Ok(())
    }
}
