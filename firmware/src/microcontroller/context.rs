//! The [`Board`] of the main loop, over the resources that it shares with the interrupts.

use super::processor::{ESTIMATOR_CYCLES, LOST_BYTES, SAMPLING_CYCLES, stack};
use super::sensor_spi::{BurstEnd, SensorSpi};
use super::settings_flash::SettingsFlash;
use super::{DataReadyPin as _, Microcontroller};
use crate::acquisition::{EdgeAction, Sampler, SamplingActivity, TimedBurst};
use crate::board::{Board, BrownOutLevel, BusTiming, FrameTimes, Uptime};
use crate::bus_frame::BusFault;
use crate::receive::{HostPort, ReceivedBytes};
use crate::sample_intake::Estimators;
use crate::settings_store::{SettingsStore, StoreError};
use crate::transmit::TransmitQueue;
use crate::watchdog::{Feeder, FeedingDelay};
use core::sync::atomic::Ordering::Relaxed;
use embedded_hal::delay::DelayNs;
use embedded_hal::digital::OutputPin;
use embedded_hal::spi::{ErrorType, Operation, SpiDevice};
use heapless::spsc::Producer;
use link::Health;
use rtic::Mutex;

/// Pause between a burst and the first frame after it, µs: the stall of low-power mode.
const STALL_US: u32 = 75;
/// Time for which RST is low, µs, as in the Linux driver; the data sheet gives no minimum.
const RESET_US: u32 = 100;
/// Time after which a burst is abandoned, µs; the longest takes 1.5 ms (164 kHz, gaps of 16 µs).
const BURST_US: u32 = 5_000;

/// The resources shared with the two interrupts of sampling.
pub struct SharedSampling<M: Microcontroller> {
    uptime: Uptime,
    bus: SensorSpi<M::Spi, M::Select>,
    sampler: Sampler<'static>,
    line: M::DataReady,
}

impl<M: Microcontroller> SharedSampling<M> {
    /// Sampling that queues its bursts in `queue`.
    pub fn new(bus: SensorSpi<M::Spi, M::Select>, line: M::DataReady, queue: Producer<'static, TimedBurst>) -> Self {
        Self { uptime: Uptime::new(M::counter()), bus, sampler: Sampler::new(queue), line }
    }

    fn now_us(&mut self) -> u64 {
        self.uptime.at(M::counter())
    }

    /// Handles a data-ready edge: starts the transfer of a burst by DMA.
    pub fn data_ready(&mut self) {
        self.line.clear();
        let now_us = self.now_us();
        match self.sampler.data_ready(now_us) {
            EdgeAction::StartBurst => self.bus.start_burst(),
            EdgeAction::Mask => self.line.set_masked(true),
            EdgeAction::Ignore => {}
        }
    }

    /// Handles the end of the transfer: queues the burst.
    pub fn transfer_ended(&mut self) {
        match self.bus.end_burst() {
            BurstEnd::MoreWords => {}
            BurstEnd::Complete(received) => self.sampler.transfer_ended(Some(received)),
            BurstEnd::Failed => self.sampler.transfer_ended(None),
        }
    }
}

/// The resources shared with the interrupt of the estimators.
pub struct SharedEstimation {
    /// The estimators.
    pub estimators: Estimators<'static>,
    /// The queues to the serial ports.
    pub transmit_queue: TransmitQueue<'static>,
}

/// A [`Board`] made of what it shares with its interrupts; access disables only those.
pub struct BoardContext<'r, M: Microcontroller, S, E> {
    sampling: S,
    estimation: E,
    reset_line: &'r mut Option<M::Output>,
    received: &'r mut ReceivedBytes<'static>,
    request_transmission: fn(),
    abandon_burst: fn(),
    asleep_us: u64,
    watchdog: Feeder<M>,
}

impl<'r, M: Microcontroller, S, E> BoardContext<'r, M, S, E> {
    /// `received` has the bytes from the serial ports. `request_transmission` requests their interrupts. `abandon_burst` requests the
    /// interrupt of the end of a burst, which fails if it is still being transferred.
    pub fn new(
        (sampling, estimation): (S, E),
        reset_line: &'r mut Option<M::Output>,
        received: &'r mut ReceivedBytes<'static>,
        request_transmission: fn(),
        abandon_burst: fn(),
    ) -> Self {
        let watchdog = Feeder::default();
        Self { sampling, estimation, reset_line, received, request_transmission, abandon_burst, asleep_us: 0, watchdog }
    }

    fn store() -> Option<SettingsStore<SettingsFlash<M::Flash>>> {
        SettingsFlash::store()
    }
}

impl<M: Microcontroller, S: Mutex<T = SharedSampling<M>>, E: Mutex<T = SharedEstimation>> Board
    for BoardContext<'_, M, S, E>
{
    fn now_us(&mut self) -> u64 {
        self.sampling.lock(|sampling| sampling.now_us())
    }

    /// Returns before the waking interrupt is served.
    fn sleep(&mut self) {
        cortex_m::interrupt::free(|_| {
            let fell_asleep = M::counter();
            cortex_m::asm::wfi();
            self.asleep_us += u64::from(M::counter().wrapping_sub(fell_asleep));
        });
    }

    fn sensor_bus(&mut self) -> (impl SpiDevice<u8>, impl DelayNs) {
        (LockedBus(&mut self.sampling), FeedingDelay(&mut self.watchdog))
    }

    fn set_clock_limit(&mut self, limit_hz: u32) -> u32 {
        self.sampling.lock(|sampling| sampling.bus.set_clock_limit(limit_hz))
    }

    fn reset_bus(&mut self) {
        self.sampling.lock(|sampling| sampling.bus.reset());
    }

    fn reset_sensor(&mut self) -> bool {
        let Some(line) = self.reset_line else { return false };
        let is_low = line.set_low().is_ok();
        FeedingDelay(&mut self.watchdog).delay_us(RESET_US);
        line.set_high().is_ok() && is_low
    }

    fn set_bus_timing(&mut self, timing: BusTiming) {
        self.sampling.lock(|sampling| sampling.bus.select.timing = timing);
    }

    fn frame_times(&mut self) -> FrameTimes {
        self.sampling.lock(|sampling| sampling.bus.select.take_times())
    }

    fn data_ready_width_us(&mut self, limit_us: u32) -> Option<u32> {
        let start = M::counter();
        let mut edge = |active: bool| loop {
            let now = M::counter();
            if self.sampling.lock(|sampling| sampling.line.is_active()) == active {
                return Some(now);
            }
            if now.wrapping_sub(start) > limit_us {
                return None;
            }
            self.watchdog.feed();
        };
        edge(false)?;
        let risen = edge(true)?;
        Some(edge(false)?.wrapping_sub(risen))
    }

    fn set_sampling(&mut self, enabled: bool) {
        self.sampling.lock(|sampling| sampling.sampler.set_enabled(enabled));
        if enabled {
            self.sampling.lock(|sampling| sampling.line.set_masked(false));
        } else {
            let start = M::counter();
            while self.sampling.lock(|sampling| sampling.sampler.is_reading()) {
                if M::counter().wrapping_sub(start) > BURST_US {
                    (self.abandon_burst)();
                }
            }
            FeedingDelay(&mut self.watchdog).delay_us(STALL_US);
        }
    }

    fn sampling_activity(&mut self) -> SamplingActivity {
        self.sampling.lock(|sampling| sampling.sampler.activity())
    }

    fn estimators<R>(&mut self, access: impl FnOnce(&mut Estimators<'static>) -> R) -> R {
        self.estimation.lock(|estimation| access(&mut estimation.estimators))
    }

    fn transmit_queue<R>(&mut self, access: impl FnOnce(&mut TransmitQueue<'static>) -> R) -> R {
        let result = self.estimation.lock(|estimation| access(&mut estimation.transmit_queue));
        (self.request_transmission)();
        result
    }

    fn receive(&mut self) -> Option<(HostPort, u8)> {
        self.received.next()
    }

    fn health(&mut self) -> Health {
        let (stack_bytes, stack_size) = stack();
        let asleep_permille = (1000 * self.asleep_us).checked_div(self.now_us()).unwrap_or(0);
        Health {
            serial_overruns: LOST_BYTES.iter().map(|lost| lost.load(Relaxed)).fold(0, u32::saturating_add),
            awake_permille: 1000_u32.saturating_sub(asleep_permille as u32),
            sampling_cycles: SAMPLING_CYCLES.load(Relaxed),
            estimator_cycles: ESTIMATOR_CYCLES.load(Relaxed),
            stack_bytes,
            stack_size,
            ..Health::default()
        }
    }

    fn feed_watchdog(&mut self) {
        self.watchdog.feed();
    }

    fn restart(&mut self) {
        M::restart()
    }

    fn program_brown_out(&mut self) -> BrownOutLevel {
        M::program_brown_out()
    }

    fn keeps_record(&mut self) -> bool {
        Self::store().is_some()
    }

    fn read_record(&mut self, record: &mut [u8]) -> Option<usize> {
        Self::store()?.read(record)
    }

    fn write_record(&mut self, record: &[u8]) -> Result<(), StoreError> {
        Self::store().ok_or(StoreError::NoMemory)?.replace(record)
    }

    fn start_boot_loader(&mut self) -> bool {
        M::start_boot_loader()
    }
}

/// The bus, locked for one transaction at a time.
struct LockedBus<'a, S>(&'a mut S);

impl<S> ErrorType for LockedBus<'_, S> {
    type Error = BusFault;
}

impl<M: Microcontroller, S: Mutex<T = SharedSampling<M>>> SpiDevice<u8> for LockedBus<'_, S> {
    fn transaction(&mut self, operations: &mut [Operation<'_, u8>]) -> Result<(), Self::Error> {
        self.0.lock(|sampling| sampling.bus.transaction(operations))
    }
}
