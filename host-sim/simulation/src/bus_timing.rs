//! The times on a captured bus against the limits of the data sheet.

use recordings::spi_export::CapturedFrame;
use virtual_sensor::{MAX_SCK_BURST_HZ, MAX_SCK_NORMAL_HZ, MIN_STALL_NORMAL_NS};

/// Share by which a clock may seem faster than it is: the capture has ticks, and chip select is low for longer than the clock
/// runs, not shorter.
const TOLERANCE: f64 = 0.01;

/// What the times of a captured bus show. Without the ends of transactions nothing is counted.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct CapturedBusTiming {
    /// Transactions whose begin and end are known.
    pub timed: u64,
    /// Transactions whose clock is faster than the part allows: 1 MHz in a burst, 2 MHz elsewhere. The clock is at least the
    /// number of bits over the time of chip select.
    pub fast_clock: u64,
    /// The fastest such lower limit of the clock, Hz.
    pub fastest_hz: f64,
    /// Transactions that begin sooner than 9 µs after the end of the one before.
    pub short_stall: u64,
    /// The shortest pause, s.
    pub shortest_stall_s: Option<f64>,
    last_end_s: Option<f64>,
}

impl CapturedBusTiming {
    /// Adds the next transaction.
    pub(crate) fn add(&mut self, captured: &CapturedFrame, is_burst: bool) {
        let start_s = captured.frame.time_s;
        if let Some(end_s) = self.last_end_s {
            let stall_s = start_s - end_s;
            self.short_stall += u64::from(stall_s < (1.0 - TOLERANCE) * MIN_STALL_NORMAL_NS as f64 * 1e-9);
            self.shortest_stall_s = Some(self.shortest_stall_s.map_or(stall_s, |shortest| shortest.min(stall_s)));
        }
        self.last_end_s = captured.end_s;
        if let Some(end_s) = captured.end_s.filter(|end_s| *end_s > start_s) {
            let clock_hz = 8.0 * captured.frame.mosi.len() as f64 / (end_s - start_s);
            let most_hz = f64::from(if is_burst { MAX_SCK_BURST_HZ } else { MAX_SCK_NORMAL_HZ });
            self.timed += 1;
            self.fastest_hz = self.fastest_hz.max(clock_hz);
            self.fast_clock += u64::from(clock_hz > (1.0 + TOLERANCE) * most_hz);
        }
    }

    /// What the user should know, one sentence each; none where the times are not known.
    pub fn notes(&self) -> Vec<String> {
        let mut notes = Vec::new();
        if self.timed > 0 {
            let stall = self
                .shortest_stall_s
                .map_or_else(String::new, |stall_s| format!(", shortest pause {:.1} us", 1e6 * stall_s));
            notes.push(format!(
                "bus timing of {} transactions: mean clock up to {:.0} kHz{stall}; {} outside the limits of the data sheet",
                self.timed,
                1e-3 * self.fastest_hz,
                self.fast_clock + self.short_stall,
            ));
        }
        if self.fast_clock > 0 {
            notes.push(format!(
                "{} transactions have a clock above 1 MHz in a burst or 2 MHz elsewhere",
                self.fast_clock
            ));
        }
        if self.short_stall > 0 {
            notes.push(format!("{} transactions begin less than 9 us after the one before", self.short_stall));
        }
        notes
    }
}
