//! Time since the start from a counter that wraps.

/// Microseconds since the start, from a microsecond counter of 32 bits.
#[derive(Debug, Clone, Copy)]
pub struct Uptime {
    last: u32,
    total_us: u64,
}

impl Uptime {
    /// Starts at 0, with the counter at `counter`.
    #[must_use]
    pub const fn new(counter: u32) -> Self {
        Self { last: counter, total_us: 0 }
    }

    /// The time at which the counter reads `counter`; to be asked at least once in 71 minutes.
    pub fn at(&mut self, counter: u32) -> u64 {
        self.total_us += u64::from(counter.wrapping_sub(self.last));
        self.last = counter;
        self.total_us
    }
}

#[cfg(test)]
mod tests {
    use super::Uptime;

    #[test]
    fn time_goes_on_when_the_counter_wraps() {
        let mut uptime = Uptime::new(0xFFFF_FFF0);
        assert_eq!(uptime.at(0xFFFF_FFFF), 15);
        assert_eq!(uptime.at(0), 16);
        assert_eq!(uptime.at(5), 21);
        assert_eq!(uptime.at(5), 21);
        assert_eq!(uptime.at(4), 0x1_0000_0014);
    }
}
