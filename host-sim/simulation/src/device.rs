//! The firmware's application on the host: the same code as in the image, with the virtual sensor, in virtual time.

use adis16405_driver::{BURST_BYTES, BURST_REQUEST};
use embedded_hal::spi::SpiDevice;
use firmware::retained::{RetainedMemory, blank_memory};
use firmware::{
    App, Board, BoardMeters, BurstQueue, Estimators, FIRST_CONFIG, FinishedEpoch, RetainedRam, Sampler, Start,
    Statistics, TimedBurst, TransmitBuffer, TransmitQueue, estimate,
};
use heapless::spsc::Consumer;
use link::Boot;
use std::collections::VecDeque;
use virtual_sensor::{EmulatedBus, VirtualAdis16405, VirtualDelay};

/// SCK of the sensor's bus, Hz.
const SCK_HZ: u32 = 1_000_000;

/// Time before the first frame after a burst, µs.
const STALL_US: u64 = 75;

/// Longest time between two passes of the main loop, µs.
const WAKE_US: u64 = 100_000;

/// A simulated device: the application, the virtual sensor, and both ends of the serial link, whose transfers take no
/// virtual time.
pub struct Device {
    app: App,
    board: SimulatedBoard,
}

/// The simulated board: all but the application.
struct SimulatedBoard {
    bus: EmulatedBus,
    now_us: u64,
    sampler: Sampler<'static>,
    estimators: Estimators<'static>,
    arrivals: Consumer<'static, TimedBurst>,
    transmit_queue: TransmitQueue<'static>,
    outgoing: Consumer<'static, u8>,
    sent: Vec<u8>,
    received: VecDeque<u8>,
    restarts: u32,
}

impl Device {
    /// Starts the application with a sensor and the contents of the retained memory.
    ///
    /// Queues and statistics, 50 kB, are leaked: on the target they are statics.
    pub fn new(part: VirtualAdis16405, memory: &'static RetainedMemory) -> Self {
        let (to_estimators, arrivals) = Box::leak(Box::new(BurstQueue::new())).split();
        let (to_port, outgoing) = Box::leak(Box::new(TransmitBuffer::new())).split();
        let statistics = Box::leak(Box::new(Statistics::new()));
        let mut board = SimulatedBoard {
            now_us: part.now() / 1000,
            bus: EmulatedBus::with_sck_hz(part, SCK_HZ),
            sampler: Sampler::new(to_estimators),
            estimators: Estimators::new(statistics, FIRST_CONFIG),
            arrivals,
            transmit_queue: TransmitQueue::new(to_port),
            outgoing,
            sent: Vec::new(),
            received: VecDeque::new(),
            restarts: 0,
        };
        let start = Start {
            boot: Boot::default(),
            retained: RetainedRam::open(memory),
            finished: Box::leak(Box::new(FinishedEpoch::EMPTY)),
        };
        Self { app: App::new(start, &mut board), board }
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
            let ready_us = self.board.bus.part().next_data_ready() / 1000 + 1;
            let next_us = ready_us.min(self.board.now_us + WAKE_US).min(until_us);
            let before = self.board.bus.part().samples();
            self.board.advance_to(next_us);
            if self.board.bus.part().samples() > before {
                self.board.data_ready();
            }
            self.turn();
        }
        std::mem::take(&mut self.board.sent)
    }

    /// The bus and the part on it.
    pub fn bus(&self) -> &EmulatedBus {
        &self.board.bus
    }

    /// Number of restarts that the application requested.
    pub fn restarts(&self) -> u32 {
        self.board.restarts
    }

    fn turn(&mut self) {
        while self.app.turn(&mut self.board) {
            self.board.transmit();
        }
        self.board.transmit();
    }
}

impl SimulatedBoard {
    fn advance_to(&mut self, us: u64) {
        self.bus.advance_to(us * 1000);
        self.now_us = us;
    }

    /// The two sampling interrupts and the one of the estimators.
    fn data_ready(&mut self) {
        if self.sampler.data_ready(self.now_us) {
            let mut answer = [0; BURST_BYTES];
            let Ok(()) = self.bus.transfer(&mut answer, &BURST_REQUEST);
            self.sampler.transfer_ended(Some(&answer));
            self.now_us = self.now_us.max(self.bus.part().now() / 1000);
        }
        estimate(&mut self.estimators, &mut self.transmit_queue, &mut self.arrivals);
    }

    fn transmit(&mut self) {
        self.sent.extend(std::iter::from_fn(|| self.outgoing.dequeue()));
    }
}

impl Board for SimulatedBoard {
    type Bus<'a> = EmulatedBus;
    type Delay<'a> = VirtualDelay;

    fn now_us(&mut self) -> u64 {
        // Transactions of the driver advance the part's time.
        self.now_us = self.now_us.max(self.bus.part().now() / 1000);
        self.now_us
    }

    fn sensor_bus(&mut self) -> (EmulatedBus, VirtualDelay) {
        (self.bus.clone(), self.bus.delay())
    }

    fn set_clock_limit(&mut self, limit_hz: u32) -> u32 {
        let sck_hz = limit_hz.min(SCK_HZ);
        self.bus.part_mut().set_sck_hz(Some(sck_hz));
        sck_hz
    }

    fn set_sampling(&mut self, enabled: bool) {
        self.sampler.set_enabled(enabled);
        if !enabled {
            let stalled_us = self.now_us() + STALL_US;
            self.advance_to(stalled_us);
        }
    }

    fn estimators<R>(&mut self, access: impl FnOnce(&mut Estimators<'static>) -> R) -> R {
        access(&mut self.estimators)
    }

    fn transmit_queue<R>(&mut self, access: impl FnOnce(&mut TransmitQueue<'static>) -> R) -> R {
        access(&mut self.transmit_queue)
    }

    fn receive(&mut self) -> Option<u8> {
        self.received.pop_front()
    }

    fn meters(&mut self) -> BoardMeters {
        BoardMeters::default()
    }

    fn feed_watchdog(&mut self) {}

    fn restart(&mut self) {
        self.restarts += 1;
    }
}
