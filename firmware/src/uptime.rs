//! Time since the start from a counter that wraps.

/// Microseconds since the start, from a microsecond counter that restarts at 0 every `period_us`.
#[derive(Debug, Clone, Copy)]
pub struct Uptime {
    period_us: u32,
    last: u32,
    total_us: u64,
}

impl Uptime {
    /// Starts at 0, with the counter at `counter`.
    #[must_use]
    pub const fn new(period_us: u32, counter: u32) -> Self {
        Self { period_us, last: counter, total_us: 0 }
    }

    /// The time at which the counter reads `counter`; to be asked at least once a period.
    pub fn at(&mut self, counter: u32) -> u64 {
        let step = if counter >= self.last {
            counter - self.last
        } else {
            counter.saturating_add(self.period_us.saturating_sub(self.last))
        };
        self.last = counter;
        self.total_us += u64::from(step);
        self.total_us
    }
}

#[cfg(test)]
mod tests {
    use super::Uptime;

    #[test]
    fn time_goes_on_when_the_counter_wraps() {
        let mut uptime = Uptime::new(4_000_000_000, 3_999_999_990);
        assert_eq!(uptime.at(3_999_999_999), 9);
        assert_eq!(uptime.at(0), 10);
        assert_eq!(uptime.at(5), 15);
        assert_eq!(uptime.at(5), 15);
        assert_eq!(uptime.at(4), 4_000_000_014);
    }
}
