//! The times of a captured bus, compared with the limits of the data sheet.

use recordings::recorded_file::CapturedFrame;
use virtual_sensor::{MAX_SCK_BURST_HZ, MAX_SCK_NORMAL_HZ, MIN_READ_RATE_NORMAL_NS, MIN_STALL_NORMAL_NS};

/// Fraction by which a clock may seem too fast: the capture has ticks, and chip select is low for longer than the clock runs.
const TOLERANCE: f64 = 0.01;

/// The times of a captured bus. Without the ends of transactions nothing is counted.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct CapturedBusTiming {
    /// Transactions whose begin and end are known.
    pub timed: u64,
    /// Transactions whose clock is faster than the part allows: 1 MHz in a burst, 2 MHz elsewhere. The clock is at least the
    /// number of bits over the time of chip select.
    pub fast_clock: u64,
    /// The fastest of these clocks, as a lower limit, Hz.
    pub fastest_hz: f64,
    /// Transactions that begin sooner than 9 µs after the end of the one before.
    pub short_stall: u64,
    /// The shortest pause, s.
    pub shortest_stall_s: Option<f64>,
    /// Transactions that keep the pause but begin sooner than 40 µs after the begin of the one before.
    pub short_interval: u64,
    last_start_s: Option<f64>,
    last_end_s: Option<f64>,
}

impl CapturedBusTiming {
    /// Adds the next transaction.
    pub(crate) fn add(&mut self, captured: &CapturedFrame, is_burst: bool) {
        let start_s = captured.frame.time_s;
        if let Some(end_s) = self.last_end_s {
            let stall_s = start_s - end_s;
            let is_below = |time_s: f64, least_ns: u64| time_s < (1.0 - TOLERANCE) * least_ns as f64 * 1e-9;
            let short_stall = is_below(stall_s, MIN_STALL_NORMAL_NS);
            let interval_s = start_s - self.last_start_s.unwrap_or(end_s);
            self.short_stall += u64::from(short_stall);
            self.short_interval += u64::from(!short_stall && is_below(interval_s, MIN_READ_RATE_NORMAL_NS));
            self.shortest_stall_s = Some(self.shortest_stall_s.map_or(stall_s, |shortest| shortest.min(stall_s)));
        }
        self.last_end_s = captured.end_s;
        self.last_start_s = Some(start_s);
        if let Some(end_s) = captured.end_s.filter(|end_s| *end_s > start_s) {
            let clock_hz = 8.0 * captured.frame.mosi.len() as f64 / (end_s - start_s);
            let most_hz = f64::from(if is_burst { MAX_SCK_BURST_HZ } else { MAX_SCK_NORMAL_HZ });
            self.timed += 1;
            self.fastest_hz = self.fastest_hz.max(clock_hz);
            self.fast_clock += u64::from(clock_hz > (1.0 + TOLERANCE) * most_hz);
        }
    }

    /// Notes for the user, one sentence each; none if the times are not known.
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
                self.fast_clock + self.short_stall + self.short_interval,
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
        if self.short_interval > 0 {
            notes.push(format!(
                "{} transactions begin less than 40 us after the begin of the one before",
                self.short_interval
            ));
        }
        notes
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use recordings::frame_log::Frame;

    /// A transaction of `bytes` bytes that begins at `start_us` and lasts for `low_us`, both in µs.
    fn transaction(bytes: usize, start_us: f64, low_us: f64) -> CapturedFrame {
        let frame = Frame { time_s: 1e-6 * start_us, mosi: vec![0; bytes], miso: vec![0; bytes] };
        CapturedFrame { frame, end_s: Some(1e-6 * (start_us + low_us)) }
    }

    /// Data sheet Rev. B, Table 2 and Figure 3: at least 9 µs between frames and 40 µs from one falling edge of chip select to the next.
    /// SCK is at most 2 MHz, in a burst 1 MHz.
    #[test]
    fn transactions_outside_the_limits_are_counted_by_rule() {
        let mut timing = CapturedBusTiming::default();
        // The columns are bytes, begin and time of chip select low; 16 and 208 bits at 1 MHz are within the limits.
        for (bytes, start_us, low_us) in [
            (2, 0.0, 16.0),
            (2, 40.0, 16.0),
            (2, 72.0, 16.0),     // 16 µs after the end of the one before, 32 µs after its begin
            (2, 96.0, 16.0),     // 8 µs after its end
            (26, 1000.0, 208.0), // as it should be
            (2, 1217.0, 16.0),   // 9 µs after the end of a burst
            (2, 1300.0, 7.0),    // 2.3 MHz
            (26, 2000.0, 160.0), // 1.3 MHz
        ] {
            timing.add(&transaction(bytes, start_us, low_us), bytes == 26);
        }
        assert_eq!((timing.timed, timing.short_interval, timing.short_stall, timing.fast_clock), (8, 1, 1, 2));
        let notes = timing.notes().join("\n");
        assert!(notes.contains("4 outside the limits"), "{notes}");
        assert!(notes.contains("1 transactions begin less than 40 us after the begin of the one before"), "{notes}");
    }
}
