//! The board as the main loop sees it: the trait, and the board context that implements it over a microcontroller's
//! resources and interrupt locks.

use crate::acquisition::{Sampler, SamplingActivity};
use crate::sample_intake::Estimators;
use crate::settings_store::StoreError;
use crate::transmit::TransmitQueue;
use embedded_hal::delay::DelayNs;
use embedded_hal::spi::{ErrorType, Operation, SpiDevice};
use heapless::spsc;
use rtic_core::Mutex;

/// Time before the first frame after a burst in µs: the sensor's longest stall time, that of its low-power mode.
const STALL_US: u32 = 75;
/// Time in µs for which the sensor's RST line is low, as with the driver of Linux; the data sheet has no least time.
const RESET_US: u32 = 100;
/// Time in µs after which a burst is abandoned: the longest one, at 164 kHz with gaps of 16 µs, takes 1.5 ms.
const BURST_US: u32 = 5_000;

/// Times of chip select between two frames in one of the sensor's power modes, in ns.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SelectTiming {
    /// Least time that chip select is high.
    pub high_ns: u32,
    /// Least time from one falling edge of chip select to the next, t_READRATE.
    pub read_ns: u32,
}

/// Times of the sensor's bus that the board keeps whatever the driver does.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct BusTiming {
    /// Between two frames in normal mode.
    pub normal: SelectTiming,
    /// At a serial clock of at most 300 kHz: the sensor is, or may be, in low-power mode.
    pub low_power: SelectTiming,
    /// Pause between two words of a burst in ns; 0 for none. With a pause every word is a DMA transfer of its own, with an
    /// interrupt at its end.
    pub word_gap_ns: u32,
}

impl BusTiming {
    /// Chip select is high for 16 µs, the stall that the manufacturer's own tools keep, or 75 µs, the stall of low-power mode;
    /// frames begin 40 or 150 µs apart (ADIS16400/ADIS16405 data sheet Rev. B, Table 2). Bursts have no pauses, as with the
    /// drivers of Linux and PX4.
    pub const SAFE: Self = Self {
        normal: SelectTiming { high_ns: 16_000, read_ns: 40_000 },
        low_power: SelectTiming { high_ns: 75_000, read_ns: 150_000 },
        word_gap_ns: 0,
    };

    /// For a sensor that answers wrongly with [`SAFE`](Self::SAFE): chip select is high for 50 µs, as with the driver of
    /// Linux, and every word of a burst is followed by the stall of a frame. A burst takes 0.45 ms at 656 kHz.
    pub const CAREFUL: Self = Self {
        normal: SelectTiming { high_ns: 50_000, read_ns: 40_000 },
        low_power: SelectTiming { high_ns: 100_000, read_ns: 150_000 },
        word_gap_ns: 9_000,
    };
}

/// Times of frames on the sensor's bus as the board has made them, in µs, to within one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FrameTimes {
    /// Time for which chip select was low in the last frame.
    pub low_us: u32,
    /// Shortest time for which it was high between two frames.
    pub shortest_high_us: u32,
    /// Shortest time from one falling edge of chip select to the next.
    pub shortest_period_us: u32,
}

impl FrameTimes {
    /// Before the first frame.
    pub const NONE: Self = Self { low_us: 0, shortest_high_us: u32::MAX, shortest_period_us: u32::MAX };
}

/// The sensor's bus, whose serial clock can be changed between two frames.
pub trait SensorBus: SpiDevice<u8> {
    /// Sets the fastest serial clock of at most `limit_hz`, or the slowest one if none is slow enough; returns it in Hz.
    fn set_clock_limit(&mut self, limit_hz: u32) -> u32;
    /// Drops what was received, and disables and enables the peripheral.
    fn reset(&mut self);
    /// Keeps other times from the next frame on.
    fn set_timing(&mut self, timing: BusTiming);
    /// The times of the frames since they were taken last.
    fn take_frame_times(&mut self) -> FrameTimes;
}

/// What the application needs of a board: a [`BoardContext`] on a microcontroller, or a virtual sensor on the host.
pub trait Board {
    /// The sensor's bus, for registers.
    type Bus<'a>: SpiDevice<u8>
    where
        Self: 'a;
    /// Waits between frames and during the self-test.
    type Delay<'a>: DelayNs
    where
        Self: 'a;

    /// Time since the start in microseconds.
    fn now_us(&mut self) -> u64;
    /// The sensor's bus and a delay. To be used only while sampling is disabled.
    fn sensor_bus(&mut self) -> (Self::Bus<'_>, Self::Delay<'_>);
    /// Sets the fastest serial clock of at most `limit_hz`, or the slowest one if none is slow enough; returns it in Hz. To be
    /// used only while sampling is disabled.
    fn set_clock_limit(&mut self, limit_hz: u32) -> u32;
    /// Enables or disables sampling. On return after disabling, no burst is being transferred, and the sensor's stall time
    /// has passed.
    fn set_sampling(&mut self, enabled: bool);
    /// Transfers of bursts so far.
    fn sampling_activity(&mut self) -> SamplingActivity;
    /// Resets the microcontroller's side of the sensor's bus. To be used only while sampling is disabled.
    fn reset_bus(&mut self);
    /// Keeps other times on the sensor's bus. Returns false if the board cannot. To be used only while sampling is disabled.
    fn set_bus_timing(&mut self, _timing: BusTiming) -> bool {
        false
    }
    /// Times of the frames on the sensor's bus since they were asked for last; `None` if the board does not know them.
    fn frame_times(&mut self) -> Option<FrameTimes> {
        None
    }
    /// Width of the next pulse of data ready in µs; `None` if none ends within `limit_us`, or the board does not see the level. To
    /// be used only while sampling is disabled.
    fn data_ready_width_us(&mut self, _limit_us: u32) -> Option<u32> {
        None
    }
    /// Pulses the sensor's RST line. Returns false if the board does not connect it.
    fn reset_sensor(&mut self) -> bool {
        false
    }
    /// Gives access to the estimators, which process no burst meanwhile: `access` must be short.
    fn estimators<R>(&mut self, access: impl FnOnce(&mut Estimators<'static>) -> R) -> R;
    /// Gives access to the transmit queue, and has what is queued transmitted.
    fn transmit_queue<R>(&mut self, access: impl FnOnce(&mut TransmitQueue<'static>) -> R) -> R;
    /// The next received byte, and the port that has received it.
    fn receive(&mut self) -> Option<(HostPort, u8)>;
    /// Load figures of the board.
    fn meters(&mut self) -> BoardMeters;
    /// Feeds the watchdog.
    fn feed_watchdog(&mut self);
    /// Restarts the microcontroller; retained RAM keeps its content.
    fn restart(&mut self);
    /// Programs the level of the supply below which the microcontroller is reset into memory that keeps it.
    fn program_brown_out(&mut self) -> BrownOutLevel {
        BrownOutLevel::Fixed
    }
    /// Whether the board has memory that keeps a record without power.
    fn keeps_record(&mut self) -> bool {
        false
    }
    /// Copies the record in memory that keeps it without power to `record`, and returns its length; `None` if there is none.
    fn read_record(&mut self, _record: &mut [u8]) -> Option<usize> {
        None
    }
    /// Replaces that record, or erases it if `record` is empty. Interrupts may be disabled for the time that the memory takes: to be used
    /// only while sampling is disabled.
    ///
    /// # Errors
    /// The board has no such memory, or it does not take the record. The one before is kept.
    fn write_record(&mut self, _record: &[u8]) -> Result<(), StoreError> {
        Err(StoreError::NoMemory)
    }
    /// Starts the boot loader that takes an image over USB. Returns false if the board has none that a program can start.
    fn start_boot_loader(&mut self) -> bool {
        false
    }
}

/// A serial port to the host.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum HostPort {
    /// On pins of the board.
    Uart,
    /// On its USB connector.
    Usb,
}

impl HostPort {
    /// Number of ports.
    pub const COUNT: usize = 2;
}

/// The queues of received bytes.
pub struct ReceivedBytes<'q> {
    /// From the UART.
    pub uart: spsc::Consumer<'q, u8>,
    /// From the USB port of a board that has one.
    pub usb: Option<spsc::Consumer<'q, u8>>,
}

impl ReceivedBytes<'_> {
    fn next(&mut self) -> Option<(HostPort, u8)> {
        let usb = || self.usb.as_mut().and_then(|queue| queue.dequeue()).map(|byte| (HostPort::Usb, byte));
        self.uart.dequeue().map(|byte| (HostPort::Uart, byte)).or_else(usb)
    }
}

/// The brown-out level of a microcontroller after the request to program it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum BrownOutLevel {
    /// It needs no programming: it is set at every start, or cannot be set.
    Fixed,
    /// It was programmed before.
    Set,
    /// It was programmed now.
    Programmed,
    /// It could not be programmed.
    Failed,
}

/// Load figures of a board since it started.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct BoardMeters {
    /// Time that the processor slept, in microseconds.
    pub asleep_us: u64,
    /// Received bytes lost because they came faster than they were read.
    pub serial_overruns: u32,
    /// Longest sampling interrupt in processor cycles.
    pub sampling_cycles: u32,
    /// Longest run of the estimators in processor cycles, preemption included.
    pub estimator_cycles: u32,
    /// Largest stack depth in bytes.
    pub stack_bytes: u32,
    /// Size of the stack in bytes.
    pub stack_size: u32,
}

/// Microseconds since the start, from a microsecond counter of 32 bits.
#[derive(Debug, Clone, Copy)]
pub struct Uptime {
    last: u32,
    total_us: u64,
}

impl Uptime {
    /// Time 0 at counter value `counter`.
    #[must_use]
    pub const fn new(counter: u32) -> Self {
        Self { last: counter, total_us: 0 }
    }

    /// The time at counter value `counter`; must be called at least once in 71 minutes, in which the counter wraps.
    pub fn at(&mut self, counter: u32) -> u64 {
        self.total_us += u64::from(counter.wrapping_sub(self.last));
        self.last = counter;
        self.total_us
    }
}

/// What differs from one microcontroller to the next.
pub trait Chip {
    /// A counter of microseconds that wraps at 2³².
    fn microseconds(&mut self) -> u32;
    /// Sleeps until an interrupt is pending and returns before it is served. `clock` is called with the counter right before
    /// and right after the sleep, while interrupts are disabled.
    fn sleep(&mut self, clock: impl FnMut(u32));
    /// Requests the interrupt that transmits what is queued.
    fn transmit(&mut self);
    /// Requests the interrupt of the end of a burst, which then fails if it is still being transferred.
    fn abandon_burst(&mut self);
    /// Feeds the watchdog.
    fn feed(&mut self);
    /// Restarts the microcontroller.
    fn restart(&mut self);
    /// Load figures, without the time asleep.
    fn meters(&mut self) -> BoardMeters;
    /// Sets the sensor's RST line active, which is low, or inactive. Returns false if it is not connected.
    fn set_reset_line(&mut self, active: bool) -> bool;
    /// Programs the brown-out level.
    fn program_brown_out(&mut self) -> BrownOutLevel;
    /// As [`Board::keeps_record`].
    fn keeps_record(&mut self) -> bool;
    /// As [`Board::read_record`].
    fn read_record(&mut self, record: &mut [u8]) -> Option<usize>;
    /// As [`Board::write_record`].
    fn write_record(&mut self, record: &[u8]) -> Result<(), StoreError>;
    /// Starts the boot loader. Returns false if there is none.
    fn start_boot_loader(&mut self) -> bool;
}

/// The data-ready line, whose edges raise an interrupt.
pub trait DataReadyLine {
    /// Ignores edges, or takes them again; those that came meanwhile are forgotten.
    fn set_masked(&mut self, masked: bool);
    /// The level of the line.
    fn is_active(&mut self) -> bool;
}

/// What the main loop shares with the interrupts. Each lock disables only the interrupts that share the resource.
pub struct Locks<T, B, S, D, E, Q> {
    /// [`Uptime`], shared with sampling.
    pub uptime: T,
    /// The sensor's bus, shared with sampling.
    pub bus: B,
    /// [`Sampler`], shared with sampling.
    pub sampler: S,
    /// The data-ready line, shared with sampling.
    pub data_ready: D,
    /// [`Estimators`], shared with the estimators' interrupt.
    pub estimators: E,
    /// [`TransmitQueue`], shared with the estimators' interrupt.
    pub transmit_queue: Q,
}

/// A [`Board`] made of a chip and of what it shares with its interrupts.
pub struct BoardContext<'r, C, T, B, S, D, E, Q> {
    chip: C,
    locks: Locks<T, B, S, D, E, Q>,
    received: &'r mut ReceivedBytes<'static>,
    asleep_us: u64,
    watchdog: WatchdogFeeder,
}

/// Feeds the watchdog only when the microsecond counter has advanced since the last time: without a running counter no wait
/// would end, and the watchdog must restart the microcontroller.
#[derive(Clone, Copy)]
struct WatchdogFeeder {
    /// The counter when the watchdog was fed last.
    fed_at: u32,
}

impl WatchdogFeeder {
    fn feed(&mut self, chip: &mut impl Chip) {
        let now = chip.microseconds();
        if now != self.fed_at {
            self.fed_at = now;
            chip.feed();
        }
    }
}

/// Prolongs the time of a watchdog that is shorter than a step of the main loop: a periodic interrupt feeds it as long as the
/// main loop has done so within the last ticks.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct WatchdogExtension {
    /// Feedings by the main loop that have been seen.
    feedings: u32,
    ticks_left: u32,
}

impl WatchdogExtension {
    /// Before the first feeding.
    pub const START: Self = Self { feedings: 0, ticks_left: 0 };

    /// To be called at every tick with the number of feedings by the main loop so far. Returns whether the watchdog is to be
    /// fed: for `ticks` ticks after each of them.
    pub fn tick(&mut self, feedings: u32, ticks: u32) -> bool {
        self.ticks_left = if feedings == self.feedings { self.ticks_left.saturating_sub(1) } else { ticks };
        self.feedings = feedings;
        self.ticks_left > 0
    }
}

impl<'r, C: Chip, T, B, S, D, E, Q> BoardContext<'r, C, T, B, S, D, E, Q> {
    /// `received` has the bytes from the serial ports.
    pub fn new(chip: C, locks: Locks<T, B, S, D, E, Q>, received: &'r mut ReceivedBytes<'static>) -> Self {
        Self { chip, locks, received, asleep_us: 0, watchdog: WatchdogFeeder { fed_at: 0 } }
    }

    /// Sleeps until the next interrupt.
    pub(crate) fn sleep(&mut self) {
        let mut fell_asleep = None;
        let asleep_us = &mut self.asleep_us;
        self.chip.sleep(|now| match fell_asleep {
            None => fell_asleep = Some(now),
            Some(then) => *asleep_us += u64::from(now.wrapping_sub(then)),
        });
    }
}

impl<C, T, B, S, D, E, Q> Board for BoardContext<'_, C, T, B, S, D, E, Q>
where
    C: Chip,
    T: Mutex<T = Uptime>,
    B: Mutex<T: SensorBus>,
    S: Mutex<T = Sampler<'static>>,
    D: Mutex<T: DataReadyLine>,
    E: Mutex<T = Estimators<'static>>,
    Q: Mutex<T = TransmitQueue<'static>>,
{
    type Bus<'a>
        = LockedBus<'a, B>
    where
        Self: 'a;

    type Delay<'a>
        = FeedingDelay<'a, C>
    where
        Self: 'a;

    fn now_us(&mut self) -> u64 {
        let chip = &mut self.chip;
        self.locks.uptime.lock(|uptime| uptime.at(chip.microseconds()))
    }

    fn sensor_bus(&mut self) -> (Self::Bus<'_>, Self::Delay<'_>) {
        (LockedBus(&mut self.locks.bus), FeedingDelay { chip: &mut self.chip, watchdog: &mut self.watchdog })
    }

    fn set_clock_limit(&mut self, limit_hz: u32) -> u32 {
        self.locks.bus.lock(|bus| bus.set_clock_limit(limit_hz))
    }

    fn reset_bus(&mut self) {
        self.locks.bus.lock(SensorBus::reset);
    }

    fn reset_sensor(&mut self) -> bool {
        let is_connected = self.chip.set_reset_line(true);
        if is_connected {
            FeedingDelay { chip: &mut self.chip, watchdog: &mut self.watchdog }.delay_us(RESET_US);
            self.chip.set_reset_line(false);
        }
        is_connected
    }

    fn set_bus_timing(&mut self, timing: BusTiming) -> bool {
        self.locks.bus.lock(|bus| bus.set_timing(timing));
        true
    }

    fn frame_times(&mut self) -> Option<FrameTimes> {
        Some(self.locks.bus.lock(SensorBus::take_frame_times))
    }

    fn data_ready_width_us(&mut self, limit_us: u32) -> Option<u32> {
        let start = self.chip.microseconds();
        let mut edge = |active: bool| loop {
            let now = self.chip.microseconds();
            if self.locks.data_ready.lock(DataReadyLine::is_active) == active {
                return Some(now);
            }
            if now.wrapping_sub(start) > limit_us {
                return None;
            }
            self.watchdog.feed(&mut self.chip);
        };
        edge(false)?;
        let risen = edge(true)?;
        Some(edge(false)?.wrapping_sub(risen))
    }

    fn set_sampling(&mut self, enabled: bool) {
        self.locks.sampler.lock(|sampler| sampler.set_enabled(enabled));
        if enabled {
            self.locks.data_ready.lock(|line| line.set_masked(false));
        } else {
            let start = self.chip.microseconds();
            while self.locks.sampler.lock(|sampler| sampler.is_reading()) {
                if self.chip.microseconds().wrapping_sub(start) > BURST_US {
                    self.chip.abandon_burst();
                }
            }
            FeedingDelay { chip: &mut self.chip, watchdog: &mut self.watchdog }.delay_us(STALL_US);
        }
    }

    fn sampling_activity(&mut self) -> SamplingActivity {
        self.locks.sampler.lock(|sampler| sampler.activity())
    }

    fn estimators<R>(&mut self, access: impl FnOnce(&mut Estimators<'static>) -> R) -> R {
        self.locks.estimators.lock(access)
    }

    fn transmit_queue<R>(&mut self, access: impl FnOnce(&mut TransmitQueue<'static>) -> R) -> R {
        let result = self.locks.transmit_queue.lock(access);
        self.chip.transmit();
        result
    }

    fn receive(&mut self) -> Option<(HostPort, u8)> {
        self.received.next()
    }

    fn meters(&mut self) -> BoardMeters {
        BoardMeters { asleep_us: self.asleep_us, ..self.chip.meters() }
    }

    fn feed_watchdog(&mut self) {
        self.watchdog.feed(&mut self.chip);
    }

    fn restart(&mut self) {
        self.chip.restart();
    }

    fn program_brown_out(&mut self) -> BrownOutLevel {
        self.chip.program_brown_out()
    }

    fn keeps_record(&mut self) -> bool {
        self.chip.keeps_record()
    }

    fn read_record(&mut self, record: &mut [u8]) -> Option<usize> {
        self.chip.read_record(record)
    }

    fn write_record(&mut self, record: &[u8]) -> Result<(), StoreError> {
        self.chip.write_record(record)
    }

    fn start_boot_loader(&mut self) -> bool {
        self.chip.start_boot_loader()
    }
}

/// Waits by the chip's counter and feeds the watchdog meanwhile.
pub struct FeedingDelay<'a, C> {
    chip: &'a mut C,
    watchdog: &'a mut WatchdogFeeder,
}

impl<C: Chip> DelayNs for FeedingDelay<'_, C> {
    fn delay_ns(&mut self, ns: u32) {
        self.delay_us(ns.div_ceil(1000));
    }

    fn delay_us(&mut self, us: u32) {
        let start = self.chip.microseconds();
        while self.chip.microseconds().wrapping_sub(start) <= us {
            self.watchdog.feed(self.chip);
        }
    }
}

/// The shared bus, locked for one transaction at a time.
pub struct LockedBus<'a, B>(&'a mut B);

impl<B: Mutex<T: SpiDevice<u8>>> ErrorType for LockedBus<'_, B> {
    type Error = <B::T as ErrorType>::Error;
}

impl<B: Mutex<T: SpiDevice<u8>>> SpiDevice<u8> for LockedBus<'_, B> {
    fn transaction(&mut self, operations: &mut [Operation<'_, u8>]) -> Result<(), Self::Error> {
        self.0.lock(|bus| bus.transaction(operations))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn uptime_continues_when_the_counter_wraps() {
        let mut uptime = Uptime::new(0xFFFF_FFF0);
        assert_eq!(uptime.at(0xFFFF_FFFF), 15);
        assert_eq!(uptime.at(0), 16);
        assert_eq!(uptime.at(5), 21);
        assert_eq!(uptime.at(5), 21);
        assert_eq!(uptime.at(4), 0x1_0000_0014);
    }

    /// A chip whose counter does not advance for its first readings; counts how often the watchdog is fed until then and
    /// afterwards.
    #[derive(Default)]
    struct StoppedCounter {
        readings: u32,
        feedings: [u32; 2],
    }

    const STOPPED_READINGS: u32 = 10_000;

    impl Chip for StoppedCounter {
        fn microseconds(&mut self) -> u32 {
            self.readings += 1;
            self.readings.saturating_sub(STOPPED_READINGS)
        }

        fn feed(&mut self) {
            self.feedings[usize::from(self.readings > STOPPED_READINGS)] += 1;
        }

        fn sleep(&mut self, _: impl FnMut(u32)) {}
        fn transmit(&mut self) {}
        fn abandon_burst(&mut self) {}
        fn restart(&mut self) {}
        fn set_reset_line(&mut self, _: bool) -> bool {
            false
        }
        fn program_brown_out(&mut self) -> BrownOutLevel {
            BrownOutLevel::Fixed
        }
        fn keeps_record(&mut self) -> bool {
            false
        }
        fn read_record(&mut self, _: &mut [u8]) -> Option<usize> {
            None
        }
        fn write_record(&mut self, _: &[u8]) -> Result<(), StoreError> {
            Err(StoreError::NoMemory)
        }
        fn start_boot_loader(&mut self) -> bool {
            false
        }
        fn meters(&mut self) -> BoardMeters {
            BoardMeters::default()
        }
    }

    #[test]
    fn a_long_step_is_fed_through_and_a_hang_is_not() {
        let mut extension = WatchdogExtension::START;
        let fed = |extension: &mut WatchdogExtension, feedings, ticks| {
            (0..ticks).filter(|_| extension.tick(feedings, 480)).count()
        };
        assert_eq!(fed(&mut extension, 0, 100), 0, "nothing has been fed yet");
        assert_eq!(fed(&mut extension, 1, 400), 400, "25 s at 16 ticks a second");
        assert_eq!(fed(&mut extension, 2, 1000), 480, "the main loop hangs");
        assert_eq!(fed(&mut extension, 2, 1000), 0);
        assert_eq!(fed(&mut extension, 3, 1), 1);
    }

    #[test]
    fn the_watchdog_is_not_fed_while_the_counter_stands_still() {
        let (mut chip, mut watchdog) = (StoppedCounter::default(), WatchdogFeeder { fed_at: 0 });
        FeedingDelay { chip: &mut chip, watchdog: &mut watchdog }.delay_us(50);
        let [stopped, running] = chip.feedings;
        assert_eq!(stopped, 0);
        assert!(running > 20, "{running} times in 50 us");
    }
}
