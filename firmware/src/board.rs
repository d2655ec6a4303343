//! The interface of a board to the main loop.

use crate::acquisition::SamplingActivity;
use crate::receive::HostPort;
use crate::sample_intake::Estimators;
use crate::settings_store::StoreError;
use crate::transmit::TransmitQueue;
use embedded_hal::delay::DelayNs;
use embedded_hal::spi::SpiDevice;
use link::Health;

/// Times of chip select between two frames in one power mode, ns.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SelectTiming {
    /// Least time that chip select is high.
    pub high_ns: u32,
    /// Least time from one falling edge of chip select to the next, t_READRATE.
    pub read_ns: u32,
}

/// Minimum times of the sensor's bus; they hold whatever the driver does.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct BusTiming {
    /// Times in normal mode.
    pub normal: SelectTiming,
    /// Times in low-power mode, with a serial clock of at most 300 kHz.
    pub low_power: SelectTiming,
    /// Pause between two words of a burst in ns, each of which is then a DMA transfer; 0 for none.
    pub word_gap_ns: u32,
}

impl BusTiming {
    /// Chip select is high for 16 µs (stall of the manufacturer's tools) or 75 µs (low-power mode); frames begin 40 or
    /// 150 µs apart (ADIS16400/ADIS16405 data sheet Rev. B, Table 2). Bursts have no pauses.
    pub const USUAL: Self = Self {
        normal: SelectTiming { high_ns: 16_000, read_ns: 40_000 },
        low_power: SelectTiming { high_ns: 75_000, read_ns: 150_000 },
        word_gap_ns: 0,
    };

    /// Times for a sensor that fails with [`USUAL`](Self::USUAL): chip select high for 50 µs, and a frame's stall after
    /// every word. A burst takes 0.45 ms at 656 kHz.
    pub const SLOW: Self = Self {
        normal: SelectTiming { high_ns: 50_000, read_ns: 40_000 },
        low_power: SelectTiming { high_ns: 100_000, read_ns: 150_000 },
        word_gap_ns: 9_000,
    };
}

/// Measured times of frames on the sensor's bus, ±1 µs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FrameTimes {
    /// Time for which chip select was low in the last frame.
    pub low_us: u32,
    /// Shortest time for which chip select was high between two frames.
    pub shortest_high_us: u32,
    /// Shortest time from one falling edge of chip select to the next.
    pub shortest_period_us: u32,
}

impl FrameTimes {
    /// The times before the first frame.
    pub const NONE: Self = Self { low_us: 0, shortest_high_us: u32::MAX, shortest_period_us: u32::MAX };
}

/// The application's interface to a board: its microcontroller, or a virtual sensor on the host.
pub trait Board {
    /// Time since the start in microseconds.
    fn now_us(&mut self) -> u64;
    /// Sleeps until the next interrupt.
    fn sleep(&mut self) {}
    /// The sensor's bus, for registers, and its delay. May be called only while sampling is disabled.
    fn sensor_bus(&mut self) -> (impl SpiDevice<u8>, impl DelayNs);
    /// Sets the fastest serial clock of at most `limit_hz`, or the slowest one if none is slow enough; returns it in
    /// Hz. May be called only while sampling is disabled.
    fn set_clock_limit(&mut self, limit_hz: u32) -> u32;
    /// Enables or disables sampling. Returns when no burst is being transferred and the stall time has passed.
    fn set_sampling(&mut self, enabled: bool);
    /// Transfers of bursts so far.
    fn sampling_activity(&mut self) -> SamplingActivity;
    /// Resets the microcontroller's side of the bus. May be called only while sampling is disabled.
    fn reset_bus(&mut self);
    /// Sets other bus times. May be called only while sampling is disabled.
    fn set_bus_timing(&mut self, timing: BusTiming);
    /// Frame times since the last call.
    fn frame_times(&mut self) -> FrameTimes;
    /// Width of the next data-ready pulse in µs, while sampling is disabled; `None` if none ends within `limit_us`.
    fn data_ready_width_us(&mut self, limit_us: u32) -> Option<u32>;
    /// Pulses the sensor's RST line; false if not connected.
    fn reset_sensor(&mut self) -> bool {
        false
    }
    /// Gives access to the estimators, which wait meanwhile: `access` must be short.
    fn estimators<R>(&mut self, access: impl FnOnce(&mut Estimators<'static>) -> R) -> R;
    /// Gives access to the transmit queue, then starts transmission.
    fn transmit_queue<R>(&mut self, access: impl FnOnce(&mut TransmitQueue<'static>) -> R) -> R;
    /// The next received byte, and its port.
    fn receive(&mut self) -> Option<(HostPort, u8)>;
    /// Load figures of the board since it started, and the bytes that its ports have lost; all other counters are 0.
    fn health(&mut self) -> Health;
    /// Feeds the watchdog.
    fn feed_watchdog(&mut self);
    /// Restarts the microcontroller; retained RAM keeps its content.
    fn restart(&mut self);
    /// Programs the brown-out level into memory that keeps it.
    fn program_brown_out(&mut self) -> BrownOutLevel {
        BrownOutLevel::Fixed
    }
    /// True if the board has memory for a record that survives a loss of power.
    fn keeps_record(&mut self) -> bool {
        false
    }
    /// Copies the persistent record and returns its length; `None` without one.
    fn read_record(&mut self, _record: &mut [u8]) -> Option<usize> {
        None
    }
    /// Replaces the record, or erases it if `record` is empty. May be called only while sampling is disabled, since
    /// interrupts may be off meanwhile.
    ///
    /// # Errors
    /// The board has no such memory, or it does not take the record. The previous record is kept.
    fn write_record(&mut self, _record: &[u8]) -> Result<(), StoreError> {
        Err(StoreError::NoMemory)
    }
    /// Starts the boot loader for images over USB; false without one.
    fn start_boot_loader(&mut self) -> bool {
        false
    }
}

/// Brown-out level after a request to program it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum BrownOutLevel {
    /// The level is set at every start, or cannot be set.
    Fixed,
    /// The level had been programmed before.
    Set,
    /// The level was programmed now.
    Programmed,
    /// The level could not be programmed.
    Failed,
}

/// Microseconds since the start, from a microsecond counter of 32 bits.
#[derive(Debug, Clone, Copy)]
pub struct Uptime {
    last: u32,
    total_us: u64,
}

impl Uptime {
    /// The uptime that is 0 at counter value `counter`.
    pub const fn new(counter: u32) -> Self {
        Self { last: counter, total_us: 0 }
    }

    /// The time at a counter value; to be called at least once in 71 minutes, before the counter wraps.
    pub fn at(&mut self, counter: u32) -> u64 {
        self.total_us += u64::from(counter.wrapping_sub(self.last));
        self.last = counter;
        self.total_us
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
}
