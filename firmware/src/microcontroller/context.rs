//! The [`Board`] that the main loop has, over what it shares with the interrupts.

use super::processor::{ESTIMATOR_CYCLES, LOST_BYTES, SAMPLING_CYCLES, stack};
use super::settings_flash::SettingsFlash;
use super::{BoardSupport, Microcontroller};
use crate::acquisition::{Sampler, SamplingActivity};
use crate::board::{
    Board, BoardMeters, BrownOutLevel, BusTiming, DataReadyLine as _, FrameTimes, SensorBus as _, Uptime,
};
use crate::receive::{HostPort, ReceivedBytes};
use crate::sample_intake::Estimators;
use crate::settings_store::{SettingsStore, StoreError};
use crate::transmit::TransmitQueue;
use crate::watchdog::{Feeder, FeedingDelay};
use core::sync::atomic::Ordering::Relaxed;
use embedded_hal::delay::DelayNs;
use embedded_hal::digital::OutputPin;
use embedded_hal::spi::{ErrorType, Operation, SpiDevice};

/// Before the first frame after a burst, µs: the stall of low-power mode.
const STALL_US: u32 = 75;
/// RST low, µs, as with the driver of Linux; the data sheet has no minimum.
const RESET_US: u32 = 100;
/// Abandons a burst, µs; the longest takes 1.5 ms (164 kHz, gaps of 16 µs).
const BURST_US: u32 = 5_000;

/// Resources of main loop and interrupts; access disables only the interrupts that share them.
pub trait SharedResources {
    /// The board.
    type Board: BoardSupport;
    /// Shared with sampling.
    fn uptime<R>(&mut self, access: impl FnOnce(&mut Uptime) -> R) -> R;
    /// The sensor's bus, shared with sampling.
    fn bus<R>(&mut self, access: impl FnOnce(&mut BusOf<Self>) -> R) -> R;
    /// Shared with sampling.
    fn sampler<R>(&mut self, access: impl FnOnce(&mut Sampler<'static>) -> R) -> R;
    /// The data-ready line, shared with sampling.
    fn line<R>(&mut self, access: impl FnOnce(&mut <Self::Board as BoardSupport>::DataReady) -> R) -> R;
    /// Shared with their interrupt.
    fn estimators<R>(&mut self, access: impl FnOnce(&mut Estimators<'static>) -> R) -> R;
    /// Shared with the interrupt of the estimators.
    fn transmit_queue<R>(&mut self, access: impl FnOnce(&mut TransmitQueue<'static>) -> R) -> R;
    /// Requests the interrupts of the serial ports, which transmit what is queued.
    fn request_transmission();
    /// Requests the interrupt of the end of a burst, which fails if it is still being transferred.
    fn abandon_burst();
}

type BusOf<S> = <<S as SharedResources>::Board as BoardSupport>::Bus;
type MicrocontrollerOf<S> = <<S as SharedResources>::Board as BoardSupport>::Microcontroller;

/// A [`Board`] made of what it shares with its interrupts.
pub struct BoardContext<'r, S: SharedResources> {
    shared: S,
    reset_line: &'r mut Option<<S::Board as BoardSupport>::ResetLine>,
    received: &'r mut ReceivedBytes<'static>,
    asleep_us: u64,
    watchdog: Feeder<MicrocontrollerOf<S>>,
}

impl<'r, S: SharedResources> BoardContext<'r, S> {
    /// `received` has the bytes from the serial ports.
    pub fn new(
        shared: S,
        reset_line: &'r mut Option<<S::Board as BoardSupport>::ResetLine>,
        received: &'r mut ReceivedBytes<'static>,
    ) -> Self {
        Self { shared, reset_line, received, asleep_us: 0, watchdog: Feeder::default() }
    }

    fn counter() -> u32 {
        <MicrocontrollerOf<S> as crate::bus_frame::MicrosecondCounter>::counter()
    }

    fn store() -> Option<SettingsStore<SettingsFlash<<MicrocontrollerOf<S> as Microcontroller>::Flash>>> {
        SettingsFlash::store()
    }
}

impl<S: SharedResources> Board for BoardContext<'_, S> {
    type Bus<'a>
        = LockedBus<'a, S>
    where
        Self: 'a;
    type Delay<'a>
        = FeedingDelay<'a, MicrocontrollerOf<S>>
    where
        Self: 'a;

    fn now_us(&mut self) -> u64 {
        self.shared.uptime(|uptime| uptime.at(Self::counter()))
    }

    /// Returns before the waking interrupt is served.
    fn sleep(&mut self) {
        cortex_m::interrupt::free(|_| {
            let fell_asleep = Self::counter();
            cortex_m::asm::wfi();
            self.asleep_us += u64::from(Self::counter().wrapping_sub(fell_asleep));
        });
    }

    fn sensor_bus(&mut self) -> (Self::Bus<'_>, Self::Delay<'_>) {
        (LockedBus(&mut self.shared), FeedingDelay(&mut self.watchdog))
    }

    fn set_clock_limit(&mut self, limit_hz: u32) -> u32 {
        self.shared.bus(|bus| bus.set_clock_limit(limit_hz))
    }

    fn reset_bus(&mut self) {
        self.shared.bus(|bus| bus.reset());
    }

    fn reset_sensor(&mut self) -> bool {
        let Some(line) = self.reset_line else { return false };
        let is_low = line.set_low().is_ok();
        FeedingDelay(&mut self.watchdog).delay_us(RESET_US);
        line.set_high().is_ok() && is_low
    }

    fn set_bus_timing(&mut self, timing: BusTiming) -> bool {
        self.shared.bus(|bus| bus.set_timing(timing));
        true
    }

    fn frame_times(&mut self) -> Option<FrameTimes> {
        Some(self.shared.bus(|bus| bus.take_frame_times()))
    }

    fn data_ready_width_us(&mut self, limit_us: u32) -> Option<u32> {
        let start = Self::counter();
        let mut edge = |active: bool| loop {
            let now = Self::counter();
            if self.shared.line(|line| line.is_active()) == active {
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
        self.shared.sampler(|sampler| sampler.set_enabled(enabled));
        if enabled {
            self.shared.line(|line| line.set_masked(false));
        } else {
            let start = Self::counter();
            while self.shared.sampler(|sampler| sampler.is_reading()) {
                if Self::counter().wrapping_sub(start) > BURST_US {
                    S::abandon_burst();
                }
            }
            FeedingDelay(&mut self.watchdog).delay_us(STALL_US);
        }
    }

    fn sampling_activity(&mut self) -> SamplingActivity {
        self.shared.sampler(|sampler| sampler.activity())
    }

    fn estimators<R>(&mut self, access: impl FnOnce(&mut Estimators<'static>) -> R) -> R {
        self.shared.estimators(access)
    }

    fn transmit_queue<R>(&mut self, access: impl FnOnce(&mut TransmitQueue<'static>) -> R) -> R {
        let result = self.shared.transmit_queue(access);
        S::request_transmission();
        result
    }

    fn receive(&mut self) -> Option<(HostPort, u8)> {
        self.received.next()
    }

    fn meters(&mut self) -> BoardMeters {
        let (stack_bytes, stack_size) = stack();
        BoardMeters {
            asleep_us: self.asleep_us,
            serial_overruns: LOST_BYTES.iter().map(|lost| lost.load(Relaxed)).fold(0, u32::saturating_add),
            sampling_cycles: SAMPLING_CYCLES.load(Relaxed),
            estimator_cycles: ESTIMATOR_CYCLES.load(Relaxed),
            stack_bytes,
            stack_size,
        }
    }

    fn feed_watchdog(&mut self) {
        self.watchdog.feed();
    }

    fn restart(&mut self) {
        MicrocontrollerOf::<S>::restart()
    }

    fn program_brown_out(&mut self) -> BrownOutLevel {
        MicrocontrollerOf::<S>::program_brown_out()
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
        MicrocontrollerOf::<S>::start_boot_loader()
    }
}

/// Locked for one transaction at a time.
pub struct LockedBus<'a, S>(&'a mut S);

impl<S: SharedResources> ErrorType for LockedBus<'_, S> {
    type Error = <BusOf<S> as ErrorType>::Error;
}

impl<S: SharedResources> SpiDevice<u8> for LockedBus<'_, S> {
    fn transaction(&mut self, operations: &mut [Operation<'_, u8>]) -> Result<(), Self::Error> {
        self.0.bus(|bus| bus.transaction(operations))
    }
}
